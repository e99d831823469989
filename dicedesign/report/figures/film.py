"""A throw as a strip of pictures."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.report.charts.paper import Paper
from dicedesign.report.charts.picture_grid import picture_grid, trimmed
from dicedesign.report.figures.figure import FIGURES, Figure
from dicedesign.report.render.filmed_die import MARGIN, FilmedDie, can_be_filmed, filmed
from dicedesign.report.render.tabletop import Tabletop, side_camera

if TYPE_CHECKING:
    from dicedesign.throws.film import Film

__all__ = ["film_figure"]

_MOMENTS: Final = 10

_COLUMNS: Final = 5

_TALL: Final = 3.0
"""Height of a film, over the extent of its die, beyond which all pictures are in one row."""

_PIXELS: Final = 1800
"""Width of all pictures in a row."""


def film_figure(filmed: FilmedDie) -> Paper:
    """The die at up to 10 moments, with the time above each.

    Between any two of them it moves and turns about as much. The camera goes along with it, but not
    up and down.
    """
    film, radius = filmed.film, filmed.radius
    moments = _moments(film)
    tabletop = Tabletop(filmed.triangles, radius, 0.0)
    camera = side_camera(filmed.travel())
    ground = film.positions * [1.0, 1.0, 0.0]
    lowest, highest = filmed.reach(ground, tabletop, camera)
    columns = _MOMENTS if highest - lowest > _TALL * 2.0 * radius else _COLUMNS
    width = _PIXELS // columns
    unit = MARGIN * 2.0 * radius / width
    size = max(math.ceil((highest - lowest) / unit), width)
    middle_height = (lowest + highest) / 2.0 * camera.frame()[1]
    first = (size - width) // 2
    pictures = []
    for frame in moments:
        center = ground[frame] + middle_height
        moved = replace(camera, center=center, half_width=size * unit / 2.0)
        picture = tabletop.picture(filmed.placed(frame), ground[frame], moved, size)
        pictures.append(picture[:, first : first + width])
    rows = [trimmed(pictures[k : k + columns]) for k in range(0, len(pictures), columns)]
    titles = [f"{film.seconds[frame]:.2f} s" for frame in moments]
    return picture_grid([picture for row in rows for picture in row], titles, columns)


def _moments(film: Film) -> list[int]:
    """Frames, the first and the last among them, between which the die moves about as much: on the
    way of its center of mass and, at its radius, about that."""
    from scipy.spatial.transform import Rotation

    turns = Rotation.from_matrix(film.rotations)
    turned = (turns[1:] * turns[:-1].inv()).magnitude() * film.table.size / 2.0
    moved = np.linalg.norm(np.diff(film.positions, axis=0), axis=1)
    way = np.concatenate([[0.0], np.cumsum(moved + turned)])
    wanted = np.linspace(0.0, way[-1], _MOMENTS)
    nearest = np.abs(way[:, None] - wanted).argmin(axis=0)
    nearest[-1] = len(way) - 1
    return [int(frame) for frame in np.unique(nearest)]


FIGURES.register(
    Figure(
        name="film",
        line="a throw at several moments",
        rank=16,
        title="The same throw in pictures",
        caption=(
            "With the time since the die was let go. The camera goes along with the die; the "
            "farther the shadow is below it, the higher it is in the air."
        ),
        wanted=can_be_filmed,
        draw=lambda die: film_figure(filmed(die)).png(),
    )
)
