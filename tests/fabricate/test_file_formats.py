"""Solids written in every format and read back, by trimesh and by this package."""

from __future__ import annotations

import io
from pathlib import Path

import lib3mf
import numpy as np
import pytest
import trimesh
from common.bodies import write_mesh
from common.bumpy import bumpy_sphere
from pygltflib import GLTF2

from dicedesign.errors import InputError, OutputError
from dicedesign.fabricate.file_formats import (
    FILE_FORMATS,
    mesh_bytes,
    save_contents,
)
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.geometry.triangles import Surface, solid_properties
from dicedesign.palette import BLANK, INK

THREE_MF = FILE_FORMATS["3mf"]


def read(data: bytes, path: Path):
    """Model of a file that is read without warnings."""
    path.write_bytes(data)
    model = lib3mf.Wrapper().CreateModel()
    reader = model.QueryReader("3mf")
    reader.SetStrictModeActive(True)
    reader.ReadFromFile(str(path))
    assert reader.GetWarningCount() == 0
    return model


def objects(model) -> list:
    iterator = model.GetMeshObjects()
    return [iterator.GetCurrentMeshObject() for _ in iter(iterator.MoveNext, False)]


def facts(model) -> dict[str, str]:
    group = model.GetMetaDataGroup()
    entries = [group.GetMetaData(k) for k in range(group.GetMetaDataCount())]
    return {entry.GetName(): entry.GetValue() for entry in entries}


def materials(model) -> dict[tuple[int, int], tuple[str, str]]:
    """Names and colors by the numbers of list and entry."""
    entries, iterator = {}, model.GetBaseMaterialGroups()
    while iterator.MoveNext():
        group = iterator.GetCurrentBaseMaterialGroup()
        for entry in group.GetAllPropertyIDs():
            color = group.GetDisplayColor(entry)
            shown = f"#{color.Red:02x}{color.Green:02x}{color.Blue:02x}"
            entries[group.GetResourceID(), entry] = group.GetName(entry), shown
    return entries


def test_a_3mf_has_names_units_facts_and_colors(contents, tmp_path: Path) -> None:
    model = read(THREE_MF.write(contents), tmp_path / "box.3mf")
    assert facts(model) == {"Title": "box & co", **contents.facts}
    assert model.GetUnit() == lib3mf.ModelUnit.MilliMeter
    (thing,), known, (part,) = objects(model), materials(model), contents.parts
    assert thing.GetName() == "die"
    assert thing.IsManifoldAndOriented()
    assert sorted(known.values()) == [("die", BLANK), ("labels", INK)]
    vertices = np.array([vertex.Coordinates for vertex in thing.GetVertices()])
    triangles = np.array([list(each.Indices) for each in thing.GetTriangleIndices()])
    names = [
        {known[paint.ResourceID, entry][0] for entry in paint.PropertyIDs}
        for paint in thing.GetAllTriangleProperties()
    ]
    are_labels = np.array([name == {"labels"} for name in names])
    assert all(len(name) == 1 for name in names)
    read_middles, middles = (
        vertices[triangles].mean(axis=1),
        part.points[part.triangles].mean(axis=1),
    )
    for chosen, wanted in ((are_labels, part.labels), (~are_labels, ~part.labels)):
        np.testing.assert_allclose(read_middles[chosen], middles[wanted], atol=1e-5)


def test_parts_are_one_item_to_print(inlaid, tmp_path: Path) -> None:
    data = THREE_MF.write(inlaid)
    model = read(data, tmp_path / "inlaid.3mf")
    assert [thing.GetName() for thing in objects(model)] == ["die", "inlay"]
    assert sorted(materials(model).values()) == [("die", BLANK), ("inlay", INK)]
    items = model.GetBuildItems()
    assert items.MoveNext()
    assert items.GetCurrent().GetObjectResource().GetName() == "inlaid"
    assert not items.MoveNext()

    scene = trimesh.load(io.BytesIO(data), file_type="3mf", force="scene")
    assert scene.units == "millimeter"
    volumes = sorted(mesh.volume for mesh in scene.dump())
    assert volumes == pytest.approx([64.0, 936.0])


GLB = FILE_FORMATS["glb"]


def light(color: str) -> np.ndarray:
    """Linear light of a color in sRGB (IEC 61966-2-1)."""
    shown = [int(color[k : k + 2], 16) / 255.0 for k in (1, 3, 5)]
    return np.array([s / 12.92 if s <= 0.04045 else ((s + 0.055) / 1.055) ** 2.4 for s in shown])


