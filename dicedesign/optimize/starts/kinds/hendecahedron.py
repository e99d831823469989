"""Two bodies of eleven facets."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Literal

import numpy as np

from dicedesign.errors import InputError
from dicedesign.optimize.starts.start import (
    STARTS,
    Start,
    StartKind,
    check_sides,
    normalised_start,
)
from dicedesign.runtime.arrays import Floats

__all__ = ["HENDECAHEDRA", "hendecahedron"]

FACETS: Final = 11


def hendecahedron(kind: str) -> Start:
    """An 11-faced polyhedron for the total of two dice; `kind` is "bisymmetric" or "circus".

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
    return _polyhedron(normals, offsets, directions)


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
    return _polyhedron(directions, np.ones(11), directions)


def _polyhedron(normals: Floats, offsets: Floats, directions: Floats) -> Start:
    from dicedesign.geometry.hulls.halfspaces import polyhedron_corners

    return normalised_start(polyhedron_corners(normals, offsets), directions)


def _check(kind: str, outcomes: int) -> None:
    check_sides(outcomes)
    if outcomes != FACETS:
        raise InputError(
            f"start.hendecahedron: expected a target of {FACETS} outcomes, one for each facet, got "
            f"{outcomes}; take another start"
        )


HENDECAHEDRA: Final[dict[str, Callable[[], Start]]] = {
    "bisymmetric": _bisymmetric,
    "circus": _circus,
}

STARTS.register(
    StartKind(
        name="hendecahedron",
        line="a body of eleven facets, `bisymmetric` or `circus`, for the total of two dice",
        rank=1,
        options=Literal["bisymmetric", "circus"],
        check=_check,
        make=lambda kind, task: hendecahedron(kind),
    )
)
