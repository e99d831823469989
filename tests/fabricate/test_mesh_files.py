"""Solids written in every format and read back, by trimesh and by this package."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
import trimesh
from common.bumpy import bumpy_sphere

from dicedesign.errors import InputError, OutputError
from dicedesign.fabricate.file_formats import FILE_FORMATS, mesh_bytes, save_mesh, with_stl
from dicedesign.geometry.meshes.formats import stl_bytes
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.geometry.solid import solid_properties
from dicedesign.geometry.surfaces.surface import Surface

MESHES = [kind for kind in FILE_FORMATS if kind.name != "step"]


def die() -> Surface:
    """With coordinates of many sizes, some of them tiny."""
    surface = bumpy_sphere()
    points = 10.0 * (surface.points - surface.points[0])
    points[1] = [1e-7 / 3.0, -1e-13, 12.345678901234567]
    return surface.moved(points)


def by_trimesh(data: bytes, name: str) -> trimesh.Trimesh:
    """The file in millimetres, z upward, with corners at one place joined."""
    mesh = trimesh.load(io.BytesIO(data), file_type=name, force="mesh", process=False)
    kind = FILE_FORMATS[name]
    scale = {"mm": 1.0, "m": 1000.0}[kind.unit]
    x, y, z = scale * np.asarray(mesh.vertices, dtype=np.float64).T
    places = np.stack({"z": [x, y, z], "y": [x, -z, y]}[kind.upward], axis=1)
    return trimesh.Trimesh(places, mesh.faces)


@pytest.mark.parametrize("kind", MESHES, ids=lambda kind: kind.name)
def test_what_is_written_is_read_back(tmp_path: Path, kind) -> None:
    surface, path = die(), tmp_path / f"die.{kind.name.upper()}"
    save_mesh(path, surface.points, surface.triangles)
    assert [file.name for file in tmp_path.iterdir()] == [path.name]
    body = read_body(path)
    assert body.triangles is not None
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
    volume, _ = solid_properties(points, triangles)
    assert volume == pytest.approx(surface.volume, rel=1e-6)

    mesh = by_trimesh(path.read_bytes(), kind.name)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(surface.volume, rel=1e-6)
    np.testing.assert_allclose(mesh.extents, np.ptp(surface.points, axis=0), rtol=1e-6)
    np.testing.assert_allclose(mesh.bounds[0], surface.points.min(axis=0), rtol=1e-6, atol=1e-5)


@pytest.mark.parametrize("kind", MESHES, ids=lambda kind: kind.name)
def test_the_same_solid_is_the_same_file(kind) -> None:
    surface, ending = die(), f".{kind.name}"
    first, second = (mesh_bytes(surface.points, surface.triangles, ending) for _ in range(2))
    assert first == second
    if ending == ".stl":
        assert first == stl_bytes(surface.points, surface.triangles)


@pytest.mark.parametrize("name", ["die.dxf", "die", "die.stl.gz", "diestl"])
def test_other_endings_are_refused(tmp_path: Path, name: str) -> None:
    surface = die()
    with pytest.raises(InputError, match=r"expected a file ending out of \.stl, \.3mf, \.obj"):
        save_mesh(tmp_path / name, surface.points, surface.triangles)
    with pytest.raises(InputError, match="mesh file: expected a file ending out of"):
        mesh_bytes(surface.points, surface.triangles, Path(name).suffix)
    assert list(tmp_path.iterdir()) == []


def test_other_names_are_refused() -> None:
    assert with_stl(["obj", "stl", "obj"]) == ["stl", "obj"]
    with pytest.raises(InputError, match=r"files: expected formats out of stl, 3mf.*got 'dxf'; ch"):
        with_stl(["obj", "dxf"])


@pytest.mark.parametrize("kind", list(FILE_FORMATS), ids=lambda kind: kind.name)
def test_what_is_not_finite_is_refused(kind) -> None:
    if kind.name == "step":
        pytest.importorskip("OCP")
    surface = die()
    surface.points[3, 1] = np.nan
    with pytest.raises(InputError, match=r"expected .*finite .*got \[.*nan.* in row 3; repair"):
        mesh_bytes(surface.points, surface.triangles, f".{kind.name}")
    surface.points[3, 1] = 1e39
    if kind.precision == "float32":
        with pytest.raises(InputError, match=r"finite in float32, got \[.*1e\+39.* in row 3; re"):
            mesh_bytes(surface.points, surface.triangles, f".{kind.name}")


def test_a_missing_folder_is_named(tmp_path: Path) -> None:
    surface = die()
    with pytest.raises(OutputError, match="expected to write a file in an existing, writable fol"):
        save_mesh(tmp_path / "none" / "die.stl", surface.points, surface.triangles)
