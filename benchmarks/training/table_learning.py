"""Fits the momentum model of a table, or of all tables, to simulated throws of random dice, some of
which it is only judged by."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import torch

from benchmarks.training.momentum_training import FINE_STEP, STEP, TrainingDie, new_model, train
from benchmarks.training.random_throws import (
    Deviations,
    ThrownRandomDie,
    deviation,
    flat_counts,
    mean_deviations,
    throw_random_dice,
    training_dice,
)
from dicedesign.runtime.checkpoint import Checkpoint
from dicedesign.runtime.checks import MOST_SEED, check_whole
from dicedesign.throws.momentum_model import (
    MomentumModel,
    general_model,
    general_model_of,
    plain_model,
)
from dicedesign.throws.table_terms import GENERAL, WIDEST, TableRange
from dicedesign.throws.tables import Table

__all__ = ["LearnedModel", "check_learning", "learn_momentum", "throws_of_die"]

HELD_OUT: Final = 10
"""One of so many dice is held out."""

HELD_OUT_DROPS: Final = 4
"""Drops of a die that is held out over those, on all tables, of one that is not: fewer would hide
the model's own error behind that of sampling."""

TABLES: Final = 4
"""Tables that a die is thrown onto which is not held out."""

THROWS: Final = "throws"
"""Rows of a checkpoint: what came up with each die, as of `flat_counts`."""


@dataclass(frozen=True)
class LearnedModel:
    """A momentum model and how good it is on the table.

    Attributes
    ----------
    plain: the model as a file has it.
    fitted, held_out: over the dice that it was fitted to, and over the others.
    unresolved: drops that came to no rest.
    """

    plain: dict[str, Any]
    fitted: Deviations
    held_out: Deviations
    unresolved: int


def check_learning(table: Table, dice: int, drops: int, seed: int, epochs: int) -> None:
    """Raise InputError for fewer than `HELD_OUT` dice, less than a drop for each table, no epoch, a
    seed below 0, or a table of which there can be no model."""
    check_whole("dice", dice, HELD_OUT)
    check_whole("drops", drops, TABLES)
    check_whole("seed", seed, least=0, most=MOST_SEED)
    check_whole("epochs", epochs)
    WIDEST.require(table, "take another")


def throws_of_die(
    tables: tuple[Table, ...], is_general: bool, number: int, drops: int, seed: int
) -> list[tuple[Table, int]]:
    """Tables, and how often a die is thrown onto each: the first one of those given, and others
    near any of them, for a general model the last one of all its range. Every `HELD_OUT`-th die is
    held out: it is thrown onto the first table alone, and more often."""
    if _is_held_out(number):
        return [(tables[0], drops * HELD_OUT_DROPS)]
    rng = np.random.default_rng([seed, number, 1])
    drawn = [tables[0]]
    for place in range(1, TABLES):
        one = tables[rng.integers(len(tables))]
        is_far = is_general and place == TABLES - 1
        drawn.append((GENERAL if is_far else TableRange.around([one])).drawn(one, rng))
    return [(table, math.ceil(drops / TABLES)) for table in drawn]


def learn_momentum(
    tables: tuple[Table, ...],
    is_general: bool,
    dice: int,
    drops: int,
    seed: int,
    epochs: int,
    *,
    workers: Executor,
    checkpoint: Checkpoint | None = None,
    on_die: Callable[[int], None] | None = None,
    on_epoch: Callable[[float], None] | None = None,
) -> LearnedModel:
    """Throw random dice and fit the model to them, from that of all tables on.

    Training runs in this process, in one thread, so that the same numbers give the same model.

    Parameters
    ----------
    tables: the one that the model is for, and what it may be instead.
    is_general: whether the model is one of all tables, learned from nothing.
    dice, drops, seed, epochs: how many random dice, drops of each that the model is fitted to, on
        `TABLES` tables together, the seed of everything random, and how often training sees each.
    workers: throw dice side by side.
    checkpoint: of the same tables, dice, drops, seed and epochs; dice that were thrown and epochs
        that were made before are taken from it, and others are added.
    on_die: called with 1 for each die that was thrown.
    on_epoch: called with the loss over each epoch of training.

    Raises InputError: as `check_learning` and `throw_random_die`.
    """
    check_learning(tables[0], dice, drops, seed, epochs)
    throws = [throws_of_die(tables, is_general, number, drops, seed) for number in range(dice)]
    kept = checkpoint or Checkpoint()
    known = list(kept.rows(THROWS))
    fit = (len(row) % len(of_die) == 0 for row, of_die in zip(known, throws, strict=False))
    kept.require(len(known) <= dice and all(fit))
    thrown: list[tuple[ThrownRandomDie, ...]] = []
    for number, of_die in enumerate(throw_random_dice(throws, seed, workers, known=known)):
        if number >= len(known):
            kept.add(THROWS, [flat_counts(of_die)])
        kept.require(all(len(one.counts) == len(one.die.poses.normals) for one in of_die))
        thrown.append(of_die)
        if on_die is not None:
            on_die(1)
    torch.set_num_threads(1)
    to_fit: list[TrainingDie] = []
    for number, (of_die, onto) in enumerate(zip(thrown, throws, strict=True)):
        if not _is_held_out(number):
            to_fit += training_dice(of_die, [table for table, _ in onto])
    if is_general:
        start, step = new_model(to_fit, GENERAL, seed), STEP
    else:
        start, step = replace(general_model(), range=TableRange.around(tables)), FINE_STEP
    found = train(to_fit, start, kept, epochs=epochs, step=step, seed=seed, on_epoch=on_epoch)
    plain = plain_model(found)
    model = MomentumModel.of(general_model_of(plain), tables[0])
    fitted, held_out = (
        mean_deviations(
            [
                deviation(of_die[0], model)
                for number, of_die in enumerate(thrown)
                if _is_held_out(number) == out
            ]
        )
        for out in (False, True)
    )
    unresolved = sum(one.unresolved for of_die in thrown for one in of_die)
    return LearnedModel(plain, fitted, held_out, unresolved)


def _is_held_out(number: int) -> bool:
    return number % HELD_OUT == HELD_OUT - 1
