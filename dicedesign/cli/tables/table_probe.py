"""`dicedesign table probe`: how many throws of a die tell how much about a table."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from dicedesign.cli.options import print_json
from dicedesign.runtime.checks import MOST_SEED, check_whole
from dicedesign.runtime.text import printable, text_table

if TYPE_CHECKING:
    from dicedesign.throws.table_information import Errors, TableInformation

__all__ = ["add_action"]

THROWS: Final = (50, 100, 200, 300, 500, 1000, 2000)
"""Of a real die, for which errors are told."""

LEAST: Final = 2_000
"""Fewest simulated throws that tell anything."""


def add_action(actions: Any) -> None:
    """Add the action to argparse's `actions`."""
    probe = actions.add_parser(
        "probe",
        help="how many throws of a die tell how much about a table",
        description="Say how well so many throws of a die determine restitution and friction of a "
        "table, whoever throws it, and what to do. The die of recipes/probe.yaml is designed to "
        "tell much; any other may be asked about.",
    )
    probe.add_argument("die", type=Path, metavar="FOLDER", help="folder that `dicedesign run` left")
    probe.add_argument(
        "--table",
        default="board-game",
        metavar="NAME|FILE.json",
        help="that yours is thought to be like (default: board-game)",
    )
    probe.add_argument(
        "--drops",
        type=int,
        default=200_000,
        metavar="N",
        help="simulated throws that tell (default: 200000)",
    )
    probe.add_argument("--seed", type=int, default=0, metavar="S", help="default: 0")
    probe.add_argument("--json", action="store_true", help="print JSON instead of a table")
    probe.set_defaults(command=_probe)


def _probe(options: argparse.Namespace) -> int:
    # Imported here, as other commands do without.
    from dicedesign.runtime.workers import progress_bar
    from dicedesign.throws.engines import require_engine
    from dicedesign.throws.table_information import table_information
    from dicedesign.throws.tables import table_named
    from dicedesign.throws.throw_counts import uncounted_die

    check_whole("--drops", options.drops, least=LEAST)
    check_whole("--seed", options.seed, least=0, most=MOST_SEED)
    require_engine("native")
    table = table_named(options.table)
    die, _ = uncounted_die(options.die)
    with progress_bar("drops", options.drops) as bar:
        found = table_information(
            die.body,
            die.group_of_rest,
            table.sized(die.size),
            options.drops,
            options.seed,
            bar.update,
        )
    if options.json:
        rows = [{"throws": throws, **_plain(found.errors(throws))} for throws in THROWS]
        print_json({"table": table.as_dict(), "drops": options.drops, "errors": rows})
    else:
        print(_guide(options.die, table.name, found))
    return 0


def _plain(errors: Errors) -> dict[str, float | None]:
    return {name: x if math.isfinite(x) else None for name, x in vars(errors).items()}


def _guide(folder: Path, table: str, found: TableInformation) -> str:
    where = printable(folder)
    rows = []
    for throws in THROWS:
        left = found.errors(throws)
        restitution = _cell(left.restitution, left.restitution_error)
        rows.append((throws, restitution, _cell(left.friction, left.friction_error)))
    return "\n".join(
        [
            f"Print {where}/die.stl as it is, throw it onto your table as you always do, and type "
            "what comes up:",
            f"  dicedesign rolls {where} --log rolls.csv",
            "Then fit your table to it, with other dice of yours if you have thrown any:",
            f"  dicedesign table fit --rolls {where} rolls.csv --out my_table.json",
            "",
            f"Standard errors, of a table like {table} and a hand of which little is known (± what "
            "the simulation leaves open):",
            *text_table([("throws", "d"), ("restitution", ">"), ("friction", ">")], rows),
        ]
    )


def _cell(error: float, own: float) -> str:
    if not math.isfinite(error):
        return "-"
    return f"{error:.3f} ± {own:.3f}" if math.isfinite(own) else f"{error:.3f}"
