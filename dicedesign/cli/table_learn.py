"""`dicedesign table learn`: the momentum model of a table."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dicedesign.cli.options import add_worker_options, check_worker_options
from dicedesign.errors import InputError
from dicedesign.runtime.workers import open_workers

if TYPE_CHECKING:
    from dicedesign.learning.table_learning import LearnedModel
    from dicedesign.throws.tables import Table

__all__ = ["add_action"]


def add_action(actions: Any) -> None:
    """Add the action to the argparse `actions` of `dicedesign table`."""
    learn = actions.add_parser(
        "learn",
        help="fit a table's momentum model to simulated throws of random dice",
        description="Throw random dice onto a table in the package's own simulator, fit the "
        "momentum model to all but every eighth of them, and write the table with it. A third of "
        "the throws is onto the table, the others onto tables of a restitution a fifth lower and "
        "higher, so that the model knows what that does. Dice held out are thrown onto the table "
        "only, four times as often, and only show how good the model is. With the defaults it "
        "takes half an hour to an hour on two cores.",
    )
    learn.add_argument(
        "table",
        metavar="TABLE",
        help="name of a table that comes with the package, or a .json file",
    )
    learn.add_argument(
        "--dice", type=int, default=1000, metavar="N", help="random dice (default: 1000)"
    )
    learn.add_argument(
        "--drops",
        type=int,
        default=2000,
        metavar="N",
        help="of each die, on all tables (default: 2000)",
    )
    learn.add_argument("--seed", type=int, default=0, metavar="S", help="default: 0")
    learn.add_argument(
        "--steps",
        type=int,
        default=250,
        metavar="N",
        help="most iterations of training (default: 250)",
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
    from dicedesign.runtime.files import atomic_write, make_writable_folder
    from dicedesign.throws.tables import learned_on, table_named

    check_worker_options(options)
    check_learning(options.dice, options.drops, options.seed, options.steps)
    table = table_named(options.table)
    _require_momentum(table)
    out = _out(options)
    # Better known before the simulations than after.
    make_writable_folder(out.parent)
    losses = _Losses()
    with open_workers(options, "dice", options.dice, 0) as workers:
        found = learn_momentum(
            table,
            options.dice,
            options.drops,
            options.seed,
            options.steps,
            workers=workers.executor,
            on_die=workers.advance,
            on_loss=losses.tell,
        )
    losses.close()
    entries = {**table.as_dict(), "momentum": {"table": learned_on(table), **found.plain}}
    text = json.dumps(entries, indent=1, allow_nan=False)
    atomic_write(out, (text + "\n").encode())
    print(f"note: wrote {out}", file=sys.stderr)
    print("\n".join(_lines(found)))
    return 0


def _require_momentum(table: Table) -> None:
    if table.drag > 0.0:
        raise InputError(
            f"table {table.name}: expected one without drag, on which dice have momentum, got a "
            f"drag of {table.drag:g}; its odds are those of `dicedesign rest`"
        )


def _out(options: argparse.Namespace) -> Path:
    if options.out is None:
        return Path(f"{Path(options.table).stem}.json")
    given: Path = options.out
    if given.suffix != ".json":
        raise InputError(f"--out: expected a path that ends in .json, got {given}; rename it")
    return given


class _Losses:
    """A bar on stderr for training, from the first loss on."""

    def __init__(self) -> None:
        self._bar: Any = None

    def tell(self, loss: float) -> None:
        from tqdm import tqdm

        if self._bar is None:
            self._bar = tqdm(file=sys.stderr, disable=not sys.stderr.isatty(), unit=" evaluations")
        self._bar.set_postfix_str(f"loss {loss:.5f}", refresh=False)
        self._bar.update()

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()


def _lines(found: LearnedModel) -> list[str]:
    lines = [
        "total variation to simulated throws",
        f"{'':<12}  dice  {'geometric':>9}  {'worst':>6}  {'momentum':>8}  {'worst':>6}  "
        "noise floor",
    ]
    for name, part in (("fitted to", found.fitted), ("held out", found.held_out)):
        lines.append(
            f"{name:<12}  {part.dice:>4}  {part.geometric:>9.4f}  {part.worst_geometric:>6.3f}  "
            f"{part.momentum:>8.4f}  {part.worst_momentum:>6.3f}  {part.noise_floor:>11.4f}"
        )
    if found.unresolved:
        lines.append(f"{found.unresolved} drops came to no rest")
    return lines
