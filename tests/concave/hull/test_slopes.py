"""Slopes of the support function, against the support function itself."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from common.bumpy import bumpy_sphere, unit
from common.dented_cube import CORNERS, NORMALS

from dicedesign.concave.slopes import (
    LIFETIME,
    NEARLY_LOWEST,
    SlopeMemory,
    SlopeOptions,
    climbs,
)
from dicedesign.gradient.rest_odds import RestEvaluation, evaluate_rests
from dicedesign.runtime.arrays import Floats

OPTIONS = SlopeOptions(fall=5e-3, rise=3e-3, circle=math.radians(3.0))


def height(points: Floats, direction: Floats) -> float:
    """Of the center of mass, the origin, over the table."""
    return float((points @ direction).max())


def arc(start: Floats, end: Floats, count: int) -> Floats:
    """(count, 3) directions, the shorter way."""
    angle = math.acos(np.clip(start @ end, -1.0, 1.0))
    parts = np.linspace(0.0, 1.0, count)[:, None]
    return (np.sin((1.0 - parts) * angle) * start + np.sin(parts * angle) * end) / math.sin(angle)


def rests_of(points: Floats) -> RestEvaluation:
    return evaluate_rests(torch.from_numpy(points), torch.zeros(3, dtype=torch.float64))


def normals_of(rests: RestEvaluation) -> Floats:
    """(r, 3) those that are down in its rests."""
    return rests.hull.normals[rests.paths.rests]


def bumpy_points() -> Floats:
    return unit(bumpy_sphere()).points


def askew_cube(seed: int) -> Floats:
    """Corners of a cube that was stretched and sheared: a body with six rests."""
    points = CORNERS @ (np.eye(3) + 0.1 * np.random.default_rng(seed).normal(size=(3, 3)))
    return np.asarray(points / np.linalg.norm(points, axis=1).max())


def test_climbs_are_those_of_the_support_function() -> None:
    points = bumpy_points()
    rng = np.random.default_rng(1)
    starts, ends = rng.normal(size=(6, 3)), rng.normal(size=(4, 3))
    starts /= np.linalg.norm(starts, axis=1)[:, None]
    ends /= np.linalg.norm(ends, axis=1)[:, None]
    found = climbs(points, starts, ends)
    for row, start in enumerate(starts):
        for column, end in enumerate(ends):
            heights = [height(points, direction) for direction in arc(start, end, 4000)]
            lowest, expected = math.inf, 0.0
            for value in heights:
                lowest = min(lowest, value)
                expected = max(expected, value - lowest)
            assert expected - 0.015 < found[row, column] < expected + 1e-4
    assert found.min() >= 0.0
    assert found.max() > 0.1


def test_from_side_to_side_of_a_cube_one_climbs_over_an_edge() -> None:
    found = climbs(CORNERS, NORMALS, NORMALS)
    expected = np.full((6, 6), math.sqrt(2.0) - 1.0)
    np.fill_diagonal(expected, 0.0)
    # The opposite side too: any way there is as long, and leads over other sides.
    np.testing.assert_allclose(found, expected, atol=2e-3)
    downhill = climbs(CORNERS, np.ones((1, 3)) / math.sqrt(3.0), NORMALS[:3])
    np.testing.assert_allclose(downhill, 0.0, atol=1e-15)


@pytest.mark.parametrize("seed", range(4))
def test_conditions_hold_where_all_rests_are_wanted(seed: int) -> None:
    points = askew_cube(seed)
    rests = rests_of(points)
    outcomes = normals_of(rests)
    memory = SlopeMemory(OPTIONS)
    conditions = memory.conditions(rests, outcomes, np.arange(len(outcomes)), 0)
    assert memory.cells == {}
    assert conditions.excess(points).max(initial=-1.0) <= 0.0


@pytest.mark.parametrize("seed", range(4))
def test_conditions_fail_on_the_way_from_an_unwanted_rest(seed: int) -> None:
    points = askew_cube(seed)
    rests = rests_of(points)
    normals = normals_of(rests)
    outcomes = normals[:-1]
    of_rest = np.append(np.arange(len(outcomes)), np.argmax(outcomes @ normals[-1]))
    memory = SlopeMemory(OPTIONS)
    conditions = memory.conditions(rests, outcomes, of_rest, 0)
    assert memory.cells
    assert conditions.excess(points).max() > OPTIONS.fall


def test_each_is_a_slope_of_the_support_function() -> None:
    points = bumpy_points()
    rests = rests_of(points)
    normals = normals_of(rests)
    outcomes = normals[:2]
    memory = SlopeMemory(OPTIONS)
    of_rest = np.argmax(normals @ outcomes.T, axis=1)
    conditions = memory.conditions(rests, outcomes, of_rest, 0)
    slopes = conditions.excess(points) - conditions.least
    step, compared, nearly = 1e-6, 0, 0
    for direction, outcome, _ in memory.cells.values():
        # On a facet the slope is another along each edge.
        if np.diff(np.sort(points @ direction)[-2:]) < 1e-4:
            continue
        end = outcomes[outcome]
        tangent = end - (end @ direction) * direction
        tangent /= np.linalg.norm(tangent)
        alike = np.abs(conditions.tangents - tangent).max(axis=1) < 1e-12
        lowest = height(points, direction)
        ahead = math.cos(step) * direction + math.sin(step) * tangent
        for place in np.flatnonzero(alike):
            stood_on = float(points[conditions.corners[place]] @ direction)
            assert stood_on >= lowest - NEARLY_LOWEST - 1e-14
            if stood_on < lowest:
                nearly += 1
                continue
            expected = (height(points, ahead) - lowest) / step
            assert slopes[place] == pytest.approx(expected, abs=1e-5)
            compared += 1
    assert compared >= 5
    assert nearly >= 5


def test_conditions_are_linear_in_the_corners() -> None:
    points = bumpy_points()
    rests = rests_of(points)
    outcomes = normals_of(rests)[:3]
    of_rest = np.argmax(normals_of(rests) @ outcomes.T, axis=1)
    conditions = SlopeMemory(OPTIONS).conditions(rests, outcomes, of_rest, 0)
    other = points + 0.1 * np.random.default_rng(3).normal(size=points.shape)
    mixed = conditions.excess(0.3 * points + 0.7 * other)
    expected = 0.3 * conditions.excess(points) + 0.7 * conditions.excess(other)
    np.testing.assert_allclose(mixed, expected, atol=1e-14)
    inside = np.setdiff1d(np.arange(len(points)), rests.hull.source)
    assert not np.isin(conditions.corners, inside).any()


def test_a_rest_opposite_to_its_outcome_is_asked_to_drain() -> None:
    rests = rests_of(CORNERS / math.sqrt(3.0))
    normals = normals_of(rests)
    outcomes = np.array([[0.0, 0.0, 1.0]])
    memory = SlopeMemory(OPTIONS)
    conditions = memory.conditions(rests, outcomes, np.zeros(len(normals), dtype=np.int64), 0)
    assert np.isfinite(conditions.tangents).all()
    np.testing.assert_allclose(np.linalg.norm(conditions.tangents, axis=1), 1.0, rtol=1e-12)
    assert conditions.excess(CORNERS / math.sqrt(3.0)).max() > OPTIONS.fall


def test_what_no_arc_meets_again_is_forgotten() -> None:
    points = askew_cube(1)
    rests = rests_of(points)
    normals = normals_of(rests)
    memory = SlopeMemory(OPTIONS)
    of_rest = np.append(np.arange(len(normals) - 1), 0)
    memory.conditions(rests, normals[:-1], of_rest, 0)
    first = set(memory.cells)
    for step, kept in ((LIFETIME - 1, first), (LIFETIME, set())):
        memory.conditions(rests, normals, np.arange(len(normals)), step)
        assert set(memory.cells) == kept
