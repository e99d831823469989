"""`dicedesign table`: tables of throw parameters."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from dicedesign.cli.options import (
    add_worker_options,
    check_worker_options,
    checkpoint_beside,
    json_path,
    print_json,
    workers_of,
    write_table,
)
from dicedesign.cli.tables import table_learn
from dicedesign.runtime.printable import printable
from dicedesign.runtime.text_table import text_table

if TYPE_CHECKING:
    from dicedesign.throws.counts.table_check import DieCheck
    from dicedesign.throws.counts.table_fit import TableFit

__all__ = ["add_parser"]

UNITS: Final = {"height": "m", "speed": "m/s", "spin": "rad/s"}
"""Of the parameters that have one."""

CHECKED: Final = 20
"""Fresh drops for the verdict, for each drop of an evaluation."""

LEVEL: Final = 0.05
"""p-value up to which a die rejects a table."""

VAGUE: Final = 0.75
"""Part of the search's range from which on an interval says that the counts do not tell."""


def add_parser(commands: Any) -> None:
    """Add the subcommand and its own subcommands to argparse's `commands`."""
    parser = commands.add_parser(
        "table",
        help="fit a table's throw parameters or its momentum model",
        description="Tables of throw parameters.",
    )
    actions = parser.add_subparsers(title="actions", required=True, metavar="ACTION")
    fit = actions.add_parser(
        "fit",
        help="fit throw parameters to counts of real dice",
        description="Fit one set of restitution, friction, drop height, speed and spin to what "
        "came up with several real dice, and test each die against it with fresh drops. With "
        "--out, what was simulated is kept beside the table until that is there: the same command "
        "goes on where an earlier one was interrupted or killed.",
    )
    fit.add_argument(
        "--throws",
        type=Path,
        required=True,
        metavar="CSV",
        help="a line for each outcome: columns die, mesh (a file, or a folder that `dicedesign "
        "run` left, as seen from the CSV), outcome and throws; for mesh files also geometric, the "
        "outcome's odds without momentum; perhaps com (x y z) and size_mm (else 25)",
    )
    fit.add_argument(
        "--dice", metavar="NAME,...", help="fit to these dice of the file (default: to all)"
    )
    fit.add_argument(
        "--evaluations",
        type=int,
        default=256,
        metavar="N",
        help="sets of parameters that are simulated (default: 256)",
    )
    fit.add_argument(
        "--drops",
        type=int,
        default=2000,
        metavar="N",
        help=f"of each die for each set; {CHECKED} times as many test the fit (default: 2000)",
    )
    fit.add_argument("--seed", type=int, default=0, metavar="S", help="default: 0")
    add_worker_options(
        fit,
        "how many simulations at a time (default: one for each core, or each thread of the "
        "cluster); the result does not depend on it",
    )
    fit.add_argument(
        "--out", type=Path, metavar="TABLE.json", help="write the table, for --table elsewhere"
    )
    fit.add_argument("--json", action="store_true", help="print JSON instead of a table")
    fit.set_defaults(command=_fit)
    table_learn.add_action(actions)


def _fit(options: argparse.Namespace) -> int:
    # Imported here, as other commands do without.
    from dicedesign.runtime.files import make_writable_folder
    from dicedesign.throws.counts.table_check import check_table
    from dicedesign.throws.counts.table_fit import check_effort, fit_table
    from dicedesign.throws.counts.throw_counts import read_throw_counts, throws_digest
    from dicedesign.throws.engines.engine import require_engine
    from dicedesign.throws.tables import Table

    check_worker_options(options)
    require_engine("native")
    check_effort(options.evaluations, options.drops, options.seed)
    out = None if options.out is None else json_path(options.out)
    wanted = options.dice and [name.strip() for name in options.dice.split(",")]
    dice = read_throw_counts(options.throws, wanted)
    if out is not None:
        # Better known before the simulations than after.
        make_writable_folder(out.parent)
    source = "fitted to " + ", ".join(f"{die.counts.sum()} throws of {die.name}" for die in dice)
    name = "fitted" if out is None else printable(out.stem)
    start = Table(name, 0.5, 0.3, 0.5, 0.0, 0.0, source=source)
    total = (options.evaluations + CHECKED) * options.drops * len(dice)
    work = {
        "set of throws": throws_digest(dice),
        "number of evaluations": str(options.evaluations),
        "number of drops": str(options.drops),
        "seed": str(options.seed),
    }
    with (
        checkpoint_beside(out, work) as checkpoint,
        workers_of(options, "drops", total) as workers,
    ):
        fit = fit_table(
            dice,
            start,
            options.evaluations,
            options.drops,
            options.seed,
            workers=workers.executor,
            checkpoint=checkpoint,
            progress=workers.advance,
        )
        # A seed that no evaluation had.
        checks = check_table(
            dice,
            fit.table,
            CHECKED * options.drops,
            options.seed,
            workers=workers.executor,
            progress=workers.advance,
        )
        if out is not None:
            write_table(out, fit.table.as_dict())
    if options.json:
        print_json(_plain(fit, checks))
    else:
        print("\n".join([*_parameters(fit), "", *_dice(checks), "", *_sentences(fit, checks)]))
    return 0