def test_colors_and_facts_are_read(contents) -> None:
    data = GLB.write(contents)
    file = GLTF2.load_from_bytes(data)
    assert file.asset.version == "2.0"
    assert file.asset.extras == contents.facts
    assert file.scenes[0].name == "box & co"
    primitives = file.meshes[0].primitives
    labels = int(contents.parts[0].labels.sum())
    counts = [3 * (len(contents.parts[0].triangles) - labels), 3 * labels]
    assert [file.accessors[each.attributes.POSITION].count for each in primitives] == counts
    for primitive, color in zip(primitives, (BLANK, INK), strict=True):
        # Viewers must show faces without normals flat.
        assert primitive.attributes.NORMAL is None
        material = file.materials[primitive.material].pbrMetallicRoughness
        np.testing.assert_allclose(material.baseColorFactor[:3], light(color), atol=1e-6)
        assert material.baseColorFactor[3] == 1.0
        assert material.metallicFactor == 0.0


def test_parts_have_names_and_join_to_the_whole(inlaid, tmp_path) -> None:
    for kind, within in ((THREE_MF, 1e-12), (GLB, 1e-5)):
        path = tmp_path / f"inlaid.{kind.name}"
        path.write_bytes(kind.write(inlaid))
        volume, center = solid_properties(*kind.read_back(path))
        assert volume == pytest.approx(1000.0, rel=1e-6)
        np.testing.assert_allclose(center, 0.0, atol=within)
    assert [node.name for node in GLTF2().load(str(path)).nodes] == ["die", "inlay"]


def die() -> Surface:
    """Surface with coordinates of many magnitudes, some tiny."""
    surface = bumpy_sphere()
    points = 10.0 * (surface.points - surface.points[0])
    points[1] = [1e-7 / 3.0, -1e-13, 12.345678901234567]
    return surface.with_points(points)


def by_trimesh(data: bytes, name: str) -> trimesh.Trimesh:
    """Mesh of the file in millimeters, z upward, with equal corners merged."""
    mesh = trimesh.load(io.BytesIO(data), file_type=name, force="mesh", process=False)
    kind = FILE_FORMATS[name]
    scale = {"mm": 1.0, "m": 1000.0}[kind.unit]
    x, y, z = scale * np.asarray(mesh.vertices, dtype=np.float64).T
    places = np.stack({"z": [x, y, z], "y": [x, -z, y]}[kind.upward], axis=1)
    return trimesh.Trimesh(places, mesh.faces)


@pytest.mark.parametrize("kind", list(FILE_FORMATS), ids=lambda kind: kind.name)
def test_files_are_read_back(tmp_path: Path, kind) -> None:
    surface, path = die(), tmp_path / f"die.{kind.name.upper()}"
    write_mesh(path, surface.points, surface.triangles)
    assert [file.name for file in tmp_path.iterdir()] == [path.name]
    assert path.read_bytes() == mesh_bytes(surface.points, surface.triangles, f".{kind.name}")
    body = read_body(path)
    assert body.single_precision == (kind.precision == "float32")
    points, triangles = kind.read_back(path)
    expected = surface.points
    if kind.precision == "float32":
        rounding = np.abs(expected).max() * 2.0**-24
        np.testing.assert_allclose(
            points[triangles], expected[surface.triangles], rtol=0.0, atol=1.001 * rounding
        )
    else:
        np.testing.assert_array_equal(points[triangles], expected[surface.triangles])
    mesh = by_trimesh(path.read_bytes(), kind.name)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(surface.volume, rel=1e-6)
    np.testing.assert_allclose(mesh.bounds[0], surface.points.min(axis=0), rtol=1e-6, atol=1e-5)


def test_unsuitable_files_are_refused(contents, tmp_path: Path) -> None:
    surface = die()
    for name in ("die.dxf", "die.stl.gz"):
        with pytest.raises(InputError, match=r"\.stl, \.3mf, \.obj"):
            write_mesh(tmp_path / name, surface.points, surface.triangles)
    with pytest.raises(OutputError, match="folder"):
        save_contents(tmp_path / "none" / "die.stl", contents)
    surface.points[3, 1] = 1e39
    with pytest.raises(InputError, match=r"float32.*1e\+39.*row 3"):
        mesh_bytes(surface.points, surface.triangles, ".stl")
    surface.points[3, 1] = np.nan
    for kind in FILE_FORMATS:
        with pytest.raises(InputError, match=r"nan.*row 3"):
            mesh_bytes(surface.points, surface.triangles, f".{kind.name}")
    assert list(tmp_path.iterdir()) == []
