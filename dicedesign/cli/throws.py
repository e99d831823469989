"""`dicedesign throw` and `rolls`: simulated throws of a die, and what the user's own say."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from functools import partial
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dicedesign.cli.commands import RollsArguments, ThrowArguments
from dicedesign.cli.options import (
    direction,
    numbers,
    percent_intervals,
    plain_rows,
    print_json,
    print_notes,
    read_poses,
    text_table,
    workers_of,
)
from dicedesign.errors import InputError, named, printable
from dicedesign.runtime.files import atomic_write, hold_interrupts

if TYPE_CHECKING:
    from dicedesign.geometry.meshes.body import Body
    from dicedesign.rest.poses import RestPoses
    from dicedesign.runtime.arrays import Integers
    from dicedesign.throws.goodness_of_fit import RollVerdict
    from dicedesign.throws.roll_log import RollLog
    from dicedesign.throws.simulation import Throws

DROPS: Final = 10_000

CONFIDENCE: Final = 0.95

MM_PER_METER: Final = 1e3


def throw(options: ThrowArguments) -> int:
    """Print how often each rest comes up."""
    from dicedesign.throws.momentum_model import momentum_model
    from dicedesign.throws.momentum_probabilities import momentum_probabilities
    from dicedesign.throws.rigid_body import PAPER_DIRECTIONS, rigid_body
    from dicedesign.throws.simulation import check_throws, simulate
    from dicedesign.throws.tables import load_table, with_hand

    size = None if options.size is None else options.size / MM_PER_METER
    with named("--table"):
        name = with_hand(options.table, options.hand)
        table = load_table(name)
    model = None
    try:
        model = momentum_model(name)
    except InputError as error:
        print_notes(f"without probabilities by the momentum model, as {error}")
    table = table.for_size(size)
    orientations: Any = options.orientations or ("icosahedron" if name == "paper" else "uniform")
    drops = options.drops
    if drops is None:
        drops = PAPER_DIRECTIONS if orientations == "icosahedron" else DROPS
    check_throws(drops, options.seed, options.engine, orientations)
    labels, tensor = None, None
    if os.path.isdir(options.die):
        mesh, poses, labels = _read_finished(options)
    else:
        mesh, poses = read_poses(options.die, options.com)
    if options.inertia is not None:
        xx, yy, zz, xy, xz, yz = numbers("--inertia", options.inertia, "xx,yy,zz,xy,xz,yz")
        tensor = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
    body = rigid_body(mesh, poses, tensor)
    if labels is not None and size is None:
        # Its files are in millimeters.
        table = table.for_size(2.0 * body.radius / MM_PER_METER)
    started = time.perf_counter()
    momentum = None if model is None else momentum_probabilities(poses, body, model)
    with workers_of(options, "drops", drops) as workers:
        throws = simulate(
            body,
            table,
            drops,
            options.seed,
            engine=options.engine,
            orientations=orientations,
            workers=workers.executor,
            progress=workers.bar.update,
        )
    seconds = time.perf_counter() - started
    columns: dict[str, Any] = {
        "label": labels,
        "normal": poses.normals,
        "count": throws.counts,
        "frequency": throws.frequencies,
        "interval": None,
        "geometric": poses.probabilities,
        "momentum": momentum,
    }
    summary = _judge_throws(throws, poses, columns)
    if options.json:
        print_json(summary | {"orientations": orientations, "seconds": seconds})
    else:
        heading = (
            f"{printable(options.die)}: {throws.drops} drops on {table.name}, "
            f"{1e3 * table.size:g} mm, engine {throws.engine}, {seconds:.1f} s\n"
        )
        print(heading, *_text(columns, summary), sep="\n")
    return 0


def _read_finished(options: ThrowArguments) -> tuple[Body, RestPoses, list[str | None]]:
    """A die that was designed here, without its marks, and the labels of its rests."""
    from dicedesign.rest.outcomes import facet_of_rest
    from dicedesign.results.folder import read_result

    die = read_result(options.die)
    center = np.array(die.center_of_mass)
    body, poses = read_poses(die.plain_file, options.com, center=center)
    normals = np.array([normal for _, normal in die.outcome_normals]).reshape(-1, 3)
    facets = facet_of_rest(poses.normals, normals).tolist()
    return body, poses, [None if facet < 0 else die.outcome_normals[facet][0] for facet in facets]


def _judge_throws(throws: Throws, poses: RestPoses, columns: dict[str, Any]) -> dict[str, Any]:
    """The answer as plain data; adds the intervals to the columns of rests.

    Frequencies are those among the drops that were resolved; None, as the distances, if none was.
    """
    from dicedesign.rest.outcomes import asymmetry
    from dicedesign.runtime.arrays import exact_intervals
    from dicedesign.throws.distances import effective_counts, measure_transport, measure_variation
    from dicedesign.throws.goodness_of_fit import chi_square

    landed = throws.outcomes >= 0
    came, probabilities = np.zeros(throws.rests), poses.probabilities
    variation = transport = test = None
    if landed.any():
        came = effective_counts(throws.outcomes[landed], throws.weights[landed], throws.rests)
        variation = asdict(measure_variation(came, probabilities, CONFIDENCE))
        transport = asdict(measure_transport(poses.normals, came, probabilities, CONFIDENCE))
        if throws.rests > 1:
            test = asdict(chi_square(came, probabilities))
    else:
        columns["frequency"] = [None] * throws.rests
    columns["interval"] = exact_intervals(came, float(came.sum()), CONFIDENCE)
    return {
        "drops": throws.drops,
        "unresolved": throws.unresolved,
        "table": throws.table.as_dict(),
        "engine": throws.engine,
        "seed": throws.seed,
        "rests": plain_rows(columns),
        "total_variation": variation,
        "wasserstein": transport,
        "chi_square": test,
        "asymmetry": asymmetry(poses),
    }


def _text(columns: dict[str, Any], summary: dict[str, Any]) -> list[str]:
    level = f"{100 * CONFIDENCE:g} %"
    labels, momentum = columns["label"], columns["momentum"]
    frequencies = [np.nan if part is None else 100 * part for part in columns["frequency"]]
    lines = [
        text_table(
            ("rest", "d", range(1, len(columns["count"]) + 1)),
            ("label", ">", labels and [label or "-" for label in labels]),
            ("count", "d", columns["count"]),
            ("frequency %", ".3f", frequencies),
            (f"{level} interval", ">", percent_intervals(columns["interval"])),
            ("geometric %", ".3f", 100 * columns["geometric"]),
            ("momentum %", ".3f", None if momentum is None else 100 * momentum),
            ("facet normal (down)", "", map(direction, columns["normal"])),
        ),
        "",
    ]
    if summary["unresolved"]:
        lines.append(f"unresolved: {summary['unresolved']} drops ended on no facet in time")
    for name, what in (
        ("total_variation", "total variation from the probabilities without momentum"),
        ("wasserstein", "Wasserstein distance from them, in radians,"),
    ):
        distance = summary[name]
        if distance is not None:
            low, high = distance["interval"]
            lines.append(
                f"{what} {distance['value']:.4f}, {level} interval {low:.4f} to {high:.4f}; noise "
                f"floor {distance['noise_floor']:.4f}"
            )
    test = summary["chi_square"]
    if test is not None:
        lines.append(
            f"chi-square against them {test['statistic']:.4g} on {test['degrees']} degrees of "
            f"freedom, p = {test['p_value']:.2g}; asymmetry rho {summary['asymmetry']:.3g}"
        )
    return lines


LEAST_CONFIDENCE: Final = 0.5

DONE: Final = "done"

UNDO: Final = "undo"
"""Words that are no throws, unless the die has them as labels."""


def judge_rolls(options: RollsArguments) -> int:
    """Print what the user's throws say."""
    from dicedesign.throws import goodness_of_fit
    from dicedesign.throws.roll_log import RollLog, read_counts

    if not LEAST_CONFIDENCE <= options.confidence < 1.0:
        raise InputError(
            f"--confidence: expected at least {LEAST_CONFIDENCE:g} and less than 1, got "
            f"{options.confidence:g}; 0.95 is usual"
        )
    labels, probabilities, source = _read_probabilities(options.die)
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
        _log_rolls(log, judge)
        counts = log.counts
        if not counts.any():
            print('{"throws": 0}' if options.json else "no throws, nothing to judge")
            return 0
    verdict = judge(counts)
    if options.figure is not None:
        from dicedesign.report.bar_charts import rolls_chart

        atomic_write(options.figure, rolls_chart(labels, verdict).png())
    if options.json:
        print_json({"probabilities_source": source, **_summarize(labels, verdict)})
    else:
        print(f"{printable(options.die)}: {verdict.throws} throws, tested for the {source}\n")
        print(_describe(labels, verdict))
    return 0


