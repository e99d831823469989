"""Figures of a roll moment by moment, and of the paper's ablation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from dicedesign.geometry.sphere import angle_between, even_directions
from dicedesign.report.gauss_map import path_of, paths_figure
from dicedesign.report.palette import ACCENT, BASINS, rgb
from dicedesign.report.render.pictures import trim
from dicedesign.report.render.raster import Camera, camera_on, framed
from dicedesign.report.render.renderer import Surface, render
from dicedesign.report.render.shading import MATERIAL
from dicedesign.report.render.tabletop import render_on_table, with_shadow
from dicedesign.report.sheet import NOTE, Sheet, picture_grid
from dicedesign.report.solid_figures import color_triangles
from dicedesign.rest.poses import RestPoses
from dicedesign.rest.roll import RollStep, roll_steps
from dicedesign.runtime.arrays import Floats, Integers

MOST_MOMENTS: Final = 10

UP: Final = np.array([0.0, 0.0, 1.0])

SIDE: Final = np.array([1.0, -0.7, 0.5])
"""From where bodies are seen."""


@dataclass(frozen=True, eq=False)
class Ablation:
    """A die that was designed without some terms of the energy.

    Attributes
    ----------
    name: what was left out.
    error: largest |p - q| of the outcomes.
    poses: its rests; outcomes: (k,) which outcome each counts for.
    """

    name: str
    error: float
    poses: RestPoses
    outcomes: Integers


def drop_figure(
    surface: Surface, poses: RestPoses, down: Sequence[float] | Floats | None = None
) -> Sheet:
    """A body in the moments of a roll in which its contact with the table changes, all from one
    side, and the path of the direction that points down over the Gauss map.

    surface: the body; poses: its rests; down: (3,) direction of it that points down at first, or
    None for the one of 300 with the most changes of contact. Of more than ten moments those are
    shown that are most evenly spread over the way. Source: figure 6 of the paper.
    """
    equilibria = poses.morse.equilibria
    starts = even_directions(300) if down is None else [np.asarray(down)]
    steps = max((roll_steps(equilibria, start) for start in starts), key=len)
    shown = _moments(steps)
    placed = [
        surface.points @ steps[k].transform[:3, :3].T + steps[k].transform[:3, 3] for k in shown
    ]
    middles = [
        poses.center_of_mass @ step.transform[:3, :3].T + step.transform[:3, 3]
        for step in (steps[0], steps[-1])
    ]
    rise = np.radians(18.0)
    level = _level_view(middles[1] - middles[0])
    camera = Camera(np.cos(rise) * level + np.sin(rise) * UP, UP, np.zeros(3), 1.0)
    cameras = framed([camera] * len(placed), [with_shadow(points, UP) for points in placed])
    reach = float(poses.hull.diameter) / 2.0
    pictures = [
        render_on_table(replace(surface, points=points), UP, own, 300, reach)
        for points, own in zip(placed, cameras, strict=True)
    ]
    titles = [f"{k + 1}: {steps[k].contact}, {steps[k].height:.4g} high" for k in shown]
    titles[-1] = f"{shown[-1] + 1}: at rest, {steps[-1].height:.4g} high"
    columns = min(5, len(pictures))
    lacking = -len(pictures) % columns
    pictures += [np.full_like(pictures[0], 255)] * lacking
    titles += [""] * lacking
    rows = [trim(pictures[k : k + columns]) for k in range(0, len(pictures), columns)]
    sphere = paths_figure(poses, path_of(steps)[:1]).pixels()
    grid = picture_grid([p for row in rows for p in row], titles, columns).pixels()
    sheet = Sheet(max(grid.shape[1], sphere.shape[1]), len(grid) + 10 + len(sphere))
    sheet.picture(grid, (sheet.width - grid.shape[1]) / 2.0, 0.0)
    sheet.picture(sphere, (sheet.width - sphere.shape[1]) / 2.0, len(grid) + 10.0)
    return sheet


def _moments(steps: Sequence[RollStep]) -> list[int]:
    """At most `MOST_MOMENTS` of the steps, the first and the last among them."""
    downs = path_of(steps)
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
    turn = np.radians(25.0)
    return np.asarray(np.cos(turn) * np.cross(right, UP) + np.sin(turn) * right)


def ablation_figure(ablations: Sequence[Ablation]) -> Sheet:
    """Dice, each from two sides, with what was left out in their design, how far their
    probabilities are off, and how far rests are from the most probable one of their outcome.
    Source: figure 9 of the paper."""
    columns, side, gap, title_room = 2, 360, 24.0, 64.0
    rows = -(-len(ablations) // columns)
    wide, tall = 2.0 * side + gap, side + title_room + gap
    sheet = Sheet(columns * wide + gap, rows * tall + 40.0)
    for number, ablation in enumerate(ablations):
        row, column = divmod(number, columns)
        left, top = gap + column * wide, gap + row * tall
        # The most probable rest of the outcome of each rest; these come the most probable first.
        _, first, which = np.unique(ablation.outcomes, return_index=True, return_inverse=True)
        main = first[which]
        surface = _paint_rests(ablation, np.unique(main))
        for k, direction in enumerate((SIDE, -SIDE)):
            camera = camera_on(surface.points, direction, (0.0, 0.0, 1.0))
            sheet.picture(render(surface, camera, side), left + k * side, top + title_room)
        sheet.text(ablation.name, (left + side, top + 12.0))
        sheet.text(_describe(ablation, main), (left + side, top + 42.0), size=NOTE)
    note = (
        "Each die from two opposite sides. In pale colours the facets of the outcomes, in a strong "
        "one further rests that count for one of them."
    )
    sheet.text(note, (sheet.width / 2.0, sheet.height - 22.0), size=NOTE)
    return sheet


def _describe(ablation: Ablation, main: Integers) -> str:
    """Error, angles and counts; main: (k,) the most probable rest of each rest's outcome."""
    normals, mains = ablation.poses.normals, np.unique(main)
    one, other = np.triu_indices(len(mains), 1)
    apart = angle_between(normals[mains[one]], normals[mains[other]]).min(initial=np.pi)
    told = (
        f"|p − q| up to {ablation.error:.1e}, outcomes {np.degrees(apart):.0f}° apart, "
        f"{len(normals)} rests for {len(mains)} of them"
    )
    stray = np.degrees(angle_between(normals, normals[main]).max())
    return f"{told}, up to {stray:.1f}° off" if len(normals) > len(mains) else told


def _paint_rests(ablation: Ablation, main: Integers) -> Surface:
    """The hull with its rests in colour; main: (o,) the most probable of each outcome."""
    hull, poses = ablation.poses.hull, ablation.poses
    colors = np.tile(np.asarray(MATERIAL, dtype=np.float64), (len(hull.normals), 1))
    pale = 0.35 + 0.65 * rgb(BASINS)
    colors[poses.facets] = rgb([ACCENT])[0]
    colors[poses.facets[main]] = pale[ablation.outcomes[main] % len(pale)]
    of_triangle = np.repeat(np.arange(len(hull.normals)), np.diff(hull.facet_start) - 2)
    return color_triangles(hull.vertices, hull.triangles, colors[of_triangle])
