"""Rolls moment by moment, and dice of the paper's ablation."""

from __future__ import annotations

import numpy as np
import trimesh
from common.drawings import is_whole

from dicedesign.report.body_drawings import (
    MOST_MOMENTS,
    Ablation,
    ablation_figure,
    drop_figure,
)
from dicedesign.report.body_figures import MOST_TRIANGLES, drawn_surface
from dicedesign.report.palette import ACCENT, rgb
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.rest.roll import RollStep, roll_steps

CUBE = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)


def share_like_accent(picture: np.ndarray) -> float:
    """Part of the drawn pixels whose red, green and blue are in the proportions of the accent."""
    pixels = picture.reshape(-1, 3).astype(float)
    pixels = pixels[(pixels < 255).any(axis=1)]
    accent = rgb([ACCENT])[0]
    cosines = pixels @ accent / (np.linalg.norm(pixels, axis=1) * np.linalg.norm(accent))
    return float((cosines > 0.995).mean())


def test_further_rests_are_told_and_shown() -> None:
    poses = rest_poses(CUBE)
    clean = Ablation("all terms", 1e-3, poses, np.arange(6))
    # Opposite facets for one outcome: three of the six rests are further ones.
    opposite = np.abs(poses.normals).argmax(axis=1)
    doubled = Ablation("without coplanar", 0.25, poses, opposite)
    figure = ablation_figure([clean, doubled])
    assert is_whole(figure)
    text = " ".join(figure.texts)
    assert "6 rests for 6 of them" in text
    assert "6 rests for 3 of them, up to 180.0° off" in text
    assert "2.5e-01" in text
    assert text.count("outcomes 90° apart") == 2
    shares = [share_like_accent(picture) for picture in figure.pictures]
    assert len(shares) == 4
    assert max(shares[:2]) < 0.02
    assert sum(shares[2:]) > 0.3


def rolled(mesh: trimesh.Trimesh, down: list[float]) -> tuple[RestPoses, tuple[RollStep, ...]]:
    poses = rest_poses(mesh)
    return poses, roll_steps(poses.morse.equilibria, down)


def test_a_falling_tower_is_shown_from_corner_to_side() -> None:
    mesh = trimesh.creation.box((1.0, 1.2, 4.0))
    poses, steps = rolled(mesh, [0.5, 0.2, 0.6])
    surface = drawn_surface(mesh.vertices, mesh.faces, poses.hull)
    figure = drop_figure(surface, poses, steps[0].down)
    assert is_whole(figure)
    grid, sphere = figure.pictures
    assert grid.shape[0] > 250
    assert sphere.shape[1] > 1000
    ink = (grid[70:] < 200).any(axis=(0, 2))
    starts = np.flatnonzero(ink[1:] & ~ink[:-1])
    # As many bodies side by side as the contact changed.
    assert len(starts) == len(steps)


def test_a_roll_of_many_contacts_is_shown_in_few_pictures() -> None:
    points = np.random.default_rng(1).normal(size=(300, 3))
    mesh = trimesh.convex.convex_hull(points / np.linalg.norm(points, axis=1, keepdims=True))
    mesh.vertices[:, 2] *= 2.0
    mesh = trimesh.convex.convex_hull(mesh.vertices)
    poses, steps = rolled(mesh, [0.1, 0.05, 1.0])
    assert len(steps) > MOST_MOMENTS
    surface = drawn_surface(mesh.vertices, mesh.faces, poses.hull)
    figure = drop_figure(surface, poses, steps[0].down)
    assert figure.pictures[0].shape[1] <= 5 * 324 + 24
    assert figure.png() == drop_figure(surface, poses, steps[0].down).png()


def test_a_body_at_rest_is_one_picture() -> None:
    mesh = trimesh.creation.box((1.0, 1.2, 4.0))
    poses, steps = rolled(mesh, [1.0, 0.0, 0.0])
    assert len(steps) == 1
    surface = drawn_surface(mesh.vertices, mesh.faces, poses.hull)
    assert is_whole(drop_figure(surface, poses, steps[0].down))


def test_what_is_drawn_of_points_and_of_too_many_triangles_is_the_hull() -> None:
    mesh = trimesh.creation.icosphere(subdivisions=2)
    hull = rest_poses(mesh.vertices).hull
    for triangles in (None, np.zeros((MOST_TRIANGLES + 1, 3), dtype=np.int64)):
        assert drawn_surface(mesh.vertices, triangles, hull).points is hull.vertices
    assert drawn_surface(mesh.vertices, mesh.faces, hull).points is mesh.vertices
