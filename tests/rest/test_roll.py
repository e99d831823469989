"""Single rolls: rigid, without slip, downhill, and ending where the complex says."""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np
import pytest
from numpy.typing import ArrayLike

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.rest.equilibria import Equilibria, classify
from dicedesign.rest.roll import RollStep, roll_steps


def body(seed: int) -> Equilibria:
    rng = np.random.default_rng(seed)
    hull = convex_hull(rng.normal(size=(5 + 3 * seed, 3)) * [1.0, 0.7, 0.4] + [3.0, 2.0, 1.0])
    somewhere = rng.dirichlet(np.ones(len(hull.vertices))) @ hull.vertices
    return classify(hull, 0.5 * (hull.centroid + somewhere))


def rolls(seed: int, max_angle: float | None) -> list[tuple[Equilibria, tuple[RollStep, ...]]]:
    equilibria = body(seed)
    downs = np.random.default_rng(seed).normal(size=(12, 3))
    return [(equilibria, roll_steps(equilibria, down, max_angle)) for down in downs]


def place(step: RollStep, points: np.ndarray) -> np.ndarray:
    return points @ step.transform[:3, :3].T + step.transform[:3, 3]


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("max_angle", [None, 0.05])
def test_the_body_moves_rigidly_on_the_table(seed: int, max_angle: float | None) -> None:
    for equilibria, steps in rolls(seed, max_angle):
        for step in steps:
            turn = step.transform[:3, :3]
            np.testing.assert_allclose(turn @ turn.T, np.eye(3), rtol=0, atol=1e-13)
            assert np.linalg.det(turn) == pytest.approx(1.0)
            np.testing.assert_array_equal(step.transform[3], [0, 0, 0, 1])
            np.testing.assert_allclose(turn @ step.down, [0, 0, -1], rtol=0, atol=1e-13)
            heights = place(step, equilibria.hull.vertices)[:, 2]
            assert heights.min() > -1e-12
            np.testing.assert_allclose(heights[list(step.vertices)], 0.0, atol=1e-12)
            center = place(step, equilibria.center_of_mass)
            assert step.height == pytest.approx(center[2], abs=1e-12)
            names = {1: "vertex", 2: "edge"}
            assert step.contact == names.get(len(step.vertices), "facet")
        np.testing.assert_allclose(place(steps[0], equilibria.center_of_mass)[:2], 0.0, atol=1e-12)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("max_angle", [None, 0.3, 0.05])
def test_it_rolls_downhill_without_slip_by_no_more_than_the_largest_angle(
    seed: int, max_angle: float | None
) -> None:
    for equilibria, steps in rolls(seed, max_angle):
        heights = np.array([step.height for step in steps])
        assert (np.diff(heights) < 0).all()
        for before, after in pairwise(steps):
            pivots = sorted(set(before.vertices) & set(after.vertices))
            assert pivots
            if max_angle is not None:
                turn = after.transform[:3, :3] @ before.transform[:3, :3].T
                angle = np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1))
                assert angle <= max_angle + 1e-7
            corners = equilibria.hull.vertices[pivots]
            np.testing.assert_allclose(
                place(after, corners), place(before, corners), rtol=0, atol=1e-12
            )


def test_a_body_at_rest_stays() -> None:
    cube = classify(convex_hull(np.array(list(product([-1.0, 1.0], repeat=3)))), [0, 0, 0])
    for down in cube.hull.normals:
        steps = roll_steps(cube, 4.0 * down)
        assert len(steps) == 1
        assert np.allclose(steps[0].down, down, atol=1e-15)
        assert steps[0].contact == "facet"
        assert steps[0].height == pytest.approx(1.0)


@pytest.mark.parametrize("down", [[0, 0, 0], [1, 2], [np.nan, 0, 1], [[0, 0, 1]]])
def test_bad_directions_are_refused(down: ArrayLike) -> None:
    with pytest.raises(InputError, match=r"^down: expected three finite numbers, not all zero, go"):
        roll_steps(body(0), down)
