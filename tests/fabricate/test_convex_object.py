"""Rounded edges by laws of parallel bodies, hidden hollows, and solids of dirty surfaces."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh
from common.bumpy import ball, self_intersecting_sphere
from hypothesis import given, settings
from hypothesis import strategies as st

from dicedesign.errors import EngravingError, InputError
from dicedesign.fabricate.convex_object import WALL, hollow_out, round_edges
from dicedesign.fabricate.finish_options import EdgeOptions, core_scale
from dicedesign.fabricate.surface_assessment import printable_solid
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.meshes.manifold import mesh_of, solid
from dicedesign.geometry.surfaces.quality import surface_quality
from dicedesign.geometry.surfaces.self_intersections import intersecting_triangles
from dicedesign.geometry.triangles import Surface
from dicedesign.rest.poses import analyze

CUBE = convex_hull(np.array(np.meshgrid([-5.0, 5.0], [-5.0, 5.0], [-5.0, 5.0])).reshape(3, -1).T)


def random_hull(seed: int) -> ConvexHull:
    random = np.random.default_rng(seed)
    points = random.standard_normal((14, 3))
    return convex_hull(10.0 * points / np.linalg.norm(points, axis=1)[:, None])


@settings(max_examples=15, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    radius=st.floats(0.05, 3.0),
    shape=st.sampled_from(["fillet", "chamfer"]),
)
def test_a_rounded_body_has_the_probabilities_of_its_core(
    seed: int, radius: float, shape: str
) -> None:
    """Its height over the table is the core's plus the radius in every direction, so its edges and
    corners have no rests either. The center of mass is the same."""
    core = random_hull(seed)
    body = round_edges(core, core.centroid, EdgeOptions(radius, shape))
    before, after = analyze(core, core.centroid), analyze(body, core.centroid)
    assert len(after.normals) == len(before.normals)
    pairs = np.argmax(before.normals @ after.normals.T, axis=1)
    np.testing.assert_allclose(after.normals[pairs], before.normals, atol=1e-9)
    # Strips are flat, so paths deviate slightly from those of a round body.
    rough = {"fillet": 5e-4, "chamfer": 5e-3}[shape] * radius
    np.testing.assert_allclose(after.probabilities[pairs], before.probabilities, atol=rough)


def test_a_cube_keeps_its_faces_and_steiners_volume() -> None:
    radius = 2.0
    body = round_edges(CUBE, np.zeros(3), EdgeOptions(radius))
    poses = analyze(body, np.zeros(3))
    np.testing.assert_allclose(poses.probabilities, np.full(6, 1 / 6), atol=1e-12)
    np.testing.assert_allclose(poses.areas, np.full(6, 100.0), rtol=1e-9)
    np.testing.assert_allclose(np.ptp(body.vertices, axis=0), np.full(3, 14.0), rtol=1e-12)
    steiner = 1000.0 + 600.0 * radius + 3 * 10.0 * math.pi * radius**2 + 4 / 3 * math.pi * radius**3
    sharp = 14.0**3
    # Flat strips are inside the round ones.
    assert steiner - 0.02 * (sharp - steiner) < body.surface.volume < steiner


def test_unsuitable_radii_are_refused() -> None:
    """Within a hundredth and a fifth of the size; chamfers may be finer."""
    for part in (0.01, 0.2):
        assert 0.0 < core_scale(EdgeOptions(part * 30.0), 30.0) < 1.0
    for radius in (0.299, 6.001):
        with pytest.raises(InputError, match=r"edges\.radius_mm: .*(0\.3|6)"):
            core_scale(EdgeOptions(radius), 30.0)
    with pytest.raises(InputError, match="radius_mm"):
        EdgeOptions(math.nan)
    with pytest.raises(InputError, match="'fillet' or 'chamfer'"):
        EdgeOptions(1.0, "round")
    assert core_scale(EdgeOptions(0.03, "chamfer"), 30.0) == pytest.approx(0.998)


# Hidden hollows.


@pytest.fixture
def cube_with_pocket(box):
    """Make a cube with a square pocket in its upper side."""

    def make(size: float, side: float, depth: float) -> Surface:
        plain, tool = box(size, size, size), box(side, side, side)
        shift = np.array([0.0, 0.0, size / 2.0 + side / 2.0 - depth])
        body = solid(plain.surface) - solid(tool.surface.with_points(tool.vertices + shift))
        return mesh_of(body)

    return make


def test_the_center_of_mass_returns_to_its_place(cube_with_pocket) -> None:
    body = cube_with_pocket(20.0, 8.0, 0.6)
    assert abs(body.centroid[2]) > 0.03
    end = hollow_out(body, np.zeros(3))
    judge = trimesh.Trimesh(end.points, end.triangles, process=False)
    np.testing.assert_allclose(judge.center_mass, np.zeros(3), atol=1e-12)
    assert judge.is_watertight
    hollow = end.points[len(body.points) :]
    assert hollow[:, 2].max() < 0.0
    middle, radius = hollow.mean(axis=0), np.linalg.norm(hollow - hollow.mean(axis=0), axis=1).max()
    assert radius >= 1.0
    assert middle[2] - radius > -10.0 + WALL - 1e-9
    # A smaller hollow would have to be farther out, in the wall.
    assert radius == pytest.approx(1.0, abs=1e-6) or middle[2] - radius < -10.0 + WALL + 0.5


def test_a_balanced_body_is_unchanged_and_one_without_room_refused(box, cube_with_pocket) -> None:
    body = box(20.0, 20.0, 20.0).surface
    assert hollow_out(body, np.zeros(3)) is body
    with pytest.raises(EngravingError, match="balance"):
        hollow_out(cube_with_pocket(6.0, 5.0, 2.0), np.zeros(3))


# Dirty surfaces.


def test_slivers_are_collapsed_and_counted() -> None:
    before = ball(4)
    assert printable_solid(before)[1] == ()
    points = before.points.copy()
    a, b = before.triangles[0, :2]
    points[a] = points[b] + 1e-9 * (points[a] - points[b])
    assert len(surface_quality(before.with_points(points)).slivers) == 2
    after, (note,) = printable_solid(before.with_points(points))
    assert len(surface_quality(after).slivers) == 0
    assert len(after.triangles) == len(before.triangles) - 2
    assert "5118 triangles" in note
    assert after.volume == pytest.approx(before.with_points(points).volume, rel=1e-8)


def test_self_intersections_are_reported() -> None:
    surface, notes = printable_solid(self_intersecting_sphere())
    pairs = intersecting_triangles(surface.points, surface.triangles)
    assert len(pairs) > 0
    assert f"{len(pairs)} pairs" in notes[-1]


def test_a_surface_whose_cleaned_solid_is_empty_is_refused() -> None:
    flat = ball(4).with_points(ball(4).points * [1, 1, 1e-9])
    with pytest.raises(InputError, match="printable solid"):
        printable_solid(flat)
