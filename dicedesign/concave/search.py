"""Search for a concave die: attempts at a hull are designed, filled and compared, and the state is
saved in a checkpoint from which a later session resumes."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from dicedesign.balance.regions import is_shifted
from dicedesign.concave.attempt import Attempts
from dicedesign.concave.bent_attempt import BentAttempts
from dicedesign.concave.options import ConcaveOptions
from dicedesign.concave.result import (
    ConcaveDie,
    ConcaveProgress,
    FilledHull,
    Hollow,
    JudgePrints,
    eye_cost,
    is_better,
    is_right,
    judge,
    prints_above_preferred,
)
from dicedesign.errors import NoStartError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.triangles import Surface
from dicedesign.results.parts import Draft
from dicedesign.results.result import Step
from dicedesign.runtime import checkpoint
from dicedesign.runtime.arrays import Floats
from dicedesign.runtime.checkpoint import Arrays
from dicedesign.runtime.workers import one_thread

SMALL_COST = 2.0
"""Value of `eye_cost` up to which a die is good enough."""

PATIENCE = 1.5
"""Factor of `ConcaveOptions.enough` while prints of the best die could be better."""


def checkpoint_bytes(progress: ConcaveProgress, search: Mapping[str, str]) -> bytes:
    """Content of a checkpoint.

    search: texts that identify the search, by kind, as in `read_checkpoint`.
    """
    state = asdict(progress)
    arrays = state.pop("best")
    best = None if arrays is None else arrays.pop("draft")
    return checkpoint.checkpoint_bytes(search, state | {"best": best}, arrays or {})


def read_checkpoint(path: Path, search: Mapping[str, str]) -> ConcaveProgress:
    """Read the state of a search from a file of `checkpoint_bytes`.

    search: texts that must equal the stored ones, by kind, such as "target".

    Raises InputError: the file is missing, damaged, or belongs to another search; the message names
    the kind that differs.
    """

    def restore(state: dict[str, Any], arrays: Arrays) -> ConcaveProgress:
        best = state["best"]
        return ConcaveProgress(
            state["attempts"],
            state["seconds"],
            None if best is None else FilledHull(Draft(**best), **arrays),
            tuple(Draft(**draft) for draft in state["tried"]),
            tuple(Step(**step) for step in state["history"]),
        )

    return checkpoint.read_checkpoint(path, search, restore)


def make_concave_die(
    surface: Surface,
    target: Floats,
    options: ConcaveOptions,
    *,
    wall: float | None = None,
    judge_prints: JudgePrints | None = None,
    seed: int = 0,
    resume: ConcaveProgress | None = None,
    on_step: Callable[[Step], None] = lambda _: None,
    on_attempt: Callable[[ConcaveProgress], None] = lambda _: None,
) -> ConcaveDie:
    """Deform a surface until its convex hull and its center of mass give the target probabilities.

    Each attempt designs a hull for one choice of outcomes with a fixed center of mass, and deforms
    the surface to fill it. The best die is the first by `rank`.

    Parameters
    ----------
    surface: closed, connected, without self-intersections (see `make_surface`).
    target: (k,) target probabilities.
    options: see `ConcaveOptions`.
    wall: minimum thickness of walls around cavities, over the largest distance of two points of the
        die, positive; None for a solid die.
    judge_prints: see `JudgePrints`; None if no prints are judged.
    seed: seed of the attempts' choices and directions. Attempt n does not depend on the session or
        the number of threads.
    resume: state of an earlier session.
    on_step: receives every step, numbered from 0 in each attempt.
    on_attempt: receives the state after every attempt.

    Raises
    ------
    NoStartError: no attempt led to a filled hull.
    InputError: the hull has too few vertices for the outcomes, or a package is missing.
    """
    started, steps = time.perf_counter(), list[Step]()
    progress = resume or ConcaveProgress()
    before = progress.seconds

    def seconds() -> float:
        """Wall-clock time over all sessions."""
        return before + time.perf_counter() - started

    def record(stage: str, energy: float, error: float | None = None) -> None:
        attempt = progress.attempts + 1
        step = Step(len(steps), seconds(), energy, error, stage=stage, attempt=attempt)
        steps.append(step)
        on_step(step)

    def has_ended() -> bool:
        """Whether attempts or time are used up, or the best die has converged and is near the
        original or the best of enough attempts; more attempts if its prints could be better."""
        best, done = progress.best, progress.attempts
        if done >= most:
            return True
        if options.seconds is not None and done > 0 and seconds() >= options.seconds:
            return True
        if best is None or not is_right(best.draft, options):
            return False
        if options.rests == "several":
            return eye_cost(best.draft) <= SMALL_COST or done >= options.enough
        if prints_above_preferred(best.draft, options) > 0.0:
            return done >= PATIENCE * options.enough
        return best.draft.displacement <= options.displacement or done >= options.enough

    attempts: Attempts | BentAttempts
    most = options.attempts
    if options.rests == "several":
        attempts = BentAttempts(surface, target, options, record, wall, judge_prints)
        most = min(most, len(attempts.ways))
    else:
        attempts = Attempts(surface, target, options, seed, record, wall, judge_prints)
    with one_thread():
        if progress.best is not None:
            # The size or the printer may be others.
            known = judge(progress.best, surface, options, judge_prints)
            progress = replace(progress, best=known)
        while not has_ended():
            number, begun = progress.attempts + 1, seconds()
            steps.clear()
            best, history, tried = progress.best, progress.history, progress.tried
            filled = attempts.attempt(number, best)
            if filled is not None:
                draft = replace(filled.draft, attempt=number, seconds=seconds() - begun)
                filled, tried = replace(filled, draft=draft), (*tried, draft)
            if filled is not None and is_better(filled, best, options):
                best, history = filled, tuple(steps)
            elif best is None:
                history = tuple(steps)
            progress = ConcaveProgress(number, seconds(), best, tried, history)
            on_attempt(progress)
    best = progress.best
    if best is None:
        raise NoStartError(
            f"start: expected a surface whose hull leads to the target, but none of "
            f"{progress.attempts} attempts did; allow more with method.concave.attempts, "
            "or take another target or surface"
        )
    after, hollow = surface.with_points(best.points), None
    if wall is not None and is_shifted(after, best.center_of_mass):
        hollow = Hollow(wall, best.center_of_mass)
    hull = convex_hull(best.hull_points)
    corners = len(convex_hull(surface.points).vertices), len(best.hull_points)
    faces = best.directions, best.outcome_of
    return ConcaveDie(surface, after, hull, *faces, corners, progress, hollow)
