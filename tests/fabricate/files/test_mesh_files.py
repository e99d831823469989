"""Solids written in every format and read back, by trimesh and by this package."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
import trimesh
from common.bumpy import bumpy_sphere

from dicedesign.errors import InputError, OutputError
from dicedesign.fabricate.files.formats import ENDINGS, mesh_bytes, save_mesh
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.geometry.meshes.stl import stl_bytes
from dicedesign.geometry.solid import solid_properties
from dicedesign.geometry.surfaces.surface import Surface


def die() -> Surface:
    """With coordinates of many sizes, some of them tiny."""
    surface = bumpy_sphere()
    points = 10.0 * (surface.points - surface.points[0])
    points[1] = [1e-7 / 3.0, -1e-13, 12.345678901234567]
    return surface.moved(points)


@pytest.mark.parametrize("ending", ENDINGS)
def test_what_is_written_is_read_back(tmp_path: Path, ending: str) -> None:
    surface, path = die(), tmp_path / f"die{ending.upper()}"
    save_mesh(path, surface.points, surface.triangles)
    assert [file.name for file in tmp_path.iterdir()] == [path.name]
    body = read_body(path)
    expected = surface.points
    if ending == ".stl":
        expected = expected.astype(np.float32).astype(np.float64)
    assert body.triangles is not None
    assert body.single_precision == (ending == ".stl")
    np.testing.assert_array_equal(body.points[body.triangles], expected[surface.triangles])
    volume, _ = solid_properties(body.points, body.triangles)
    assert volume == pytest.approx(surface.volume, rel=1e-6)

    mesh = trimesh.load(io.BytesIO(path.read_bytes()), file_type=ending[1:], force="mesh")
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(surface.volume, rel=1e-6)
    np.testing.assert_allclose(mesh.extents, np.ptp(surface.points, axis=0), rtol=1e-6)
    np.testing.assert_allclose(mesh.bounds[0], surface.points.min(axis=0), rtol=1e-6, atol=1e-5)


@pytest.mark.parametrize("ending", ENDINGS)
def test_the_same_solid_is_the_same_file(ending: str) -> None:
    surface = die()
    first, second = (mesh_bytes(surface.points, surface.triangles, ending) for _ in range(2))
    assert first == second
    if ending == ".stl":
        assert first == stl_bytes(surface.points, surface.triangles)


def test_a_3mf_file_is_in_millimetres() -> None:
    surface = die()
    data = mesh_bytes(surface.points, surface.triangles, ".3mf")
    assert trimesh.load(io.BytesIO(data), file_type="3mf").units == "millimeter"


@pytest.mark.parametrize("name", ["die.step", "die", "die.stl.gz"])
def test_other_endings_are_refused(tmp_path: Path, name: str) -> None:
    surface = die()
    with pytest.raises(InputError, match=r"expected a file ending out of \.stl, \.obj, \.3mf, .pl"):
        save_mesh(tmp_path / name, surface.points, surface.triangles)
    with pytest.raises(InputError, match="mesh file: expected a file ending out of"):
        mesh_bytes(surface.points, surface.triangles, Path(name).suffix)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("ending", ENDINGS)
def test_what_is_not_finite_is_refused(ending: str) -> None:
    surface = die()
    surface.points[3, 1] = np.nan
    with pytest.raises(InputError, match=r"expected .*finite .*got \[.*nan.* in row 3; repair"):
        mesh_bytes(surface.points, surface.triangles, ending)


def test_a_missing_folder_is_named(tmp_path: Path) -> None:
    surface = die()
    with pytest.raises(OutputError, match="expected to write a file in an existing, writable fol"):
        save_mesh(tmp_path / "none" / "die.stl", surface.points, surface.triangles)
