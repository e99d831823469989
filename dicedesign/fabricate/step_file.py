"""STEP files with flat faces, for CAD programs, by Open CASCADE.

Source: ISO 10303-214, solids bounded by planar faces.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from itertools import compress
from pathlib import Path
from typing import Any, Final

import numpy as np

from dicedesign.errors import InputError, MeshFileError
from dicedesign.fabricate.file_formats import Contents, FileFormat, Part
from dicedesign.geometry.triangles import edge_neighbors, find_parts, solid_properties
from dicedesign.runtime.arrays import Floats, Integers

TOLERANCE: Final = 1e-7
"""Largest distance in mm between equal edges, and from the plane of a face; and largest angle in
radians between parts of one face."""

MOST_TRIANGLES: Final = 50_000
"""Largest number of triangles of a part: every face costs a kilobyte and a millisecond."""


def step(contents: Contents) -> bytes:
    """Write STEP: solids, with connected triangles in one plane joined to one face.

    Raises InputError for a part that is not closed or has more than `MOST_TRIANGLES`.
    """
    import tempfile

    from OCP.APIHeaderSection import APIHeaderSection_MakeHeader
    from OCP.Interface import Interface_Static
    from OCP.STEPCAFControl import STEPCAFControl_Writer
    from OCP.TCollection import TCollection_ExtendedString, TCollection_HAsciiString
    from OCP.TDataStd import TDataStd_Name
    from OCP.TDocStd import TDocStd_Document
    from OCP.XCAFDoc import XCAFDoc_DocumentTool

    _silence()
    document = TDocStd_Document(TCollection_ExtendedString("dicedesign"))
    shapes = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    for part in contents.parts:
        for solid in _solids(part):
            label = shapes.AddShape(solid, False)
            TDataStd_Name.Set_s(label, TCollection_ExtendedString(part.name))
    writer = STEPCAFControl_Writer()
    Interface_Static.SetCVal_s("write.step.unit", "MM")
    writer.Transfer(document)
    header = APIHeaderSection_MakeHeader(writer.ChangeWriter().Model())
    # A fixed time makes files reproducible.
    header.SetTimeStamp(TCollection_HAsciiString("1970-01-01T00:00:00"))
    header.SetName(TCollection_HAsciiString(contents.title))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "die.step")
        writer.Write(str(path))
        return path.read_bytes()


def read_step(path: Path) -> tuple[Floats, Integers]:
    """Read points (n, 3) in mm and triangles (t, 3) of the flat faces of a STEP file.

    Raises MeshFileError if it cannot be read.
    """
    from OCP.BRep import BRep_Tool
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.IFSelect import IFSelect_ReturnStatus
    from OCP.STEPControl import STEPControl_Reader
    from OCP.TopAbs import TopAbs_Orientation
    from OCP.TopLoc import TopLoc_Location
    from OCP.TopoDS import TopoDS
    from scipy.spatial import KDTree

    _silence()
    reader = STEPControl_Reader()
    if reader.ReadFile(str(path)) != IFSelect_ReturnStatus.IFSelect_RetDone:
        raise MeshFileError(f"{path}: expected a STEP file, got another; export it again")
    reader.TransferRoots()
    shape = reader.OneShape()
    # The second argument, a deflection, does not matter for flat faces.
    BRepMesh_IncrementalMesh(shape, 1.0)
    vertices = [BRep_Tool.Pnt_s(TopoDS.Vertex(vertex)) for vertex in _within(shape, "VERTEX")]
    points = np.unique(_places(vertices), axis=0)
    tree = KDTree(points)
    triangles = []
    for face in _within(shape, "FACE"):
        mesh = BRep_Tool.Triangulation_s(TopoDS.Face(face), TopLoc_Location())
        # Each face has its own nodes at the solid's corners.
        nodes = _places([mesh.Node(k) for k in range(1, mesh.NbNodes() + 1)])
        _, corner = tree.query(nodes)
        own = corner[np.array([mesh.Triangle(k + 1).Get() for k in range(mesh.NbTriangles())]) - 1]
        turned = face.Orientation() == TopAbs_Orientation.TopAbs_REVERSED
        triangles.append(own[:, ::-1] if turned else own)
    return points, np.concatenate(triangles)


def _within(shape: Any, kind: str) -> Iterator[Any]:
    """Yield the faces, vertices or other parts of a shape, shared ones repeatedly."""
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer

    explorer = TopExp_Explorer(shape, getattr(TopAbs_ShapeEnum, f"TopAbs_{kind}"))
    while explorer.More():
        yield explorer.Current()
        explorer.Next()


def _places(points: list[Any]) -> Floats:
    """(n, 3) coordinates of points."""
    return np.array([(point.X(), point.Y(), point.Z()) for point in points])


def _solids(part: Part) -> list[Any]:
    """Solids of a part, one for each outer shell; a single outer shell may have hollows."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeSolid

    if len(part.triangles) > MOST_TRIANGLES:
        raise InputError(
            f"step: expected a solid of at most {MOST_TRIANGLES} triangles, got "
            f"{len(part.triangles)}; take 3mf or obj for a surface like this"
        )
    across = edge_neighbors(part.triangles)
    one, edge = np.nonzero(across >= 0)
    shell_of = find_parts(one, across[one, edge], len(across))
    meshes = [part.triangles[shell_of == k] for k in range(shell_of.max() + 1)]
    is_outer = [solid_properties(part.points, mesh)[0] > 0.0 for mesh in meshes]
    if not all(is_outer) and sum(is_outer) != 1:
        raise InputError(
            f"step: expected a solid of one outer shell about its hollows, got {sum(is_outer)}; "
            "take another format"
        )
    shells = [_shell(part.points, mesh) for mesh in meshes]
    makers = [BRepBuilderAPI_MakeSolid(shell) for shell in compress(shells, is_outer)]
    for shell, outer in zip(shells, is_outer, strict=True):
        if not outer:
            makers[0].Add(shell)
    return [_join_faces(maker.Solid()) for maker in makers]


