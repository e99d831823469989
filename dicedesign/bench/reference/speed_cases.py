"""Point sets for the speed bench, how fast they are to be, and how fast others were."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from dicedesign.geometry.meshes.body import Body
from dicedesign.optimize.starts.kinds.hendecahedron import hendecahedron
from dicedesign.runtime.arrays import Floats
from tests.reference.extremes import large
from tests.reference.sampled import lattice_directions, random_directions

__all__ = ["DIE_CORNERS", "Case", "Ratios", "built_in_cases", "goals", "mesh_case", "sphere_case"]

DIE_CORNERS: Final = 20
"""Hulls of at most so many vertices count as dice."""

DENTED_POINTS: Final = 5000
"""Of the built-in surface most of whose points are inside of its hull."""


@dataclass(frozen=True)
class Ratios:
    """How many times as long as scipy's hull something takes; None where it is not known.

    Attributes
    ----------
    query: all resting probabilities.
    gradient: the energy of a design and its gradient.
    """

    query: float | None = None
    gradient: float | None = None


@dataclass(frozen=True)
class Case:
    """Points to measure with.

    Attributes
    ----------
    name: for the table.
    points: (n, 3).
    cpp: what the paper's public C++ implementation took, times as long as Qhull, measured earlier
        on another machine.
    """

    name: str
    points: Floats
    cpp: Ratios = Ratios()


def goals(points: int, corners: int) -> Ratios:
    """What is aimed at, for so many points of which some are corners of the hull."""
    if 2 * corners < points:
        return Ratios(0.9, 1.2)
    if corners <= DIE_CORNERS:
        return Ratios(2.0, 5.0)
    if corners <= 100:
        return Ratios(1.5, 4.0)
    return Ratios(1.2, 5.0)


_CPP: Final = {
    "spot": Ratios(1.9, 2.3),
    "bunny": Ratios(1.75, 1.4),
}
"""Of meshes, by the names of their files. The bunny was one of 35,000 vertices."""


def mesh_case(name: str, stem: str, body: Body) -> Case:
    """The points of a mesh; stem: its file's name without the ending."""
    return Case(name, body.points, _CPP.get(stem.lower(), Ratios()))


def built_in_cases(most_points: int = 100_000) -> Iterator[Case]:
    """Those that need no files and have at most so many points: dice, dense hulls, and a surface
    with dents."""
    for case in _built_in_cases():
        if len(case.points) > most_points:
            return
        yield case


def _built_in_cases() -> Iterator[Case]:
    """In the order of their sizes, roughly."""
    corner = np.concatenate([np.zeros((1, 3)), np.eye(3)])
    yield Case("tetrahedron", random_directions(4, 0) * [1.0, 0.8, 0.7], Ratios(2.0))
    yield Case("corner of a cube", corner, Ratios(2.0))
    yield sphere_case(8)
    yield sphere_case(12)
    yield sphere_case(20)
    yield Case("2d6 die of 11 facets", hendecahedron("bisymmetric").points, Ratios(None, 9.0))
    yield sphere_case(100, Ratios(3.4))
    yield sphere_case(1000, Ratios(None, 25.0))
    yield Case("1,000 on an ellipsoid", large(1000).points, Ratios(3.0))
    yield Case(f"{DENTED_POINTS:,} on a dented surface", _dented(DENTED_POINTS))
    yield sphere_case(100_000)


def sphere_case(points: int, cpp: Ratios = Ratios()) -> Case:
    """Random points on a sphere."""
    return Case(f"{points:,} on a sphere", random_directions(points, 0), cpp)


def _dented(points: int) -> Floats:
    """Points (n, 3) on a ball with six round bumps; what lies between these is inside the hull."""
    directions = lattice_directions(points, 0)
    height = np.exp(8.0 * (directions @ random_directions(6, 1).T - 1.0)).sum(axis=1)
    return directions * (0.5 + height)[:, None]
