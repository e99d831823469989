"""`dicedesign table`: tables of throw parameters."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from dicedesign.cli import table_learn
from dicedesign.cli.options import add_worker_options, check_worker_options
from dicedesign.errors import InputError
from dicedesign.runtime.workers import open_workers

if TYPE_CHECKING:
    from dicedesign.throws.counts.table_check import DieCheck
    from dicedesign.throws.counts.table_fit import TableFit
    from dicedesign.throws.tables import Table

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
        "came up with several real dice, and test each die against it with fresh drops.",
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
    from dicedesign.throws.counts.throw_counts import read_throw_counts
    from dicedesign.throws.tables import Table

    check_worker_options(options)
    check_effort(options.evaluations, options.drops, options.seed)
    if options.out is not None and options.out.suffix != ".json":
        raise InputError(f"--out: expected a path that ends in .json, got {options.out}; rename it")
    wanted = options.dice and [name.strip() for name in options.dice.split(",")]
    dice = read_throw_counts(options.throws, wanted)
    if options.out is not None:
        # Better known before the simulations than after.
        make_writable_folder(options.out.parent)
    source = "fitted to " + ", ".join(f"{die.counts.sum()} throws of {die.name}" for die in dice)
    name = "fitted" if options.out is None else options.out.stem
    start = Table(name, 0.5, 0.3, 0.5, 0.0, 0.0, source=source)
    total = (options.evaluations + CHECKED) * options.drops * len(dice)
    with open_workers(options, "drops", total, 0) as workers:
        fit = fit_table(
            dice,
            start,
            options.evaluations,
            options.drops,
            options.seed,
            workers=workers.executor,
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
    if options.out is not None:
        _write(fit.table, options.out)
    if options.json:
        print(json.dumps(_plain(fit, checks), indent=1, allow_nan=False))
    else:
        print("\n".join([*_parameters(fit), "", *_dice(checks), "", *_sentences(fit, checks)]))
    return 0


def _write(table: Table, path: Path) -> None:
    from dicedesign.runtime.files import atomic_write

    atomic_write(path, (json.dumps(table.as_dict(), indent=1, allow_nan=False) + "\n").encode())
    print(f"note: wrote {path}", file=sys.stderr)


def _parameters(fit: TableFit) -> list[str]:
    lines = ["parameter        fitted    mean      +-      90 % within      searched"]
    for name, entry in fit.parameters.items():
        within, searched = (f"{a:.3g} to {b:.3g}" for a, b in (entry.interval, entry.limits))
        lines.append(
            f"{name:<12} {entry.fitted:>7.3g} {UNITS.get(name, ''):<5} {entry.mean:>6.3g}  "
            f"{entry.deviation:>6.2g}  {within:>15}  {searched:>12}"
        )
    lines += ["", "correlations   " + "".join(f"{name:>13}" for name in fit.parameters)]
    for name, row in zip(fit.parameters, fit.correlations, strict=True):
        lines.append(f"{name:<15}" + "".join(f"{value:13.2f}" for value in row + 0.0))
    return lines


def _dice(checks: Sequence[DieCheck]) -> list[str]:
    width = max(3, *(len(check.die.name) for check in checks))
    lines = [f"{'die':<{width}}  throws  degrees  chi2 fitted  p     exact p  chi2 geometric  p"]
    for check in checks:
        fitted, geometric = check.chi_square, check.geometric
        lines.append(
            f"{check.die.name:<{width}}  {check.die.counts.sum():>6}  {fitted.degrees:>7}  "
            f"{fitted.statistic:>11.2f}  {fitted.p_value:<5.2g} {check.exact.p_value:<7.2g}  "
            f"{geometric.statistic:>14.2f}  {geometric.p_value:.2g}"
        )
    for check in checks:
        die = check.die
        kind = max(len("outcome"), *map(len, die.labels))
        lines += ["", f"{die.name}", f"{'outcome':<{kind}}  throws  fitted  geometric"]
        rows = zip(
            die.labels,
            die.counts,
            die.counts.sum() * check.odds,
            die.counts.sum() * die.geometric,
            strict=True,
        )
        lines += [f"{a:<{kind}}  {b:>6}  {c:>6.1f}  {d:>9.1f}" for a, b, c, d in rows]
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
