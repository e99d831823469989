"""The sequence of a roll: as many pictures as moments, all at one scale, and the heights."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from common.drawings import is_whole

from dicedesign.report.body_figures.body_figure import MOST_TRIANGLES, drawn_surface
from dicedesign.report.body_figures.drop import MOST_MOMENTS, drop_figure
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.rest.roll import RollStep, roll_steps


def rolled(mesh: trimesh.Trimesh, down: list[float]) -> tuple[RestPoses, tuple[RollStep, ...]]:
    poses = rest_poses(mesh)
    return poses, roll_steps(poses.morse.equilibria, down)


def test_a_falling_tower_is_shown_from_corner_to_side() -> None:
    mesh = trimesh.creation.box((1.0, 1.2, 4.0))
    poses, steps = rolled(mesh, [0.5, 0.2, 0.6])
    surface = drawn_surface(mesh.vertices, mesh.faces, poses.hull)
    figure = drop_figure(surface, poses, steps)
    assert is_whole(figure)
    grid, sphere = figure.pictures
    assert grid.shape[0] > 250
    assert sphere.shape[1] > 1000
    ink = (grid[70:] < 200).any(axis=(0, 2))
    starts = np.flatnonzero(ink[1:] & ~ink[:-1])
    # As many bodies side by side as the contact changed.
    assert len(starts) == len(steps)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_roll_of_many_contacts_is_shown_in_few_pictures(seed: int) -> None:
    points = np.random.default_rng(seed).normal(size=(300, 3))
    mesh = trimesh.convex.convex_hull(points / np.linalg.norm(points, axis=1, keepdims=True))
    mesh.vertices[:, 2] *= 2.0
    mesh = trimesh.convex.convex_hull(mesh.vertices)
    poses, steps = rolled(mesh, [0.1, 0.05, 1.0])
    assert len(steps) > MOST_MOMENTS
    surface = drawn_surface(mesh.vertices, mesh.faces, poses.hull)
    figure = drop_figure(surface, poses, steps)
    assert figure.pictures[0].shape[1] <= 5 * 324 + 24
    assert figure.png() == drop_figure(surface, poses, steps).png()


def test_a_body_at_rest_is_one_picture() -> None:
    mesh = trimesh.creation.box((1.0, 1.2, 4.0))
    poses, steps = rolled(mesh, [1.0, 0.0, 0.0])
    assert len(steps) == 1
    surface = drawn_surface(mesh.vertices, mesh.faces, poses.hull)
    assert is_whole(drop_figure(surface, poses, steps))


def test_what_is_drawn_of_points_and_of_too_many_triangles_is_the_hull() -> None:
    mesh = trimesh.creation.icosphere(subdivisions=2)
    hull = rest_poses(mesh.vertices).hull
    for triangles in (None, np.zeros((MOST_TRIANGLES + 1, 3), dtype=np.int64)):
        assert drawn_surface(mesh.vertices, triangles, hull).points is hull.vertices
    assert drawn_surface(mesh.vertices, mesh.faces, hull).points is mesh.vertices
