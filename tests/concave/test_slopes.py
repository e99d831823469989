"""Slopes of the support function and displacements of minimum work, computed in other ways."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest
import torch
from common.bumpy import bumpy_sphere, unit
from common.dented_cube import CORNERS

from dicedesign.concave.slopes import (
    NEARLY_LOWEST,
    SOFTNESS,
    SlopeConditions,
    SlopeMemory,
    SlopeOptions,
    climbs,
    least_displacement,
)
from dicedesign.gradient.rest_probabilities import RestEvaluation, evaluate_rests
from dicedesign.runtime.arrays import Floats

OPTIONS = SlopeOptions(fall=5e-3, rise=3e-3, circle=math.radians(3.0))


def height(points: Floats, direction: Floats) -> float:
    """Height of the center of mass, the origin, over the table."""
    return float((points @ direction).max())


def arc(start: Floats, end: Floats, count: int) -> Floats:
    """(count, 3) directions along the shorter arc."""
    angle = math.acos(np.clip(start @ end, -1.0, 1.0))
    parts = np.linspace(0.0, 1.0, count)[:, None]
    return (np.sin((1.0 - parts) * angle) * start + np.sin(parts * angle) * end) / math.sin(angle)


def rests_of(points: Floats) -> RestEvaluation:
    return evaluate_rests(torch.from_numpy(points), torch.zeros(3, dtype=torch.float64))


def normals_of(rests: RestEvaluation) -> Floats:
    """(r, 3) normals of the rests."""
    return rests.hull.normals[rests.paths.rests]


def bumpy_points() -> Floats:
    return unit(bumpy_sphere()).points


def askew_cube(seed: int) -> Floats:
    """Corners of a stretched and sheared cube with six rests."""
    points = CORNERS @ (np.eye(3) + 0.1 * np.random.default_rng(seed).normal(size=(3, 3)))
    return np.asarray(points / np.linalg.norm(points, axis=1).max())


def test_climbs_are_those_of_the_support_function() -> None:
    points = bumpy_points()
    rng = np.random.default_rng(1)
    starts, ends = rng.normal(size=(6, 3)), rng.normal(size=(4, 3))
    starts /= np.linalg.norm(starts, axis=1)[:, None]
    ends /= np.linalg.norm(ends, axis=1)[:, None]
    computed = climbs(points, starts, ends)
    for row, start in enumerate(starts):
        for column, end in enumerate(ends):
            heights = [height(points, direction) for direction in arc(start, end, 4000)]
            lowest, expected = math.inf, 0.0
            for value in heights:
                lowest = min(lowest, value)
                expected = max(expected, value - lowest)
            assert expected - 0.015 < computed[row, column] < expected + 1e-4
    assert computed.min() >= 0.0
    assert computed.max() > 0.1


@pytest.mark.parametrize("seed", range(2))
def test_conditions_fail_only_between_other_rests_and_outcomes(seed: int) -> None:
    points = askew_cube(seed)
    rests = rests_of(points)
    normals = normals_of(rests)
    memory = SlopeMemory(OPTIONS)
    conditions = memory.conditions(rests, normals, np.arange(len(normals)), 0)
    assert memory.cells == {}
    assert conditions.excess(points).max(initial=-1.0) <= 0.0
    # Without the last outcome, its rest belongs to the nearest other one.
    outcomes = normals[:-1]
    of_rest = np.append(np.arange(len(outcomes)), np.argmax(outcomes @ normals[-1]))
    conditions = memory.conditions(rests, outcomes, of_rest, 0)
    assert memory.cells
    assert conditions.excess(points).max() > OPTIONS.fall


def test_conditions_are_slopes_of_the_support_function() -> None:
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
        # On a facet the slope is not unique.
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


def test_a_rest_opposite_to_its_outcome_has_conditions() -> None:
    rests = rests_of(CORNERS / math.sqrt(3.0))
    normals = normals_of(rests)
    outcomes = np.array([[0.0, 0.0, 1.0]])
    memory = SlopeMemory(OPTIONS)
    conditions = memory.conditions(rests, outcomes, np.zeros(len(normals), dtype=np.int64), 0)
    assert np.isfinite(conditions.tangents).all()
    np.testing.assert_allclose(np.linalg.norm(conditions.tangents, axis=1), 1.0, rtol=1e-12)
    assert conditions.excess(CORNERS / math.sqrt(3.0)).max() > OPTIONS.fall


COUNT = 7


class Case:
    """Random corners, equations and inequalities, some of which are violated."""

    def __init__(self, seed: int, inequalities: int, equations: int) -> None:
        rng = np.random.default_rng(seed)
        root = rng.normal(size=(3 * COUNT, 3 * COUNT))
        self.compliance = root @ root.T / COUNT + 0.1 * np.eye(3 * COUNT)
        self.displacement = 0.1 * rng.normal(size=(COUNT, 3))
        tangents = rng.normal(size=(inequalities, 3))
        tangents /= np.linalg.norm(tangents, axis=1)[:, None]
        corners = rng.integers(0, COUNT, inequalities)
        self.conditions = SlopeConditions(tangents, corners, np.full(inequalities, 0.01))
        self.excess = 0.05 * rng.normal(size=inequalities)
        self.jacobian = rng.normal(size=(equations, COUNT, 3))
        self.misses = 0.05 * rng.normal(size=equations)

    def solve(self) -> Floats:
        return least_displacement(
            self.compliance.reshape(COUNT, 3, COUNT, 3),
            self.displacement,
            self.conditions,
            self.excess,
            self.jacobian,
            self.misses,
        )

    def expected(self) -> Floats:
        """Stationary displacements with a spring for each violated inequality: the only consistent
        set of springs."""
        size, count = 3 * COUNT, len(self.excess)
        rows = np.zeros((count, size))
        for row, corner in enumerate(self.conditions.corners):
            rows[row, 3 * corner : 3 * corner + 3] = self.conditions.tangents[row]
        bounds = rows @ self.displacement.ravel() - self.excess
        sides = self.jacobian.reshape(len(self.misses), size)
        wanted = sides @ self.displacement.ravel() + self.misses
        softness = SOFTNESS * np.trace(self.compliance) / size
        stiffness = np.linalg.inv(self.compliance)
        zeros = np.zeros((len(wanted), len(wanted)))
        agreeing = []
        for springs in product([False, True], repeat=count):
            active = np.array(springs, dtype=bool)
            above = stiffness + rows[active].T @ rows[active] / softness
            system = np.block([[above, sides.T], [sides, zeros]])
            side = np.concatenate([rows[active].T @ bounds[active] / softness, wanted])
            moved = np.linalg.solve(system, side)[:size]
            if np.array_equal(rows @ moved > bounds, active):
                agreeing.append(moved)
        (only,) = agreeing
        return only.reshape(COUNT, 3)


@pytest.mark.parametrize(
    ("seed", "inequalities", "equations"), [(0, 6, 2), (1, 6, 2), (20, 0, 2), (21, 6, 0)]
)
def test_the_displacement_has_minimum_work(seed: int, inequalities: int, equations: int) -> None:
    case = Case(seed, inequalities, equations)
    np.testing.assert_allclose(case.solve(), case.expected(), atol=1e-6)
