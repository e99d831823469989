"""Parts of a design that repeat most: a trial step, and the Jacobian of all odds."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import cycle
from typing import Any, ClassVar, Final

import numpy as np
from scipy.spatial import ConvexHull

from dicedesign.bench.measures.processes import in_turn
from dicedesign.bench.measures.queries.query_speed import PAPER, ROW, Effort
from dicedesign.bench.rows import Row, column, hidden, milliseconds
from dicedesign.geometry.hulls.hull import HullMemory
from dicedesign.optimize.coordinates.facets import FacetCoordinates
from dicedesign.optimize.coordinates.shape import Coordinates
from dicedesign.optimize.coordinates.vertices import VertexCoordinates
from dicedesign.optimize.energy.objective import Objective
from dicedesign.optimize.solvers.candidate import CandidateMaker
from dicedesign.optimize.starts.kinds.hendecahedron import hendecahedron
from dicedesign.optimize.targets import sum_of_dice
from dicedesign.runtime.arrays import Floats
from tests.reference.extremes import large

__all__ = ["PartRow", "part_works", "speed_parts"]

DENSE: Final = 500
"""Points of the dense hull."""


@dataclass(frozen=True)
class PartRow(Row):
    """What a part of a design costs.

    Attributes
    ----------
    part: what is done with a shape, the body.
    seconds: how long that takes; ratio: as a multiple of scipy's hull of the same corners, which
        takes `scipy_hull_seconds`.
    """

    table: ClassVar[str | None] = "parts"

    part: str = column("part of a design", -36)
    body: str = column("body", -28)
    seconds: float = column("ms", 9, milliseconds)
    ratio: float = column("hulls", 9, ".2f")
    scipy_hull_seconds: float = hidden()


def speed_parts(effort: Effort) -> Iterator[PartRow]:
    """Rows of the table."""
    for body, corners, works in part_works():
        actions: list[Callable[[], Any]] = [partial(ConvexHull, corners), *works.values()]
        hull, *others = in_turn(actions, effort.seconds, rounds=effort.rounds, row=ROW)
        for part, seconds in zip(works, others, strict=True):
            yield PartRow(part, body, seconds, seconds / hull, hull)


def part_works() -> Iterator[tuple[str, Floats, dict[str, Callable[[], Any]]]]:
    """Bodies, their corners, and what is done with them, by name."""
    rng = np.random.default_rng(0)
    start = hendecahedron("bisymmetric")
    facets, place = FacetCoordinates.of(start.points, np.zeros(3))
    places = [place + 1e-2 * rng.normal(size=place.shape)]
    places.append(places[0] + 1e-4 * rng.normal(size=place.shape))
    target = sum_of_dice([6, 6]).probabilities
    die = Objective(facets, target, PAPER, None)
    works = {
        **_steps(die, places, start.directions),
        **_jacobians(facets, places, start.directions),
    }
    yield "2d6 die of 11 facets", facets.shape(places[0]).points, works
    points = large(DENSE).points
    vertices, place = VertexCoordinates.of(points, np.zeros(3))
    places = [place, place + 1e-6 * rng.normal(size=place.shape)]
    dense = Objective(vertices, np.full(3, 1.0 / 3.0), PAPER, None)
    yield f"{DENSE} on an ellipsoid", points, _steps(dense, places, np.eye(3))


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
