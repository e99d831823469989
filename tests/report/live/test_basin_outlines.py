"""Outlines of basins hold the directions that roll to their rest, and no others."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.path import Path

from dicedesign.report.figures.gauss_map import basin_of_directions, placed_discs
from dicedesign.report.live.basin_outlines import basin_outlines
from dicedesign.rest.poses import RestPoses, rest_poses

CUBE = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
BODIES = ("cube", "box", "random", "needle", "tumbler")


def random_directions(count: int, seed: int) -> np.ndarray:
    points = np.random.default_rng(seed).normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def body(name: str) -> RestPoses:
    if name == "cube":
        return rest_poses(CUBE)
    if name == "box":
        return rest_poses(CUBE * [1.0, 1.7, 2.3])
    if name == "needle":
        return rest_poses(random_directions(60, 8) * [1.0, 1.0, 9.0])
    if name == "tumbler":
        dome = random_directions(400, 3)
        foot = [[0.2, 0, -1.05], [-0.2, 0.2, -1.05], [-0.2, -0.2, -1.05]]
        points = np.concatenate([dome, [[0, 0, 1.8]], foot])
        return rest_poses(points, center_of_mass=[0.0, 0.0, -0.9])
    return rest_poses(random_directions(300, 5) * [1.0, 1.3, 0.8])


def shoelace(ring: np.ndarray) -> float:
    """Area of a polygon whose second coordinate runs downward."""
    x, y = ring.T
    return -0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


@pytest.mark.parametrize("name", BODIES)
def test_areas_are_the_odds(name: str) -> None:
    poses = body(name)
    one, _ = placed_discs(poses)
    whole = 2.0 * np.pi * one.radius**2
    areas = [sum(map(shoelace, rings)) / whole for rings in basin_outlines(poses)]
    np.testing.assert_allclose(areas, poses.probabilities, atol=2e-3)


@pytest.mark.parametrize("name", BODIES)
def test_each_direction_is_in_the_outline_of_its_rest_alone(name: str) -> None:
    poses = body(name)
    directions = random_directions(1500, 4)
    rests = basin_of_directions(poses, directions)
    discs = placed_discs(poses)
    here = [directions @ placed.disc.axis >= 0.0 for placed in discs]
    points = np.where(
        here[0][:, None],
        discs[0].on_paper(discs[0].disc.project(directions)),
        discs[1].on_paper(discs[1].disc.project(directions)),
    )
    found = np.zeros((len(directions), len(poses.facets)))
    for rest, rings in enumerate(basin_outlines(poses)):
        for ring in rings:
            turn = 1.0 if shoelace(ring) > 0.0 else -1.0
            found[:, rest] += turn * Path(ring, closed=False).contains_points(points)
    # Pieces of borders are straight on paper, so that a few directions are on the wrong side.
    wrong = (found != np.eye(len(poses.facets))[rests]).any(axis=1)
    assert wrong.mean() < 0.01
