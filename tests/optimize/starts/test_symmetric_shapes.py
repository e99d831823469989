"""Symmetric starting shapes: rests, odds and symmetry by the forward model."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

import numpy as np
import pytest

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.point_groups import point_group
from dicedesign.optimize.starts.start import Start
from dicedesign.optimize.starts.symmetric_search import symmetric_shapes_near
from dicedesign.optimize.targets import binomial, sum_of_dice
from dicedesign.rest.basins import find_basins
from dicedesign.rest.poses import rest_poses

HALF = np.full(20, 1 / 19)
HALF[[0, 19]] = 0.5 / 19
CASES = {
    "two dice, mirror": (sum_of_dice([6, 6]).probabilities, "Cs"),
    "two dice, half turn": (sum_of_dice([6, 6]).probabilities, "C2"),
    "a coin": (np.full(2, 1 / 2), "D2d"),
    "five": (np.full(5, 1 / 5), "D3h"),
    "half weight": (HALF, "D3d"),
    "loaded": (np.array([1 / 3] + [2 / 15] * 5), "C5v"),
    "coins": (binomial(5).probabilities, "C2v"),
}


def shapes(target: np.ndarray, group: np.ndarray, seed: int) -> Iterator[Start]:
    """Starts alone, without the turns that found nothing."""
    starts = symmetric_shapes_near(target, group, seed)
    return (start for start in starts if start is not None)


def odds_of(start: Start) -> np.ndarray:
    """Odds of the outcomes of a start that has one rest for each."""
    poses = rest_poses(start.points)
    cosines = start.directions @ poses.normals.T
    outcome = np.argmax(cosines, axis=0)
    assert sorted(outcome) == list(range(len(start.directions)))
    np.testing.assert_allclose(cosines.max(axis=0), 1.0, atol=1e-9)
    odds = np.empty(len(outcome))
    odds[outcome] = poses.probabilities
    return odds


@pytest.mark.parametrize("name", CASES)
def test_starts_are_symmetric_and_have_a_rest_for_each_outcome(name: str) -> None:
    target, group = CASES[name][0], point_group(CASES[name][1])
    for start in islice(shapes(target, group, 0), 4):
        odds = odds_of(start)
        hull = convex_hull(start.points)
        assert len(find_basins(hull, hull.centroid)) == 1
        extents = np.ptp(start.points, axis=0)
        assert extents.max() == pytest.approx(2.0)
        np.testing.assert_allclose(hull.centroid, np.zeros(3), atol=1e-12)
        for element in group:
            images = start.points @ element.T
            gaps = np.linalg.norm(images[:, None] - start.points[None], axis=-1)
            assert gaps.min(axis=1).max() < 1e-10
            cosines = (start.directions @ element.T) @ start.directions.T
            image = np.argmax(cosines, axis=1)
            np.testing.assert_allclose(odds[image], odds, atol=1e-12)
            np.testing.assert_allclose(target[image], target, rtol=1e-12)


def test_an_outcome_with_most_of_the_odds_gets_them() -> None:
    """By chance its odds would be a third."""
    target = np.array([0.6, 0.2, 0.2])
    for name in ("C2v", "Cs"):
        starts = islice(shapes(target, point_group(name), 0), 8)
        odds = [odds_of(start) for start in starts]
        assert max(row[0] for row in odds) > 0.55
        assert all(row[1] == pytest.approx(row[2], abs=1e-12) for row in odds)


def test_odds_that_fill_no_orbits_are_refused_before_a_shape_is_asked_for() -> None:
    with pytest.raises(InputError, match="expected outcomes of equal probability to fill whole"):
        symmetric_shapes_near(sum_of_dice([6, 6]).probabilities, point_group("D3h"), 0)
