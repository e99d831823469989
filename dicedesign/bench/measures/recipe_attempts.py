"""Recipes designed as they are, their dice measured by the forward model."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from dicedesign.design.starts.start import Start
from dicedesign.errors import NoStartError
from dicedesign.recipe.design_stage import DesignedDie, design_die
from dicedesign.recipe.schema.recipe import Recipe
from dicedesign.recipe.summary import odds_summary
from dicedesign.results.status import Status
from dicedesign.search.trial import NO_DIE

__all__ = ["RecipeAttempt", "attempt_recipe"]


@dataclass(frozen=True)
class RecipeAttempt:
    """One recipe by its own method.

    Attributes
    ----------
    name: of the recipe.
    method: "exact" or "descent".
    outcomes: how many the target has.
    status: why the design stopped: the name of a `Status`, or `NO_DIE`.
    rests: stable facets of the die by the forward model.
    tolerance: largest |p - q| that the recipe takes for reached.
    error: largest |p - q| by the forward model; infinite unless there is one rest for each outcome
        and no other.
    odds_seconds: wall-clock time after which the design was within the tolerance first, by its
        history; nan if never.
    seconds: wall-clock time of the whole design, the search for starting shapes and the improvement
        by preference included.
    inradius_mm: radius of the smallest of the largest circles in the outcomes' facets.
    border_deg: least angle from a rest's normal to the border of its basin. Like `inradius_mm`, nan
        where `error` is infinite.
    """

    name: str
    method: str
    outcomes: int
    status: str
    rests: int
    tolerance: float
    error: float
    odds_seconds: float
    seconds: float
    inradius_mm: float
    border_deg: float

    @property
    def solved(self) -> bool:
        """Whether the die is all that the recipe wants, with one rest for each outcome."""
        return self.status == Status.CONVERGED.name and self.error <= self.tolerance

    def plain(self) -> dict[str, Any]:
        """Everything for JSON."""
        return {**asdict(self), "solved": self.solved}


def attempt_recipe(recipe: Recipe, start: Start | None) -> RecipeAttempt:
    """Design the die of a recipe, which is neither engraved nor written, and measure it.

    start: of the recipe, by `make_start`.

    Raises InputError if the start does not suit the target.
    """
    method = "descent" if recipe.method.exact is None else "exact"
    outcomes, tolerance = len(recipe.target.target().labels), recipe.method.tolerance
    started = time.perf_counter()
    try:
        die = design_die(recipe, start)
    except NoStartError:
        die = None
    seconds = time.perf_counter() - started
    rests, odds_seconds, measured = 0, np.nan, (np.inf, np.nan, np.nan)
    if die is not None:
        rests, measured = len(die.verdict.poses.facets), _measured(die)
        met = (step.seconds for step in die.design.history if step.error <= tolerance)
        odds_seconds = next(met, np.nan)
    error, inradius_mm, border_deg = measured
    return RecipeAttempt(
        name=recipe.name,
        method=method,
        outcomes=outcomes,
        status=NO_DIE if die is None else die.status.name,
        rests=rests,
        tolerance=tolerance,
        error=error,
        odds_seconds=odds_seconds,
        seconds=seconds,
        inradius_mm=inradius_mm,
        border_deg=border_deg,
    )


def _measured(die: DesignedDie) -> tuple[float, float, float]:
    """Error, smallest circle in mm and least angle to a border in degrees."""
    outcomes = range(len(die.target.labels))
    if sorted(die.verdict.outcome_of_rest.tolist()) != list(outcomes):
        return np.inf, np.nan, np.nan
    summary = odds_summary(die.verdict, die.target, None)
    inradius_mm, border_deg = (
        min(facet[name] for facet in summary["facets"]) for name in ("inradius_mm", "border_deg")
    )
    return summary["max_abs_error"], inradius_mm, border_deg
