"""`dicedesign rolls`: tests of the user's own throws of a die."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

from dicedesign.cli.commands import RollsArguments
from dicedesign.cli.options import (
    find_poses,
    percent_intervals,
    plain_rows,
    print_json,
    print_notes,
    require_figure,
    text_table,
)
from dicedesign.errors import InputError, printable
from dicedesign.results.folder import read_result
from dicedesign.results.result import Result
from dicedesign.runtime.arrays import Integers
from dicedesign.runtime.files import atomic_write
from dicedesign.runtime.interrupts import hold_interrupts
from dicedesign.throws import goodness_of_fit
from dicedesign.throws.goodness_of_fit import ADVICE, POWER, WITHIN, RollVerdict
from dicedesign.throws.roll_log import RollLog, read_counts

LEAST_CONFIDENCE = 0.5

DONE = "done"

UNDO = "undo"
"""Commands, unless the die has them as labels."""


def judge_rolls(options: RollsArguments) -> int:
    """Print the verdict on the user's throws."""
    if not LEAST_CONFIDENCE <= options.confidence < 1.0:
        raise InputError(
            f"--confidence: expected at least {LEAST_CONFIDENCE:g} and less than 1, got "
            f"{options.confidence:g}; 0.95 is usual"
        )
    require_figure(options, options.figure)
    _check_page(options)
    labels, probabilities, source, die = _read_probabilities(options.die, options.item)
    if len(labels) < 2:
        raise InputError(
            f"{options.die}: expected a die with at least 2 outcomes, got {len(labels)}; "
            "there is nothing to test"
        )
    judge = partial(
        goodness_of_fit.judge_rolls, probabilities=probabilities, confidence=options.confidence
    )
    if options.log is None:
        assert options.counts is not None
        counts = read_counts(options.counts, labels)
    else:
        log = RollLog(options.log, labels)
        if options.page:
            _serve_page(options, log, probabilities, judge, die)
        else:
            _log_rolls(log, judge)
        counts = log.counts
        if not counts.any():
            print('{"throws": 0}' if options.json else "no throws, nothing to judge")
            return 0
    verdict = judge(counts)
    if options.figure is not None:
        from dicedesign.report.bar_charts import roll_frequencies
        from dicedesign.report.sheet import figure_bytes

        figure = roll_frequencies(labels, verdict)
        atomic_write(options.figure, figure_bytes(figure, options.figure.suffix))
    if options.json:
        print_json({"probabilities_source": source, **_summarize(labels, verdict)})
    else:
        print(f"{printable(options.die)}: {verdict.throws} throws, tested for the {source}\n")
        print(_describe(labels, verdict))
    return 0


def _check_page(options: RollsArguments) -> None:
    """Raise InputError for a page without a file or with JSON, or its options without a page."""
    if options.page and options.log is None:
        raise InputError(
            "--page: expected a file for the throws, got none; name it with --log, such as "
            "--log rolls.csv"
        )
    if options.page and options.json:
        raise InputError(
            "--json: expected no --page, which prints its address; run dicedesign rolls on the "
            "file afterwards"
        )
    given = {
        "--port": options.port != RollsArguments.port,
        "--no-browser": options.no_browser,
        "--phone": options.phone,
    }
    for name, is_given in given.items():
        if is_given and not options.page:
            raise InputError(f"{name}: expected --page with it, got none; add --page")


def _serve_page(
    options: RollsArguments,
    log: RollLog,
    probabilities: Sequence[float],
    judge: Callable[[Integers], RollVerdict],
    die: Result | None,
) -> None:
    """Serve a page that logs throws until an interrupt."""
    from dicedesign.view.rolls_page import RollsPage
    from dicedesign.view.server import serve

    name = options.die.name if die is None else die.name
    page = RollsPage(log, probabilities, judge, name, die)
    with suppress(KeyboardInterrupt):
        serve(page.app, options.port, phone=options.phone, browser=not options.no_browser)
    log.reload()


def _read_probabilities(
    path: Path, item: int | None
) -> tuple[list[str], list[float], str, Result | None]:
    """Labels, probabilities, the name of these, and the finished die: the target of a finished die,
    or the probabilities of a mesh's rests without momentum."""
    if not os.path.isdir(path):
        # A finished die does not need this import.
        from dicedesign.geometry.meshes.reading import read_body

        _, poses = find_poses(read_body(path, item))
        labels = [str(i + 1) for i in range(len(poses.probabilities))]
        return labels, poses.probabilities.tolist(), "geometric probabilities of its rests", None
    die = read_result(path)
    print_notes(*die.changes())
    if not die.converged:
        print_notes(f"{path}: this die does not meet its target ({die.status})")
    return list(die.labels), list(die.target), "target of its design", die


