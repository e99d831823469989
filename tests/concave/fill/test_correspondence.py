"""The hull fill by correspondence on small surfaces: what it promises."""

from __future__ import annotations

import numpy as np
import pytest
from common.bumpy import ball, bent_capsule, bumpy_sphere, nearby_hull, unit
from common.dented_cube import dented_cube

from dicedesign.concave.correspondence import MOST_ROUNDS, fill_by_correspondence
from dicedesign.concave.result import FillResult, FillStatus
from dicedesign.concave.space_elasticity import Elasticity
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.surfaces.remeshing import refined
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Floats, Integers


def wanted(surface: Surface, amount: float) -> tuple[ConvexHull, Integers]:
    """A hull near the surface's own, and the points that are to be its corners."""
    hull = nearby_hull(surface, amount)
    return hull, convex_hull(surface.points).source[hull.source]


def fill(
    surface: Surface, hull: ConvexHull, corners: Integers, center: Floats
) -> tuple[FillResult, list[float]]:
    energies: list[float] = []
    result = fill_by_correspondence(Elasticity(surface), hull, corners, center, energies.append)
    assert energies[-1] == result.energy
    return result, energies


@pytest.mark.parametrize(
    ("surface", "amount"),
    [
        (unit(bumpy_sphere()), 0.01),
        (unit(bumpy_sphere()), 0.05),
        (unit(bumpy_sphere(3)), 0.05),
        (unit(bent_capsule(18, 10)), 0.03),
    ],
)
@pytest.mark.parametrize("way", [[0.0, 0.0, 0.0], [0.01, -0.005, 0.01]])
def test_the_hull_and_the_center_of_mass_are_the_wanted_ones(
    surface: Surface, amount: float, way: list[float]
) -> None:
    hull, corners = wanted(surface, amount)
    center = surface.centroid + np.array(way)
    result, _ = fill(surface, hull, corners, center)
    assert result.status is FillStatus.FITTED
    np.testing.assert_array_equal(result.points[corners], hull.vertices)
    found = convex_hull(result.points)
    assert sorted(found.vertices.tolist()) == sorted(hull.vertices.tolist())
    others = np.setdiff1d(np.arange(len(result.points)), corners)
    slacks = hull.heights(np.zeros(3)) - result.points[others] @ hull.normals.T
    assert slacks.min() > 1e-6 * surface.diagonal
    miss = surface.moved(result.points).centroid - center
    assert np.linalg.norm(miss) < 1e-12 * surface.diagonal
    moved = np.linalg.norm(result.points - surface.points, axis=1) / surface.diagonal
    assert moved.mean() < 2.0 * amount + 0.05


def test_in_single_precision_too_the_corners_alone_span_the_hull() -> None:
    surface = unit(bumpy_sphere())
    hull, corners = wanted(surface, 0.05)
    result, _ = fill(surface, hull, corners, surface.centroid)
    rounded = result.points.astype(np.float32).astype(np.float64)
    np.testing.assert_array_equal(np.sort(convex_hull(rounded).source), np.sort(corners))


def test_points_on_flat_sides_sink_by_a_hair() -> None:
    """A cube of some hundred points, most of them on its sides and edges."""
    surface, _ = refined(dented_cube(), 300)
    surface = unit(surface)
    own = convex_hull(surface.points)
    corners = own.vertices + 0.02 * np.random.default_rng(0).normal(size=own.vertices.shape)
    hull = convex_hull(corners)
    result, _ = fill(surface, hull, own.source[hull.source], surface.centroid)
    assert result.status is FillStatus.FITTED
    found = convex_hull(result.points)
    assert sorted(found.vertices.tolist()) == sorted(hull.vertices.tolist())


def test_place_and_unit_matter_little() -> None:
    surface = unit(bumpy_sphere())
    hull, corners = wanted(surface, 0.03)
    center = surface.centroid + np.array([0.01, 0.0, 0.0])
    first, _ = fill(surface, hull, corners, center)
    shift = np.array([0.3, -0.2, 0.5])
    moved = surface.moved(1.5 * surface.points + shift)
    there = convex_hull(1.5 * hull.vertices + shift)
    np.testing.assert_array_equal(there.source, np.arange(len(corners)))
    second, _ = fill(moved, there, corners, 1.5 * center + shift)
    assert second.status is FillStatus.FITTED
    # The constant in the kernel is for radius 1.
    np.testing.assert_allclose((second.points - shift) / 1.5, first.points, atol=1e-3)


def test_a_surface_that_fits_stays_as_it_is() -> None:
    surface = unit(bumpy_sphere(1))
    hull = convex_hull(surface.points)
    inside = np.setdiff1d(np.arange(len(surface.points)), hull.source)
    slack = (hull.heights(np.zeros(3)) - surface.points[inside] @ hull.normals.T).min()
    assert slack > 1e-4
    result, steps = fill(surface, hull, hull.source, surface.centroid)
    assert result.status is FillStatus.FITTED
    assert len(steps) == 1
    np.testing.assert_array_equal(result.points, surface.points)


def test_a_center_of_mass_out_of_reach() -> None:
    surface = unit(bent_capsule(18, 10))
    hull = convex_hull(surface.points)
    result, steps = fill(surface, hull, hull.source, surface.centroid + np.array([0.8, 0.1, -0.2]))
    assert result.status is FillStatus.NO_PROGRESS
    assert len(steps) < MOST_ROUNDS


def test_a_convex_surface_has_nothing_to_move() -> None:
    """All its points are corners; they stay in place, and so does the center of mass."""
    surface = unit(ball(1))
    hull = convex_hull(surface.points)
    assert len(hull.vertices) == len(surface.points)
    center = surface.centroid + np.array([0.05, 0.0, 0.0])
    result, _ = fill(surface, hull, hull.source, center)
    np.testing.assert_array_equal(result.points[hull.source], hull.vertices)
