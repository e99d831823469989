"""Dice that the momentum model was not fitted to, thrown, and printed ones beside the model."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from statistics import median
from typing import ClassVar, Final

import numpy as np
import torch

from benchmarks.training.random_dice import RandomDie
from benchmarks.training.random_throws import ThrownRandomDie, throw_random_dice
from dicedesign.bench.measures.processes import in_turn
from dicedesign.bench.rows import Row, column, hidden
from dicedesign.gradient.rest_odds import evaluate_rests
from dicedesign.gradient.thrown_odds import ThrownOdds
from dicedesign.throws.distances import noise_floor, total_variation
from dicedesign.throws.goodness_of_fit import chi_square, two_sample_chi_square
from dicedesign.throws.momentum_model import MomentumModel
from dicedesign.throws.momentum_odds import momentum_odds
from dicedesign.throws.simulation import simulate
from dicedesign.throws.tables import Table
from dicedesign.throws.throw_counts import CountedDie

__all__ = ["RESTS", "PrintedRow", "judge_printed_die", "model_times", "throw_unseen_dice"]

RESTS: Final = (7, 13)
"""Fewest and most of the dice that are thrown."""

SEED: Final = 1_000_000
"""Of the dice and their drops; not one that a model is likely to be fitted with."""

ROUNDS: Final = 3

ROW_SECONDS: Final = 2e-3
"""Of each measurement of time: rounds, and seconds that each takes at least."""


@dataclass(frozen=True)
class PrintedRow(Row):
    """A model's odds beside what came up with a printed die.

    Attributes
    ----------
    die: its name; throws: of it; model: whose odds.
    chi_square, degrees, p_value: of the test whether the throws can come from them; of simulated
        ones, from the same odds.
    total_variation: between them and the frequencies; noise_floor: its mean if they were right.
    odds: (g,) of the outcomes.
    drops, unresolved: of the simulation, and how many of them came to no rest.
    """

    table: ClassVar[str | None] = "printed_dice"

    die: str = column("printed die", -23)
    throws: int = column("throws", 8)
    model: str = column("  odds", -13, lambda model: f"  {model}")
    chi_square: float = column("chi-square", 10, ".2f")
    degrees: int = column("degrees", 9)
    p_value: float = column("p", 9, ".2g")
    total_variation: float = column("total variation", 17, ".4f")
    noise_floor: float = column("floor", 8, ".4f")
    odds: tuple[float, ...] = hidden()
    drops: int = hidden()
    unresolved: int = hidden()


def throw_unseen_dice(
    dice: int, drops: int, table: Table, engine: str, workers: Executor
) -> Iterator[ThrownRandomDie]:
    """Random dice of `RESTS` rests, thrown. Raises InputError: as `throw_random_die`."""
    throws = [[(table, drops)]] * dice
    for (thrown,) in throw_random_dice(throws, SEED, workers, rests=RESTS, engine=engine):
        yield thrown


def model_times(
    dice: Sequence[RandomDie], model: MomentumModel, thrown: ThrownOdds
) -> tuple[float, float]:
    """Processor seconds that the model takes for dice whose Morse complex is known, medians: for
    the odds, in NumPy, and for their derivatives in the vertices, with those of the odds without
    momentum, which they need."""
    times = []
    for die in dice:
        uniform = die.poses.center_of_mass_source == "uniform solid hull"
        center = None if uniform else torch.from_numpy(die.poses.center_of_mass)
        rests = evaluate_rests(torch.from_numpy(die.poses.hull.vertices), center)
        # It keeps what it has computed.
        rests.odds.sum()
        works = [
            partial(momentum_odds, die.poses, die.body, model),
            partial(thrown.jacobian, rests),
        ]
        times.append(in_turn(works, 0.0, rounds=ROUNDS, row=ROW_SECONDS))
    odds, jacobian = (median(column) for column in zip(*times, strict=True))
    return odds, jacobian


def judge_printed_die(
    die: CountedDie,
    table: Table,
    model: MomentumModel | None,
    drops: int,
    engine: str,
    workers: Executor,
) -> list[PrintedRow]:
    """Three predictions of a printed die beside what came up. Where its size is unknown it has the
    table's. Raises InputError: as `simulate`."""
    sized = table.sized(die.size)
    simulated = simulate(die.body, sized, drops, SEED, engine=engine, workers=workers)
    counts = die.by_outcome(simulated.counts)
    shown = die.group_of_rest >= 0
    by_rest = momentum_odds(die.poses, die.body, model)
    momentum = np.bincount(die.group_of_rest[shown], by_rest[shown], minlength=len(die.labels))
    momentum = momentum / momentum.sum()
    throws = int(die.counts.sum())
    return [
        PrintedRow(
            die=die.name,
            throws=throws,
            model=name,
            chi_square=test.statistic,
            degrees=test.degrees,
            p_value=test.p_value,
            total_variation=total_variation(die.counts / throws, odds),
            noise_floor=noise_floor(odds, throws),
            odds=tuple(odds.tolist()),
            drops=simulated.drops,
            unresolved=simulated.unresolved,
        )
        for name, odds, test in (
            ("geometric", die.geometric, chi_square(die.counts, die.geometric)),
            ("momentum", momentum, chi_square(die.counts, momentum)),
            (
                "simulated",
                (counts + 0.5) / (counts + 0.5).sum(),
                two_sample_chi_square(die.counts, counts),
            ),
        )
    ]