def _log_rolls(log: RollLog, judge: Callable[[Integers], RollVerdict]) -> None:
    """Log throws from stdin until `DONE`, its end or an interrupt.

    judge: returns the verdict on counts (k,). At a terminal, each line is answered on stderr, and a
    wrong line can be typed again.

    Raises InputError: a line of another stdin is wrong; the lines before it are logged.
    """
    say = partial(print, file=sys.stderr, flush=True)
    is_terminal = sys.stdin.isatty()
    if is_terminal:
        count_text = f"{len(log.throws)} throws so far. " if log.throws else ""
        say(
            f"{count_text}Type what comes up ({', '.join(map(printable, log.labels))}), one or "
            f"several on a line. {UNDO} removes the last, an empty line shows all, {DONE} ends.\n"
            f"{ADVICE}"
        )
    try:
        for number in count(1):
            if is_terminal:
                say("> ", end="")
            line = sys.stdin.readline()
            text = line.strip()
            if not line or (text == DONE and DONE not in log.labels):
                break
            try:
                with hold_interrupts("rolls"):
                    change = _apply(log, text)
            except InputError as error:
                if not is_terminal:
                    raise InputError(f"stdin, line {number}: {error}") from error
                say(str(error))
                continue
            if is_terminal:
                say(_answer(log, change, judge))
    except KeyboardInterrupt:
        # End the current line.
        say("")
    say(f"{len(log.throws)} throws in {printable(log.path)}")


def _apply(log: RollLog, text: str) -> str:
    """Apply a line to the log; return the change in words, "" for none."""
    if text != UNDO or UNDO in log.labels:
        return ", ".join(log.add(text))
    label = log.undo()
    return "no throw to take back" if label is None else f"took back {label}"


def _answer(log: RollLog, change: str, judge: Callable[[Integers], RollVerdict]) -> str:
    """Verdict after a line; all of it after an empty one."""
    if not log.throws:
        return change or "no throws yet"
    verdict = judge(log.counts)
    if not change:
        return _describe(log.labels, verdict)
    return f"{change}: {verdict.summary}"


def _summarize(labels: list[str], verdict: RollVerdict) -> dict[str, Any]:
    """Verdict as plain data."""
    columns: dict[str, Any] = {
        "label": labels,
        "count": verdict.counts,
        "frequency": verdict.frequencies,
        "interval": verdict.intervals,
        "probabilities": verdict.probabilities,
        "posterior_mean": verdict.posterior_means,
        "posterior_interval": verdict.posterior_intervals,
    }
    return {
        "throws": verdict.throws,
        "confidence": verdict.confidence,
        "outcomes": plain_rows(columns),
        "chi_square": asdict(verdict.chi_square),
        "exact_test": None if verdict.exact is None else asdict(verdict.exact),
        "p_value": verdict.p_value,
        "rejected": verdict.rejected,
        "total_variation": asdict(verdict.variation),
        "throws_to_reject": verdict.to_reject,
        "throws_to_confirm": verdict.to_confirm,
    }


def _describe(labels: Sequence[str], verdict: RollVerdict) -> str:
    """Text of the verdict."""
    level = f"{100 * verdict.confidence:g} %"
    table = text_table(
        ("label", "", labels),
        ("count", "d", verdict.counts),
        ("probabilities %", ".3f", 100 * verdict.probabilities),
        ("frequency %", ".3f", 100 * verdict.frequencies),
        (f"{level} interval", ">", percent_intervals(verdict.intervals)),
        ("posterior %", ".3f", 100 * verdict.posterior_means),
        (f"{level} credible", ">", percent_intervals(verdict.posterior_intervals)),
    )
    test, exact, variation = verdict.chi_square, verdict.exact, verdict.variation
    low, high = variation.interval
    lines = [
        table,
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
        f"total variation {variation.value:.4f}, {level} interval {low:.4f} to {high:.4f}; a "
        f"perfect die shows {variation.noise_floor:.4f} in the mean"
    )
    significance = f"{1.0 - verdict.confidence:.3g}"
    if verdict.rejected:
        lines.append(
            f"The throws reject these probabilities at the level {significance}; no more are "
            "needed."
        )
        return "\n".join(lines)
    lines.append(f"The throws do not reject these probabilities at the level {significance}.")
    if verdict.to_reject is not None:
        more = max(0, verdict.to_reject - verdict.throws)
        lines.append(
            f"If the die's probabilities are these frequencies, {more} more throws would reject "
            f"these probabilities with probability {POWER:g}."
        )
    lines.append(
        f"If the die's probabilities are these, {verdict.more_to_confirm} more throws would show "
        f"that they are, to within a total variation of {WITHIN:g}."
    )
    return "\n".join(lines)
