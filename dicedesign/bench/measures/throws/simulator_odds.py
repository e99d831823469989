"""Shapes thrown in simulators, and what the geometric model says of their rests."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from typing import Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.geometry.meshes.body import Body
from dicedesign.rest.asymmetry import asymmetry
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.runtime.workers import in_order
from dicedesign.throws.distances import effective_counts
from dicedesign.throws.engines import ENGINES, require_engine
from dicedesign.throws.odds_comparison import OddsComparison, Prediction, compare_odds
from dicedesign.throws.release import PAPER_DIRECTIONS
from dicedesign.throws.rigid_body import rigid_body
from dicedesign.throws.simulation import Throws, simulate
from dicedesign.throws.tables import Table, table_named

__all__ = [
    "ENGINE_NAMES",
    "GEOMETRIC",
    "TABLES",
    "EngineThrows",
    "ShapeOdds",
    "TableOdds",
    "compare_shape",
    "compare_shapes",
    "installed_engines",
]

GEOMETRIC: Final = "geometric model"

ENGINE_NAMES: Final[Mapping[str, str]] = {engine.name: engine.title for engine in ENGINES}

TABLES: Final = ("carpet", "board-game")
"""Without and with momentum."""


@dataclass(frozen=True)
class EngineThrows:
    """One simulator's throws of a shape: how many, how many of them ended on no facet, and the
    seconds of one core that they took."""

    drops: int
    unresolved: int
    seconds: float


@dataclass(frozen=True)
class TableOdds:
    """A shape on one table.

    Attributes
    ----------
    throws: by engine.
    comparisons: by two names out of `GEOMETRIC` and `ENGINE_NAMES`, without those of an engine in
        which no drop was resolved.
    """

    throws: dict[str, EngineThrows]
    comparisons: dict[tuple[str, str], OddsComparison]


@dataclass(frozen=True)
class ShapeOdds:
    """A shape and how it falls.

    Attributes
    ----------
    name: as in `cut_shapes`. vertices, facets: of its hull. rests: how many.
    asymmetry: rho (equation 20).
    tables: what came of it on each table, by name.
    """

    name: str
    vertices: int
    facets: int
    rests: int
    asymmetry: float
    tables: dict[str, TableOdds]


def installed_engines(
    wanted: Sequence[str] = ENGINES.names,
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The wanted simulators that can throw here, and why the others cannot.

    Raises InputError: none can.
    """
    installed: list[str] = []
    notes = []
    for engine in wanted:
        try:
            require_engine(engine)
        except InputError as error:
            notes.append(str(error))
        else:
            installed.append(engine)
    if not installed:
        raise InputError(f"engines: expected a simulator, got none; {'; '.join(notes)}")
    return tuple(installed), tuple(notes)


def compare_shapes(
    bodies: Sequence[Body], engines: Sequence[str], drops: int, draws: int, workers: Executor
) -> Iterator[ShapeOdds]:
    """`compare_shape` of each, in order, numbered from 0."""
    tasks = [
        partial(compare_shape, body, number, tuple(engines), drops, draws)
        for number, body in enumerate(bodies)
    ]
    return in_order(tasks, workers)


def compare_shape(
    body: Body,
    number: int,
    engines: Sequence[str],
    drops: int,
    draws: int,
    throw: Callable[..., Throws] = simulate,
) -> ShapeOdds:
    """Throw a shape onto each table in each simulator, and compare all odds with each other.

    number: of the shape, from 0, which seeds its drops; those of two simulators are independent.
    drops: on each table in other simulators than the package's own. draws: for each sampling error
    and noise floor. throw: `simulate`, or one like it.
    """
    poses = rest_poses(body)
    return ShapeOdds(
        name=body.name,
        vertices=len(poses.hull.vertices),
        facets=len(poses.hull.normals),
        rests=len(poses.probabilities),
        asymmetry=asymmetry(poses),
        tables={
            name: _compare_on(body, poses, table_named(name), number, engines, drops, draws, throw)
            for name in TABLES
        },
    )


def _compare_on(
    body: Body,
    poses: RestPoses,
    table: Table,
    number: int,
    engines: Sequence[str],
    drops: int,
    draws: int,
    throw: Callable[..., Throws],
) -> TableOdds:
    thrown = rigid_body(body, poses)
    predictions = {GEOMETRIC: Prediction(poses.probabilities)}
    counted = {}
    for engine in engines:
        count = PAPER_DIRECTIONS if engine == "native" else drops
        begun = time.process_time()
        throws = throw(
            thrown,
            table,
            count,
            len(ENGINES.names) * number + ENGINES.names.index(engine),
            engine=engine,
            orientations="uniform" if count % PAPER_DIRECTIONS else "icosahedron",
        )
        seconds = time.process_time() - begun
        counted[engine] = EngineThrows(throws.drops, throws.unresolved, seconds)
        if throws.unresolved < throws.drops:
            predictions[ENGINE_NAMES[engine]] = _prediction(throws)
    rng = np.random.default_rng([number, TABLES.index(table.name)])
    comparisons = {
        (one, other): compare_odds(poses.normals, predictions[one], predictions[other], draws, rng)
        for one, other in combinations(predictions, 2)
    }
    return TableOdds(counted, comparisons)


def _prediction(throws: Throws) -> Prediction:
    """Frequencies among resolved drops, and the drops of equal weight that they are worth."""
    landed = throws.outcomes >= 0
    counts = effective_counts(throws.outcomes[landed], throws.weights[landed], throws.rests)
    return Prediction(throws.frequencies, round(float(counts.sum())))