def _read_probabilities(path: Path) -> tuple[list[str], list[float], str]:
    """The outcomes of a die that was designed here with its target, or the numbers of a mesh's
    rests with their probabilities without momentum; and what these probabilities are, in words."""
    if not os.path.isdir(path):
        _, poses = read_poses(path)
        known = [str(i + 1) for i in range(len(poses.probabilities))]
        return known, poses.probabilities.tolist(), "geometric probabilities of its rests"
    from dicedesign.results.folder import read_result

    die = read_result(path)
    if not die.converged:
        print_notes(f"{path}: this die does not meet its target ({die.status})")
    return list(die.labels), list(die.target), "target of its design"


def _log_rolls(log: RollLog, judge: Callable[[Integers], RollVerdict]) -> None:
    """Write down throws from stdin until it says `DONE` or ends, or somebody interrupts it.

    judge: gives the verdict of counts (k,). To somebody at a terminal each line is answered on
    stderr; one that is wrong is told of, and the next is waited for.

    Raises InputError: a line of another stdin is wrong; those before it are written down.
    """
    say = partial(print, file=sys.stderr, flush=True)
    at_terminal = sys.stdin.isatty()
    if at_terminal:
        begun = f"{len(log.throws)} throws so far. " if log.throws else ""
        say(
            f"{begun}Type what comes up ({', '.join(map(printable, log.labels))}), one or several "
            f"on a line. {UNDO} takes the last back, an empty line shows all, {DONE} ends.\n"
            "Decide on a number before you begin: who stops as soon as p is small finds fault with "
            "good dice, too."
        )
    try:
        for number in count(1):
            if at_terminal:
                say("> ", end="")
            line = sys.stdin.readline()
            text = line.strip()
            if not line or (text == DONE and DONE not in log.labels):
                break
            try:
                with hold_interrupts("rolls"):
                    done = _take(log, text)
            except InputError as error:
                if not at_terminal:
                    raise InputError(f"stdin, line {number}: {error}") from error
                say(str(error))
                continue
            if at_terminal:
                say(_answer(log, done, judge))
    except KeyboardInterrupt:
        # The line that was begun ends.
        say("")
    say(f"{len(log.throws)} throws in {printable(log.path)}")