def _parameters(fit: TableFit) -> list[str]:
    columns = [("parameter", ""), ("fitted", ".3g"), ("", ""), ("mean", ".3g"), ("+-", ".2g")]
    rows = [
        [
            name,
            entry.fitted,
            UNITS.get(name, ""),
            entry.mean,
            entry.deviation,
            *(f"{low:.3g} to {high:.3g}" for low, high in (entry.interval, entry.limits)),
        ]
        for name, entry in fit.parameters.items()
    ]
    correlations = [
        [name, *(row + 0.0)] for name, row in zip(fit.parameters, fit.correlations, strict=True)
    ]
    return [
        *text_table([*columns, ("90 % within", ">"), ("searched", ">")], rows),
        "",
        *text_table(
            [("correlations", ""), *((name, ".2f") for name in fit.parameters)], correlations
        ),
    ]


def _dice(checks: Sequence[DieCheck]) -> list[str]:
    columns = [("die", ""), ("throws", "d"), ("degrees", "d"), ("chi2 fitted", ".2f"), ("p", ".2g")]
    rows = [
        [
            check.die.name,
            check.die.counts.sum(),
            check.chi_square.degrees,
            check.chi_square.statistic,
            check.chi_square.p_value,
            check.exact.p_value,
            check.geometric.statistic,
            check.geometric.p_value,
        ]
        for check in checks
    ]
    lines = text_table(
        [*columns, ("exact p", ".2g"), ("chi2 geometric", ".2f"), ("p", ".2g")], rows
    )
    columns = [("outcome", ""), ("throws", "d"), ("fitted", ".1f"), ("geometric", ".1f")]
    for check in checks:
        die, throws = check.die, check.die.counts.sum()
        outcomes = zip(
            die.labels, die.counts, throws * check.odds, throws * die.geometric, strict=True
        )
        lines += ["", f"{die.name}", *text_table(columns, outcomes)]
    return lines


def _sentences(fit: TableFit, checks: Sequence[DieCheck]) -> list[str]:
    drops = CHECKED * fit.drops
    rejecting = [c.die.name for c in checks if c.chi_square.p_value <= LEVEL]
    verdict = "no die rejects" if not rejecting else ", ".join(rejecting) + " rejects"
    lines = [
        f"{fit.evaluations} sets of parameters, {fit.drops} drops of each die for each; "
        f"log likelihood {fit.log_likelihood:.2f}, of odds equal to all frequencies 0",
        f"the surrogate's predictions were {fit.surprise:.2f} of its standard deviations off",
        f"with {drops} fresh drops {verdict} the fitted set at the level {LEVEL:g}",
    ]
    vague = [
        name
        for name, entry in fit.parameters.items()
        if entry.interval[1] - entry.interval[0] >= VAGUE * (entry.limits[1] - entry.limits[0])
    ]
    if vague:
        lines.append(f"these throws hardly tell: {', '.join(vague)}")
    unresolved = {c.die.name: c.unresolved for c in checks if c.unresolved}
    lines += [f"{name}: {count} fresh drops came to no rest" for name, count in unresolved.items()]
    return lines


def _plain(fit: TableFit, checks: Sequence[DieCheck]) -> dict[str, Any]:
    """The answer as plain data."""
    return {
        "table": fit.table.as_dict(),
        "parameters": {
            name: {
                "fitted": entry.fitted,
                "mean": entry.mean,
                "standard_deviation": entry.deviation,
                "interval": list(entry.interval),
                "searched": list(entry.limits),
            }
            for name, entry in fit.parameters.items()
        },
        "correlations": fit.correlations.tolist(),
        "evaluations": fit.evaluations,
        "drops": fit.drops,
        "log_likelihood": fit.log_likelihood,
        "surprise": fit.surprise,
        "effective_points": fit.effective_points,
        "dice": [_plain_check(check) for check in checks],
    }


def _plain_check(check: DieCheck) -> dict[str, Any]:
    die = check.die
    return {
        "die": die.name,
        "outcomes": list(die.labels),
        "throws": die.counts.tolist(),
        "geometric_odds": die.geometric.tolist(),
        "simulated": check.simulated.tolist(),
        "unresolved": check.unresolved,
        "degrees": check.chi_square.degrees,
        "chi_square": check.chi_square.statistic,
        "p_value": check.chi_square.p_value,
        "exact_p_value": check.exact.p_value,
        "geometric_chi_square": check.geometric.statistic,
        "geometric_p_value": check.geometric.p_value,
    }
