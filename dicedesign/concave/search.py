"""From a surface to a concave die: ways to a hull are tried, filled and compared; and the file of a
search, from which it goes on later.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from dicedesign.balance.regions import is_shifted
from dicedesign.concave.attempt import Attempts
from dicedesign.concave.options import ConcaveOptions
from dicedesign.concave.result import (
    ConcaveDie,
    ConcaveProgress,
    ConcaveStep,
    FilledHull,
    Hollow,
    missing,
)
from dicedesign.errors import InputError, NoStartError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.triangles import Surface
from dicedesign.results.parts import Draft
from dicedesign.runtime import checkpoint
from dicedesign.runtime.arrays import Floats
from dicedesign.runtime.checkpoint import Arrays
from dicedesign.runtime.workers import one_thread

_ARRAYS = ("points", "hull_points", "center_of_mass", "directions")
"""Of `FilledHull`; all else is text in JSON."""


def checkpoint_bytes(progress: ConcaveProgress, search: Mapping[str, str]) -> bytes:
    """The content of a checkpoint.

    search: what the progress belongs to, by kind, as in `read_checkpoint`.
    """
    state, arrays = asdict(progress), {}
    if progress.best is not None:
        arrays = {name: state["best"].pop(name) for name in _ARRAYS}
    return checkpoint.checkpoint_bytes(search, state, arrays)


def read_checkpoint(path: Path, search: Mapping[str, str]) -> ConcaveProgress:
    """The progress in a file that `checkpoint_bytes` made.

    search: texts that must be those it was written with, by kind, such as "recipe".

    Raises
    ------
    InputError: the file is missing or damaged, or belongs to another search; the message names the
        kind that differs.
    """
    if not os.path.exists(path):
        raise InputError(
            f"{path}: expected the checkpoint of a run that was interrupted, got none; run without "
            "--resume to begin"
        )

    def progress(state: dict[str, Any], arrays: Arrays) -> ConcaveProgress:
        best = state["best"]
        if best is not None:
            best = FilledHull(**best | {name: arrays[name] for name in _ARRAYS})
        tried = tuple(Draft(**attempt) for attempt in state["tried"])
        history = tuple(ConcaveStep(**step) for step in state["history"])
        return ConcaveProgress(state["attempts"], state["seconds"], best, tried, history)

    return checkpoint.read_checkpoint(
        path,
        search,
        progress,
        restart="run without --resume to start again",
        elsewhere="choose another folder with --out",
    )


def make_concave_die(
    surface: Surface,
    target: Floats,
    options: ConcaveOptions,
    *,
    wall: float | None = None,
    seed: int = 0,
    resume: ConcaveProgress | None = None,
    on_step: Callable[[ConcaveStep], None] | None = None,
    on_attempt: Callable[[ConcaveProgress], None] | None = None,
) -> ConcaveDie:
    """Deform a surface until its convex hull and its center of mass have the wanted probabilities.

    Each attempt designs the hull with the center of mass held, for one choice of outcomes, and lets
    the surface follow. The best is one with nothing missing (`missing`), of least
    displacement, which counts for more where angles are small (`rank`); where none is as
    wanted, the one with the least missing.

    Parameters
    ----------
    surface: closed, of one component, without self-intersections (see `make_surface`).
    target: (k,) the probabilities.
    options: see `ConcaveOptions`.
    wall: least thickness around cavities, over the largest distance of two points of the die, above
        0; None for a solid die.
    seed: of the attempts' slopes and choices; attempt n is the same in any session, with any number
        of threads.
    resume: how far a former session came.
    on_step: called after every step.
    on_attempt: called after every attempt, with what it takes to go on from there.

    Raises
    ------
    NoStartError: no attempt led to a filled hull.
    InputError: more outcomes than the hull can carry; a fill needs a package that is missing.
    """
    started, steps = time.perf_counter(), list[ConcaveStep]()
    progress = resume or ConcaveProgress(0, 0.0, None, (), ())
    before = progress.seconds

    def seconds() -> float:
        """Wall-clock time, over all sessions."""
        return before + time.perf_counter() - started

    def record(number: int, stage: str, energy: float, error: float | None = None) -> None:
        steps.append(ConcaveStep(number, stage, seconds(), energy, error))
        if on_step is not None:
            on_step(steps[-1])

    def has_ended() -> bool:
        """True if no more may be tried, or the best is as wanted and near the original, or all that
        were enough are tried."""
        best, done = progress.best, progress.attempts
        if done >= options.attempts:
            return True
        if options.seconds is not None and done > 0 and seconds() >= options.seconds:
            return True
        if best is None or missing(best, options) > 0.0:
            return False
        return best.displacement <= options.displacement or done >= options.enough

    attempts = Attempts(surface, target, options, seed, record, wall)
    with one_thread():
        while not has_ended():
            number, begun = progress.attempts + 1, seconds()
            steps.clear()
            best, history, tried = progress.best, progress.history, progress.tried
            filled = attempts.attempt(number, best)
            if filled is not None:
                tried += (filled.draft(seconds() - begun),)
            if filled is not None and attempts.is_better(filled, best):
                best, history = filled, tuple(steps)
            elif best is None:
                history = tuple(steps)
            progress = ConcaveProgress(number, seconds(), best, tried, history)
            if on_attempt is not None:
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
    return ConcaveDie(
        surface,
        after,
        convex_hull(best.hull_points),
        best.directions,
        (len(attempts.problem.whole_hull.vertices), len(best.hull_points)),
        progress,
        hollow,
    )
