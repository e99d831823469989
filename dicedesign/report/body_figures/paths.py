"""Paths of rolling bodies over the Gauss map, as in figure 7 of the paper."""

from __future__ import annotations

from typing import Final

import numpy as np

from dicedesign.geometry.sphere import even_directions
from dicedesign.report.body_figures.body_figure import BODY_FIGURES, BodyFigure, Subject
from dicedesign.report.charts.palette import BASINS, rgb
from dicedesign.report.charts.paper import Paper
from dicedesign.report.figures.gauss_map import complex_figure
from dicedesign.rest.poses import RestPoses
from dicedesign.rest.roll import RollStep, roll_steps
from dicedesign.runtime.arrays import Floats

__all__ = ["path_of", "paths_figure"]

STARTS: Final = 80
"""Orientations all over the sphere, where no other is asked for."""

PALE: Final = 0.55
"""White in the colours of basins."""

NOTE: Final = "A path leads from where a body is let go, the dot, to its rest."


def paths_figure(poses: RestPoses, downs: Floats) -> Paper:
    """Paths of a body over its Gauss map as two equal-area discs, let go with directions (n, 3) of
    any length above 0 pointing down. Raises InputError: one of them is 0 or not finite."""
    equilibria = poses.morse.equilibria
    paths = [path_of(roll_steps(equilibria, down)) for down in downs]
    colors = np.rint(255.0 * (PALE + (1.0 - PALE) * rgb(BASINS))).astype(np.uint8)
    return complex_figure(
        poses, lambda directions, rests: colors[rests % len(colors)], NOTE, paths=paths
    )


def path_of(steps: tuple[RollStep, ...]) -> Floats:
    """The directions (n, 3) that point down in steps of a roll."""
    return np.array([step.down for step in steps])


def _draw(subject: Subject) -> Paper:
    alone = subject.down is not None
    downs = np.asarray(subject.down)[None] if alone else even_directions(STARTS)
    return paths_figure(subject.poses, downs)


BODY_FIGURES.register(
    BodyFigure(
        name="paths",
        line="ways of rolling bodies over the Gauss map, from many orientations or one (--down)",
        rank=20,
        draw=_draw,
    )
)
