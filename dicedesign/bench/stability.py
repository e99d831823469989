"""The stability suite: every case in a watched process, one row for each."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from dicedesign.bench.bodies.problem import Case, DesignProblem, turned
from dicedesign.bench.bodies.stability_suite import stability_cases
from dicedesign.bench.measures.processes import CrashError, HangError, Watchdog
from dicedesign.bench.reference.measurement import Measurement, measure

__all__ = ["ERROR_LIMIT", "OK", "Row", "run_case", "run_stability", "verdict"]

OK: Final = "ok"

ERROR_LIMIT: Final = 1e-12
"""Largest error of a probability, and largest difference of their sum from 1."""

CONDITION_FACTOR: Final = 100.0
"""Where it is more, the error may be so many times the condition times machine epsilon."""

OUTSIDE_LIMIT: Final = 1e-10
"""How far a point may lie outside of the hull, over half its extent."""

COARSER_OUTSIDE_LIMIT: Final = 1e-7
"""The same of a hull that was made again: at up to 1000 times the unevenness of its facets, which
is up to 1e-11 or a few times as much."""

PATIENCE: Final = 60.0
"""Seconds after which a case counts as hanging; large ones get a millisecond more per point."""

ORACLE_TURNS: Final = 2
"""How many of a case's orientations are held against the oracle; all are against the rest."""

QUICK_TURNS: Final = 2
"""Orientations of each solid in the short suite."""


@dataclass(frozen=True)
class Row:
    """What became of a case. Of several orientations the worst values count.

    Attributes
    ----------
    name: of the case; size: facets of the hull; rests: how many.
    excess: sum of probabilities less 1.
    error: largest error of a probability, None where only the sum could be checked.
    measures: what the error was found by.
    condition: see `dicedesign.bench.reference.condition`.
    seconds: longest wall-clock time of a query.
    tied: whether the center of mass was moved to both sides of a balance.
    verdict: "ok", or what went wrong.
    ending: how a design ended; empty for other cases.
    """

    name: str
    size: int = 0
    rests: int = 0
    excess: float = 0.0
    error: float | None = None
    measures: tuple[str, ...] = ()
    condition: float = 0.0
    seconds: float = 0.0
    tied: bool = False
    verdict: str = OK
    ending: str = ""


def run_stability(
    *,
    quick: bool = False,
    largest: int | None = None,
    on_case: Callable[[str], None] = lambda name: None,
) -> Iterator[Row]:
    """Rows of the suite, as they come.

    quick: only the short suite, which takes less than a minute.
    largest: leave out cases of more points.
    on_case: is told the name of each case before it runs.
    """
    with Watchdog(run_case) as dog:
        for case in stability_cases():
            if (quick and not case.quick) or (largest is not None and case.points > largest):
                continue
            turns = min(case.turns, QUICK_TURNS) if quick else case.turns
            patience = PATIENCE + 1e-3 * case.points
            for count in (0, turns) if turns else (0,):
                name = f"{case.name}, {count} rotations" if count else case.name
                on_case(name)
                try:
                    yield replace(dog.call((case.name, count), patience), name=name)
                except HangError as error:
                    yield Row(name, verdict=f"hang: {error}")
                except CrashError as error:
                    yield Row(name, verdict=f"crash: {error}")


def run_case(task: tuple[str, int]) -> Row:
    """One case by its name: as it stands for 0 turns, else in so many random orientations."""
    name, turns = task
    problem = _cases()[name].build()
    if isinstance(problem, DesignProblem):
        return _design_row(name, problem)
    if turns == 0:
        return _row(name, [measure(problem)], problem.rests, problem.facets)
    if problem.shares is None:
        shares = measure(problem, oracle=False).probabilities
        problem = replace(problem, shares=np.array(shares))
    found = [measure(turned(problem, seed), oracle=seed < ORACLE_TURNS) for seed in range(turns)]
    return _row(name, found, problem.rests, problem.facets)


def _design_row(name: str, problem: DesignProblem) -> Row:
    from dicedesign.bench.measures.watched_design import watch_design

    watched = watch_design(problem)
    row = _row(name, [watched.measurement], None)
    found = watched.faults[0] if watched.faults else row.verdict
    return replace(row, seconds=watched.seconds, verdict=found, ending=watched.ending)


def _cases() -> dict[str, Case]:
    return {case.name: case for case in stability_cases()}


def _row(
    name: str, found: Sequence[Measurement], rests: int | None, facets: int | None = None
) -> Row:
    errors = [error for one in found for error in one.errors.values()]
    verdicts = [verdict(one, rests, facets) for one in found]
    return Row(
        name=name,
        size=found[0].facets,
        rests=found[0].rests,
        excess=max((one.excess for one in found), key=abs),
        error=max(errors, default=None),
        measures=tuple(sorted({measure for one in found for measure in one.errors})),
        condition=max(one.condition for one in found),
        seconds=max(one.seconds for one in found),
        tied=any(one.tied for one in found),
        verdict=next((text for text in verdicts if text != OK), OK),
    )


def verdict(found: Measurement, rests: int | None = None, facets: int | None = None) -> str:
    """ "ok", or what is wrong with a measurement whose number of rests or facets may be known."""
    limit = max(ERROR_LIMIT, CONDITION_FACTOR * found.condition * float(np.finfo(np.float64).eps))
    if rests is not None and found.rests != rests:
        return f"{found.rests} rests instead of {rests}"
    if facets is not None and found.facets != facets:
        return f"{found.facets} facets instead of {facets}"
    if not abs(found.excess) <= ERROR_LIMIT:
        return f"sum of probabilities off by {found.excess:.1e}"
    if found.outside > (COARSER_OUTSIDE_LIMIT if found.made_again else OUTSIDE_LIMIT):
        return f"point outside of the hull by {found.outside:.1e}"
    for name, error in found.errors.items():
        if not error <= limit:
            return f"error {error:.1e} ({name}) above {limit:.1e}"
    return OK
