"""Random convex polyhedra of several kinds, as somebody might make dice of them."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import Final

import numpy as np

from dicedesign.errors import DegenerateBodyError
from dicedesign.geometry.hulls.halfspaces import polyhedron_corners
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.optimize.starts.repulsion import spread_directions
from dicedesign.runtime.arrays import Floats

__all__ = ["KINDS", "random_shape"]

FACETS: Final = (5, 20)
"""Fewest and most half-spaces of a pebble; they need not all make facets."""

CORNERS: Final = (5, 12)
"""Fewest and most points of a hull of points; they need not all be corners."""

MOST_SPREADING: Final = 60
"""Steps in which random directions repel each other are fewer than this."""

FEWEST_STEPS: Final = 5
"""Of them for half-spaces, which may bound nothing where they face the same way."""

UNEVENNESS: Final = (0.02, 0.25)
"""Half the range of the distances of half-spaces around 1."""

POINT_DISTANCES: Final = (0.75, 1.25)
"""Range of the distances of a hull's points."""

WIDTHS: Final = (0.7, 1.0)

SHORT: Final = (0.45, 0.8)

LONG: Final = (1.2, 2.0)
"""Ranges of a stretched pebble's second extent over its first, and of its third if it is flat, and
if it is long."""

PRISM_SIDES: Final = (3, 12)

PYRAMID_SIDES: Final = (3, 10)

HEIGHTS: Final = (0.4, 2.0)
"""Of a prism's half and of a bipyramid's upper pyramid, over the circumscribed radius."""

TAPERS: Final = (0.6, 1.0)
"""Range of the size of a prism's top over its bottom's."""

MOST_TWIST: Final = 0.3
"""Of every other prism's top against its bottom, in radians."""

LOWER_HEIGHTS: Final = (0.5, 1.0)
"""Range of the height of a bipyramid's lower pyramid over its upper one's."""

TURNS: Final = (0.02, 0.06)
"""Angles in radians by which facets of regular shapes are turned: one of the two for a shape."""

SHIFTS: Final = (0.9, 1.1)
"""Range of the factors by which they are shifted."""

BOX_EXTENTS: Final = (0.5, 1.0)

BOX_NOISE: Final = 0.05
"""Standard deviation of the coordinates of a box's corners, over half its largest extent."""

PLATONIC_NOISE: Final = 0.12
"""Of those of a Platonic solid's, over its circumscribed radius."""

GOLDEN: Final = (1.0 + 5.0**0.5) / 2.0

SIGNS: Final = np.array(list(product((-1.0, 1.0), repeat=3)))

PLATONIC: Final = (
    np.array([(1.0, 1.0, 1.0), (1.0, -1.0, -1.0), (-1.0, 1.0, -1.0), (-1.0, -1.0, 1.0)]),
    SIGNS,
    np.concatenate([np.eye(3), -np.eye(3)]),
    np.unique(
        np.concatenate([np.roll(SIGNS * (0.0, 1.0, GOLDEN), turn, axis=1) for turn in range(3)])
        + 0.0,
        axis=0,
    ),
)
"""Corners of tetrahedron, cube, octahedron and icosahedron."""


def random_shape(rng: np.random.Generator) -> tuple[str, Floats]:
    """A kind of `KINDS`, and points (n, 3) in no unit whose hull is a polyhedron of it that has the
    origin inside or near.

    Raises DegenerateBodyError: what was drawn bounds no solid.
    """
    names = tuple(KINDS)
    parts = np.array([part for part, _ in KINDS.values()])
    kind = names[rng.choice(len(names), p=parts / parts.sum())]
    return kind, KINDS[kind][1](rng)


def _pebble(rng: np.random.Generator) -> Floats:
    """Half-spaces facing all ways at distances around 1."""
    facets = _whole(rng, FACETS)
    steps = int(rng.integers(FEWEST_STEPS, MOST_SPREADING))
    unevenness = rng.uniform(*UNEVENNESS)
    distances = rng.uniform(1.0 - unevenness, 1.0 + unevenness, facets)
    return polyhedron_corners(spread_directions(facets, rng, steps), distances)


