"""`dicedesign table learn`: the momentum model of a table."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dicedesign.cli.options import (
    add_worker_options,
    check_worker_options,
    checkpoint_beside,
    json_path,
    workers_of,
    write_table,
)
from dicedesign.errors import InputError
from dicedesign.runtime.files import make_writable_folder
from dicedesign.runtime.text_table import text_table
from dicedesign.runtime.workers import progress_bar

if TYPE_CHECKING:
    from tqdm import tqdm

    from dicedesign.learning.table_learning import LearnedModel
    from dicedesign.throws.tables import Table

__all__ = ["add_action"]


def add_action(actions: Any) -> None:
    """Add the action to the argparse `actions` of `dicedesign table`."""
    learn = actions.add_parser(
        "learn",
        help="fit a table's momentum model to simulated throws of random dice",
        description="Throw random dice onto a table in the package's own simulator, fit the "
        "momentum model to all but every tenth of them, from that of all tables on, and write the "
        "table with it. A quarter of the throws is onto the table, the others onto tables near it, "
        "so that the model knows what changes of the table do. Dice held out are thrown onto the "
        "table only, four times as often, and only show how good the model is. With the defaults "
        "it takes some minutes on two cores. What was done is kept beside the result until that is "
        "there: the same command goes on where an earlier one was interrupted or killed.",
    )
    learn.add_argument(
        "table",
        metavar="TABLE",
        help="name of a table that comes with the package, or a .json file",
    )
    learn.add_argument(
        "--dice", type=int, default=600, metavar="N", help="random dice (default: 600)"
    )
    learn.add_argument(
        "--drops",
        type=int,
        default=1000,
        metavar="N",
        help="of each die, on all tables (default: 1000)",
    )
    learn.add_argument("--seed", type=int, default=0, metavar="S", help="default: 0")
    learn.add_argument(
        "--epochs",
        type=int,
        default=20,
        metavar="N",
        help="how often training sees each die (default: 20)",
    )
    learn.add_argument(
        "--all-tables",
        action="store_true",
        help="learn the model of all tables from nothing, half of the throws at random ones; it "
        "alone is written",
    )
    add_worker_options(
        learn,
        "dice that are thrown at a time (default: one for each core, or each thread of the "
        "cluster); the result does not depend on it",
    )
    learn.add_argument(
        "--out",
        type=Path,
        metavar="TABLE.json",
        help="where to write the table, for --table elsewhere (default: its name with .json, here)",
    )
    learn.set_defaults(command=_learn)


def _learn(options: argparse.Namespace) -> int:
    # Imported here, as other commands do without.
    from dicedesign.learning.table_learning import check_learning, learn_momentum
    from dicedesign.throws.engines.engine import require_engine
    from dicedesign.throws.tables import posterior_tables, table_entries, table_named

    check_worker_options(options)
    require_engine("native")
    table, entries = table_named(options.table), table_entries(options.table)
    posterior = posterior_tables(options.table)
    _require_momentum(table)
    check_learning(table, options.dice, options.drops, options.seed, options.epochs)
    out = json_path(options.out or Path(f"{Path(options.table).stem}.json"))
    # Better known before the simulations than after.
    make_writable_folder(out.parent)
    bar: tqdm[Any] | None = None

    def on_epoch(loss: float) -> None:
        nonlocal bar
        if bar is None:
            # Not before the dice are thrown, which have a bar of their own.
            bar = progress_bar("epochs", options.epochs)
        bar.set_postfix_str(f"loss {loss:.5f}", refresh=False)
        bar.update()

    work = {
        "table": json.dumps([one.as_dict() for one in (table, *posterior)]),
        "number of dice": str(options.dice),
        "number of drops": str(options.drops),
        "seed": str(options.seed),
        "number of epochs": str(options.epochs),
        "kind of model": "of all tables" if options.all_tables else "of the table",
    }
    with (
        checkpoint_beside(out, work) as checkpoint,
        workers_of(options, "dice", options.dice) as workers,
    ):
        learned = learn_momentum(
            (table, *posterior),
            options.all_tables,
            options.dice,
            options.drops,
            options.seed,
            options.epochs,
            workers=workers.executor,
            checkpoint=checkpoint,
            on_die=workers.advance,
            on_epoch=on_epoch,
        )
        if bar is not None:
            bar.close()
        of_table = {**entries, **table.as_dict(), "momentum": learned.plain}
        write_table(out, learned.plain if options.all_tables else of_table)
    print("\n".join(_lines(learned)))
    return 0


def _require_momentum(table: Table) -> None:
    if table.drag > 0.0:
        raise InputError(
            f"table {table.name}: expected one without drag, on which dice have momentum, got a "
            f"drag of {table.drag:g}; its odds are those of `dicedesign rest`"
        )


def _lines(learned: LearnedModel) -> list[str]:
    columns = [("", ""), ("dice", "d"), ("geometric", ".4f"), ("worst", ".3f")]
    columns += [("momentum", ".4f"), ("worst", ".3f"), ("noise floor", ".4f")]
    rows = [
        [
            name,
            part.dice,
            part.geometric,
            part.worst_geometric,
            part.momentum,
            part.worst_momentum,
            part.noise_floor,
        ]
        for name, part in (("fitted to", learned.fitted), ("held out", learned.held_out))
    ]
    lines = ["total variation to simulated throws", *text_table(columns, rows)]
    if learned.unresolved:
        lines.append(f"{learned.unresolved} drops came to no rest")
    return lines
