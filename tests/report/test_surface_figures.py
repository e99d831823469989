"""Views of a surface before and after, in its hull, colored by displacement, and at rest."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh
from common.drawings import color_mask, is_whole
from common.finished import finished_box

from dicedesign.fabricate.die import FinishedDie, assess_file
from dicedesign.geometry.meshes.reading import stl_bytes
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.triangles import Surface
from dicedesign.optimize.targets import Target
from dicedesign.palette import BASINS, repeat, rgb
from dicedesign.report import surface_figures
from dicedesign.report.raster import Camera, three_cameras
from dicedesign.report.renderer import RenderMesh
from dicedesign.report.sheet import Sheet
from dicedesign.report.surface_figures import (
    before_after_figure,
    crossings,
    displacement,
    hull,
    rests,
    rows_of_views,
    surface_of,
)

UP = np.array([0.0, 0.0, 1.0])


def pictures_by_title(paper: Sheet) -> dict[str, np.ndarray]:
    """Pictures of a grid by their titles."""
    return dict(zip(paper.texts, (p for p in paper.pictures if (p < 255).any()), strict=True))


def dumbbell() -> trimesh.Trimesh:
    """Two boxes, one larger, along y."""
    small, large = trimesh.creation.box([0.6, 1.0, 0.6]), trimesh.creation.box([1.2, 0.8, 1.2])
    return trimesh.util.concatenate(
        [small.apply_translation([0, -0.8, 0]), large.apply_translation([0, 0.8, 0])]
    )


@pytest.mark.parametrize("up", [*np.eye(3), *-np.eye(3), np.array([1.0, 2.0, 1.0])])
def test_three_cameras_look_from_around_and_above_and_see_everything(up: np.ndarray) -> None:
    points = np.random.default_rng(0).normal(size=(200, 3)) * [3, 1, 1] + [5, 0, 0]
    cameras = three_cameras(points, up)
    up = up / np.linalg.norm(up)
    directions = np.array([camera.direction for camera in cameras])
    np.testing.assert_allclose(directions @ up, np.sin(np.radians(15.0)))
    flat = directions - np.outer(directions @ up, up)
    cosines = flat @ flat.T / np.cos(np.radians(15.0)) ** 2
    np.testing.assert_allclose(cosines[~np.eye(3, dtype=bool)], -0.5)
    assert len({camera.half_width for camera in cameras}) == 1
    largest = 0.0
    for camera in cameras:
        frame = camera.frame()
        np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
        assert frame[1] @ up > 0.9
        places = camera.pixel_positions(points, 100)[:, :2]
        np.testing.assert_allclose(places.min(axis=0) + places.max(axis=0), 100.0)
        largest = max(largest, float(np.ptp(places, axis=0).max()))
    assert largest == pytest.approx(100.0 / 1.08)


def test_before_and_after_are_drawn_at_one_scale() -> None:
    mesh = dumbbell()
    before = np.asarray(mesh.vertices)
    after = 0.5 * before
    both = RenderMesh(before, mesh.faces), RenderMesh(after, mesh.faces)
    figure = before_after_figure(*both, UP)
    sizes = [
        np.ptp(np.nonzero((picture < 255).any(axis=2)), axis=1) + 1 for picture in figure.pictures
    ]
    for large, small in zip(sizes[:3], sizes[3:], strict=True):
        np.testing.assert_allclose(small, 0.5 * large, atol=1.5)


def reshaped_die(points: Any, triangles: Any, downs: np.ndarray, before: Any = None) -> FinishedDie:
    """Die of a surface, with an outcome for each direction (k, 3) that points down."""
    surface = Surface(np.asarray(points, float), np.asarray(triangles, np.int64))
    start = surface if before is None else Surface(np.asarray(before), surface.triangles)
    target = Target([f"${k}$" for k in range(len(downs))], np.full(len(downs), 1.0 / len(downs)))
    data = stl_bytes(surface)
    die = finished_box(labels=target.labels)
    concave: Any = SimpleNamespace(before=start, after=surface, directions=downs)
    plain = assess_file(data, downs / norms(downs)[:, None], target)
    return replace(die, plain=plain, reshaped=concave, upward=UP)


def clear(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw shells without tints."""
    shell_of = surface_figures.shell_of

    def clear_shell(die: FinishedDie) -> RenderMesh:
        shell = shell_of(die)
        return replace(shell, colors=np.full_like(shell.points, np.nan))

    monkeypatch.setattr(surface_figures, "shell_of", clear_shell)


