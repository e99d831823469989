"""A throw as a picture that moves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from io import BytesIO
from typing import Final

import numpy as np

from dicedesign.report.charts.paper import Picture
from dicedesign.report.charts.picture_grid import trimmed
from dicedesign.report.figures.figure import FIGURES, Figure
from dicedesign.report.render.filmed_die import MARGIN, FilmedDie, can_be_filmed, filmed
from dicedesign.report.render.tabletop import Tabletop, side_camera
from dicedesign.runtime.arrays import Floats

__all__ = ["moving_picture"]

_PIXELS: Final = 480

_MOST_FRAMES: Final = 150

_COLORS: Final = 64

_SAMPLED_FRAMES: Final = 8
"""Pictures by which the colours are chosen."""

_SLOWER: Final = 4

_LAST_MILLISECONDS: Final = 2000


def moving_picture(filmed: FilmedDie) -> bytes:
    """The throw as an animated GIF that begins again and again, four times slower than it was;
    faster where it would have more than 150 frames. The same film gives the same bytes."""
    from dicedesign.throws.film import FRAMES_PER_SECOND

    film, radius = filmed.film, filmed.radius
    camera = side_camera(filmed.travel())
    right, _, toward = camera.frame()
    along = film.positions @ right
    level = toward * [1.0, 1.0, 0.0] / np.linalg.norm(toward[:2])
    nearness = film.positions @ level
    tabletop = Tabletop(filmed.triangles, radius, float(np.ptp(nearness)) / 2.0)
    middle = _middle(along) * right + _middle(nearness) * level
    lowest, highest = filmed.reach(middle, tabletop, camera)
    side = max(float(np.ptp(along)) + MARGIN * 2.0 * radius, highest - lowest)
    center = middle + (lowest + highest) / 2.0 * camera.frame()[1]
    camera = replace(camera, center=center, half_width=side / 2.0)
    last = len(film.seconds) - 1
    frames = np.linspace(0, last, min(last + 1, _MOST_FRAMES)).round().astype(int).tolist()
    pictures = [tabletop.picture(filmed.placed(frame), middle, camera, _PIXELS) for frame in frames]
    return _gif(trimmed(pictures), 1000 * _SLOWER // FRAMES_PER_SECOND)


def _middle(values: Floats) -> float:
    return float(values.min() + values.max()) / 2.0


def _gif(pictures: Sequence[Picture], milliseconds: int) -> bytes:
    """Pictures (h, w, 3) of one size as an animated GIF in colours that all of them share, each
    shown so long, the last longer."""
    from PIL import Image

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
        duration=[*[milliseconds] * (len(frames) - 1), _LAST_MILLISECONDS],
        loop=0,
    )
    return buffer.getvalue()


FIGURES.register(
    Figure(
        name="throw",
        line="a throw as a moving picture",
        rank=14,
        title="A throw",
        caption="A simulated throw of typical length, in slow motion.",
        wanted=can_be_filmed,
        draw=lambda die: moving_picture(filmed(die)),
        suffix=".gif",
    )
)
