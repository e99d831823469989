"""A typical throw of a die on its table: as a strip of pictures, and as one that moves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from io import BytesIO
from typing import Final

import numpy as np
from PIL import Image
from scipy.spatial.transform import Rotation

from dicedesign.fabricate.die import FinishedDie
from dicedesign.report.render.pictures import Picture, trim
from dicedesign.report.render.raster import Camera
from dicedesign.report.render.tabletop import Tabletop, side_camera
from dicedesign.report.sheet import Sheet, picture_grid
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.simulation import FRAMES_PER_SECOND, Film, throw_film

MARGIN: Final = 1.2
"""Room around the die in pictures, over its extent."""

MOMENTS: Final = 10

STRIP_PIXELS: Final = 1800
"""Width of all pictures in a row."""

TALL: Final = 3.0
"""Height of a film, over the extent of its die, beyond which all pictures are in one row."""

GIF_PIXELS: Final = 480

MOST_FRAMES: Final = 150

SLOWER: Final = 4


@dataclass(frozen=True, eq=False)
class FilmedDie:
    """A throw, and the solid to draw in it.

    Attributes
    ----------
    film: of the throw.
    points: (n, 3) of the solid, labels cut in or not, in the frame and unit of length of the body
        that was filmed; triangles: (t, 3).
    center_of_mass: (3,) that the body was thrown with, in the same.
    """

    film: Film
    points: Floats
    triangles: Integers
    center_of_mass: Floats

    @property
    def radius(self) -> float:
        """Of the die on its table, in m."""
        return self.film.table.size / 2.0

    def travel(self) -> Floats:
        """The level unit direction (3,) from the throw's start to its end."""
        positions = self.film.positions
        way = (positions[-1] - positions[0]) * [1.0, 1.0, 0.0]
        length = float(np.linalg.norm(way))
        # One that goes nowhere may do so in any direction.
        return way / length if length > self.radius else np.array([1.0, 0.0, 0.0])

    def placed(self, frame: int) -> Floats:
        """Points (n, 3) of the solid in a frame, in m."""
        return self.film.placed(self.points, self.center_of_mass, frame)

    def reach(self, middles: Floats, tabletop: Tabletop, camera: Camera) -> tuple[float, float]:
        """How far below and above the table's middle (3,), or (f, 3) in each frame, a picture of
        the film reaches."""
        heights = (self.film.positions - middles) @ camera.frame()[1]
        margin = MARGIN * tabletop.radius
        return min(float(heights.min()) - margin, -tabletop.drop), float(heights.max()) + margin


@lru_cache(maxsize=1)
def filmed(die: FinishedDie) -> FilmedDie:
    """A typical throw of a die that is thrown as a mesh."""
    assert die.thrown is not None
    thrown = die.thrown.die
    assert thrown.solid.triangles is not None
    film = throw_film(thrown.body, thrown.table)
    center = thrown.poses.center_of_mass
    return FilmedDie(film, thrown.solid.points, thrown.solid.triangles, center)


def film(die: FinishedDie) -> Sheet:
    """A throw of a die at several moments."""
    return film_figure(filmed(die))


def film_figure(filmed: FilmedDie) -> Sheet:
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
    columns = MOMENTS if highest - lowest > TALL * 2.0 * radius else MOMENTS // 2
    width = STRIP_PIXELS // columns
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
    rows = [trim(pictures[k : k + columns]) for k in range(0, len(pictures), columns)]
    titles = [f"{film.seconds[frame]:.2f} s" for frame in moments]
    return picture_grid([picture for row in rows for picture in row], titles, columns)


def _moments(film: Film) -> list[int]:
    """Frames, the first and the last among them, between which the die moves about as much: on the
    way of its center of mass and, at its radius, about that."""
    turns = Rotation.from_matrix(film.rotations)
    turned = (turns[1:] * turns[:-1].inv()).magnitude() * film.table.size / 2.0
    moved = np.linalg.norm(np.diff(film.positions, axis=0), axis=1)
    way = np.concatenate([[0.0], np.cumsum(moved + turned)])
    wanted = np.linspace(0.0, way[-1], MOMENTS)
    nearest = np.abs(way[:, None] - wanted).argmin(axis=0)
    nearest[-1] = len(way) - 1
    return [int(frame) for frame in np.unique(nearest)]


def throw(die: FinishedDie) -> bytes:
    """A throw of a die as a GIF."""
    return moving_picture(filmed(die))


def moving_picture(filmed: FilmedDie) -> bytes:
    """The throw as an animated GIF that begins again and again, four times slower than it was;
    faster where it would have more than 150 frames. The same film gives the same bytes."""
    film, radius = filmed.film, filmed.radius
    camera = side_camera(filmed.travel())
    right, upward, toward = camera.frame()
    along = film.positions @ right
    level = toward * [1.0, 1.0, 0.0] / np.linalg.norm(toward[:2])
    nearness = film.positions @ level
    tabletop = Tabletop(filmed.triangles, radius, float(np.ptp(nearness)) / 2.0)
    middle = (along.min() + along.max()) / 2.0 * right
    middle = middle + (nearness.min() + nearness.max()) / 2.0 * level
    lowest, highest = filmed.reach(middle, tabletop, camera)
    side = max(float(np.ptp(along)) + MARGIN * 2.0 * radius, highest - lowest)
    center = middle + (lowest + highest) / 2.0 * upward
    camera = replace(camera, center=center, half_width=side / 2.0)
    last = len(film.seconds) - 1
    frames = np.linspace(0, last, min(last + 1, MOST_FRAMES)).round().astype(int).tolist()
    pictures = [
        tabletop.picture(filmed.placed(frame), middle, camera, GIF_PIXELS) for frame in frames
    ]
    return _gif(trim(pictures), 1000 * SLOWER // FRAMES_PER_SECOND)


def _gif(pictures: Sequence[Picture], milliseconds: int) -> bytes:
    """Pictures (h, w, 3) of one size as an animated GIF in 64 colours that all of them share, each
    shown so long, the last for two seconds."""
    # Eight pictures tell the colours.
    samples = np.concatenate(pictures[:: math.ceil(len(pictures) / 8)])
    palette = Image.fromarray(samples).quantize(64)
    first, *others = (
        Image.fromarray(picture).quantize(palette=palette, dither=Image.Dither.NONE)
        for picture in pictures
    )
    buffer = BytesIO()
    shown = [*[milliseconds] * len(others), 2000]
    first.save(buffer, "GIF", save_all=True, append_images=others, duration=shown, loop=0)
    return buffer.getvalue()
