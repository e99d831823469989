"""Choices of outcome directions, compared with optimal transport by linear programs."""

from __future__ import annotations

import numpy as np
import pytest
from common.bumpy import bumpy_sphere, unit
from common.dented_cube import CORNERS
from scipy.optimize import linprog

from dicedesign import rest_poses
from dicedesign.concave.outcome_directions import outcome_choices
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.runtime.arrays import Floats

APART = float(np.radians(40.0))

CLOSE = 0.006
"""Difference of costs, as climb over the circumscribed radius: assignments are softened, and the
sample directions differ here."""

BOX = CORNERS * np.array([1.0, 0.8, 0.6]) / np.sqrt(2.0)


BUMPY = convex_hull(unit(bumpy_sphere()).points)


def flat_hull() -> ConvexHull:
    """Flat body with large climbs, one of whose sides is more probable than the other."""
    points = directions_at_random(80, 2) * np.array([1.0, 0.6, 0.35]) + np.array([0.0, 0.0, 0.1])
    return convex_hull(points / np.linalg.norm(points, axis=1).max())


def directions_at_random(count: int, seed: int) -> Floats:
    directions = np.random.default_rng(seed).normal(size=(count, 3))
    return np.asarray(directions / np.linalg.norm(directions, axis=1)[:, None])


def least_angle(directions: Floats) -> float:
    """Least angle between two of the directions in degrees."""
    cosines = directions @ directions.T - 2.0 * np.eye(len(directions))
    return float(np.degrees(np.arccos(cosines.max())))


def climb(points: Floats, starts: Floats, end: Floats) -> Floats:
    """(s,) climbs along the arcs from starts (s, 3) to an end."""
    angles = np.arccos(np.clip(starts @ end, -1.0, 1.0))
    highest = np.zeros(len(starts))
    lowest = np.full(len(starts), np.inf)
    for part in np.linspace(0.0, 1.0, 60):
        back, on = np.sin((1.0 - part) * angles), np.sin(part * angles)
        arc = (back[:, None] * starts + on[:, None] * end) / np.sin(angles)[:, None]
        heights = (arc @ points.T).max(axis=1)
        lowest = np.minimum(lowest, heights)
        highest = np.maximum(highest, heights - lowest)
    return highest


def climbs(points: Floats, directions: Floats) -> Floats:
    """(s, k) climbs from many directions to ends (k, 3)."""
    starts = directions_at_random(400, 7)
    return np.stack([climb(points, starts, end) for end in directions], axis=1)


def cost(costs: Floats, shares: Floats) -> float:
    """Minimum mean of costs (s, k) if each outcome takes its share of the starts."""
    starts, outcomes = costs.shape
    by_start = np.kron(np.eye(starts), np.ones(outcomes))
    by_outcome = np.kron(np.ones(starts), np.eye(outcomes))
    solution = linprog(
        costs.ravel(),
        A_eq=np.concatenate([by_start, by_outcome]),
        b_eq=np.concatenate([np.full(starts, 1.0 / starts), shares]),
    )
    assert solution.success
    return float(solution.fun)


def test_the_cheapest_choices_come_first() -> None:
    hull, shares = flat_hull(), np.array([0.9, 0.1])
    points, choices = hull.vertices, outcome_choices(hull, shares, APART, 0)
    prices = [cost(climbs(points, directions), shares) for directions in choices[::6]]
    assert min(np.diff(prices)) > -CLOSE
    assert prices[-1] > prices[0] + CLOSE
    for seed in range(100, 140):
        others = directions_at_random(2, seed)
        if least_angle(others) > np.degrees(APART):
            assert cost(climbs(points, others), shares) > prices[0] + CLOSE


def test_rests_with_the_target_probabilities_are_the_first_choice() -> None:
    poses = rest_poses(BOX, center_of_mass=np.zeros(3))
    order = np.random.default_rng(1).permutation(6)
    target = poses.probabilities[order]
    best = outcome_choices(convex_hull(BOX), target, APART, 1)[0]
    own = np.argmax(poses.normals @ best.T, axis=0)
    np.testing.assert_allclose(poses.normals[own], best, atol=1e-12)
    np.testing.assert_allclose(poses.probabilities[own], target, atol=1e-12)
    assert sorted(own.tolist()) == list(range(6))


@pytest.mark.parametrize(("count", "degrees"), [(2, 90.0), (3, 60.0)])
def test_choices_are_apart_and_differ(count: int, degrees: float) -> None:
    target = np.full(count, 1.0 / count)
    choices = outcome_choices(BUMPY, target, float(np.radians(degrees)), 0)
    assert len(choices) > 1
    for directions in choices:
        assert directions.shape == (count, 3)
        np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, rtol=1e-12)
        assert least_angle(directions) >= degrees - 1e-9
    assert len({tuple(sorted(map(tuple, choice.tolist()))) for choice in choices}) == len(choices)


def test_an_unreachable_angle_is_loosened() -> None:
    """No four directions are more than 109.5 degrees apart."""
    for directions in outcome_choices(BUMPY, np.full(4, 0.25), float(np.radians(150.0)), 0):
        assert least_angle(directions) > 60.0


def test_more_outcomes_than_facets() -> None:
    """Facets can be split, up to the number in the message."""
    cube = convex_hull(CORNERS / np.sqrt(3.0))
    for directions in outcome_choices(cube, np.full(7, 1.0 / 7.0), APART, 0):
        assert least_angle(directions) > 18.2
    text = (
        "target: expected at most 12 outcomes for a hull of 8 corners, got 13; join some, or "
        "take a surface with more corners"
    )
    with pytest.raises(InputError, match=text):
        outcome_choices(cube, np.full(13, 1.0 / 13.0), APART, 0)
