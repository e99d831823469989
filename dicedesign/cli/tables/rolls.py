"""`dicedesign rolls`: what the user's own throws of a die say about its odds."""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from dicedesign.cli.options import percent_interval, print_json, read_poses
from dicedesign.errors import InputError
from dicedesign.runtime.text import printable, text_table

if TYPE_CHECKING:
    from dicedesign.throws.roll_verdict import RollVerdict

__all__ = ["add_parser", "rolls_summary"]

LEAST_CONFIDENCE: Final = 0.5


@dataclass(frozen=True)
class _Die:
    """labels: k; odds: (k,) that it should have, positive; source: of the odds, in words."""

    labels: list[str]
    odds: list[float]
    source: str


def add_parser(commands: Any) -> None:
    """Add the subcommand to argparse's `commands`."""
    parser = commands.add_parser(
        "rolls",
        help="judge your own throws of a die",
        description="Compare counts of throws with the odds that a die should have: exact "
        "intervals, a test, the total variation, and how many more throws would settle it. With "
        "--log type what comes up, one label or several on a line; every line is saved as it ends. "
        "`undo` takes the last throw back, an empty line shows the table so far, and `done`, "
        "Ctrl-D or Ctrl-C ends.",
    )
    parser.add_argument(
        "die",
        type=Path,
        metavar="DIE",
        help="folder that `dicedesign run` left, whose target is tested; or a mesh, whose labels "
        "are the numbers that `dicedesign rest` gives its rests, and whose geometric odds are "
        "tested",
    )
    throws = parser.add_mutually_exclusive_group(required=True)
    throws.add_argument(
        "counts",
        type=Path,
        nargs="?",
        metavar="COUNTS.csv",
        help="columns label,count; or the column label alone, with one throw on each line",
    )
    throws.add_argument(
        "--log",
        type=Path,
        metavar="ROLLS.csv",
        help="type in throws as they come, and write them here, one on each line; those that are "
        "there already are gone on from",
    )
    parser.add_argument(
        "--confidence",
        type=float,
        default=0.95,
        metavar="C",
        help="of intervals; the test's level is 1 - C (default: 0.95)",
    )
    parser.add_argument(
        "--figure", type=Path, metavar="FILE.png", help="draw the frequencies beside the odds"
    )
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.set_defaults(command=_rolls)


def _rolls(options: argparse.Namespace) -> int:
    # Imported here, as other commands do without.
    from dicedesign.cli.tables.roll_logging import log_rolls
    from dicedesign.throws.roll_log import RollLog, read_counts
    from dicedesign.throws.roll_verdict import judge_rolls

    if not LEAST_CONFIDENCE <= options.confidence < 1.0:
        raise InputError(
            f"--confidence: expected at least {LEAST_CONFIDENCE:g} and less than 1, got "
            f"{options.confidence:g}; 0.95 is usual"
        )
    die = _finished(options.die) if os.path.isdir(options.die) else _mesh(options.die)
    if len(die.labels) < 2:
        raise InputError(
            f"{options.die}: expected a die with at least 2 outcomes, got {len(die.labels)}; "
            "there is nothing to test"
        )
    judge = partial(judge_rolls, odds=die.odds, confidence=options.confidence)
    if options.log is None:
        counts = read_counts(options.counts, die.labels)
    else:
        log = RollLog(options.log, die.labels)
        log_rolls(log, judge, partial(_text, die.labels))
        counts = log.counts
        if not counts.any():
            print('{"throws": 0}' if options.json else "no throws, nothing to judge")
            return 0
    verdict = judge(counts)
    if options.figure is not None:
        _draw(die.labels, verdict, options.figure)
    if options.json:
        summary = {"odds_source": die.source, **rolls_summary(die.labels, verdict)}
        print_json(summary)
    else:
        print(f"{printable(options.die)}: {verdict.throws} throws, tested for the {die.source}\n")
        print(_text(die.labels, verdict))
    return 0


def _finished(folder: Path) -> _Die:
    """The labels and the target of a die that was designed here."""
    from dicedesign.results.folder import read_result

    die = read_result(folder)
    if not die.converged:
        print(
            f"note: {printable(folder)}: this die does not meet its target ({die.status})",
            file=sys.stderr,
        )
    return _Die(list(die.labels), list(die.target), "target of its design")


