"""Places for texts beside their points, without overlaps where there is room."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dicedesign.runtime.arrays import Floats

__all__ = ["place_texts"]

_LETTER_WIDTH: Final = 0.62

_LINE_HEIGHT: Final = 1.25

_SIDES: Final = 16

_RINGS: Final = (0.55, 1.0, 1.6, 2.3)

_PEN: Final = 0.3

_SAMPLES: Final = np.array([(x, y) for x in (-0.9, -0.3, 0.3, 0.9) for y in (-0.8, 0.0, 0.8)])


def place_texts(
    anchors: Floats,
    texts: Sequence[str],
    regions: Sequence[NDArray[np.bool_]],
    obstacles: Floats,
    font_size: float,
) -> Floats:
    """Centres (k, 2) for texts beside their anchors.

    Each text in turn takes the place nearest to its anchor where it covers the fewest of the
    obstacles and of the texts placed before; a text prefers to stay above its anchor, inside of its
    region, and on the unit disc.

    Parameters
    ----------
    anchors: (k, 2) points on paper.
    texts: k texts of one or more lines.
    regions: k images (size, size) of the square [-1, 1]^2, lowest row first, True inside.
    obstacles: (m, 2) points to keep visible.
    font_size: in the unit of the points.
    """
    turns = 2.0 * np.pi * np.arange(_SIDES) / _SIDES
    around = np.stack([np.sin(turns), np.cos(turns)], axis=1)
    placed: list[tuple[Floats, Floats]] = []
    for anchor, text, region in zip(anchors, texts, regions, strict=True):
        lines = text.splitlines()
        half = (
            0.5
            * font_size
            * np.array([_LETTER_WIDTH * max(map(len, lines)), _LINE_HEIGHT * len(lines)])
        )
        reach = np.concatenate([around * (half + gap * font_size) for gap in _RINGS])
        centers = anchor + reach
        cost = np.linalg.norm(reach, axis=1) + 0.2 * font_size * np.tile(turns > 0, len(_RINGS))
        hidden = np.abs(centers[:, None] - obstacles) < half + _PEN * font_size
        cost += font_size * 3.0 * hidden.all(-1).sum(1)
        samples = centers[:, None] + half * _SAMPLES
        column, row = ((samples + 1.0) / 2.0 * len(region)).astype(int).clip(0, len(region) - 1).T
        cost += font_size * 2.5 * (~region[row, column]).mean(axis=0)
        for center, other in placed:
            overlap = (half + other - np.abs(centers - center)).clip(0.0)
            cost += 30.0 * overlap.prod(1) / font_size + font_size * (overlap > 0).all(1)
        cost += 10.0 * (np.linalg.norm(np.abs(centers) + half, axis=1) - 1.0).clip(0.0)
        placed.append((centers[int(np.argmin(cost))], half))
    return np.array([center for center, _ in placed]).reshape(-1, 2)
