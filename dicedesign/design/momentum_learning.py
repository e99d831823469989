"""Fits the momentum model of a table to simulated throws of random dice, some of which it is only
judged by."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Any, Final

import torch

from dicedesign.design.momentum_training import plain_model, train
from dicedesign.design.random_throws import (
    Deviations,
    deviation,
    mean_deviations,
    throw_random_dice,
    training_die,
)
from dicedesign.errors import InputError
from dicedesign.throws.momentum import model_of
from dicedesign.throws.tables import Table

__all__ = ["LearnedModel", "check_learning", "drops_of_dice", "learn_momentum"]

HELD_OUT: Final = 8
"""One of so many dice is held out."""

HELD_OUT_DROPS: Final = 4
"""Drops of a die that is held out over those of one that is not: fewer would hide the model's own
error behind that of sampling."""


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
    for name, value, least in (
        ("dice", dice, HELD_OUT),
        ("drops", drops, 1),
        ("seed", seed, 0),
        ("steps", steps, 1),
    ):
        if value < least:
            raise InputError(
                f"{name}: expected a whole number of at least {least}, got {value}; raise it"
            )


def drops_of_dice(dice: int, drops: int) -> list[int]:
    """How often each die is thrown: every `HELD_OUT`-th, which is held out, more often."""
    return [drops * HELD_OUT_DROPS if _is_held_out(n) else drops for n in range(dice)]


def learn_momentum(
    table: Table,
    dice: int,
    drops: int,
    seed: int,
    steps: int,
    *,
    workers: Executor,
    on_die: Callable[[int], None] | None = None,
    on_loss: Callable[[float], None] | None = None,
) -> LearnedModel:
    """Throw random dice and fit the model to them.

    Training runs in this process, in one thread, so that the same numbers give the same model.

    Parameters
    ----------
    dice, drops, seed, steps: how many random dice, drops of each that the model is fitted to, the
        seed of everything random, and iterations of training at most.
    workers: throw dice side by side.
    on_die: called with 1 for each die that was thrown.
    on_loss: called with the loss at each evaluation in training.

    Raises InputError: as `check_learning` and `throw_random_die`.
    """
    check_learning(dice, drops, seed, steps)
    thrown = []
    for one in throw_random_dice(drops_of_dice(dice, drops), seed, table, workers):
        thrown.append(one)
        if on_die is not None:
            on_die(1)
    torch.set_num_threads(1)
    seen = [training_die(one) for one in thrown if not _is_held_out(one.number)]
    plain = plain_model(train(seen, steps=steps, seed=seed, on_step=on_loss))
    model = model_of(plain)
    fitted, held_out = (
        mean_deviations(
            [deviation(one, model) for one in thrown if _is_held_out(one.number) == out]
        )
        for out in (False, True)
    )
    return LearnedModel(plain, fitted, held_out, sum(one.unresolved for one in thrown))


def _is_held_out(number: int) -> bool:
    return number % HELD_OUT == HELD_OUT - 1
