"""`dicedesign rolls`: what the user's own throws of a die say about its odds."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from dicedesign.cli.options import (
    add_json_option,
    add_value,
    percent_interval,
    print_json,
    read_poses,
)
from dicedesign.errors import InputError
from dicedesign.runtime.files import interrupts_held
from dicedesign.runtime.text import printable, text_table

if TYPE_CHECKING:
    from dicedesign.runtime.arrays import Integers
    from dicedesign.throws.goodness_of_fit import RollVerdict
    from dicedesign.throws.roll_log import RollLog

LEAST_CONFIDENCE: Final = 0.5

DONE: Final = "done"

UNDO: Final = "undo"
"""Words that are no throws, unless the die has them as labels."""


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
    add_value(
        parser,
        "die",
        "DIE",
        "folder that `dicedesign run` left, whose target is tested; or a mesh, whose labels "
        "are the numbers that `dicedesign rest` gives its rests, and whose geometric odds are "
        "tested",
        Path,
    )
    throws = parser.add_mutually_exclusive_group(required=True)
    throws.add_argument(
        "counts",
        type=Path,
        nargs="?",
        metavar="COUNTS.csv",
        help="columns label,count; or the column label alone, with one throw on each line",
    )
    add_value(
        throws,
        "--log",
        "ROLLS.csv",
        "type in throws as they come, and write them here, one on each line; those that are "
        "there already are gone on from",
        Path,
    )
    add_value(
        parser,
        "--confidence",
        "C",
        "of intervals; the test's level is 1 - C (default: 0.95)",
        float,
        0.95,
    )
    add_value(parser, "--figure", "FILE.png", "draw the frequencies beside the odds", Path)
    add_json_option(parser)
    parser.set_defaults(command=_rolls)


def _rolls(options: argparse.Namespace) -> int:
    # Imported here, as other commands do without.
    from dicedesign.throws.goodness_of_fit import judge_rolls
    from dicedesign.throws.roll_log import RollLog, read_counts

    if not LEAST_CONFIDENCE <= options.confidence < 1.0:
        raise InputError(
            f"--confidence: expected at least {LEAST_CONFIDENCE:g} and less than 1, got "
            f"{options.confidence:g}; 0.95 is usual"
        )
    labels, odds, source = (_finished if os.path.isdir(options.die) else _mesh)(options.die)
    if len(labels) < 2:
        raise InputError(
            f"{options.die}: expected a die with at least 2 outcomes, got {len(labels)}; "
            "there is nothing to test"
        )
    judge = partial(judge_rolls, odds=odds, confidence=options.confidence)
    if options.log is None:
        counts = read_counts(options.counts, labels)
    else:
        log = RollLog(options.log, labels)
        _log_rolls(log, judge, partial(_text, labels))
        counts = log.counts
        if not counts.any():
            print('{"throws": 0}' if options.json else "no throws, nothing to judge")
            return 0
    verdict = judge(counts)
    if options.figure is not None:
        _draw(labels, verdict, options.figure)
    if options.json:
        print_json({"odds_source": source, **rolls_summary(labels, verdict)})
    else:
        print(f"{printable(options.die)}: {verdict.throws} throws, tested for the {source}\n")
        print(_text(labels, verdict))
    return 0


def _log_rolls(
    log: RollLog,
    judge: Callable[[Integers], RollVerdict],
    shown: Callable[[RollVerdict], str],
) -> None:
    """Write down throws from stdin until it says `DONE` or ends, or somebody interrupts it.

    judge: gives the verdict of counts (k,); shown: all of it in words. To somebody at a terminal
    each line is answered on stderr; one that is wrong is told of, and the next is waited for.

    Raises InputError: a line of another stdin is wrong; those before it are written down.
    """
    at_terminal = sys.stdin.isatty()
    if at_terminal:
        _say(_introduction(log))
    try:
        for number in count(1):
            if at_terminal:
                print("> ", end="", file=sys.stderr, flush=True)
            line = sys.stdin.readline()
            text = line.strip()
            if not line or (text == DONE and DONE not in log.labels):
                break
            try:
                with interrupts_held("rolls"):
                    done = _take(log, text)
            except InputError as error:
                if not at_terminal:
                    raise InputError(f"stdin, line {number}: {error}") from error
                _say(str(error))
                continue
            if at_terminal:
                verdict = judge(log.counts) if log.throws else None
                _say(_answer(done, verdict, shown))
    except KeyboardInterrupt:
        # The line that was begun ends.
        _say("")
    _say(f"{len(log.throws)} throws in {printable(log.path)}")


def _take(log: RollLog, text: str) -> str:
    """Do what a line says, and return what was done, "" for nothing."""
    if text != UNDO or UNDO in log.labels:
        return ", ".join(log.add(text))
    label = log.undo()
    return "no throw to take back" if label is None else f"took back {label}"


def _answer(done: str, verdict: RollVerdict | None, shown: Callable[[RollVerdict], str]) -> str:
    """What is known after a line."""
    if verdict is None:
        return done or "no throws yet"
    if not done:
        return shown(verdict)
    known = f"{done}: {verdict.throws} throws, p = {verdict.p_value:.2g}"
    more = max(0, verdict.to_confirm - verdict.throws)
    if verdict.rejected:
        return f"{known}, which rejects the odds"
    return f"{known}, {more} more to settle it" if more else f"{known}, enough to settle it"


def _introduction(log: RollLog) -> str:
    begun = f"{len(log.throws)} throws so far. " if log.throws else ""
    return (
        f"{begun}Type what comes up ({', '.join(map(printable, log.labels))}), one or several on a "
        f"line. {UNDO} takes the last back, an empty line shows all, {DONE} ends.\n"
        "Decide on a number before you begin: who stops as soon as p is small finds fault with "
        "good dice, too."
    )


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _finished(folder: Path) -> tuple[list[str], list[float], str]:
    """The labels and the target of a die that was designed here, and what that is, in words."""
    from dicedesign.results.folder import read_result

    die = read_result(folder)
    if not die.converged:
        print(
            f"note: {printable(folder)}: this die does not meet its target ({die.status})",
            file=sys.stderr,
        )
    return list(die.labels), list(die.target), "target of its design"


def _mesh(path: Path) -> tuple[list[str], list[float], str]:
    """The numbers of a mesh's rests, their odds without momentum, and what these are, in words."""
    _, poses = read_poses(path)
    numbers = [str(i + 1) for i in range(len(poses.probabilities))]
    return numbers, poses.probabilities.tolist(), "geometric odds of its rests"


def _draw(labels: list[str], verdict: RollVerdict, path: Path) -> None:
    from dicedesign.report.bar_charts import rolls_chart
    from dicedesign.runtime.files import atomic_write

    atomic_write(path, rolls_chart(labels, verdict).png())


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
    return "\n".join([*text_table(columns, rows), *_sentences(verdict)])


def _sentences(verdict: RollVerdict) -> list[str]:
    from dicedesign.throws.goodness_of_fit import POWER, WITHIN

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
