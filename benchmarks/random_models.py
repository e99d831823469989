"""Models made at random that nobody tuned to, as surfaces to be made into dice.

Each is closed, one piece, does not meet itself, has between 1,500 and 4,000 points, at most three
tunnels, and leaves at least a sixth of its hull empty. A name gives the same model each time; last
bits of its coordinates may differ between processors.
"""

from __future__ import annotations

from itertools import islice, product
from typing import Final

import numpy as np

from benchmarks.model_blocks import blocks
from benchmarks.model_kinds import REACH, ROUND_KINDS
from benchmarks.soft_surface import soft_surface
from dicedesign.errors import DegenerateBodyError, InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.body import make_body
from dicedesign.geometry.surfaces.closed_surface import make_surface
from dicedesign.geometry.surfaces.surface import Surface

__all__ = ["MODELS", "MODEL_KINDS", "is_model", "model_names", "random_model"]

SEED: Final = 2024
"""Of all random models."""

MODEL_KINDS: Final = (*ROUND_KINDS, "blocks")
"""Kinds, which take turns."""

POINTS: Final = (1500, 4000)
"""Fewest and most points of a model."""

FILL: Final = (0.02, 5.0 / 6.0)
"""Least and largest part of its hull that a model fills."""

MOST_TUNNELS: Final = 3
"""Of a model."""


def model_names(count: int) -> tuple[str, ...]:
    """The names of the first models."""
    every = product(range(1, count + 1), MODEL_KINDS)
    return tuple(f"{kind}_{number:02d}" for number, kind in islice(every, count))


MODELS: Final = model_names(40)
"""Names of the models of the bench."""


def is_model(name: str) -> bool:
    """Whether a name is that of a model: a kind, and a number of two digits from 1 on, or more."""
    kind, _, digits = name.rpartition("_")
    return kind in MODEL_KINDS and digits == f"{_number(digits):02d}" != "00"


def random_model(name: str) -> Surface:
    """The model of a name such as blobs_03. Raises InputError for one that is no model's."""
    if not is_model(name):
        raise InputError(
            f"model: expected one of {', '.join(MODEL_KINDS)} with a number, got {name!r}; write "
            f"it such as {MODELS[0]}"
        )
    kind, _, digits = name.rpartition("_")
    rng = np.random.default_rng([SEED, MODEL_KINDS.index(kind), int(digits)])
    while True:
        surface = _drawn(kind, rng)
        if surface is not None and _is_good(surface):
            return surface


def _number(digits: str) -> int:
    return int(digits) if digits.isascii() and digits.isdecimal() else 0


def _drawn(kind: str, rng: np.random.Generator) -> Surface | None:
    """A surface of a kind, good or not; None where there is none."""
    count = int(rng.integers(1700, 3600))
    if kind in ROUND_KINDS:
        return soft_surface(ROUND_KINDS[kind](rng), REACH, count)
    try:
        return blocks(rng, count)
    except InputError:
        return None


def _is_good(surface: Surface) -> bool:
    """Whether it is as every model is."""
    points, triangles = surface.points, surface.triangles
    hull = convex_hull(points)
    fill = surface.volume / Surface(hull.vertices, hull.triangles).volume
    tunnels = 1 - (len(points) - len(triangles) // 2) // 2
    if not (POINTS[0] <= len(points) <= POINTS[1] and FILL[0] <= fill <= FILL[1]):
        return False
    if tunnels > MOST_TUNNELS:
        return False
    try:
        make_surface(make_body(points, triangles, "model"))
    except (InputError, DegenerateBodyError):
        return False
    return True