def _take(log: RollLog, text: str) -> str:
    """Do what a line says, and return what was done, "" for nothing."""
    if text != UNDO or UNDO in log.labels:
        return ", ".join(log.add(text))
    label = log.undo()
    return "no throw to take back" if label is None else f"took back {label}"


def _answer(log: RollLog, done: str, judge: Callable[[Integers], RollVerdict]) -> str:
    """What is known after a line."""
    if not log.throws:
        return done or "no throws yet"
    verdict = judge(log.counts)
    if not done:
        return _describe(log.labels, verdict)
    known = f"{done}: {verdict.throws} throws, p = {verdict.p_value:.2g}"
    more = max(0, verdict.to_confirm - verdict.throws)
    if verdict.rejected:
        return f"{known}, which rejects the probabilities"
    return f"{known}, {more} more to settle it" if more else f"{known}, enough to settle it"


def _summarize(labels: list[str], verdict: RollVerdict) -> dict[str, Any]:
    """The answer as plain data."""
    columns: dict[str, Any] = {
        "label": labels,
        "count": verdict.counts,
        "frequency": verdict.frequencies,
        "interval": verdict.intervals,
        "probabilities": verdict.probabilities,
        "posterior_mean": verdict.posterior.means,
        "posterior_interval": verdict.posterior.intervals,
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
    """All that throws say."""
    from dicedesign.throws.goodness_of_fit import POWER, WITHIN

    level, posterior = f"{100 * verdict.confidence:g} %", verdict.posterior
    table = text_table(
        ("label", "", labels),
        ("count", "d", verdict.counts),
        ("probabilities %", ".3f", 100 * verdict.probabilities),
        ("frequency %", ".3f", 100 * verdict.frequencies),
        (f"{level} interval", ">", percent_intervals(verdict.intervals)),
        ("posterior %", ".3f", 100 * posterior.means),
        (f"{level} credible", ">", percent_intervals(posterior.intervals)),
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
            f"If the die's probabilities are the frequencies seen, {more} more throws would "
            "reject these "
            f"probabilities with probability {POWER:g}."
        )
    more = max(0, verdict.to_confirm - verdict.throws)
    lines.append(
        f"If the die's probabilities are these, {more} more throws would show that they are, to "
        "within a "
        f"total variation of {WITHIN:g}."
    )
    return "\n".join(lines)
