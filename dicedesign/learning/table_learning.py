"""Fits the momentum model of a table to simulated throws of random dice, some of which it is only
judged by."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Any, Final

import torch

from dicedesign.gradient.restitution_sensitivity import CHANGES
from dicedesign.learning.momentum_training import train
from dicedesign.learning.random_throws import (
    Deviations,
    ThrownRandomDie,
    deviation,
    flat_counts,
    mean_deviations,
    throw_random_dice,
    training_die,
)
from dicedesign.runtime.checkpoint import Checkpoint
from dicedesign.runtime.checks import MOST_SEED, check_whole
from dicedesign.throws.momentum.momentum_model import model_of, plain_model
from dicedesign.throws.tables import MOST_RESTITUTION, Table

__all__ = ["LearnedModel", "check_learning", "learn_momentum", "throws_of_die"]

HELD_OUT: Final = 8
"""One of so many dice is held out."""

HELD_OUT_DROPS: Final = 4
"""Drops of a die that is held out over those, on all tables, of one that is not: fewer would hide
the model's own error behind that of sampling."""

THROWS: Final = "throws"
"""Rows of a checkpoint: what came up with each die, as of `flat_counts`."""


@dataclass(frozen=True)
class LearnedModel:
    """A momentum model and how good it is.

    Attributes
    ----------
    plain: the model as a table's file has it.
    fitted, held_out: over the dice that it was fitted to, and over the others.
    unresolved: drops that came to no rest.
    """

    plain: dict[str, Any]
    fitted: Deviations
    held_out: Deviations
    unresolved: int


def check_learning(dice: int, drops: int, seed: int, steps: int) -> None:
    """Raise InputError for fewer than `HELD_OUT` dice, no drop, no step, or a seed below 0."""
    check_whole("dice", dice, HELD_OUT)
    check_whole("drops", drops)
    check_whole("seed", seed, least=0, most=MOST_SEED)
    check_whole("steps", steps)


def throws_of_die(table: Table, number: int, drops: int) -> list[tuple[float, int]]:
    """Parts by which the restitution is higher than that of the table, and how often a die is
    thrown there: an equal share of the drops onto the table itself and onto each that robust dice
    are made for. Every `HELD_OUT`-th die is held out: it is thrown onto the table as it is, and
    more often."""
    if _is_held_out(number):
        return [(0.0, drops * HELD_OUT_DROPS)]
    if table.restitution == 0.0:
        return [(0.0, drops)]
    highest = MOST_RESTITUTION / table.restitution - 1.0
    changed = (min(change, highest) for change in CHANGES)
    changes = (0.0, *(change for change in changed if change != 0.0))
    return [(change, math.ceil(drops / len(changes))) for change in changes]


def learn_momentum(
    table: Table,
    dice: int,
    drops: int,
    seed: int,
    steps: int,
    *,
    workers: Executor,
    checkpoint: Checkpoint | None = None,
    on_die: Callable[[int], None] | None = None,
    on_loss: Callable[[float], None] | None = None,
) -> LearnedModel:
    """Throw random dice and fit the model to them.

    Training runs in this process, in one thread, so that the same numbers give the same model.

    Parameters
    ----------
    dice, drops, seed, steps: how many random dice, drops of each that the model is fitted to, on
        the table itself and on the changed ones together, the seed of everything random, and
        iterations of training at most.
    workers: throw dice side by side.
    checkpoint: of the same table, dice, drops and seed; dice that were thrown and evaluations that
        were made before are taken from it, and others are added.
    on_die: called with 1 for each die that was thrown.
    on_loss: called with the loss at each evaluation in training.

    Raises InputError: as `check_learning` and `throw_random_die`.
    """
    check_learning(dice, drops, seed, steps)
    plan = [throws_of_die(table, number, drops) for number in range(dice)]
    throws = [[(table.livelier(change), count) for change, count in of_die] for of_die in plan]
    kept = checkpoint or Checkpoint()
    known = list(kept.rows(THROWS))
    fit = (len(row) % len(of_die) == 0 for row, of_die in zip(known, plan, strict=False))
    kept.require(len(known) <= dice and all(fit))
    # With the changes that each die was thrown at.
    thrown: list[tuple[ThrownRandomDie, float]] = []
    dice_thrown = throw_random_dice(throws, seed, workers, known=known)
    for number, (of_die, thrown_die) in enumerate(zip(plan, dice_thrown, strict=True)):
        if number >= len(known):
            kept.add(THROWS, [flat_counts(thrown_die)])
        kept.require(all(len(one.counts) == len(one.die.poses.normals) for one in thrown_die))
        thrown += [(one, change) for one, (change, _) in zip(thrown_die, of_die, strict=True)]
        if on_die is not None:
            on_die(1)
    torch.set_num_threads(1)
    dice_to_fit = [
        training_die(one, change) for one, change in thrown if not _is_held_out(one.number)
    ]
    plain = plain_model(train(dice_to_fit, kept, steps=steps, seed=seed, on_step=on_loss))
    model = model_of(plain)
    fitted, held_out = (
        mean_deviations(
            [
                deviation(one, model)
                for one, change in thrown
                if _is_held_out(one.number) == out and change == 0.0
            ]
        )
        for out in (False, True)
    )
    unresolved = sum(one.unresolved for one, _ in thrown)
    return LearnedModel(plain, fitted, held_out, unresolved)


def _is_held_out(number: int) -> bool:
    return number % HELD_OUT == HELD_OUT - 1
