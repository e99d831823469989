"""A throw to look at: a strip of pictures, and a picture that moves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from io import BytesIO
from typing import Final

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray
from PIL import Image
from scipy.spatial.transform import Rotation

from dicedesign.report.charts.picture_grid import picture_grid, trimmed
from dicedesign.report.render.raster import Camera
from dicedesign.report.render.tabletop import Tabletop, side_camera
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.simulation.film import FRAMES_PER_SECOND, Film

__all__ = ["film_strip_figure", "moving_picture"]

_MOMENTS: Final = 10

_COLUMNS: Final = 5

_TALL: Final = 3.0

_STRIP_PIXELS: Final = 1800

_MARGIN: Final = 1.2

_MOVING_PIXELS: Final = 480

_MOVING_FRAMES: Final = 150

_COLORS: Final = 64

_SAMPLED_FRAMES: Final = 8

_SLOWER: Final = 4

_MILLISECONDS: Final = 1000 * _SLOWER // FRAMES_PER_SECOND

_LAST_MILLISECONDS: Final = 2000


def film_strip_figure(
    film: Film, vertices: Floats, triangles: Integers, center_of_mass: ArrayLike
) -> Figure:
    """The die at up to 10 moments, with the time above each.

    Between any two of them it moves and turns about as much. The camera goes along with it, but not
    up and down.

    Parameters
    ----------
    film: of the throw.
    vertices: (n, 3) of the die to draw, labels cut in or not, in the frame and unit of length of
        the body that was filmed; triangles: (t, 3).
    center_of_mass: (3,) that the body was thrown with, in the same.
    """
    moments = _moments(film)
    radius = film.table.size / 2.0
    tabletop = Tabletop(triangles, radius, 0.0)
    camera = side_camera(_travel(film))
    ground = film.positions * [1.0, 1.0, 0.0]
    lowest, highest = _reach(film, ground, tabletop, camera)
    columns = _MOMENTS if highest - lowest > _TALL * 2.0 * radius else _COLUMNS
    width = _STRIP_PIXELS // columns
    unit = _MARGIN * 2.0 * radius / width
    size = max(math.ceil((highest - lowest) / unit), width)
    middle_height = (lowest + highest) / 2.0 * camera.frame()[1]
    first = (size - width) // 2
    pictures = []
    for frame in moments:
        center = ground[frame] + middle_height
        moved = replace(camera, center=center, half_width=size * unit / 2.0)
        points = film.placed(vertices, center_of_mass, frame)
        picture = tabletop.picture(points, film.positions[frame], ground[frame], moved, size)
        pictures.append(picture[:, first : first + width])
    rows = [trimmed(pictures[k : k + columns]) for k in range(0, len(pictures), columns)]
    titles = [f"{film.seconds[frame]:.2f} s" for frame in moments]
    return picture_grid([picture for row in rows for picture in row], titles, columns)


def moving_picture(
    film: Film, vertices: Floats, triangles: Integers, center_of_mass: ArrayLike
) -> bytes:
    """The throw as an animated GIF that begins again and again, four times slower than it was;
    faster where it would have more than 150 frames. The same film gives the same bytes.

    Parameters as of `film_strip_figure`.
    """
    camera = side_camera(_travel(film))
    right, _, toward = camera.frame()
    along = film.positions @ right
    level = toward * [1.0, 1.0, 0.0] / np.linalg.norm(toward[:2])
    nearness = film.positions @ level
    radius = film.table.size / 2.0
    tabletop = Tabletop(triangles, radius, float(np.ptp(nearness)) / 2.0)
    middle = _middle(along) * right + _middle(nearness) * level
    lowest, highest = _reach(film, middle, tabletop, camera)
    side = max(float(np.ptp(along)) + _MARGIN * 2.0 * radius, highest - lowest)
    camera = replace(
        camera,
        center=middle + (lowest + highest) / 2.0 * camera.frame()[1],
        half_width=side / 2.0,
    )
    last = len(film.seconds) - 1
    frames = np.linspace(0, last, min(last + 1, _MOVING_FRAMES)).round().astype(int).tolist()
    pictures = [
        tabletop.picture(
            film.placed(vertices, center_of_mass, frame),
            film.positions[frame],
            middle,
            camera,
            _MOVING_PIXELS,
        )
        for frame in frames
    ]
    return _gif(trimmed(pictures))


def _travel(film: Film) -> Floats:
    """The level unit direction (3,) from a throw's start to its end."""
    way = (film.positions[-1] - film.positions[0]) * [1.0, 1.0, 0.0]
    length = float(np.linalg.norm(way))
    # One that goes nowhere may do so in any direction.
    return way / length if length > film.table.size / 2.0 else np.array([1.0, 0.0, 0.0])


def _reach(film: Film, middles: Floats, tabletop: Tabletop, camera: Camera) -> tuple[float, float]:
    """How far below and above the table's middle (3,), or (f, 3) in each frame, a picture of the
    film reaches."""
    heights = (film.positions - middles) @ camera.frame()[1]
    margin = _MARGIN * tabletop.radius
    return min(float(heights.min()) - margin, -tabletop.drop), float(heights.max()) + margin


def _middle(values: Floats) -> float:
    return float(values.min() + values.max()) / 2.0


def _moments(film: Film) -> list[int]:
    """Frames, the first and the last among them, between which the die moves about as much: on the
    way of its center of mass and, at its radius, about that."""
    turns = Rotation.from_matrix(film.rotations)
    turned = (turns[1:] * turns[:-1].inv()).magnitude() * film.table.size / 2.0
    moved = np.linalg.norm(np.diff(film.positions, axis=0), axis=1)
    way = np.concatenate([[0.0], np.cumsum(moved + turned)])
    wanted = np.linspace(0.0, way[-1], _MOMENTS)
    nearest = np.abs(way[:, None] - wanted).argmin(axis=0)
    nearest[-1] = len(way) - 1
    return [int(frame) for frame in np.unique(nearest)]


def _gif(pictures: Sequence[NDArray[np.uint8]]) -> bytes:
    """Pictures (h, w, 3) of one size as an animated GIF in colours that all of them share."""
    samples = np.concatenate(pictures[:: math.ceil(len(pictures) / _SAMPLED_FRAMES)])
    palette = Image.fromarray(samples).quantize(_COLORS)
    frames = [
        Image.fromarray(picture).quantize(palette=palette, dither=Image.Dither.NONE)
        for picture in pictures
    ]
    buffer = BytesIO()
    frames[0].save(
        buffer,
        format="GIF",
        save_all=True,
        append_images=frames[1:],
        duration=[*[_MILLISECONDS] * (len(frames) - 1), _LAST_MILLISECONDS],
        loop=0,
    )
    return buffer.getvalue()
