"""The momentum model against simulated throws of dice that it was not fitted to, and against the
counts of printed ones."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from statistics import median
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import torch
from numpy.typing import NDArray

from dicedesign.bench.measures.processes import in_turn
from dicedesign.gradient.rest_odds import RestEvaluation, evaluate_rests
from dicedesign.gradient.thrown_odds import ThrownOdds
from dicedesign.learning.random_dice import DICE_KINDS, RandomDie
from dicedesign.learning.random_throws import (
    Deviation,
    Deviations,
    ThrownRandomDie,
    mean_deviations,
    throw_random_dice,
)
from dicedesign.throws.counts.throw_counts import CountedDie
from dicedesign.throws.momentum.momentum_model import MomentumModel
from dicedesign.throws.momentum.momentum_odds import momentum_odds
from dicedesign.throws.simulation.simulation import simulate
from dicedesign.throws.statistics.goodness_of_fit import (
    ChiSquareTest,
    chi_square,
    two_sample_chi_square,
)
from dicedesign.throws.statistics.total_variation import noise_floor, total_variation
from dicedesign.throws.tables import Table

if TYPE_CHECKING:
    from dicedesign.report.charts.paper import Paper

__all__ = [
    "FULL",
    "GOAL",
    "QUICK",
    "RESTS",
    "Extent",
    "JudgedOdds",
    "ModelTimes",
    "PrintedDie",
    "by_kind",
    "deviation_figure",
    "judge_printed_die",
    "model_times",
    "throw_unseen_dice",
]

GOAL: Final = 0.03
"""Mean total variation to simulated throws."""

RESTS: Final = (7, 13)
"""Fewest and most of the dice that are thrown."""

SEED: Final = 1_000_000
"""Of the dice and their drops; not one that a model is likely to be fitted with."""

ROUNDS: Final = 3

ROW_SECONDS: Final = 2e-3
"""Of each measurement of time: rounds, and seconds that each takes at least."""


@dataclass(frozen=True)
class Extent:
    """How many random dice, and how many drops of each and of each printed die."""

    dice: int
    drops: int


FULL: Final = Extent(50, 20_000)

QUICK: Final = Extent(12, 1_000)


@dataclass(frozen=True)
class ModelTimes:
    """Medians over dice of processor seconds.

    Attributes
    ----------
    odds: for the odds of a thrown die whose Morse complex is known.
    jacobian: for their derivatives in the vertices, and those of the odds without momentum, which
        they need.
    """

    odds: float
    jacobian: float


@dataclass(frozen=True)
class JudgedOdds:
    """Odds beside what came up with a printed die.

    Attributes
    ----------
    model: whose odds. odds: (g,) of the outcomes.
    test: whether the throws can come from them; of simulated ones, from the same odds.
    total_variation: between them and the frequencies. noise_floor: its mean if they were right.
    """

    model: str
    odds: NDArray[np.float64]
    test: ChiSquareTest
    total_variation: float
    noise_floor: float

    def plain(self) -> dict[str, Any]:
        """As plain data."""
        return {
            "model": self.model,
            "odds": self.odds.tolist(),
            "chi_square": self.test.statistic,
            "degrees": self.test.degrees,
            "p_value": self.test.p_value,
            "total_variation": self.total_variation,
            "noise_floor": self.noise_floor,
        }


@dataclass(frozen=True)
class PrintedDie:
    """A printed die: its name, how often it was thrown, simulated drops and how many of these came
    to no rest, and what each model says."""

    name: str
    throws: int
    drops: int
    unresolved: int
    models: tuple[JudgedOdds, ...]


def throw_unseen_dice(
    extent: Extent, table: Table, engine: str, workers: Executor
) -> Iterator[ThrownRandomDie]:
    """Random dice of `RESTS` rests, thrown. Raises InputError: as `throw_random_die`."""
    throws = [[(table, extent.drops)]] * extent.dice
    for (thrown,) in throw_random_dice(throws, SEED, workers, rests=RESTS, engine=engine):
        yield thrown


def by_kind(found: Sequence[Deviation]) -> Iterator[tuple[str, Deviations]]:
    """All dice, and those of each kind that there are."""
    yield "all", mean_deviations(found)
    for kind in DICE_KINDS:
        alike = [one for one in found if one.kind == kind]
        if alike:
            yield kind, mean_deviations(alike)


def model_times(dice: Sequence[RandomDie], model: MomentumModel, thrown: ThrownOdds) -> ModelTimes:
    """How long the model takes, in NumPy and with its derivatives, for dice that are known."""
    times = []
    for die in dice:
        times.append(
            in_turn(
                [
                    partial(momentum_odds, die.poses, die.body, model),
                    partial(thrown.jacobian, _evaluation(die)),
                ],
                0.0,
                rounds=ROUNDS,
                row=ROW_SECONDS,
            )
        )
    return ModelTimes(*(median(column) for column in zip(*times, strict=True)))


def _evaluation(die: RandomDie) -> RestEvaluation:
    """A die's rests, traced."""
    uniform = die.poses.center_of_mass_source == "uniform solid hull"
    center = None if uniform else torch.from_numpy(die.poses.center_of_mass)
    rests = evaluate_rests(torch.from_numpy(die.poses.hull.vertices), center)
    # It keeps what it has found.
    rests.odds.sum()
    return rests


def judge_printed_die(
    die: CountedDie,
    table: Table,
    model: MomentumModel | None,
    drops: int,
    engine: str,
    workers: Executor,
) -> PrintedDie:
    """Three predictions of a printed die beside what came up. Where its size is unknown it has the
    table's. Raises InputError: as `simulate`."""
    sized = table if die.size is None else replace(table, size=die.size)
    throws = simulate(die.body, sized, drops, SEED, engine=engine, workers=workers)
    counts = die.by_outcome(throws.counts)
    shown = die.group_of_rest >= 0
    by_rest = momentum_odds(die.poses, die.body, model)
    momentum = np.bincount(die.group_of_rest[shown], by_rest[shown], minlength=len(die.labels))
    momentum = momentum / momentum.sum()
    simulated = (counts + 0.5) / (counts + 0.5).sum()
    return PrintedDie(
        name=die.name,
        throws=int(die.counts.sum()),
        drops=throws.drops,
        unresolved=throws.unresolved,
        models=(
            _judged("geometric", die, die.geometric, chi_square(die.counts, die.geometric)),
            _judged("momentum", die, momentum, chi_square(die.counts, momentum)),
            _judged("simulated", die, simulated, two_sample_chi_square(die.counts, counts)),
        ),
    )


def _judged(
    model: str, die: CountedDie, odds: NDArray[np.float64], test: ChiSquareTest
) -> JudgedOdds:
    throws = int(die.counts.sum())
    return JudgedOdds(
        model,
        odds,
        test,
        total_variation(die.counts / throws, odds),
        noise_floor(odds, throws),
    )


def deviation_figure(found: Sequence[Deviation], table: str, drops: int) -> Paper:
    """Bars of each die's total variation without momentum and by the model."""
    from dicedesign.report.charts.deviation_bars import deviation_bars_figure

    return deviation_bars_figure(
        {
            "without momentum": np.array([one.geometric for one in found]),
            "momentum model": np.array([one.momentum for one in found]),
        },
        np.array([one.noise_floor for one in found]),
        f"{len(found)} random dice of {RESTS[0]} to {RESTS[1]} rests on the table {table}",
        f"{drops} simulated drops of each die; the model was not fitted to any of them",
    )
