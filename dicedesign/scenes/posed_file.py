"""The file of a mesh, moved."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast

import numpy as np

from dicedesign.errors import InputError
from dicedesign.fabricate.file_formats import BODY_COLOR, FILE_FORMATS, Contents, Part, file_bytes
from dicedesign.fabricate.mesh_writers import rows
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.meshes.formats import OWN_ENDINGS
from dicedesign.geometry.meshes.reading import quiet_trimesh
from dicedesign.runtime.arrays import Floats

if TYPE_CHECKING:
    import trimesh

__all__ = ["POINTS", "Y_UP", "check_ending", "load_scene", "posed_bytes"]

POINTS: Final = ".xyz"
"""Ending of files of points."""

Y_UP: Final = np.array(
    [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)
"""The turn (4, 4) that makes y upward where z was."""

_MATERIALS: Final = b"mtllib"
"""In an OBJ file that names a file of materials."""


def check_ending(ending: str, name: str) -> None:
    """Raise InputError for an ending, such as ".stl", of files that cannot be written.

    name: what the message begins with.
    """
    if ending.lower() != POINTS and ending[1:].lower() not in FILE_FORMATS:
        known = ", ".join([*(f".{known}" for known in FILE_FORMATS.names), POINTS])
        raise InputError(
            f"{name}: expected a format that can be written, {known}, got {ending!r}; choose one "
            "of them"
        )


def posed_bytes(path: Path, body: Body, transform: Floats, ending: str) -> bytes:
    """The content of a file of a format: a mesh file's body, moved, in its own unit of length.

    Colours, materials, textures and the names of parts are kept where a GLB file is written, and
    the colours of a PLY file in another; all else holds the shape alone.

    Parameters
    ----------
    path: the mesh file; body: what was read from it.
    transform: (4, 4) rigid motion.
    ending: of the file to be written, such as ".stl".

    Raises
    ------
    InputError: as `check_ending`; the body has no triangles for a format that needs some; or
        coordinates that the format cannot hold.
    """
    check_ending(ending, str(path))
    kind = ending[1:].lower()
    points = body.points @ transform[:3, :3].T + transform[:3, 3]
    if ending.lower() == POINTS:
        return rows("{!r} {!r} {!r}\n", points).encode()
    if body.triangles is None:
        raise InputError(
            f"{path}: expected triangles for a file ending in {ending}, got points alone; write "
            f"one ending in {POINTS}"
        )
    if kind == "glb":
        scene = load_scene(path, body)
        scene.apply_transform(transform)
        return _exported(scene, kind)
    if kind == "ply" and path.suffix.lower() == ".ply":
        mesh: Any = load_scene(path, body).to_geometry()
        if mesh.visual.kind in ("vertex", "face"):
            return _exported(mesh.apply_transform(transform), kind)
    part = Part(path.stem, BODY_COLOR, points, body.triangles)
    contents = Contents(path.stem, [part], unit="the unit of the mesh that was posed")
    return file_bytes(contents, FILE_FORMATS[kind], str(path))


def load_scene(path: Path, body: Body) -> trimesh.Scene:
    """The scene of a mesh file that `read_body` has read: with its materials where trimesh reads
    files of its kind, or it is an OBJ file that names some, and else its body's shape alone."""
    with quiet_trimesh():
        import trimesh

        ending = path.suffix.lower()
        if ending not in OWN_ENDINGS or (ending == ".obj" and _MATERIALS in path.read_bytes()):
            with contextlib.suppress(Exception):  # its readers raise whatever they run into
                loaded: Any = trimesh.load(str(path), force="scene", process=False)
                for name, geometry in list(loaded.geometry.items()):
                    if not isinstance(geometry, trimesh.Trimesh):
                        loaded.delete_geometry(name)
                if loaded.geometry:
                    return cast("trimesh.Scene", loaded)
        scene = trimesh.Scene()
        scene.add_geometry(trimesh.Trimesh(body.points, body.triangles, process=False), path.stem)
        return scene


def _exported(thing: Any, kind: str) -> bytes:
    data: bytes = thing.export(file_type=kind)
    return data
