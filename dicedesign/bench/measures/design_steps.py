"""Parts of a design that repeat most: a trial step, and the Jacobian of all odds."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import cycle
from typing import Any, Final

import numpy as np
from scipy.spatial import ConvexHull

from dicedesign.bench.bodies.extremes import large
from dicedesign.bench.measures.processes import in_turn
from dicedesign.bench.measures.query_speed import PAPER, ROW, Effort
from dicedesign.design.coordinates.facets import FacetCoordinates
from dicedesign.design.coordinates.shape import Coordinates
from dicedesign.design.coordinates.vertices import VertexCoordinates
from dicedesign.design.energy.objective import Objective
from dicedesign.design.solvers.candidate import CandidateMaker
from dicedesign.design.starts.kinds.hendecahedron import hendecahedron
from dicedesign.design.targets import sum_of_dice
from dicedesign.geometry.hulls.reuse import HullMemory
from dicedesign.runtime.arrays import Floats

__all__ = ["Part", "speed_parts"]

DENSE: Final = 500
"""Points of the dense hull."""


@dataclass(frozen=True)
class Part:
    """What a part of a design costs.

    Attributes
    ----------
    body: the shape.
    part: what is done with it.
    seconds: how long that takes.
    hull_seconds: how long `scipy.spatial.ConvexHull` of the same corners takes.
    """

    body: str
    part: str
    seconds: float
    hull_seconds: float

    @property
    def ratio(self) -> float:
        """The part as a multiple of scipy's hull."""
        return self.seconds / self.hull_seconds

    def plain(self) -> dict[str, Any]:
        """The row as plain data."""
        return {
            "body": self.body,
            "part": self.part,
            "seconds": self.seconds,
            "scipy_hull_seconds": self.hull_seconds,
            "ratio": self.ratio,
        }


def speed_parts(effort: Effort) -> Iterator[Part]:
    """Rows of the table."""
    rng = np.random.default_rng(0)
    start = hendecahedron("bisymmetric")
    facets, place = FacetCoordinates.of(start.points, np.zeros(3))
    places = [place + 1e-2 * rng.normal(size=place.shape)]
    places.append(places[0] + 1e-4 * rng.normal(size=place.shape))
    target = sum_of_dice([6, 6]).probabilities
    die = Objective(facets, target, PAPER, None)
    yield from _measured(
        "2d6 die of 11 facets",
        facets.shape(places[0]).points,
        {**_steps(die, places, start.directions), **_jacobians(facets, places, start.directions)},
        effort,
    )
    points = large(DENSE).points
    vertices, place = VertexCoordinates.of(points, np.zeros(3))
    places = [place, place + 1e-6 * rng.normal(size=place.shape)]
    dense = Objective(vertices, np.full(3, 1.0 / 3.0), PAPER, None)
    steps = _steps(dense, places, np.eye(3))
    yield from _measured(f"{DENSE} on an ellipsoid", points, steps, effort)


def _measured(
    body: str, corners: Floats, works: dict[str, Callable[[], Any]], effort: Effort
) -> Iterator[Part]:
    actions = [lambda: ConvexHull(corners), *works.values()]
    hull, *others = in_turn(actions, effort.seconds, rounds=effort.rounds, row=ROW)
    for part, seconds in zip(works, others, strict=True):
        yield Part(body, part, seconds, hull)


def _steps(
    objective: Objective, places: list[Floats], directions: Floats
) -> dict[str, Callable[[], Any]]:
    """Energies at places near to each other, to and fro."""
    there, elsewhere = cycle(places), cycle(places)

    def fresh() -> float:
        forgetful = replace(objective, shapes=HullMemory(), polars=HullMemory())
        return forgetful.evaluate(next(elsewhere), directions).value

    return {
        "trial step, edges known": lambda: objective.evaluate(next(there), directions).value,
        "trial step, new hull": fresh,
    }


def _jacobians(
    coordinates: Coordinates, places: list[Floats], directions: Floats
) -> dict[str, Callable[[], Any]]:
    """Odds where edges are known, and with their derivatives."""
    maker, there = CandidateMaker(None), cycle(places)

    def attempt() -> Floats:
        trial = maker.attempt(coordinates, next(there), directions)
        assert trial is not None
        return trial.odds

    def attempt_and_jacobian() -> Floats:
        trial = maker.attempt(coordinates, next(there), directions)
        assert trial is not None
        return trial.odds_jacobian

    return {
        "trial of the exact method": attempt,
        "trial and Jacobian of all odds": attempt_and_jacobian,
    }
