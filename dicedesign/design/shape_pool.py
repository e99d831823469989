"""Starting shapes in turns: polyhedra are drawn into a pool, and the nearest in odds go first."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dicedesign.design.starts import Start

__all__ = ["NEARNESS", "REPULSION_STEPS", "STRETCH", "UNEVENNESS", "nearest_first"]

Floats = NDArray[np.float64]

EVEN_SHAPES: Final = 2
"""Shapes of evenly spread facets that are proposed first, where even odds are not far from the
target."""

FAR: Final = 0.3
"""Distance in odds, the root of their summed squared differences, from which on a polyhedron is
proposed only where there is nothing else."""

DRAWN: Final = 30
"""Most polyhedra drawn in each turn."""

DRAWN_OUTCOMES: Final = 2000
"""Most outcomes of all of them together, unless it is one polyhedron."""

PROPOSED: Final = 2
"""How many of all that were drawn are proposed in each turn."""

REPULSION_STEPS: Final = 10
"""Steps that keep random facets from lying too close to each other."""

UNEVENNESS: Final = 0.6
"""Largest standard deviation of the logarithms of facet distances."""

NEARNESS: Final = 1.5
"""A facet in favour is nearer than others by a factor of up to the exponential of this."""

STRETCH: Final = (-1.5, 1.0)
"""Range of the logarithm by which a polyhedron is stretched along one axis."""


def _nothing() -> None:
    """Nothing else to propose."""


def nearest_first(
    target: Floats,
    even: Callable[[int], Start | None],
    draw: Callable[[], tuple[Start, Floats] | None],
    another: Callable[[], Start | None] = _nothing,
) -> Iterator[Start | None]:
    """Starting shapes without end, and None where a turn found nothing, so that whoever asks can
    stop.

    First come even shapes, each a turn of its own, if even odds are near the target. Each later
    turn draws polyhedra into a pool. It proposes the nearest in odds of all in the pool, if they
    are near, then another shape, and the nearest of those far away if there was neither.

    target: (k,) wanted probabilities; even: makes the shape of a number from 0; draw: makes a
    random polyhedron and its odds (k,), or None where what was drawn does not suit; another: makes
    a shape that is proposed in each turn, if not None.
    """
    outcomes = len(target)
    if np.linalg.norm(target - 1.0 / outcomes) < FAR:
        for number in range(EVEN_SHAPES):
            yield even(number)
    pool: list[tuple[float, Start]] = []
    while True:
        for _ in range(max(min(DRAWN, DRAWN_OUTCOMES // outcomes), 1)):
            drawn = draw()
            if drawn is not None:
                start, odds = drawn
                pool.append((float(np.linalg.norm(odds - target)), start))
        pool.sort(key=lambda entry: -entry[0])
        near = sum(distance < FAR for distance, _ in pool[-PROPOSED:])
        for _ in range(near):
            yield pool.pop()[1]
        other = another()
        if other is not None:
            yield other
        elif near == 0:
            yield pool.pop()[1] if pool else None