def _mesh(path: Path) -> _Die:
    """The numbers of a mesh's rests, and their odds without momentum."""
    _, poses = read_poses(path)
    numbers = [str(i + 1) for i in range(len(poses.probabilities))]
    return _Die(numbers, poses.probabilities.tolist(), "geometric odds of its rests")


def _draw(labels: list[str], verdict: RollVerdict, path: Path) -> None:
    from dicedesign.report.charts.chart import sheet
    from dicedesign.report.charts.rolls import rolls_chart
    from dicedesign.runtime.files import atomic_write

    atomic_write(path, sheet([rolls_chart(labels, verdict)]).png())


def rolls_summary(labels: list[str], verdict: RollVerdict) -> dict[str, Any]:
    """The answer as plain data."""
    return {
        "throws": verdict.throws,
        "confidence": verdict.confidence,
        "outcomes": [
            {
                "label": label,
                "count": int(verdict.counts[i]),
                "frequency": float(verdict.frequencies[i]),
                "interval": verdict.intervals[i].tolist(),
                "odds": float(verdict.odds[i]),
                "posterior_mean": float(verdict.posterior.means[i]),
                "posterior_interval": verdict.posterior.intervals[i].tolist(),
            }
            for i, label in enumerate(labels)
        ],
        "chi_square": asdict(verdict.chi_square),
        "exact_test": None if verdict.exact is None else asdict(verdict.exact),
        "p_value": verdict.p_value,
        "rejected": verdict.rejected,
        "total_variation": asdict(verdict.variation),
        "throws_to_reject": verdict.to_reject,
        "throws_to_confirm": verdict.to_confirm,
    }


def _text(labels: list[str], verdict: RollVerdict) -> str:
    """All that throws say."""
    return "\n".join([*_table(labels, verdict), *_sentences(verdict)])


def _table(labels: list[str], verdict: RollVerdict) -> list[str]:
    level = f"{100 * verdict.confidence:g} %"
    posterior = verdict.posterior
    columns = [("label", ""), ("count", "d"), ("odds %", ".3f"), ("frequency %", ".3f")]
    columns += [(f"{level} interval", ">"), ("posterior %", ".3f"), (f"{level} credible", ">")]
    rows = zip(
        labels,
        verdict.counts,
        100 * verdict.odds,
        100 * verdict.frequencies,
        map(percent_interval, verdict.intervals),
        100 * posterior.means,
        map(percent_interval, posterior.intervals),
        strict=True,
    )
    return text_table(columns, rows)


def _sentences(verdict: RollVerdict) -> list[str]:
    from dicedesign.throws.roll_verdict import POWER, WITHIN

    test, exact, variation = verdict.chi_square, verdict.exact, verdict.variation
    low, high = variation.interval
    lines = [
        "",
        "intervals: exact (Clopper-Pearson); posterior: Dirichlet, by the prior of Jeffreys",
        f"chi-square {test.statistic:.4g} with {test.degrees} degrees of freedom, p = "
        f"{test.p_value:.2g}",
    ]
    if exact is not None:
        error = f" +- {exact.standard_error:.1g}" if exact.standard_error else ""
        lines.append(
            f"exact multinomial test, as some outcomes are rare: p = {exact.p_value:.2g}{error}"
        )
    lines.append(
        f"total variation {variation.value:.4f}, {100 * verdict.confidence:g} % interval "
        f"{low:.4f} to {high:.4f}; a perfect die shows {variation.noise_floor:.4f} in the mean"
    )
    level = 1.0 - verdict.confidence
    if verdict.rejected:
        lines.append(f"The throws reject these odds at the level {level:.3g}; no more are needed.")
        return lines
    lines.append(f"The throws do not reject these odds at the level {level:.3g}.")
    if verdict.to_reject is not None:
        more = max(0, verdict.to_reject - verdict.throws)
        lines.append(
            f"If the die's odds are the frequencies seen, {more} more throws would reject these "
            f"odds with probability {POWER:g}."
        )
    more = max(0, verdict.to_confirm - verdict.throws)
    lines.append(
        f"If the die's odds are these, {more} more throws would show that they are, to within a "
        f"total variation of {WITHIN:g}."
    )
    return lines
