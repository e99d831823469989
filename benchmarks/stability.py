"""stiff and extreme bodies, compared with exact answers

Ask for the rests of stiff and extreme bodies, and make stiff designs, each in a watched process;
compare with 60-digit arithmetic, closed forms and symmetries. Of several orientations the worst
values count. Exits 1 where a verdict is not ok.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.frame import NoAnswer, Report, Watched
from benchmarks.stiff_designs import DesignProblem, design_cases, run_design
from tests.reference.measurement import ERROR_LIMIT, OK, Measurement, measure, verdict
from tests.reference.problem import Case, Problem, rotate_problem
from tests.reference.stability_suite import body_cases

PATIENCE = 60.0
"""Seconds after which a case counts as hanging; large ones get a millisecond more per point."""

CONVERGED = "converged, "
"""How the ending of a design begins that has converged; its last word is the error."""

ORACLE_TURNS = 2
"""How many of a case's orientations are held against the oracle; all are against the rest."""


@dataclass(frozen=True)
class Outcome:
    """What became of a case.

    Attributes
    ----------
    facets, rests: how many. excess: sum of the probabilities less 1.
    error: largest of a probability by any measure.
    condition: see `probability_condition`; None where no error asks for it.
    seconds: wall-clock time of the query or design. ending: how a design ended.
    """

    verdict: str
    facets: int = 0
    rests: int = 0
    excess: float = 0.0
    error: float | None = None
    condition: float | None = None
    seconds: float = 0.0
    ending: str = ""


def stability_cases() -> list[Case]:
    """All bodies and designs, with unique names."""
    return [*body_cases(), *design_cases()]


def add_options(parser: argparse.ArgumentParser) -> None:
    """How much of the suite is run."""
    parser.add_argument("--largest", type=int, metavar="N", help="leave out larger bodies")


def run(options: argparse.Namespace, report: Report) -> bool:
    """Rows of the suite, as they come."""
    row = report.table(
        "cases",
        "case 44s | facets 7d | rests 6d | sum - 1 9.1e | error 9.1e | condition 10.1e | "
        "s 9.4f | verdict 2s | ending 0s",
    )
    outcomes: dict[str, list[Outcome]] = {}
    with Watched() as process:
        for case in stability_cases():
            is_too_large = options.largest is not None and case.points > options.largest
            if is_too_large or (options.quick and not case.quick):
                continue
            turns = min(case.turns, 2) if options.quick else case.turns
            for number in (0, turns) if turns else (0,):
                try:
                    seconds = PATIENCE + 1e-3 * case.points
                    outcome = process.call(seconds, run_case, case.name, number)
                except Exception as error:
                    outcome = Outcome(
                        f"{'hang' if isinstance(error, NoAnswer) else 'crash'}: {error}"
                    )
                name = f"{case.name}, {number} rotations" if number else case.name
                numbers = (
                    outcome.facets,
                    outcome.rests,
                    outcome.excess,
                    outcome.error,
                    outcome.condition,
                )
                row(name, *numbers, outcome.seconds, outcome.verdict, outcome.ending)
                outcomes.setdefault(case.kind, []).append(outcome)
    row = report.table(
        "kinds",
        "kind 28s | cases 5d | right 5d | most facets 7d | sum - 1 9.1e | error 9.1e | "
        "converged 5d | no start 5d | their max |p - q| 9.1e | most s 7.2f",
    )
    for kind, ends in outcomes.items():
        met: tuple[float | None, ...] = (None, None, None)
        if kind.startswith("designs"):
            missed = [one.ending.rpartition(" ")[2] for one in ends if CONVERGED in one.ending]
            no_start = sum(one.verdict == OK and one.facets == 0 for one in ends)
            met = (len(missed), no_start, max(map(float, missed), default=None))
        row(
            *(kind, len(ends), sum(one.verdict == OK for one in ends)),
            *(max(one.facets for one in ends), max((one.excess for one in ends), key=abs)),
            max((one.error for one in ends if one.error is not None), default=None),
            *(*met, max(one.seconds for one in ends)),
        )
    return all(one.verdict == OK for ends in outcomes.values() for one in ends)


def run_case(name: str, turns: int) -> Outcome:
    """One case by its name: as it stands for 0 turns, else in so many random orientations."""
    (case,) = (case for case in stability_cases() if case.name == name)
    problem = case.build()
    if not isinstance(problem, DesignProblem):
        return _judge(_measure(problem, turns), problem.rests, problem.facets)
    measurement, faults, seconds, ending = run_design(problem)
    outcome = Outcome(OK) if measurement is None else _judge([measurement], None, None)
    said = faults[0] if faults else outcome.verdict
    return replace(outcome, seconds=seconds, verdict=said, ending=ending)


def _measure(problem: Problem, turns: int) -> list[Measurement]:
    if turns == 0:
        return [measure(problem)]
    if problem.shares is None:
        shares = measure(problem, oracle=False).probabilities
        problem = replace(problem, shares=np.array(shares))
    return [
        measure(rotate_problem(problem, seed), oracle=seed < ORACLE_TURNS) for seed in range(turns)
    ]


def _judge(all_turns: list[Measurement], rests: int | None, facets: int | None) -> Outcome:
    verdicts = [verdict(one, rests, facets) for one in all_turns]
    asking = [one for one in all_turns if max(one.errors.values(), default=0.0) > ERROR_LIMIT]
    return Outcome(
        verdict=next((text for text in verdicts if text != OK), OK),
        facets=all_turns[0].facets,
        rests=all_turns[0].rests,
        excess=max((one.excess for one in all_turns), key=abs),
        error=max((e for one in all_turns for e in one.errors.values()), default=None),
        condition=max((one.condition for one in asking), default=None),
        seconds=max(one.seconds for one in all_turns),
        ending="(tied)" if any(one.tied for one in all_turns) else "",
    )
