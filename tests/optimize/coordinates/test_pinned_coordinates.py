"""Facets that are pinned keep their planes, whatever the others do."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.optimize.coordinates.facets import FacetCoordinates
from dicedesign.optimize.coordinates.linked import PinnedCoordinates
from dicedesign.optimize.options import ExactOptions
from dicedesign.optimize.preferences.preference import Preferences
from dicedesign.optimize.solvers.exact import solve_exactly
from dicedesign.optimize.starts.half_space_odds import repulsion
from dicedesign.optimize.starts.search import shapes_like
from dicedesign.rest.poses import rest_poses
from dicedesign.results.parts import Status

START = repulsion(7, 0)
PINNED = (1, 4)


def reach(points: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """(p,) how far a body reaches in each direction."""
    return (points @ directions.T).max(axis=0)


def facet_normals(hull: ConvexHull, directions: np.ndarray) -> np.ndarray:
    return hull.normals[np.argmax(directions @ hull.normals.T, axis=1)]


def test_the_others_move_as_without_pins() -> None:
    rng = np.random.default_rng(0)
    origin = convex_hull(START.points).centroid
    pinned = START.directions[list(PINNED)]
    coordinates, parameters = PinnedCoordinates.of(START.points, origin, pinned)
    bare, whole = FacetCoordinates.of(START.points, origin)
    assert len(parameters) == len(whole) - 4 * len(PINNED)
    moved = parameters + 0.1 * rng.normal(size=parameters.shape)
    points = coordinates.shape(moved).points
    hull = convex_hull(points)
    np.testing.assert_allclose(facet_normals(hull, pinned), pinned, atol=1e-12)
    np.testing.assert_allclose(reach(points, pinned), reach(START.points, pinned), atol=1e-12)

    all_moved = whole.copy()
    all_moved[np.isin(whole, parameters)] = moved
    shape = bare.shape(all_moved)
    np.testing.assert_array_equal(points, shape.points)
    rows = rng.normal(size=(3, *points.shape))
    np.testing.assert_array_equal(
        coordinates.shape(moved).pulled_back(rows),
        shape.pulled_back(rows)[:, np.isin(whole, parameters)],
    )


@pytest.mark.parametrize("pinned", [(), (1, 4, 6)])
def test_a_design_leaves_pinned_facets_where_they_are(pinned: tuple[int, ...]) -> None:
    target = np.array([0.2, 0.1, 0.15, 0.15, 0.1, 0.1, 0.2])
    start = replace(START, pinned=pinned)
    result = solve_exactly(
        shapes_like(start, 0), target, ExactOptions(prefer=Preferences(roundness=1.0))
    )
    assert result.status is Status.CONVERGED
    np.testing.assert_allclose(
        np.sort(rest_poses(result.hull.vertices).probabilities), np.sort(target), atol=1e-12
    )
    before, moved = START.directions, np.abs(result.directions - START.directions).max(axis=1)
    kept = np.isin(np.arange(7), pinned)
    assert (moved[kept] < 1e-12).all()
    assert (moved[~kept] > 1e-4).all()
    planes = reach(result.hull.vertices, before) - reach(START.points, before)
    assert (np.abs(planes[kept]) < 1e-12).all()


def test_variations_leave_them_too() -> None:
    start = replace(START, pinned=PINNED)
    pinned = START.directions[list(PINNED)]
    for shape in islice(shapes_like(start, 0), 1, 6):
        assert shape.pinned == PINNED
        np.testing.assert_allclose(shape.directions[list(PINNED)], pinned, atol=1e-12)
        np.testing.assert_allclose(
            reach(shape.points, pinned), reach(START.points, pinned), atol=1e-12
        )
        assert np.abs(shape.directions - START.directions).max() > 1e-3


def test_a_die_of_pinned_facets_alone_stays_as_it_is() -> None:
    start = replace(START, pinned=tuple(range(7)))
    poses = rest_poses(START.points)
    odds = poses.probabilities[np.argmax(START.directions @ poses.normals.T, axis=1)]
    result = solve_exactly(shapes_like(start, 0), odds, ExactOptions(tolerance=1e-9))
    assert result.status is Status.CONVERGED
    planes = [reach(points, START.directions) for points in (result.hull.vertices, START.points)]
    np.testing.assert_allclose(*planes, atol=1e-12)
    assert len(result.hull.normals) == len(convex_hull(START.points).normals)
