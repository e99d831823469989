"""`dicedesign table fit`: a table's throw parameters from counts of real dice."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from dicedesign.cli.options import (
    add_json_option,
    add_value,
    add_worker_options,
    check_worker_options,
    checkpoint_beside,
    json_path,
    print_json,
    workers_of,
    write_table,
)
from dicedesign.errors import InputError
from dicedesign.runtime.text import printable

if TYPE_CHECKING:
    from dicedesign.throws.throw_counts import CountedDie

CHECKED: Final = 1 / 12
"""Fresh drops of each die at the fitted table, as a part of those of all evaluations."""


def add_parser(commands: Any) -> None:
    """Add `dicedesign table` and its actions to argparse's `commands`."""
    parser = commands.add_parser(
        "table",
        help="fit a table's throw parameters",
        description="Tables of throw parameters.",
    )
    actions = parser.add_subparsers(title="actions", required=True, metavar="ACTION")
    fit = actions.add_parser(
        "fit",
        help="fit throw parameters to counts of real dice",
        description="Fit restitution, friction and the center of all hands (drop height, speed and "
        "spin) to what came up with several real dice, each thrown in a session with a hand of its "
        "own about that center. Each die is then predicted from the others, and tested against the "
        "fitted table with fresh drops. The table's file has 32 equally likely tables beside the "
        "fitted one. With --out, what was simulated is kept beside the table until that is there: "
        "the same command goes on where an earlier one was interrupted or killed. The exit code is "
        "1 where no table explains the counts of a die.",
    )
    add_value(
        fit,
        "--throws",
        "CSV",
        "a line for each outcome: columns die, mesh (a file, or a folder that `dicedesign "
        "run` left, as seen from the CSV), outcome and throws; for mesh files also geometric, the "
        "outcome's odds without momentum; perhaps com (x y z) and size_mm (else 15 to 35)",
        Path,
    )
    fit.add_argument(
        "--rolls",
        type=Path,
        nargs=2,
        action="append",
        default=[],
        metavar=("FOLDER", "ROLLS.csv"),
        help="a die of a folder that `dicedesign run` left, and its throws, a file as of "
        "`dicedesign rolls`; with or without --throws, and for several dice",
    )
    add_value(fit, "--dice", "NAME,...", "fit to these dice of the file (default: to all)")
    add_value(fit, "--check", "NAME,...", "predict these dice of the file, without fitting to them")
    add_value(
        fit,
        "--die",
        "FOLDER",
        "say what the fitted table does to this die, of a folder that `dicedesign run` left, "
        "and what more throws of it would tell",
        Path,
    )
    add_value(
        fit, "--evaluations", "N", "sets of parameters that are simulated (default: 256)", int, 256
    )
    add_value(
        fit,
        "--drops",
        "N",
        "of each die for each set; a twelfth of all as many again test the fit (default: 2000)",
        int,
        2000,
    )
    add_value(fit, "--seed", "S", "default: 0", int, 0)
    add_worker_options(
        fit,
        "how many simulations at a time (default: one for each core, or each thread of the "
        "cluster); the result does not depend on it",
    )
    add_value(fit, "--out", "TABLE.json", "write the table, for --table elsewhere", Path)
    add_json_option(fit)
    fit.set_defaults(command=_fit)


def _fit(options: argparse.Namespace) -> int:
    # Imported here, as other commands do without.
    from dicedesign.cli.fit_report import DieAtHand, fit_lines, plain_fit, unexplained
    from dicedesign.runtime.files import make_writable_folder
    from dicedesign.throws.engines import require_engine
    from dicedesign.throws.simulation import simulate
    from dicedesign.throws.table_fit import check_effort, check_table, fit_table
    from dicedesign.throws.tables import Table, posterior_entries
    from dicedesign.throws.throw_counts import rolled_die, throws_digest, uncounted_die

    check_worker_options(options)
    require_engine("native")
    check_effort(options.evaluations, options.drops, options.seed)
    out = None if options.out is None else json_path(options.out)
    checked = _names(options.check) or []
    wanted = _names(options.dice)
    if options.throws is None and not options.rolls:
        raise InputError("table fit: expected --throws or --rolls, got neither; add one of them")
    dice, others = _dice(options.throws, wanted, checked)
    dice = (*dice, *(rolled_die(folder, rolls) for folder, rolls in options.rolls))
    twice = {die.name for die in dice} & set(checked)
    if twice or not dice:
        raise InputError(
            "--check: expected dice that are not fitted to, and some that are, got "
            f"{', '.join(checked)}; name other dice"
        )
    designed = None if options.die is None else uncounted_die(options.die)
    counted = (*dice, *others)
    if designed is not None:
        others = (*others, designed[0])
    if out is not None:
        # Better known before the simulations than after.
        make_writable_folder(out.parent)
    source = "fitted to " + ", ".join(f"{die.counts.sum()} throws of {die.name}" for die in dice)
    name = "fitted" if out is None else printable(out.stem)
    start = Table(name, 0.0, 0.0, 0.0, 0.0, 0.0, source=source)
    fresh = max(1, round(CHECKED * options.evaluations * options.drops))
    total = (options.evaluations * options.drops + fresh) * (len(dice) + len(others))
    work = {
        "set of throws": throws_digest(dice),
        "set of other dice": throws_digest(others),
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
            others=others,
            workers=workers.executor,
            checkpoint=checkpoint,
            progress=workers.advance,
        )
        # A seed that no evaluation had.
        checks = check_table(
            counted,
            fit.table,
            fresh,
            options.seed,
            workers=workers.executor,
            progress=workers.advance,
        )
        at_hand = None
        if designed is not None:
            die, target = designed
            throws = simulate(
                die.body,
                fit.table.lifted(die.size),
                fresh,
                options.seed,
                workers=workers.executor,
                progress=workers.advance,
            )
            at_hand = DieAtHand(fit.dice[-1], die.by_outcome(throws.counts), target)
        if out is not None:
            posterior = posterior_entries(fit.posterior)
            write_table(out, {**fit.table.as_dict(), "posterior": posterior})
    if options.json:
        print_json(plain_fit(fit, checks, at_hand))
    else:
        print("\n".join(fit_lines(fit, checks, at_hand)))
    return 1 if unexplained(fit) else 0


def _dice(
    throws: Path | None, wanted: list[str] | None, checked: list[str]
) -> tuple[tuple[CountedDie, ...], tuple[CountedDie, ...]]:
    """The dice of a file that are fitted to, and those that are predicted."""
    from dicedesign.throws.throw_counts import read_throw_counts

    if throws is None:
        if wanted is not None or checked:
            raise InputError(
                "--dice, --check: expected a file that has these dice, got none; add --throws"
            )
        return (), ()
    dice = read_throw_counts(throws, wanted)
    if wanted is None:
        dice = tuple(die for die in dice if die.name not in checked)
    return dice, read_throw_counts(throws, checked) if checked else ()


def _names(text: str | None) -> list[str] | None:
    return None if text is None else [name.strip() for name in text.split(",")]