def _stretched(rng: np.random.Generator) -> Floats:
    third = rng.uniform(*(SHORT if rng.random() < 0.5 else LONG))
    return _pebble(rng) * np.array([1.0, rng.uniform(*WIDTHS), third])


def _hull(rng: np.random.Generator) -> Floats:
    points = _whole(rng, CORNERS)
    directions = spread_directions(points, rng, int(rng.integers(0, MOST_SPREADING)))
    return directions * rng.uniform(*POINT_DISTANCES, (points, 1))


def _prism(rng: np.random.Generator) -> Floats:
    """Over a regular polygon, tapered and perhaps twisted, with its facets moved."""
    sides, height = _whole(rng, PRISM_SIDES), rng.uniform(*HEIGHTS)
    twist = rng.uniform(0.0, MOST_TWIST) if rng.random() < 0.5 else 0.0
    bottom, top = _ring(sides, 0.0), rng.uniform(*TAPERS) * _ring(sides, twist)
    axis = np.array([0.0, 0.0, height])
    return _moved(np.concatenate([bottom - axis, top + axis]), rng)


def _bipyramid(rng: np.random.Generator) -> Floats:
    sides, height = _whole(rng, PYRAMID_SIDES), rng.uniform(*HEIGHTS)
    lower = -height * rng.uniform(*LOWER_HEIGHTS)
    apexes = np.array([(0.0, 0.0, height), (0.0, 0.0, lower)])
    return _moved(np.concatenate([_ring(sides, 0.0), apexes]), rng)


def _box(rng: np.random.Generator) -> Floats:
    """With its corners moved, so that its sides are creased."""
    return SIGNS * rng.uniform(*BOX_EXTENTS, 3) + BOX_NOISE * rng.normal(size=SIGNS.shape)


def _platonic(rng: np.random.Generator) -> Floats:
    """With either its facets or its corners moved."""
    corners = PLATONIC[rng.integers(len(PLATONIC))]
    corners = corners / np.linalg.norm(corners[0])
    if rng.random() < 0.5:
        return _moved(corners, rng)
    return corners + PLATONIC_NOISE * rng.normal(size=corners.shape)


def _ring(sides: int, turn: float) -> Floats:
    """(sides, 3) corners of a regular polygon in the plane z = 0, turned by an angle."""
    angles = 2.0 * np.pi * np.arange(sides) / sides + turn
    return np.stack([np.cos(angles), np.sin(angles), np.zeros(sides)], axis=1)


def _moved(corners: Floats, rng: np.random.Generator) -> Floats:
    """Corners of the hull of points (n, 3) after its facets have been turned and shifted."""
    hull = convex_hull(corners)
    normals = hull.normals + rng.choice(TURNS) * rng.normal(size=hull.normals.shape)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    offsets = hull.heights(np.zeros(3)) * rng.uniform(*SHIFTS, len(normals))
    if offsets.min() <= 0.0:
        raise DegenerateBodyError(
            "random shape: expected the origin inside, got it on the other side of a facet; draw "
            "again"
        )
    return polyhedron_corners(normals, offsets)


def _whole(rng: np.random.Generator, limits: tuple[int, int]) -> int:
    """A random whole number within limits, both included."""
    return int(rng.integers(limits[0], limits[1] + 1))


KINDS: Final[dict[str, tuple[float, Callable[[np.random.Generator], Floats]]]] = {
    "pebble": (0.4, _pebble),
    "stretched pebble": (0.1, _stretched),
    "hull of points": (0.12, _hull),
    "prism": (0.14, _prism),
    "bipyramid": (0.1, _bipyramid),
    "box": (0.06, _box),
    "Platonic solid": (0.08, _platonic),
}
"""Part of the shapes that is of each kind, and what draws one."""
