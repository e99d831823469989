"""Stiff and extreme bodies and designs, each in a watched process, against exact answers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

from dicedesign.bench.frame import BENCHES, Bench, Items, Run
from dicedesign.bench.options import Amount
from dicedesign.bench.rows import Row, column, hidden

if TYPE_CHECKING:
    from tests.reference.measurement import Measurement
    from tests.reference.problem import DesignProblem, Problem

__all__ = ["CaseRow", "Extent", "run_case", "run_stability"]

PATIENCE: Final = 60.0
"""Seconds after which a case counts as hanging; large ones get a millisecond more per point."""

ORACLE_TURNS: Final = 2
"""How many of a case's orientations are held against the oracle; all are against the rest."""


@dataclass(frozen=True)
class Extent:
    """How much of the suite is run.

    Attributes
    ----------
    turns: most orientations of each body; None for all of the suite.
    largest: cases of more points are left out; None for none.
    short: whether only the cases of the short suite are run.
    """

    turns: int | None = None
    largest: int | None = None
    short: bool = False


@dataclass(frozen=True)
class CaseRow(Row):
    """What became of a case. Of several orientations the worst values count.

    Attributes
    ----------
    name: of the case; size: facets of the hull; rests: how many.
    excess: sum of the probabilities less 1.
    error: largest error of a probability by any of `measures`; None where there is none.
    condition: see `tests.reference.condition`; None where no error asks for it.
    seconds: wall-clock time of the query or design.
    verdict: "ok", or what went wrong.
    tied: whether the center of mass was moved to both sides of a balance.
    ending: how a design ended; "" for other cases.
    """

    name: str = column("case", -44)
    size: int = column("facets", 7, default=0)
    rests: int = column("rests", 7, default=0)
    excess: float = column("sum - 1", 9, ".1e", default=0.0)
    error: float | None = column("error", 9, ".1e", default=None)
    condition: float | None = column("condition", 10, ".1e", default=None)
    seconds: float = column("s", 9, ".4f", default=0.0)
    verdict: str = column("verdict", 0, default="ok")
    tied: bool = column("", 0, lambda tied: "(tied)" * tied, default=False)
    ending: str = column("", 0, lambda text: f"({text})" if text else "", default="")
    measures: tuple[str, ...] = hidden(default=())


def _rows(run: Run) -> Items:
    failed = count = 0
    for row in run_stability(run):
        run.advance()
        failed += row.verdict != "ok"
        count += 1
        yield row
    yield f"{count} cases, {count - failed} ok, {failed} not"
    return failed == 0


def run_stability(run: Run) -> Iterator[CaseRow]:
    """Rows of the suite, as they come."""
    from dicedesign.bench.measures.processes import CrashError, HangError, Watchdog
    from tests.reference.stability_suite import stability_cases

    extent: Extent = run.extent
    with Watchdog(run_case) as dog:
        for case in stability_cases():
            largest = case.points if extent.largest is None else extent.largest
            if (extent.short and not case.quick) or case.points > largest:
                continue
            turns = case.turns if extent.turns is None else min(case.turns, extent.turns)
            for count in (0, turns) if turns else (0,):
                name = f"{case.name}, {count} rotations" if count else case.name
                run.begin(name)
                try:
                    row = dog.call((case.name, count), PATIENCE + 1e-3 * case.points)
                except (HangError, CrashError) as error:
                    kind = "hang" if isinstance(error, HangError) else "crash"
                    row = CaseRow(name, verdict=f"{kind}: {error}")
                yield replace(row, name=name)


def run_case(task: tuple[str, int]) -> CaseRow:
    """One case by its name: as it stands for 0 turns, else in so many random orientations."""
    from tests.reference.problem import DesignProblem
    from tests.reference.stability_suite import stability_cases

    name, turns = task
    (case,) = (case for case in stability_cases() if case.name == name)
    problem = case.build()
    if isinstance(problem, DesignProblem):
        return _design_row(name, problem)
    return _row(name, _measured(problem, turns), problem.rests, problem.facets)


def _measured(problem: Problem, turns: int) -> list[Measurement]:
    import numpy as np

    from tests.reference.measurement import measure
    from tests.reference.problem import turned

    if turns == 0:
        return [measure(problem)]
    if problem.shares is None:
        shares = measure(problem, oracle=False).probabilities
        problem = replace(problem, shares=np.array(shares))
    return [measure(turned(problem, seed), oracle=seed < ORACLE_TURNS) for seed in range(turns)]


def _design_row(name: str, problem: DesignProblem) -> CaseRow:
    from tests.reference.watched_design import watch_design

    watched = watch_design(problem)
    row = CaseRow(name)
    if watched.measurement is not None:
        row = _row(name, [watched.measurement], None, None)
    verdict = watched.faults[0] if watched.faults else row.verdict
    return replace(row, seconds=watched.seconds, verdict=verdict, ending=watched.ending)


def _row(name: str, all_turns: list[Measurement], rests: int | None, facets: int | None) -> CaseRow:
    from tests.reference.measurement import ERROR_LIMIT, OK, verdict

    verdicts = [verdict(one, rests, facets) for one in all_turns]
    asking = [one for one in all_turns if max(one.errors.values(), default=0.0) > ERROR_LIMIT]
    return CaseRow(
        name=name,
        size=all_turns[0].facets,
        rests=all_turns[0].rests,
        excess=max((one.excess for one in all_turns), key=abs),
        error=max((e for one in all_turns for e in one.errors.values()), default=None),
        condition=max((one.condition for one in asking), default=None),
        seconds=max(one.seconds for one in all_turns),
        verdict=next((text for text in verdicts if text != OK), OK),
        tied=any(one.tied for one in all_turns),
        measures=tuple(sorted({name for one in all_turns for name in one.errors})),
    )


BENCHES.register(
    Bench(
        name="stability",
        line="stiff and extreme bodies against exact answers",
        description="Ask for the rests of stiff and extreme bodies and compare with 60-digit "
        "arithmetic, closed forms and symmetries. Exit code 0 if every verdict is ok, else 1.",
        rows=_rows,
        full=Extent(),
        quick=Extent(turns=2, short=True),
        amounts=(Amount("largest", "N", "leave out bodies of more than N points", least=0),),
        packages=("numpy", "scipy", "torch", "mpmath"),
        torch=False,
        unit="cases",
    )
)
