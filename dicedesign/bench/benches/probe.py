"""What throws of dice tell about a table: a search for the die that tells most, and others beside
it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.bench.frame import BENCHES, Bench, Items, Run
from dicedesign.bench.options import Amount, Option
from dicedesign.bench.rows import Row, column
from dicedesign.runtime.arrays import Floats

if TYPE_CHECKING:
    from dicedesign.bench.measures.throws.simulator_agreement import NamedDie
    from dicedesign.throws.fitting.table_information import Errors
    from dicedesign.throws.tables import Table

__all__ = ["Extent", "ProbeRow", "frustum", "probe_family"]

BOX: Final = (1.0, 1.15, 1.3)
"""Extents of a die that is nearly a cube."""

SHOWN: Final = 6
"""Of the family."""

KEY: Final = """
Standard errors of restitution and friction after so many throws by a hand of which little is known,
± those of the simulation; both: the root of the determinant of their covariance, which is searched
for its least. Frustums of regular pyramids: sides, height over the base's radius, top over base."""


@dataclass(frozen=True)
class Extent:
    """How much is measured.

    Attributes
    ----------
    sides, heights, tops: of the family; the second and third in radii of the base.
    drops: simulated for each shape; again_drops: for the best of them, and for dice beside them.
    throws: of a real die, after which errors are compared.
    """

    sides: tuple[int, ...]
    heights: tuple[float, ...]
    tops: tuple[float, ...]
    drops: int
    again_drops: int
    throws: int = 300


def _with_error(pair: tuple[float, float], digits: int = 3) -> str:
    value, error = pair
    if not math.isfinite(value):
        return "-"
    return f"{value:.{digits}f} ± {error:.{digits}f}"


@dataclass(frozen=True)
class ProbeRow(Row):
    """A die; see `Errors`."""

    name: str = column("die", -30)
    rests: int = column("rests", 6)
    restitution: tuple[float, float] = column("restitution", 18, _with_error)
    friction: tuple[float, float] = column("friction", 18, _with_error)
    both: tuple[float, float] = column("both", 20, lambda pair: _with_error(pair, 4))

    @classmethod
    def of(cls, die: NamedDie, errors: Errors) -> ProbeRow:
        """Of what its throws leave open."""
        return cls(
            die.name,
            len(die.body.rest_heights),
            (errors.restitution, errors.restitution_error),
            (errors.friction, errors.friction_error),
            (errors.both, errors.both_error),
        )


def _rows(run: Run) -> Items:
    from dicedesign.bench.measures.throws.simulator_agreement import given_die
    from dicedesign.throws.engines.engine import require_engine
    from dicedesign.throws.tables import table_named

    extent: Extent = run.extent
    require_engine("native")
    table = table_named(run.options.table)
    beside = [given_die(path) for path in run.options.dice]
    beside.append(_named("box " + " x ".join(f"{x:g}" for x in BOX), _box()))
    family = list(probe_family(extent))
    yield {"table": table.as_dict()}
    with run.workers("dice", len(family) + min(SHOWN, len(family)) + len(beside)) as workers:
        first = list(_judged(run, family, table, extent.drops, 1, workers))
        order = np.argsort([errors.both for errors in first], kind="stable")
        best = [family[place] for place in order[:SHOWN]]
        dice = [*best, *beside]
        again = list(_judged(run, dice, table, extent.again_drops, 2, workers))
    yield (
        f"{extent.throws} throws onto {table.name}; the {len(best)} best of {len(family)} frustums,"
        f" simulated {extent.again_drops} times anew, and other dice"
    )
    yield from map(ProbeRow.of, dice, again)
    yield KEY
    return True


def probe_family(extent: Extent) -> Iterator[NamedDie]:
    """Frustums that rest on base, top and all sides, and on nothing else."""
    for sides, height, top in product(extent.sides, extent.heights, extent.tops):
        die = _named(f"frustum {sides}, {height:g}, {top:g}", frustum(sides, height, top))
        if len(die.body.rest_heights) == sides + 2:
            yield die


def frustum(sides: int, height: float, top: float) -> Floats:
    """Corners (2 sides, 3) of a pyramid over a regular polygon of radius 1, cut off where its
    radius is `top`."""
    angles = 2.0 * np.pi * np.arange(sides) / sides
    ring = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(sides)])
    return np.concatenate([ring, top * ring + [0.0, 0.0, height]])


def _box() -> Floats:
    return np.array(list(product((-0.5, 0.5), repeat=3))) * BOX


def _named(name: str, points: Floats) -> NamedDie:
    from dicedesign.bench.measures.throws.simulator_agreement import NamedDie
    from dicedesign.geometry.meshes.body import make_body
    from dicedesign.rest.poses import rest_poses
    from dicedesign.throws.rigid_body import rigid_body

    body = make_body(points, name=name)
    return NamedDie(name, rigid_body(body, rest_poses(body)))


def _judged(
    run: Run, dice: Sequence[NamedDie], table: Table, drops: int, seed: int, workers: Executor
) -> Iterator[Errors]:
    from dicedesign.runtime.executors import in_order

    tasks = [partial(judge_die, die, table, drops, seed, run.extent.throws) for die in dice]
    for errors in in_order(tasks, workers):
        run.advance()
        yield errors


def judge_die(die: NamedDie, table: Table, drops: int, seed: int, throws: int) -> Errors:
    """What so many throws leave open of a table, by as many simulated ones as `drops`."""
    from dicedesign.throws.fitting.table_information import table_information

    rests = np.arange(len(die.body.rest_heights))
    return table_information(die.body, rests, table, drops, seed).errors(throws)


BENCHES.register(
    Bench(
        name="probe",
        line="which die's throws tell most about restitution and friction of a table",
        description="Throw frustums of regular pyramids in simulation, to find the one whose "
        "throws tell most about restitution and friction of a table, whoever throws it; throw the "
        "best anew, and other dice. The die of recipes/probe.yaml came of this.",
        rows=_rows,
        full=Extent((4, 6, 8, 10), (0.6, 0.7, 0.8, 0.9), (0.3, 0.4, 0.5), 20_000, 100_000),
        quick=Extent((6, 8), (0.8,), (0.3, 0.45), 4_000, 8_000),
        amounts=(
            Amount("drops", "N", "simulated throws of each frustum"),
            Amount("again_drops", "N", "of the best, and of other dice"),
            Amount("throws", "N", "of a real die, after which dice are compared"),
        ),
        options=(
            Option(
                "dice",
                "others to compare: recipes (.yaml), or meshes",
                {"nargs": "*", "type": Path, "metavar": "DIE"},
            ),
            Option(
                "--table",
                "that throws are to tell about (default: board-game)",
                {"default": "board-game", "metavar": "NAME|FILE.json"},
            ),
        ),
        workers="dice at a time (default: one for each core)",
        torch=False,
    )
)
