"""A body that rolls to rest, moment by moment, as in figure 6 of the paper."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from dicedesign.geometry.sphere import angle_between, even_directions
from dicedesign.report.body_figures.body_figure import BODY_FIGURES, BodyFigure, Subject
from dicedesign.report.body_figures.paths import path_of, paths_figure
from dicedesign.report.charts.paper import Paper
from dicedesign.report.charts.picture_grid import picture_grid, trimmed
from dicedesign.report.render.cameras import framed
from dicedesign.report.render.raster import Camera
from dicedesign.report.render.renderer import Surface, render
from dicedesign.report.render.shadow import shadowed_table
from dicedesign.rest.poses import RestPoses
from dicedesign.rest.roll import RollStep, roll_steps
from dicedesign.runtime.arrays import Floats

__all__ = ["drop_figure"]

MOST_MOMENTS: Final = 10

COLUMNS: Final = 5

PIXELS: Final = 300

RISE: Final = np.radians(18.0)

TURN: Final = np.radians(25.0)

STARTS: Final = 300
"""Orientations among which the one with the most changes of contact is taken, where none is asked
for."""

GAP: Final = 10.0


def drop_figure(surface: Surface, poses: RestPoses, steps: Sequence[RollStep]) -> Paper:
    """A body in the moments of a roll in which its contact with the table changes, all from one
    side, and the path of the direction that points down over the Gauss map.

    surface: the body; poses: its rests; steps: of the roll, at least one, each a change of contact.
    Of more than ten steps those are shown that are most evenly spread over the way.
    """
    shown = _moments(steps)
    up = np.array([0.0, 0.0, 1.0])
    placed = [
        surface.points @ steps[k].transform[:3, :3].T + steps[k].transform[:3, 3] for k in shown
    ]
    middles = [
        poses.center_of_mass @ step.transform[:3, :3].T + step.transform[:3, 3]
        for step in (steps[0], steps[-1])
    ]
    level = _level_view(middles[1] - middles[0])
    camera = Camera(np.cos(RISE) * level + np.sin(RISE) * up, up, np.zeros(3), 1.0)
    seen = [np.concatenate([points, points * [1.0, 1.0, 0.0]]) for points in placed]
    cameras = framed([camera] * len(placed), seen)
    reach = float(poses.hull.diameter) / 2.0
    pictures = []
    for points, own in zip(placed, cameras, strict=True):
        heights = points[:, 2].clip(0.0)
        table = shadowed_table(points, surface.triangles, heights, up, own, PIXELS, reach)
        body = Surface(points, surface.triangles, smooth=surface.smooth)
        pictures.append(render(body, own, PIXELS, backdrop=table))
    titles = [f"{k + 1}: {steps[k].contact}, {steps[k].height:.4g} high" for k in shown]
    titles[-1] = f"{shown[-1] + 1}: at rest, {steps[-1].height:.4g} high"
    columns = min(COLUMNS, len(pictures))
    lacking = -len(pictures) % columns
    pictures += [np.full_like(pictures[0], 255)] * lacking
    titles += [""] * lacking
    rows = [trimmed(pictures[k : k + columns]) for k in range(0, len(pictures), columns)]
    sphere = paths_figure(poses, path_of(tuple(steps))[:1]).pixels()
    grid = picture_grid([p for row in rows for p in row], titles, columns).pixels()
    paper = Paper(max(grid.shape[1], sphere.shape[1]), grid.shape[0] + GAP + sphere.shape[0])
    paper.picture(grid, (paper.width - grid.shape[1]) / 2.0, 0.0)
    paper.picture(sphere, (paper.width - sphere.shape[1]) / 2.0, grid.shape[0] + GAP)
    return paper


def _moments(steps: Sequence[RollStep]) -> list[int]:
    """At most `MOST_MOMENTS` of the steps, the first and the last among them."""
    downs = path_of(tuple(steps))
    turned = np.concatenate([[0.0], angle_between(downs[:-1], downs[1:]).cumsum()])
    wanted = np.linspace(0.0, turned[-1], MOST_MOMENTS)
    nearest = np.abs(turned[:, None] - wanted).argmin(axis=0)
    return np.unique(nearest).tolist()


def _level_view(way: Floats) -> Floats:
    """The level direction (3,) to a viewer who sees the way of a roll run to the right, turned a
    little; any where it goes nowhere."""
    flat = np.array([way[0], way[1], 0.0])
    length = float(np.linalg.norm(flat))
    right = flat / length if length > 0.0 else np.array([1.0, 0.0, 0.0])
    toward = np.cross(right, [0.0, 0.0, 1.0])
    return np.asarray(np.cos(TURN) * toward + np.sin(TURN) * right)


def _draw(subject: Subject) -> Paper:
    equilibria = subject.poses.morse.equilibria
    if subject.down is not None:
        steps = roll_steps(equilibria, subject.down)
    else:
        rolls = (roll_steps(equilibria, down) for down in even_directions(STARTS))
        steps = max(rolls, key=len)
    return drop_figure(subject.surface, subject.poses, steps)


BODY_FIGURES.register(
    BodyFigure(
        name="drop",
        line="a body that rolls to rest, moment by moment (from --down), and its path",
        rank=40,
        draw=_draw,
    )
)