def _shell(points: Floats, triangles: Integers) -> Any:
    """Sew triangles (t, 3) between points (n, 3) to a closed surface."""
    from OCP.BRepBuilderAPI import (
        BRepBuilderAPI_MakeFace,
        BRepBuilderAPI_MakePolygon,
        BRepBuilderAPI_Sewing,
    )
    from OCP.gp import gp_Pnt
    from OCP.TopoDS import TopoDS

    sewing = BRepBuilderAPI_Sewing(TOLERANCE)
    corners = [gp_Pnt(*point) for point in points.tolist()]
    for triangle in triangles.tolist():
        outline = BRepBuilderAPI_MakePolygon(*(corners[k] for k in triangle), True)
        face = BRepBuilderAPI_MakeFace(outline.Wire(), True)
        if face.IsDone():
            sewing.Add(face.Face())
    sewing.Perform()
    shells = list(_within(sewing.SewedShape(), "SHELL"))
    if len(shells) != 1 or sewing.NbFreeEdges() > 0:
        raise InputError(
            f"step: expected closed surfaces, got one of {len(shells)} shells with "
            f"{sewing.NbFreeEdges()} open edges; repair the solid, or take another format"
        )
    return TopoDS.Shell(shells[0])


def _join_faces(solid: Any) -> Any:
    """Join connected coplanar faces of a solid."""
    from OCP.ShapeUpgrade import ShapeUpgrade_UnifySameDomain

    union = ShapeUpgrade_UnifySameDomain(solid, True, True, False)
    union.SetLinearTolerance(TOLERANCE)
    union.SetAngularTolerance(TOLERANCE)
    union.Build()
    return union.Shape()


def _silence() -> None:
    """Keep Open CASCADE from printing."""
    from OCP.Message import Message

    Message.DefaultMessenger_s().ChangePrinters().Clear()


def _require() -> None:
    if importlib.util.find_spec("OCP") is None:
        raise InputError(
            "step: expected the package cadquery-ocp-novtk, got none; run pip install "
            "'dicedesign[step]', or take another format"
        )


STEP: Final = FileFormat(
    name="step",
    line="STEP, which programs for construction read: a solid of flat faces",
    carries="name, parts",
    write=step,
    read=read_step,
    require=_require,
)
