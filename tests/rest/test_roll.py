"""Single rolls: rigid, without slip, downhill, and ending where the complex says."""

from __future__ import annotations

import math
from itertools import pairwise, product
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import ArrayLike

from dicedesign.errors import InputError, OutsideHullError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.body import make_body
from dicedesign.geometry.sphere import angle_between
from dicedesign.rest.equilibria import Equilibria, classify
from dicedesign.rest.poses import rest_poses
from dicedesign.rest.roll import RollStep, roll, roll_steps
from dicedesign.rest.tracing import destined_facets


def body(seed: int) -> Equilibria:
    rng = np.random.default_rng(seed)
    hull = convex_hull(rng.normal(size=(5 + 3 * seed, 3)) * [1.0, 0.7, 0.4] + [3.0, 2.0, 1.0])
    somewhere = rng.dirichlet(np.ones(len(hull.vertices))) @ hull.vertices
    return classify(hull, 0.5 * (hull.centroid + somewhere))


def rolls(seed: int, max_angle: float | None) -> list[tuple[Equilibria, tuple[RollStep, ...]]]:
    equilibria = body(seed)
    downs = np.random.default_rng(seed).normal(size=(12, 3))
    return [(equilibria, roll_steps(equilibria, down, max_angle)) for down in downs]


def placed(step: RollStep, points: np.ndarray) -> np.ndarray:
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
            heights = placed(step, equilibria.hull.vertices)[:, 2]
            assert heights.min() > -1e-12
            np.testing.assert_allclose(heights[list(step.vertices)], 0.0, atol=1e-12)
            center = placed(step, equilibria.center_of_mass)
            assert step.height == pytest.approx(center[2], abs=1e-12)
            names = {1: "vertex", 2: "edge"}
            assert step.contact == names.get(len(step.vertices), "facet")
        np.testing.assert_allclose(placed(steps[0], equilibria.center_of_mass)[:2], 0.0, atol=1e-12)


def test_turns_are_cut_into_as_few_pieces_as_do() -> None:
    for (_, whole), (_, cut) in zip(rolls(2, None), rolls(2, 0.3), strict=True):
        turns = [angle_between(before.down, after.down) for before, after in pairwise(whole)]
        assert len(cut) == 1 + sum(max(1, math.ceil(turn / 0.3)) for turn in turns)
        # Whole turns go from one contact to the next.
        contacts = [step.vertices for step in whole]
        assert all(before != after for before, after in pairwise(contacts))


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("max_angle", [None, 0.05])
def test_it_rolls_downhill_without_slip(seed: int, max_angle: float | None) -> None:
    for equilibria, steps in rolls(seed, max_angle):
        heights = np.array([step.height for step in steps])
        assert (np.diff(heights) < 0).all()
        for before, after in pairwise(steps):
            pivots = sorted(set(before.vertices) & set(after.vertices))
            assert pivots
            corners = equilibria.hull.vertices[pivots]
            np.testing.assert_allclose(
                placed(after, corners), placed(before, corners), rtol=0, atol=1e-12
            )


@pytest.mark.parametrize("seed", range(8))
def test_no_step_turns_farther_than_asked(seed: int) -> None:
    for max_angle in (0.3, 0.05):
        for _, steps in rolls(seed, max_angle):
            for before, after in pairwise(steps):
                turn = after.transform[:3, :3] @ before.transform[:3, :3].T
                angle = np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1))
                assert angle <= max_angle + 1e-7


@pytest.mark.parametrize("seed", range(8))
def test_a_split_roll_passes_the_same_contacts(seed: int) -> None:
    for (_, whole), (_, split) in zip(rolls(seed, None), rolls(seed, 0.1), strict=True):
        np.testing.assert_allclose(split[-1].transform, whole[-1].transform, rtol=0, atol=1e-12)
        downs = np.array([step.down for step in split])
        for step in whole:
            assert np.abs(downs - step.down).max(axis=1).min() == 0.0


@pytest.mark.parametrize("seed", range(8))
def test_rolls_end_where_facets_are_destined(seed: int) -> None:
    equilibria = body(seed)
    hull = equilibria.hull
    facets = np.arange(len(hull.normals))
    destined = destined_facets(equilibria, facets)
    assert equilibria.stable[destined].all()
    np.testing.assert_array_equal(destined[equilibria.stable], facets[equilibria.stable])
    for facet in facets:
        last = roll_steps(equilibria, hull.normals[facet])[-1]
        np.testing.assert_array_equal(last.down, hull.normals[destined[facet]])
        assert last.contact == "facet"


def test_rolls_from_everywhere_count_up_to_the_probabilities() -> None:
    for seed in range(3):
        equilibria = body(seed)
        rests = rest_poses(equilibria.hull.vertices, equilibria.center_of_mass)
        count = 600
        downs = np.random.default_rng(seed).normal(size=(count, 3))
        ends = np.array([roll_steps(equilibria, down)[-1].down for down in downs])
        found = np.bincount(np.argmax(ends @ rests.normals.T, axis=1)) / count
        p = rests.probabilities
        assert (np.abs(found - p) <= 5 * np.sqrt(p * (1 - p) / count)).all()


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


@pytest.mark.parametrize("angle", [0.0, -1.0, 1e-9, float("nan")])
def test_bad_angles_are_refused(angle: float) -> None:
    with pytest.raises(InputError, match=r"^max angle: expected at least 0.0001 radians, got "):
        roll_steps(body(0), [0, 0, 1], angle)


def test_a_body_let_go_on_a_balancing_corner_rolls_all_the_same() -> None:
    cube = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    for points in (cube, np.random.default_rng(3).normal(size=(20, 3))):
        equilibria = rest_poses(points).morse.equilibria
        for peak in equilibria.radii[equilibria.maximum]:
            steps = roll_steps(equilibria, peak, max_angle=0.1)
            assert np.isfinite([step.height for step in steps]).all()
            assert steps[-1].contact == "facet"


@pytest.mark.parametrize("size", [1e-300, 1e-5, 1e300])
def test_the_length_of_a_direction_does_not_matter(size: float) -> None:
    expected = roll_steps(body(0), [0.3, -0.2, 1.0])
    found = roll_steps(body(0), [0.3 * size, -0.2 * size, size])
    assert [step.contact for step in found] == [step.contact for step in expected]
    np.testing.assert_allclose(found[-1].transform, expected[-1].transform, atol=1e-12)


def test_a_body_rolls_as_it_comes() -> None:
    """Points, a mesh or a body, with the center of mass and the facets of its rests."""
    points = np.random.default_rng(4).normal(size=(14, 3))
    down = [0.3, -0.2, 1.0]
    expected = roll_steps(rest_poses(points).morse.equilibria, down, 0.2)
    hull = convex_hull(points)
    triangles = hull.source[hull.triangles]
    for given in (
        points,
        points.tolist(),
        make_body(points, triangles),
        SimpleNamespace(vertices=points, faces=triangles),
    ):
        steps = roll(given, down, 0.2)
        assert [step.vertices for step in steps] == [step.vertices for step in expected]
        np.testing.assert_allclose(steps[-1].transform, expected[-1].transform, atol=1e-12)
    aside = 0.8 * hull.centroid + 0.2 * hull.vertices[0]
    assert roll(points, down, center_of_mass=aside)[-1].down in rest_poses(points, aside).normals
    with pytest.raises(OutsideHullError, match="center of mass"):
        roll(points, down, center_of_mass=[9.0, 0.0, 0.0])
