"""Drops per second of each simulator on one core, and whether its time step is fine enough."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np

from dicedesign.bench.measures.throws.simulator_odds import ENGINE_NAMES
from dicedesign.bench.rows import Row, column, hidden
from dicedesign.geometry.meshes.body import Body, make_body
from dicedesign.optimize.starts.kinds.hendecahedron import hendecahedron
from dicedesign.rest.poses import rest_poses
from dicedesign.throws.goodness_of_fit import two_sample_chi_square
from dicedesign.throws.odds_comparison import OddsComparison, Prediction, compare_odds
from dicedesign.throws.rigid_body import RigidBody, rigid_body
from dicedesign.throws.simulation import simulate
from dicedesign.throws.tables import Table, table_named

__all__ = ["GOAL", "SPEED_TABLE", "EngineSpeed", "StepHalving", "die_of_11", "halve_step", "speeds"]

GOAL: Final = 100.0
"""Drops per second and core of a die of 11 facets."""

SPEED_TABLE: Final = "board-game"

TRIAL: Final = 10
"""Drops that tell how many take the time wanted."""

MOST_DROPS: Final = 20_000

DRAWS: Final = 40
"""For the sampling errors and noise floors of a halved step."""


@dataclass(frozen=True)
class EngineSpeed(Row):
    """The throughput of one simulator.

    Attributes
    ----------
    body: its name. facets, vertices: of its hull. engine: that threw it.
    drops_per_second: of one core.
    drops: that were timed. seconds: of one core that they took.
    """

    table: ClassVar[str | None] = "throughput"

    body: str = column("", -48)
    facets: int = column("facets", 8)
    vertices: int = column("corners", 9)
    engine: str = column("  simulator", -13, lambda engine: f"  {ENGINE_NAMES[engine]}")
    drops_per_second: float = column("drops a second", 16, ".0f")
    drops: int = hidden()
    seconds: float = hidden()


@dataclass(frozen=True)
class StepHalving:
    """What half the time step changes.

    Attributes
    ----------
    drops: at each of the two steps, all independent. unresolved: of all of them.
    comparison: of the odds at the two steps.
    p_value: of the two-sample chi-square test that they are the same.
    """

    drops: int
    unresolved: int
    comparison: OddsComparison
    p_value: float


def die_of_11() -> Body:
    """The hendecahedron with two mirror planes, a die for the total of two dice."""
    return make_body(hendecahedron("bisymmetric").points, name="hendecahedron")


def speeds(bodies: Sequence[Body], engines: Sequence[str], seconds: float) -> Iterator[EngineSpeed]:
    """The throughput of each simulator for each body, one after the other in this process.

    seconds: of processor time that each is to take, about.
    """
    table = table_named(SPEED_TABLE)
    for body in bodies:
        poses = rest_poses(body)
        thrown, hull = rigid_body(body, poses), poses.hull
        for engine in engines:
            # The first drop loads what the simulator needs.
            _seconds(thrown, table, engine, 1)
            drops = round(seconds * TRIAL / _seconds(thrown, table, engine, TRIAL))
            drops = min(max(drops, TRIAL), MOST_DROPS)
            taken = _seconds(thrown, table, engine, drops)
            yield EngineSpeed(
                body=body.name,
                facets=len(hull.normals),
                vertices=len(hull.vertices),
                engine=engine,
                drops_per_second=drops / taken,
                drops=drops,
                seconds=taken,
            )


def _seconds(body: RigidBody, table: Table, engine: str, drops: int) -> float:
    """Processor time of so many drops."""
    begun = time.process_time()
    simulate(body, table, drops, engine=engine)
    return time.process_time() - begun


def halve_step(body: Body, drops: int, workers: Executor) -> StepHalving:
    """Throw a body in the package's own simulator at its time step and at half of it."""
    poses = rest_poses(body)
    thrown, table = rigid_body(body, poses), table_named(SPEED_TABLE)
    whole, half = (
        simulate(thrown, table, drops, seed, refinement=refinement, workers=workers)
        for seed, refinement in enumerate((1.0, 2.0))
    )
    return StepHalving(
        drops=drops,
        unresolved=whole.unresolved + half.unresolved,
        comparison=compare_odds(
            poses.normals,
            Prediction(whole.frequencies, int(whole.counts.sum())),
            Prediction(half.frequencies, int(half.counts.sum())),
            DRAWS,
            np.random.default_rng(0),
        ),
        p_value=two_sample_chi_square(whole.counts, half.counts).p_value,
    )
