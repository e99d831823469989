"""Closed surfaces are taken, repaired, refused in words, and made of more or fewer points."""

from __future__ import annotations

import sys

import numpy as np
import pytest
import trimesh
from common.bumpy import bent_capsule, bumpy_sphere, surface_of
from scipy.spatial import cKDTree

from dicedesign.concave.shapes import SHAPES, shape
from dicedesign.errors import InputError
from dicedesign.geometry.meshes.body import Body, make_body
from dicedesign.geometry.surfaces.closed_surface import (
    decimate,
    make_surface,
    refine,
    require_dents,
)
from dicedesign.geometry.surfaces.quality import surface_quality
from dicedesign.geometry.triangles import Surface


def sphere(radius: float = 1.0, x: float = 0.0) -> trimesh.Trimesh:
    return trimesh.creation.icosphere(subdivisions=2, radius=radius).apply_translation((x, 0, 0))


def body_of(*parts: trimesh.Trimesh) -> Body:
    mesh = trimesh.util.concatenate(list(parts))
    return make_body(np.asarray(mesh.vertices), np.asarray(mesh.faces), name="thing")


def test_a_good_surface_is_taken_as_it_is() -> None:
    body = body_of(sphere())
    surface, notes = make_surface(body)
    assert notes == ()
    np.testing.assert_array_equal(surface.points, body.points)
    np.testing.assert_array_equal(surface.triangles, body.triangles)
    assert surface.volume > 4.0


@pytest.mark.parametrize(
    ("reverse", "note"),
    [
        (slice(None), "turned the surface, which was oriented inward"),
        (slice(7), "reversed 7 triangles that were wound against their neighbors"),
    ],
)
def test_triangles_are_turned_outward_with_a_note(reverse: slice, note: str) -> None:
    mesh = sphere()
    faces = mesh.faces.copy()
    faces[reverse] = faces[reverse, ::-1]
    surface, notes = make_surface(make_body(mesh.vertices, faces, name="thing"))
    assert notes == (note,)
    assert surface.volume == pytest.approx(mesh.volume)


def test_surfaces_with_dents_pass() -> None:
    for surface in (bumpy_sphere(), bent_capsule(), *(shape(name) for name in SHAPES)):
        require_dents(surface)


def torus() -> Surface:
    return surface_of(trimesh.creation.torus(2.0, 0.5, major_sections=48, minor_sections=24))


def check(surface: Surface, genus: int) -> None:
    """A surface is one that is taken as input without any repair."""
    taken, notes = make_surface(make_body(surface.points, surface.triangles))
    assert notes == ()
    assert len(taken.points) == len(surface.points)
    assert surface_quality(surface).genus == genus


@pytest.mark.parametrize("points", [600, 200, 60])
def test_a_decimated_torus_is_a_torus_of_the_wanted_size(points: int) -> None:
    pytest.importorskip("fast_simplification")
    before = torus()
    after, done = decimate(before, points)
    assert abs(len(after.points) - points) <= 1
    check(after, genus=1)
    aside = np.hypot(np.hypot(after.points[:, 0], after.points[:, 1]) - 2.0, after.points[:, 2])
    np.testing.assert_allclose(aside, 0.5, atol=0.15)
    assert done.startswith(f"decimated the surface from 1152 to {len(after.points)} points")
    change = 100 * (after.volume / before.volume - 1)
    assert f"changes the volume by {change:+.2g} %" in done


def test_without_the_extra_the_error_names_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "fast_simplification", None)
    with pytest.raises(InputError, match=r"decimation: .*pip install 'dicedesign\[concave\]'"):
        decimate(torus(), 100)


@pytest.mark.parametrize("points", [1153, 3000])
def test_a_refined_torus_is_the_same_torus(points: int) -> None:
    before = torus()
    after, done = refine(before, points)
    assert points <= len(after.points) <= 3 * points
    check(after, genus=1)
    assert after.volume == pytest.approx(before.volume, rel=1e-12)
    np.testing.assert_allclose(after.centroid, before.centroid, rtol=0, atol=1e-12)
    distance, _ = cKDTree(after.points).query(before.points)
    assert distance.max() < 1e-12
    assert done.startswith(f"refined the surface from 1152 to {len(after.points)} points")
