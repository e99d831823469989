"""`method: concave`: a surface that is bent until its hull and its center of mass have the odds."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from itertools import count
from typing import Final

from dicedesign.concave.checkpoint import checkpoint_bytes, read_checkpoint
from dicedesign.concave.fill.paper_options import HullWeights
from dicedesign.concave.options import ConcaveOptions
from dicedesign.concave.result import ConcaveProgress, ConcaveStep
from dicedesign.concave.search import make_concave_die
from dicedesign.fabricate.designed_die import DesignedDie
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.recipe.planning.work import Work
from dicedesign.recipe.schema.recipe import Recipe
from dicedesign.results.folder import CHECKPOINT
from dicedesign.results.record import Step
from dicedesign.results.status import Status
from dicedesign.runtime.files import atomic_write

__all__ = ["concave_options", "design"]

_LIMITS: Final = ("displacement", "attempts", "enough", "seconds")
"""Options that say when a search ends, and not where it leads."""


def design(work: Work) -> DesignedDie:
    """The die of a recipe, from its surface.

    Where results go to a folder, the state of the search is kept there after each attempt as
    `CHECKPOINT`.

    Raises
    ------
    InputError: the surface does not suit the target, no attempt led to a die, or there is no
        checkpoint of the same search to resume.
    """
    recipe, surface, options = work.recipe, work.surface, concave_options(work.recipe)
    assert surface is not None
    search = _search_identity(recipe, surface)
    path = None if work.folder is None else work.folder / CHECKPOINT
    progress = None
    if work.resume and path is not None:
        progress = read_checkpoint(path, search)
    if progress is not None:
        work.kept = _kept(progress)

    def on_attempt(progress: ConcaveProgress) -> None:
        if path is not None:
            atomic_write(path, checkpoint_bytes(progress, search))
            work.kept = _kept(progress)

    numbers = count(0)
    made = make_concave_die(
        surface,
        work.target.probabilities,
        options,
        seed=recipe.seed,
        resume=progress,
        on_step=lambda step: work.listeners.on_step(_step(next(numbers), step)),
        on_attempt=on_attempt,
    )
    best = made.progress.best
    assert best is not None
    work.details |= {
        "attempts": made.progress.attempts,
        "search_seconds": made.progress.seconds,
        "attempt": best.attempt,
    }
    return DesignedDie(
        status=Status.CONVERGED,
        hull=made.hull,
        directions=made.directions,
        error=best.error,
        steps=tuple(_step(number, step) for number, step in enumerate(made.progress.history)),
        reshaped=made,
    )


def concave_options(recipe: Recipe) -> ConcaveOptions:
    """The options of a recipe whose method is concave."""
    assert recipe.method.concave is not None
    return recipe.method.concave


def _step(number: int, step: ConcaveStep) -> Step:
    return Step(
        number, step.seconds, step.energy, step.error, stage=step.stage, attempt=step.attempt
    )


def _search_identity(recipe: Recipe, surface: Surface) -> dict[str, str]:
    """What a search for a die depends on, by kind: two with the same go the same way, though one
    may end sooner."""
    options = asdict(concave_options(recipe))
    for name in _LIMITS:
        del options[name]
    target = recipe.target.target().probabilities.tolist()
    data = surface.points.tobytes() + surface.triangles.tobytes()
    return {
        "target": json.dumps(target),
        "seed": str(recipe.seed),
        "method": json.dumps(options, default=HullWeights.as_dict),
        "surface": hashlib.sha256(data).hexdigest(),
    }


def _kept(progress: ConcaveProgress) -> str:
    done = f"{progress.attempts} attempt{'' if progress.attempts == 1 else 's'} done"
    if progress.best is None:
        best = "none led to a die yet"
    else:
        best = (
            f"the best is off by {progress.best.error:.2e}, its mean displacement "
            f"{100.0 * progress.best.displacement:.2g} % of the diagonal"
        )
    return f"{done}, {best}; run it again with --resume to go on"
