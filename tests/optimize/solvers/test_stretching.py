"""Bodies brought to wanted odds by a linear map: found again, exact in the file, and no worse."""

from __future__ import annotations

import numpy as np
import pytest

from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.body import make_body
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.optimize.solvers.stretching import stretched
from dicedesign.rest.outcomes import outcome_odds
from dicedesign.rest.poses import rest_poses


def box(*sizes: float) -> Surface:
    corners = np.array(np.meshgrid(*[[-s / 2, s / 2] for s in sizes])).reshape(3, -1).T
    hull = convex_hull(corners)
    return Surface(hull.vertices, hull.triangles)


def odds_of(surface: Surface, directions: np.ndarray) -> np.ndarray:
    poses = rest_poses(make_body(surface.points, surface.triangles))
    return outcome_odds(poses, directions).odds


def test_a_box_becomes_the_box_with_the_odds() -> None:
    """Opposite sides of a box are alike, and its proportions follow from the odds."""
    sides = np.concatenate([np.eye(3), -np.eye(3)])
    wanted = odds_of(box(10.0, 10.2, 9.9), sides)
    end = stretched(box(10.0, 10.0, 10.0).moved(box(10.0, 10.0, 10.0).points + 3.0), sides, wanted)
    assert end.errors[0] > 1e-3
    assert end.errors[1] < 1e-11
    np.testing.assert_allclose(odds_of(end.surface, end.directions), wanted, atol=1e-11)
    lengths = np.linalg.eigvalsh(end.matrix) * 10.0
    np.testing.assert_allclose(
        np.sort(lengths / lengths.mean()), np.sort([10.0, 10.2, 9.9]) / 10.033333333, rtol=1e-6
    )
    np.testing.assert_allclose(end.surface.centroid, np.full(3, 3.0), atol=1e-12)


def test_odds_that_no_stretch_has_are_not_made_worse() -> None:
    """A box has equal odds on opposite sides, whatever its proportions."""
    sides = np.concatenate([np.eye(3), -np.eye(3)])
    wanted = np.array([0.2, 0.16, 0.16, 0.14, 0.17, 0.17])
    end = stretched(box(10.0, 10.0, 10.0), sides, wanted)
    assert end.errors[1] <= end.errors[0]
    assert end.errors[1] == pytest.approx(0.03, abs=0.02)
