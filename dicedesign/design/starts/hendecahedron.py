"""Two bodies of eleven facets."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dicedesign.design.starts.start import Start, normalised_start
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.halfspaces import polyhedron_corners

__all__ = ["HENDECAHEDRA", "hendecahedron"]


def hendecahedron(kind: str) -> Start:
    """An 11-faced polyhedron for the total of two dice; `kind` is a key of `HENDECAHEDRA`.

    Raises InputError for another kind.
    """
    if kind not in HENDECAHEDRA:
        raise InputError(
            f"start.hendecahedron: expected one of {', '.join(HENDECAHEDRA)}, got {kind!r}"
        )
    return HENDECAHEDRA[kind]()


def _bisymmetric() -> Start:
    """The space-filling hendecahedron with two mirror planes (G. Inchbald, The Mathematical
    Gazette 80, 1996); mirror images follow each other.

    Own coordinates: the mirror planes are x = 0 and y = 0, the floor is at z = -1.2, the top at
    z = 1.8, and x and y run from -2 to 2.
    """
    normals = np.array(
        [
            (1, 0, 2),
            (0, 1, 1),
            (1, 1, -1),
            (1, -1, -1),
            (2, 0, -1),
            (0, 0, -1),
            (-2, 0, -1),
            (-1, -1, -1),
            (-1, 1, -1),
            (0, -1, 1),
            (-1, 0, 2),
        ],
        dtype=np.float64,
    )
    inside = np.array([0.0, 0.0, 1.2])
    offsets = np.array([6, 3, 1, 1, 2, 0, 2, 1, 1, 3, 6]) - normals @ inside
    directions = normals / np.linalg.norm(normals, axis=1)[:, None]
    return normalised_start(polyhedron_corners(normals, offsets), directions)


def _circus() -> Start:
    """A five-sided tent: pentagonal prism under a pentagonal pyramid; wall and roof of each side
    follow each other, the floor comes in the middle.

    Own coordinates: every facet is tangent to the unit sphere about the origin, the floor is at
    z = -1, and the first wall faces x.
    """
    angle = 2.0 * np.pi * np.arange(5) / 5.0
    wall = np.stack([np.cos(angle), np.sin(angle), np.zeros(5)], axis=1)
    roof = np.stack([np.cos(angle), np.sin(angle), np.full(5, 0.809)], axis=1)
    roof /= np.linalg.norm(roof, axis=1)[:, None]
    floor = np.array([[0.0, 0.0, -1.0]])
    pairs = np.stack([wall, roof], axis=1).reshape(10, 3)
    directions = np.concatenate([pairs[:5], floor, pairs[5:]])
    offsets = np.ones(11)
    return normalised_start(polyhedron_corners(directions, offsets), directions)


HENDECAHEDRA: dict[str, Callable[[], Start]] = {"bisymmetric": _bisymmetric, "circus": _circus}
