"""Coarser and finer surfaces: closed, in one piece, as many handles, and where they should be."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
import trimesh
from common.paths import public_data
from scipy.spatial import cKDTree

from dicedesign.errors import InputError
from dicedesign.geometry.meshes.body import make_body
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.geometry.surfaces.closed_surface import make_surface
from dicedesign.geometry.surfaces.quality import surface_quality
from dicedesign.geometry.surfaces.remeshing import decimated, refined
from dicedesign.geometry.surfaces.surface import Surface


def torus() -> Surface:
    mesh = trimesh.creation.torus(2.0, 0.5, major_sections=48, minor_sections=24)
    return Surface(np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int64))


def check(surface: Surface, genus: int) -> None:
    """A surface is one that is taken as input without any repair."""
    taken, notes = make_surface(make_body(surface.points, surface.triangles))
    assert notes == ()
    assert len(taken.points) == len(surface.points)
    assert surface_quality(surface).genus == genus


@pytest.mark.parametrize("points", [600, 200, 60])
def test_a_decimated_torus_is_a_torus_of_so_many_points(points: int) -> None:
    pytest.importorskip("fast_simplification")
    before = torus()
    after, done = decimated(before, points)
    assert abs(len(after.points) - points) <= 1
    check(after, genus=1)
    aside = np.hypot(np.hypot(after.points[:, 0], after.points[:, 1]) - 2.0, after.points[:, 2])
    np.testing.assert_allclose(aside, 0.5, atol=0.15)
    assert done.startswith(f"decimated the surface from 1152 to {len(after.points)} points")
    change = 100 * (after.volume / before.volume - 1)
    assert f"changes the volume by {change:+.2g} %" in done


def test_too_few_points_are_as_few_as_a_good_surface_has() -> None:
    pytest.importorskip("fast_simplification")
    after, done = decimated(torus(), 5)  # a torus needs 7 points
    assert 7 <= len(after.points) <= 40
    check(after, genus=1)
    assert f"to {len(after.points)} points" in done


def test_a_surface_with_so_many_points_is_kept() -> None:
    before = torus()
    assert decimated(before, 1152)[0] is before
    after, done = refined(before, 1152)
    assert after is before
    assert done == "kept the surface: its 1152 points are no less than 1152"


def test_fewer_points_than_a_tetrahedron_are_refused() -> None:
    with pytest.raises(InputError, match="expected at least 4 points, got 3; ask for more"):
        decimated(torus(), 3)


def test_without_the_extra_the_error_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "fast_simplification", None)
    with pytest.raises(InputError, match=r"decimation: .*pip install 'dicedesign\[concave\]'"):
        decimated(torus(), 100)


def test_what_meets_itself_in_every_reduction_is_refused() -> None:
    pytest.importorskip("fast_simplification")
    first, second = torus(), torus()
    points = np.vstack((first.points, second.points + np.array([0.3, 0.2, 0.1])))
    both = Surface(points, np.vstack((first.triangles, second.triangles + 1152)))
    with pytest.raises(InputError, match="got none from 2304 points by any reduction; remesh"):
        decimated(both, 1500)


@pytest.mark.parametrize("points", [1153, 3000])
def test_a_refined_torus_is_the_same_torus(points: int) -> None:
    before = torus()
    after, done = refined(before, points)
    assert points <= len(after.points) <= 3 * points
    check(after, genus=1)
    assert after.volume == pytest.approx(before.volume, rel=1e-12)
    np.testing.assert_allclose(after.centroid, before.centroid, rtol=0, atol=1e-12)
    distance, _ = cKDTree(after.points).query(before.points)
    assert distance.max() < 1e-12
    assert done.startswith(f"refined the surface from 1152 to {len(after.points)} points")


def test_a_box_of_eight_points_gets_even_triangles() -> None:
    mesh = trimesh.creation.box((1, 1, 1))
    after, _ = refined(Surface(mesh.vertices, np.asarray(mesh.faces, dtype=np.int64)), 500)
    assert 500 <= len(after.points) < 700
    shortest, mean, longest = surface_quality(after).edges
    assert longest < 3.0 * shortest
    assert mean > shortest


def test_a_mesh_is_refined_to_solid_only() -> None:
    before = torus()
    with pytest.raises(InputError, match="NotManifold"):
        refined(Surface(before.points, before.triangles[1:]), 2000)


def test_neither_library_is_loaded_before_it_is_needed() -> None:
    script = (
        "import sys, dicedesign.geometry.surfaces.remeshing\n"
        "assert not {'manifold3d', 'fast_simplification', 'torch'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", script], check=True)


@pytest.mark.parametrize(("name", "points"), [("spot", 400), ("armadillo", 2000)])
def test_models_are_decimated(name: str, points: int) -> None:
    pytest.importorskip("fast_simplification")
    path = public_data(f"models/{name}.obj")
    before, _ = make_surface(read_body(path))
    after, _ = decimated(before, points)
    assert abs(len(after.points) - points) <= 1
    check(after, genus=0)
    assert after.volume == pytest.approx(before.volume, rel=0.01)
