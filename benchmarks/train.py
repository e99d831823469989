"""fit a table's momentum model to simulated throws of random dice

Throw random dice onto a table in the package's own simulator, fit the momentum model to all but
every tenth of them, from that of all tables on, and write the table with it. A quarter of the
throws is onto the table, the others onto tables near it or of its posterior, so that the model
knows what changes of the table do. Dice held out are thrown onto the table only, four times as
often, and only show how good the model is. With the defaults it takes some minutes on two cores.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
import torch

from benchmarks.frame import Report, processes
from benchmarks.training.fitting import (
    FINE_STEP,
    GENERAL,
    STEP,
    WIDEST,
    drawn_table,
    near_tables,
    new_model,
    plain_model,
    train,
)
from benchmarks.training.throws import (
    ThrownRandomDie,
    deviation,
    mean_deviations,
    throw_random_die,
    training_dice,
)
from dicedesign import InputError, Table, table_named
from dicedesign.runtime.files import json_text
from dicedesign.throws.momentum_model import (
    GeneralModel,
    MomentumModel,
    general_model,
    general_model_of,
)
from dicedesign.throws.tables import posterior_tables, table_entries

HELD_OUT: Final = 10
"""One of so many dice is held out."""

HELD_OUT_DROPS: Final = 4
"""Drops of such a die over those, on all tables, of others: fewer would hide the model's own error
behind that of sampling."""

TABLES: Final = 4
"""Tables that a die is thrown onto which is not held out."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """What is learned from how much."""
    parser.add_argument("table", metavar="TABLE", help="name of a table, or a .json file")
    parser.add_argument("--dice", type=int, metavar="N", help="random dice (600; quick: 20)")
    parser.add_argument("--drops", type=int, metavar="N", help="of each die (1000; quick: 100)")
    parser.add_argument("--epochs", type=int, metavar="N", help="of training (20; quick: 2)")
    parser.add_argument("--seed", type=int, default=0, metavar="S")
    parser.add_argument(
        "--all-tables",
        action="store_true",
        help="learn the model of all tables from nothing, half of the throws at random ones; it "
        "alone is written",
    )
    parser.add_argument("--to", type=Path, metavar="TABLE.json", help="default: its name, here")


def run(options: argparse.Namespace, report: Report) -> bool:
    """Throw, fit, write, and say how good the model is."""
    table = table_named(options.table)
    if table.drag > 0.0:
        raise InputError(
            f"table {table.name}: expected one without drag, on which dice have momentum, got a "
            f"drag of {table.drag:g}; its odds are those of `dicedesign rest`"
        )
    WIDEST.require(table, "take another")
    dice = options.dice or (20 if options.quick else 600)
    drops = options.drops or (100 if options.quick else 1000)
    tables = (table, *posterior_tables(options.table))
    throws = [throws_of(tables, options, number, drops) for number in range(dice)]
    with processes(options.jobs) as workers:
        seeds = [options.seed] * dice
        thrown = list(workers.map(throw_random_die, range(dice), seeds, throws))
    found = fit([one for k, one in enumerate(thrown) if not is_held_out(k)], tables, options)
    plain = plain_model(found)
    written = options.to or Path(f"{Path(options.table).stem}.json")
    of_table = {**table_entries(options.table), **table.as_dict(), "momentum": plain}
    written.write_text(json_text(plain if options.all_tables else of_table))
    model = MomentumModel.of(general_model_of(json.loads(json.dumps(plain))), table)
    row = report.table(
        "deviations",
        {"total variation to simulated throws": "35s", "dice": "5d", "geometric": "7.4f"}
        | {"worst": "7.3f", "momentum": "7.4f", "worst by it": "7.3f", "floor": "7.4f"},
    )
    for name, is_out in (("fitted to", False), ("held out", True)):
        chosen = [one[0] for k, one in enumerate(thrown) if is_held_out(k) == is_out]
        judged = [deviation(one, model) for one in chosen]
        row(name, *vars(mean_deviations(judged)).values())
    report.line(f"wrote {written}")
    return True


def is_held_out(number: int) -> bool:
    """Whether a die is only judged by."""
    return number % HELD_OUT == HELD_OUT - 1


def throws_of(
    tables: Sequence[Table], options: argparse.Namespace, number: int, drops: int
) -> list[tuple[Table, int]]:
    """Tables, and how often a die is thrown onto each: the first of those given and others near any
    of them, for a model of all tables the last one of all its range."""
    if is_held_out(number):
        return [(tables[0], drops * HELD_OUT_DROPS)]
    rng = np.random.default_rng([options.seed, number, 1])
    drawn = [tables[0]]
    for place in range(1, TABLES):
        one = tables[rng.integers(len(tables))]
        is_far = options.all_tables and place == TABLES - 1
        drawn.append(drawn_table(GENERAL if is_far else near_tables([one]), one, rng))
    return [(table, math.ceil(drops / TABLES)) for table in drawn]


def fit(
    thrown: Sequence[tuple[ThrownRandomDie, ...]],
    tables: Sequence[Table],
    options: argparse.Namespace,
) -> GeneralModel:
    """The model of the dice, in one thread, so that the same numbers give the same model."""
    torch.set_num_threads(1)
    dice = [die for one in thrown for die in training_dice(one)]
    if options.all_tables:
        start, step = new_model(dice, GENERAL, options.seed), STEP
    else:
        start, step = replace(general_model(), range=near_tables(tables)), FINE_STEP
    epochs = options.epochs or (2 if options.quick else 20)
    return train(dice, start, epochs=epochs, step=step, seed=options.seed)
