"""Closed surfaces, with more or fewer points; defects made on purpose; distortion."""

from __future__ import annotations

import json
import sys

import numpy as np
import pytest
import trimesh
from common.bumpy import ball, bent_capsule, bumpy_sphere, self_intersecting_sphere, surface_of
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from dicedesign.concave.shapes import SHAPES, shape
from dicedesign.errors import InputError
from dicedesign.geometry.meshes.body import make_body
from dicedesign.geometry.sphere import angle_between, unit_vectors
from dicedesign.geometry.surfaces.closed_surface import (
    decimate,
    make_surface,
    refine,
    require_dents,
)
from dicedesign.geometry.surfaces.quality import (
    surface_distortion,
    surface_quality,
    surface_turns,
)
from dicedesign.geometry.triangles import Surface


@pytest.mark.parametrize(
    ("reverse", "note"),
    [
        (slice(0), ""),
        (slice(None), "turned the surface, which was oriented inward"),
        (slice(7), "reversed 7 triangles that were wound against their neighbors"),
    ],
)
def test_triangles_are_turned_outward_with_a_note(reverse: slice, note: str) -> None:
    given = ball(2)
    triangles = given.triangles.copy()
    triangles[reverse] = triangles[reverse, ::-1]
    surface, notes = make_surface(make_body(given.points, triangles))
    assert "".join(notes) == note
    np.testing.assert_array_equal(surface.points, given.points)
    np.testing.assert_array_equal(surface.triangles, given.triangles)


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


def test_a_sphere_has_no_defect() -> None:
    quality = surface_quality(ball(3))
    assert quality.sentences() == ()
    assert (quality.points, quality.triangles, quality.genus) == (642, 1280, 0)
    shortest, mean, longest = quality.edges
    assert 0 < shortest < mean < longest < 0.1
    assert np.degrees(quality.smallest_angle) > 50
    assert quality.distortion is None
    assert len(quality.places) == 0


def folded_sphere() -> tuple[Surface, Surface, int]:
    """A sphere, a copy with a point pulled past its neighbors in their plane, and the point."""
    before = ball(3)
    points = before.points.copy()
    point = int(np.argmax(points[:, 2]))
    ring = np.unique(before.triangles[(before.triangles == point).any(axis=1)])
    far = ring[np.argmax(points[ring, 0])]
    points[point, 0] += 2.0 * (points[far, 0] - points[point, 0])
    points[point, 2] = points[ring, 2].min()
    return before, before.with_points(points), point


def test_a_point_pulled_past_its_neighbors_turns_triangles_over() -> None:
    before, after, point = folded_sphere()
    quality = surface_quality(after, before)
    assert 1 <= len(quality.inverted) <= 3
    assert (before.triangles[quality.inverted] == point).any(axis=1).all()
    assert len(quality.folds) >= 2
    assert any("turned over" in sentence for sentence in quality.sentences())


def test_a_finger_through_the_other_side_is_found_where_it_is() -> None:
    quality = surface_quality(self_intersecting_sphere(), ball(4))
    assert len(quality.intersections) > 10
    assert len(quality.places) == 1
    np.testing.assert_allclose(quality.places[0], [0, 0, -1], atol=0.1)
    assert quality.sentences()[0].startswith("the surface intersects itself: ")
    assert " in 1 place, near (" in quality.sentences()[0]


def test_plain_data_can_be_written_as_json() -> None:
    before = ball(3)
    points = before.points.copy()
    points[before.triangles[0]] = points[before.triangles[0, 0]]
    data = surface_quality(before.with_points(points), before).data()
    read = json.loads(json.dumps(data, allow_nan=False))
    assert read["distortion"]["shape_largest"] is None
    assert read["slivers"]["count"] >= 1
    assert len(read["slivers"]["first"]) <= 20


def test_distortion_is_the_ratio_of_singular_values() -> None:
    rng = np.random.default_rng(1)
    before = ball(2)
    after = before.with_points(
        before.points @ rng.normal(size=(3, 3)) + 0.05 * rng.normal(size=(162, 3))
    )
    shapes, ratios, weights = [], [], []
    for corners, images in zip(
        before.points[before.triangles], after.points[after.triangles], strict=True
    ):
        frame, triangle = np.linalg.qr((corners[1:] - corners[0]).T)
        del frame
        linear = (images[1:] - images[0]).T @ np.linalg.inv(triangle)
        a, b = np.linalg.svd(linear, compute_uv=False)
        shapes.append(a / b)
        ratios.append(a * b)
        weights.append(abs(np.linalg.det(triangle)))
    scale = np.average(ratios, weights=weights)
    sizes = np.maximum(np.array(ratios) / scale, scale / np.array(ratios))
    distortion = surface_distortion(after, before)
    assert distortion["shape_mean"] == pytest.approx(np.average(shapes, weights=weights), rel=1e-9)
    assert distortion["shape_largest"] == pytest.approx(max(shapes), rel=1e-9)
    assert distortion["size_mean"] == pytest.approx(np.average(sizes, weights=weights), rel=1e-9)
    assert distortion["size_largest"] == pytest.approx(sizes.max(), rel=1e-9)
    below = np.array(shapes) <= distortion["shape_most"] * (1 + 1e-12)
    assert 0.95 <= np.average(below, weights=weights) < 0.96


def test_a_rotation_turns_all_normals_by_its_angle() -> None:
    before = ball(3)
    turn = Rotation.from_rotvec([0.0, 0.0, np.radians(7.0)]).as_matrix()
    turns = surface_turns(before.with_points(before.points @ turn.T), before)
    # Of a triangle whose normal has a latitude only its horizontal part turns.
    normals = unit_vectors(before.points[before.triangles].mean(axis=1))
    angles = 2.0 * np.arcsin(np.sqrt(1.0 - normals[:, 2] ** 2) * np.sin(np.radians(3.5)))
    assert turns.largest_degrees == pytest.approx(7.0, abs=0.01)
    assert np.radians(turns.mean_degrees) == pytest.approx(angles.mean(), rel=0.01)
    assert turns.mean_degrees < turns.most_degrees <= turns.largest_degrees
    assert turns.edge_after_degrees == pytest.approx(turns.edge_before_degrees)
    assert turns.peaks == 0


@pytest.mark.parametrize(("height", "peaks"), [(0.1, 0), (0.2, 2), (-0.2, 0)])
def test_peaks_are_where_the_curvature_has_grown(height: float, peaks: int) -> None:
    """Two bumps of radius r = 1 + height exp(-t^2 / 0.2^2) at an angle t have the curvature
    1 / r + 2 height / (0.2 r)^2 at their tops, which grew by 4.0 and 6.8; a sphere with a radius
    of 5 % of the diagonal has 5.8."""
    before = ball(5)
    points = before.points
    tops = np.array([[0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    away = angle_between(points[:, None], tops).min(axis=1)
    after = before.with_points(points * (1.0 + height * np.exp(-((away / 0.2) ** 2)))[:, None])
    turns = surface_turns(after, before)
    assert turns.peaks == peaks
    assert turns.edge_after_degrees > turns.edge_before_degrees
