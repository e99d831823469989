"""Views of a surface before and after, in its hull, colored by displacement, and at rest."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from common.drawings import color_mask, is_whole

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.report.palette import BASINS, repeat, rgb
from dicedesign.report.raster import Camera, three_cameras
from dicedesign.report.renderer import RenderMesh, Shell
from dicedesign.report.sheet import Sheet
from dicedesign.report.surface_figures import (
    before_after_figure,
    crossings_figure,
    displacement_figure,
    hull_figure,
    outcome_tints,
    rests_figure,
    rows_of_views,
)

UP = np.array([0.0, 0.0, 1.0])


def titled(paper: Sheet) -> dict[str, np.ndarray]:
    """Pictures of a grid by their titles."""
    return dict(zip(paper.texts, (p for p in paper.pictures if (p < 255).any()), strict=True))


def dumbbell() -> trimesh.Trimesh:
    """Two boxes, one larger, along y."""
    small, large = trimesh.creation.box([0.6, 1.0, 0.6]), trimesh.creation.box([1.2, 0.8, 1.2])
    return trimesh.util.concatenate(
        [small.apply_translation([0, -0.8, 0]), large.apply_translation([0, 0.8, 0])]
    )


def test_three_cameras_look_from_around_and_above_and_see_everything() -> None:
    points = np.random.default_rng(0).normal(size=(200, 3)) * [3, 1, 1] + [5, 0, 0]
    up = np.array([0.0, 2.0, 0.0])
    cameras = three_cameras(points, up)
    directions = np.array([camera.direction for camera in cameras])
    np.testing.assert_allclose(directions[:, 1], np.sin(np.radians(15.0)))
    flat = directions[:, [0, 2]] / np.cos(np.radians(15.0))
    np.testing.assert_allclose((flat @ flat.T)[~np.eye(3, dtype=bool)], -0.5)
    # The first is in front, which is +z, and to the right.
    assert directions[0, 2] > directions[0, 0] > 0
    assert len({camera.half_width for camera in cameras}) == 1
    largest = 0.0
    for camera in cameras:
        places = camera.pixel_positions(points, 100)[:, :2]
        assert (places > 0).all()
        assert (places < 100).all()
        np.testing.assert_allclose(places.min(axis=0) + places.max(axis=0), 100.0)
        largest = max(largest, float(np.ptp(places, axis=0).max()))
    assert largest == pytest.approx(100.0 / 1.08)


def test_any_direction_may_be_upward() -> None:
    for up in (*np.eye(3), *-np.eye(3), np.ones(3)):
        for camera in three_cameras(np.eye(3), up):
            frame = camera.frame()
            np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
            assert frame[1] @ up > 0.9 * np.linalg.norm(up)


def test_before_and_after_are_drawn_at_one_scale() -> None:
    mesh = dumbbell()
    before = np.asarray(mesh.vertices)
    after = 0.5 * before
    both = RenderMesh(before, mesh.faces), RenderMesh(after, mesh.faces)
    figure = before_after_figure(*both, UP)
    assert figure.texts == [f"{name}, view {k}" for name in ("before", "after") for k in (1, 2, 3)]
    sizes = [
        np.ptp(np.nonzero((picture < 255).any(axis=2)), axis=1) + 1 for picture in figure.pictures
    ]
    for large, small in zip(sizes[:3], sizes[3:], strict=True):
        np.testing.assert_allclose(small, 0.5 * large, atol=1.5)
    assert figure.png() == before_after_figure(*both, UP).png()


def hull_of(mesh: trimesh.Trimesh, downs: np.ndarray) -> Shell:
    """The convex hull, its facets toward directions tinted as outcomes 0, 1, ..."""
    hull = convex_hull(mesh.vertices)
    corners = hull.vertices[hull.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    near = normals @ downs.T > 0.999
    return Shell(
        hull.vertices, hull.triangles, outcome_tints(np.where(near.any(1), near.argmax(1), -1))
    )


def clear(shell: Shell) -> Shell:
    return Shell(shell.vertices, shell.triangles, np.full_like(shell.tints, np.nan))


def share_tinted(tinted: np.ndarray, plain: np.ndarray, color: np.ndarray) -> float:
    """Of the pixels drawn in a picture of clear glass, those that tints bring near a color."""
    drawn = (plain < 255).any(axis=2)
    change = (tinted[drawn].astype(float) - plain[drawn]) / 255.0
    wanted = color - plain[drawn] / 255.0
    share = (change * wanted).sum(-1) / (wanted * wanted).sum(-1)
    aside = np.linalg.norm(change - share[:, None] * wanted, axis=1)
    return float(((share > 0.4) & (aside < 0.05)).mean())


def test_the_overlay_shows_the_hull_and_its_rests() -> None:
    mesh = dumbbell()
    downs = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    shell = hull_of(mesh, downs)
    surface = RenderMesh(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    # One camera at each outcome's facet.
    cameras = [Camera(down, np.array([1.0, 0, 0]), np.zeros(3), 1.5) for down in downs]
    figure = hull_figure(surface, shell, ["$heads$", "tails"], cameras)
    assert figure.texts[-2:] == ["$heads$", "tails"]
    colors = rgb(BASINS[:2])
    for color in BASINS[:2]:
        assert color_mask(figure, color)[-45:].sum() > 300
    first, second = figure.pictures
    plain = hull_figure(surface, clear(shell), ["a", "b"], cameras).pictures
    assert share_tinted(first, plain[0], colors[0]) > 0.9
    assert share_tinted(first, plain[0], colors[1]) == 0.0
    assert share_tinted(second, plain[1], colors[1]) > 0.2
    # The hull covers more than the surface alone.
    bare = rows_of_views({"": surface}, cameras[1:]).pictures[0]
    assert (second < 255).any(axis=2).sum() > 1.1 * (bare < 255).any(axis=2).sum()
    assert is_whole(figure)


def test_displacement_is_written_in_percent_of_the_diagonal_and_colored() -> None:
    mesh = trimesh.creation.icosphere(subdivisions=4)
    before = np.asarray(mesh.vertices)
    after = before + np.where(before[:, :1] > 0.0, [[0.1, 0.0, 0.0]], 0.0)
    cameras = [Camera(np.array([x, 0.0, 0.0]), UP, np.zeros(3), 1.3) for x in (1.0, -1.0)]
    figure = displacement_figure(before, after, mesh.faces, cameras)
    diagonal = np.linalg.norm(np.ptp(before, axis=0))
    largest = 100.0 * 0.1 / diagonal
    mean = largest * (before[:, 0] > 0.0).mean()
    expected = f"mean {mean:.2g} %, largest {largest:.2g} % of the diagonal"
    assert f"displacement: {expected}" in figure.texts
    assert "displacement (% of the diagonal)" in figure.texts
    assert is_whole(figure)
    moved, still = (
        picture[len(picture) // 2, picture.shape[1] // 2] for picture in figure.pictures[:2]
    )
    assert still.astype(int).sum() > moved.astype(int).sum() + 200


def test_a_surface_that_was_not_moved_has_a_displacement_figure() -> None:
    mesh = trimesh.creation.icosphere(subdivisions=1)
    points = np.asarray(mesh.vertices)
    figure = displacement_figure(points, points, mesh.faces, three_cameras(points, UP))
    assert "mean 0 %, largest 0 %" in " ".join(figure.texts)
    assert is_whole(figure)


@pytest.mark.parametrize("count", [1, 6])
def test_each_outcome_is_shown_lying_and_from_below(count: int) -> None:
    mesh = dumbbell()
    downs = np.concatenate([np.eye(3), -np.eye(3)])[:count] * 7.0
    shell = hull_of(mesh, downs / 7.0)
    surface = RenderMesh(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    labels = [f"no. {k}" for k in range(count)]
    probabilities = np.arange(1, count + 1) / 100.0
    front = np.array([1.0, 2.0, 3.0])
    figure = rests_figure(surface, shell, downs, labels, probabilities, front)
    shown = titled(figure)
    plain = titled(rests_figure(surface, clear(shell), downs, labels, probabilities, front))
    for k, label in enumerate(labels):
        assert f"{label}: {k + 1}.00 %" in shown
        # The facet that it rests on is seen straight from below.
        below = f"{label}: underside"
        colors = rgb(repeat(BASINS, count))
        shares = [share_tinted(shown[below], plain[below], color) for color in colors]
        assert int(np.argmax(shares)) == k
        assert shares[k] > 0.15
    assert len(figure.pictures) == 2 * count + (4 if count == 6 else 0)
    assert len({picture.shape[1] for picture in shown.values()}) == 1
    assert len({picture.shape[0] for picture in figure.pictures[: min(count, 4)]}) == 1


def test_resting_views_need_matching_arguments() -> None:
    mesh = dumbbell()
    surface = RenderMesh(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    shell = hull_of(mesh, np.eye(3))
    with pytest.raises(InputError, match="got 2 directions, 1 labels and 2 probabilities"):
        rests_figure(surface, shell, np.eye(3)[:2], ["a"], np.ones(2), UP)
    with pytest.raises(InputError, match="at least one"):
        rests_figure(surface, shell, np.zeros((0, 3)), [], np.ones(0), UP)


def test_triangles_that_meet_are_red() -> None:
    mesh = dumbbell()
    points, triangles = np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int64)
    cameras = three_cameras(points, UP)

    def red(pairs: list[list[int]]) -> int:
        found = np.array(pairs, dtype=np.int64).reshape(-1, 2)
        drawn = np.concatenate(crossings_figure(points, triangles, found, cameras).pictures)
        channels = drawn[..., :3].astype(int)
        return int((channels[..., 0] > channels[..., 1] + 60).sum())

    assert red([]) == 0
    few, all_of_them = red([[0, 1]]), red([[2 * k, 2 * k + 1] for k in range(len(triangles) // 2)])
    assert 0 < few < all_of_them
