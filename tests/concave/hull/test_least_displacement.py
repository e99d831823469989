"""The least displacement of corners, against every set of inequalities tried in turn."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from dicedesign.concave.slopes import REGULAR, SOFTNESS, SlopeConditions, least_displacement
from dicedesign.runtime.arrays import Floats

CORNERS = 7


class Case:
    """Random corners, equations and inequalities, some of which fail at present."""

    def __init__(self, seed: int, inequalities: int = 6, equations: int = 2) -> None:
        rng = np.random.default_rng(seed)
        root = rng.normal(size=(3 * CORNERS, 3 * CORNERS))
        self.compliance = root @ root.T / CORNERS + 0.1 * np.eye(3 * CORNERS)
        self.displacement = 0.1 * rng.normal(size=(CORNERS, 3))
        tangents = rng.normal(size=(inequalities, 3))
        tangents /= np.linalg.norm(tangents, axis=1)[:, None]
        corners = rng.integers(0, CORNERS, inequalities)
        self.conditions = SlopeConditions(tangents, corners, np.full(inequalities, 0.01))
        self.excess = 0.05 * rng.normal(size=inequalities)
        self.jacobian = rng.normal(size=(equations, CORNERS, 3))
        self.misses = 0.05 * rng.normal(size=equations)

    def found(self) -> Floats:
        return least_displacement(
            self.compliance.reshape(CORNERS, 3, CORNERS, 3),
            self.displacement,
            self.conditions,
            self.excess,
            self.jacobian,
            self.misses,
        )

    def failing(self, following: Floats) -> Floats:
        """(s,) how much each inequality fails at another displacement."""
        rows = self.conditions.tangents
        change = (following - self.displacement)[self.conditions.corners]
        return np.asarray(self.excess + (rows * change).sum(axis=1))

    def expected(self) -> Floats:
        """Stationary in the displacements themselves, with each inequality a spring where it fails;
        the one set of springs that agrees with itself."""
        size, count = 3 * CORNERS, len(self.excess)
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
            kept = np.array(springs, dtype=bool)
            above = stiffness + rows[kept].T @ rows[kept] / softness
            system = np.block([[above, sides.T], [sides, zeros]])
            side = np.concatenate([rows[kept].T @ bounds[kept] / softness, wanted])
            moved = np.linalg.solve(system, side)[:size]
            if np.array_equal(rows @ moved > bounds, kept):
                agreeing.append(moved)
        (only,) = agreeing
        return only.reshape(CORNERS, 3)


@pytest.mark.parametrize("seed", range(8))
def test_it_is_the_one_of_least_work(seed: int) -> None:
    case = Case(seed)
    np.testing.assert_allclose(case.found(), case.expected(), atol=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_equations_are_met_and_inequalities_nearly(seed: int) -> None:
    case = Case(seed)
    following = case.found()
    gained = np.einsum("knc,nc->k", case.jacobian, following - case.displacement)
    np.testing.assert_allclose(gained, case.misses, atol=1e3 * REGULAR)
    assert case.failing(following).max() < 0.3 * case.excess.max()


def test_equations_alone() -> None:
    case = Case(20, inequalities=0)
    np.testing.assert_allclose(case.found(), case.expected(), atol=1e-6)


def test_inequalities_alone() -> None:
    """As for one outcome, whose odds are always 1."""
    case = Case(21, equations=0)
    np.testing.assert_allclose(case.found(), case.expected(), atol=1e-6)


def test_with_nothing_asked_for_it_is_none() -> None:
    case = Case(22, inequalities=0, equations=0)
    np.testing.assert_array_equal(case.found(), np.zeros((CORNERS, 3)))


def test_equations_may_depend_on_each_other() -> None:
    case = Case(23, inequalities=0, equations=1)
    once = case.found()
    case.jacobian, case.misses = np.repeat(case.jacobian, 2, axis=0), np.repeat(case.misses, 2)
    np.testing.assert_allclose(case.found(), once, atol=1e-6)