def share_tinted(tinted: np.ndarray, plain: np.ndarray, color: np.ndarray) -> float:
    """Of the pixels drawn in a picture of clear glass, those that tints bring near a color."""
    drawn = (plain < 255).any(axis=2)
    change = (tinted[drawn].astype(float) - plain[drawn]) / 255.0
    wanted = color - plain[drawn] / 255.0
    share = (change * wanted).sum(-1) / (wanted * wanted).sum(-1)
    aside = np.linalg.norm(change - share[:, None] * wanted, axis=1)
    return float(((share > 0.4) & (aside < 0.05)).mean())


def test_the_overlay_shows_the_hull_and_its_rests(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = dumbbell()
    die = reshaped_die(mesh.vertices, mesh.faces, np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]))
    # One camera at each outcome's facet.
    cameras = [Camera(down, np.array([1.0, 0, 0]), np.zeros(3), 1.5) for down in np.eye(3)[1:]]
    monkeypatch.setattr(surface_figures, "three_cameras", lambda *_: cameras)
    figure = hull(die)
    colors = rgb(BASINS[:2])
    for color in BASINS[:2]:
        assert color_mask(figure, color)[-45:].sum() > 300
    first, second = figure.pictures
    clear(monkeypatch)
    plain = hull(die).pictures
    assert share_tinted(first, plain[0], colors[0]) > 0.9
    assert share_tinted(second, plain[1], colors[1]) > 0.2
    # The hull covers more than the surface alone.
    bare = rows_of_views({"": surface_of(die)}, cameras[1:]).pictures[0]
    assert (second < 255).any(axis=2).sum() > 1.1 * (bare < 255).any(axis=2).sum()
    assert is_whole(figure)


def test_displacement_is_written_in_percent_of_the_diagonal_and_colored() -> None:
    mesh = trimesh.creation.icosphere(subdivisions=3)
    before = np.asarray(mesh.vertices)
    # The first camera looks at the side that moves, the second one from behind.
    after = before + np.where(before[:, 1:2] < 0.0, [[0.0, -0.1, 0.0]], 0.0)
    figure = displacement(reshaped_die(after, mesh.faces, np.eye(3), before))
    largest = 100.0 * 0.1 / np.linalg.norm(np.ptp(before, axis=0))
    mean = largest * (before[:, 1] < 0.0).mean()
    assert f"mean {mean:.2g} %, largest {largest:.2g} %" in " ".join(figure.texts)
    assert is_whole(figure)
    moved, still = (
        picture[len(picture) // 2, picture.shape[1] // 2] for picture in figure.pictures[:2]
    )
    assert still.astype(int).sum() > moved.astype(int).sum() + 200
    assert is_whole(displacement(reshaped_die(before, mesh.faces, np.eye(3))))


@pytest.mark.parametrize("count", [1, 6])
def test_each_outcome_is_shown_lying_and_from_below(
    count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    mesh = dumbbell()
    downs = np.concatenate([np.eye(3)[1:], -np.eye(3), np.eye(3)[:1]])[:count] * 7.0
    die = reshaped_die(mesh.vertices, mesh.faces, downs)
    shown = pictures_by_title(rests(die))
    clear(monkeypatch)
    plain = pictures_by_title(rests(die))
    colors = rgb(repeat(BASINS, count))
    for k, p in enumerate(die.plain.outcomes.probabilities):
        assert f"${k}$: {100.0 * p:.2f} %" in shown
        # The facet that it rests on is seen straight from below.
        below = f"${k}$: underside"
        shares = [share_tinted(shown[below], plain[below], color) for color in colors]
        assert int(np.argmax(shares)) == k
        assert shares[k] > 0.15


def test_intersecting_triangles_are_red() -> None:
    mesh = dumbbell()
    die = reshaped_die(mesh.vertices, mesh.faces, np.eye(3))

    def count_red(pairs: list[list[int]]) -> int:
        quality: Any = SimpleNamespace(intersections=np.reshape(pairs, (-1, 2)).astype(int))
        drawn = np.concatenate(crossings(replace(die, quality=quality)).pictures)
        channels = drawn[..., :3].astype(int)
        return int((channels[..., 0] > channels[..., 1] + 60).sum())

    everything = np.arange(len(mesh.faces)).reshape(-1, 2).tolist()
    assert count_red([]) == 0 < count_red([[0, 1]]) < count_red(everything)
