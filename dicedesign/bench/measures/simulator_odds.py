"""Shapes thrown in simulators, and what the geometric model says of their rests."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from typing import Final

import numpy as np

from dicedesign.bench.bodies.cut_shapes import cut_shapes, made_models
from dicedesign.errors import InputError
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.rest.asymmetry import asymmetry
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.runtime.executors import in_order
from dicedesign.throws.engines.engine import ENGINES, require_engine
from dicedesign.throws.release import PAPER_DIRECTIONS
from dicedesign.throws.rigid_body import rigid_body
from dicedesign.throws.simulation.simulation import Throws, simulate
from dicedesign.throws.statistics.odds_comparison import OddsComparison, Prediction, compare_odds
from dicedesign.throws.statistics.total_variation import effective_counts
from dicedesign.throws.tables import Table, table_named

__all__ = [
    "ENGINE_NAMES",
    "FULL",
    "GEOMETRIC",
    "QUICK",
    "TABLES",
    "EngineThrows",
    "Extent",
    "ShapeOdds",
    "TableOdds",
    "compare_shape",
    "compare_shapes",
    "installed_engines",
    "table_shapes",
]

GEOMETRIC: Final = "geometric model"

ENGINE_NAMES: Final[Mapping[str, str]] = {engine.name: engine.title for engine in ENGINES}

TABLES: Final = ("carpet", "board-game")
"""Without and with momentum."""


@dataclass(frozen=True)
class Extent:
    """How much is measured.

    Attributes
    ----------
    every: one of so many shapes is thrown.
    drops: of each shape on each table in MuJoCo and in Bullet. The package's own simulator takes
        the paper's directions; so do they at a multiple of their number, else uniform orientations.
    draws: for each sampling error and noise floor.
    speed_seconds: of processor time for each simulator's throughput.
    halving_drops: at each of two time steps.
    models: whether the shapes include pieces of the models that the package builds.
    """

    every: int
    drops: int
    draws: int
    speed_seconds: float
    halving_drops: int
    models: bool


FULL: Final = Extent(1, 202, 16, 3.0, 40_000, models=True)

QUICK: Final = Extent(13, 40, 6, 0.2, 2_000, models=False)


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


def table_shapes(models: Mapping[str, Surface], extent: Extent) -> list[Body]:
    """Shapes to throw: pieces of boxes, spheres and models, those of the package if none is given.

    Raises InputError: as `cut_shapes`.
    """
    own = made_models() if extent.models else {}
    return cut_shapes(models or own)[:: extent.every]


def installed_engines() -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The simulators that can throw here, and why the others cannot.

    Raises InputError: none can.
    """
    found: list[str] = []
    notes = []
    for engine in ENGINES.names:
        try:
            require_engine(engine)
        except InputError as error:
            notes.append(str(error))
        else:
            found.append(engine)
    if not found:
        raise InputError(f"bench table: expected a simulator, got none; {'; '.join(notes)}")
    return tuple(found), tuple(notes)


def compare_shapes(
    bodies: Sequence[Body], engines: Sequence[str], extent: Extent, workers: Executor
) -> Iterator[ShapeOdds]:
    """`compare_shape` of each, in order, numbered from 0."""
    tasks = [
        partial(compare_shape, body, number, tuple(engines), extent.drops, extent.draws)
        for number, body in enumerate(bodies)
    ]
    return in_order(tasks, workers)


def compare_shape(
    body: Body, number: int, engines: Sequence[str], drops: int, draws: int
) -> ShapeOdds:
    """Throw a shape onto each table in each simulator, and compare all odds with each other.

    number: of the shape, from 0, which seeds its drops; those of two simulators are independent.
    drops, draws: as in `Extent`.
    """
    poses = rest_poses(body)
    return ShapeOdds(
        name=body.name,
        vertices=len(poses.hull.vertices),
        facets=len(poses.hull.normals),
        rests=len(poses.probabilities),
        asymmetry=asymmetry(poses),
        tables={
            name: _compare_on(body, poses, table_named(name), number, engines, drops, draws)
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
) -> TableOdds:
    thrown = rigid_body(body, poses)
    predictions = {GEOMETRIC: Prediction(poses.probabilities)}
    counted = {}
    for engine in engines:
        count = PAPER_DIRECTIONS if engine == "native" else drops
        begun = time.process_time()
        throws = simulate(
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
