"""A body whose center of mass was moved: how it rests, what is inside, and its odds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.report.charts.bar_chart import OddsBars, odds_chart
from dicedesign.report.charts.palette import ACCENT, FAINT, PALE, rgb
from dicedesign.report.charts.paper import Paper, Picture
from dicedesign.report.charts.picture_grid import picture_grid, trimmed
from dicedesign.report.render.raster import Camera
from dicedesign.report.render.renderer import Surface, render
from dicedesign.report.render.shading import MATERIAL
from dicedesign.runtime.arrays import Floats

if TYPE_CHECKING:
    from manifold3d import Manifold

    from dicedesign.balance.balanced import Balanced

__all__ = ["balance_figure"]

_PIXELS: Final = 420

_CHART: Final = 650.0
"""Height of the chart."""

_MOST_POSES: Final = 10
"""In the chart."""

_SIDE: Final = (1.0, -0.7, 0.5)
"""From where a standing body is seen."""

_CENTER: Final = 7.0
"""Radius of the dot at the center of mass, in pixels."""


def balance_figure(found: Balanced) -> Paper:
    """The body in its most probable pose before and now, and cut open through its center of mass,
    below bars of the odds of the poses that the goal is about."""
    views = [
        ("before", _standing(found, before=True)),
        ("now", _standing(found, before=False)),
        ("cut open, and the center of mass", _opened(found)),
    ]
    pictures = trimmed([picture for _, picture in views])
    paper = picture_grid(pictures, [name for name, _ in views], 3, above=_CHART)
    kinds = [
        OddsBars.written("before", FAINT, found.before[:_MOST_POSES]),
        OddsBars.written("now", ACCENT, found.odds[:_MOST_POSES]),
    ]
    chart = odds_chart(
        ["new" if number is None else str(number) for number in found.numbers[:_MOST_POSES]],
        kinds,
        title="odds before and now",
        x_label="pose, numbered by its odds before",
        target=None if found.wanted is None else found.wanted[:_MOST_POSES],
    )
    chart.draw(paper)
    return paper


def _standing(found: Balanced, *, before: bool) -> Picture:
    """The outside in its most probable pose."""
    poses = found.poses_before if before else found.poses
    body = found.made.body
    assert body.triangles is not None
    turn, move = poses.transforms[0][:3, :3], poses.transforms[0][:3, 3]
    points = body.points @ turn.T + move
    camera = _camera(points, np.array(_SIDE), np.array([0.0, 0.0, 1.0]))
    return render(Surface(points, body.triangles), camera, _PIXELS)


def _camera(points: Floats, direction: Floats, up: Floats) -> Camera:
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    radius = 1.03 * float(np.linalg.norm(points - middle, axis=1).max())
    return Camera(direction, up, middle, radius)


def _opened(found: Balanced) -> Picture:
    """The body cut through its centers of mass, before and now, upright if it can be, with a dot at
    each."""
    shift = found.center - found.center_before
    up = np.array([0.0, 0.0, 1.0])
    across = np.linalg.cross(up, shift)
    if np.linalg.norm(across) <= 1e-3 * np.linalg.norm(shift) or not shift.any():
        across = np.array([0.0, -1.0, 0.0])
    across /= np.linalg.norm(across)
    points, triangles, colors = [], [], []
    start = 0
    for part, color in _parts(found):
        half = part.trim_by_plane(tuple(-across), -float(across @ found.center))
        if half.is_empty():
            continue
        mesh = half.to_mesh64()
        corners = np.array(mesh.vert_properties[:, :3], dtype=np.float64)
        points.append(corners)
        triangles.append(np.array(mesh.tri_verts, dtype=np.int64) + start)
        colors.append(np.tile(color, (len(corners), 1)))
        start += len(corners)
    direction = across + np.array([0.0, 0.0, 0.15])
    everything = np.concatenate(points)
    drawn = Surface(
        everything, np.concatenate(triangles), np.concatenate(colors).astype(np.float64), False
    )
    camera = _camera(found.made.body.points, direction, up)
    picture = render(drawn, camera, _PIXELS)
    for center, dot in ((found.center_before, FAINT), (found.center, ACCENT)):
        column, row = camera.pixel_positions(center[None], _PIXELS)[0, :2]
        places = np.indices((_PIXELS, _PIXELS)) + 0.5
        spot = np.hypot(places[0] - row, places[1] - column) <= _CENTER
        picture[spot] = np.rint(255.0 * rgb([dot])[0]).astype(np.uint8)
    return picture


def _parts(found: Balanced) -> list[tuple[Manifold, Floats]]:
    """What the body is of, with the color of each."""
    from dicedesign.geometry.manifold import solid

    made = found.made
    assert made.body.triangles is not None
    body = solid(made.body.points, made.body.triangles)
    plain = MATERIAL.astype(np.float64)
    parts = [(body, plain)]
    if made.sparse is not None:
        assert made.sparse.triangles is not None
        sparse = solid(made.sparse.points, made.sparse.triangles)
        parts = [(body - sparse, plain), (body ^ sparse, rgb([PALE])[0])]
    return parts
