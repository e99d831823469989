"""Closed surfaces that the package builds itself, to be made into dice.

Each has between 1,000 and 3,500 points, evenly spread, is one piece, does not meet itself, and is 2
to 3 units of length large.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from dicedesign.concave.shapes.animals import dragon, duck, kitten
from dicedesign.concave.shapes.knot import knot
from dicedesign.errors import InputError
from dicedesign.geometry.surfaces.surface import Surface

__all__ = ["SHAPES", "shape"]

SHAPES: Final[dict[str, Callable[[], Surface]]] = {
    "dragon": dragon,
    "duck": duck,
    "kitten": kitten,
    "knot": knot,
}
"""Builders by name."""


def shape(name: str) -> Surface:
    """The surface of a name in `SHAPES`, built anew, the same each time.

    Raises InputError for another name.
    """
    if name not in SHAPES:
        raise InputError(f"shape: expected one of {', '.join(SHAPES)}, got {name!r}; use one")
    return SHAPES[name]()
