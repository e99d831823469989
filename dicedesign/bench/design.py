"""Every method and preconditioner on the same recipes: error and energy over time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np

from dicedesign.bench.machine import machine_description
from dicedesign.design.options import DescentOptions, ExactOptions, SobolevOptions
from dicedesign.design.preferences.preference import Preferences
from dicedesign.design.result import DesignStep
from dicedesign.design.starts.start import Start
from dicedesign.recipe.design_stage import design_die
from dicedesign.recipe.schema.recipe import Recipe

if TYPE_CHECKING:
    from dicedesign.report.charts.paper import Paper

__all__ = ["METHODS", "Method", "Run", "methods_figure", "methods_record", "run_method"]


@dataclass(frozen=True)
class Method:
    """A way to design.

    Attributes
    ----------
    name: what tables and figures call it.
    set_up: the recipe with this method instead of its own.
    """

    name: str
    set_up: Callable[[Recipe], Recipe]


def _descent(
    coordinates: Literal["facets", "vertices"],
    sobolev_power: int | None = None,
    stability: float | None = None,
) -> Callable[[Recipe], Recipe]:
    """Descent in these coordinates, with a stability weight other than the recipe's if given."""
    sobolev = None if sobolev_power is None else SobolevOptions(power=sobolev_power)

    def set_up(recipe: Recipe) -> Recipe:
        own = recipe.method.descent or DescentOptions()
        weight = own.weights.stability if stability is None else stability
        weights = own.weights.changed(stability=weight)
        return _under(
            recipe, replace(own, coordinates=coordinates, sobolev=sobolev, weights=weights)
        )

    return set_up


def _under(recipe: Recipe, options: DescentOptions) -> Recipe:
    method = recipe.method.model_copy(update={"descent": options, "exact": None})
    return recipe.model_copy(update={"method": method})


def _exactly(recipe: Recipe) -> Recipe:
    exact = replace(recipe.method.exact or ExactOptions(), prefer=Preferences())
    method = recipe.method.model_copy(update={"exact": exact, "descent": None})
    return recipe.model_copy(update={"method": method})


def _limited(recipe: Recipe, seconds: float) -> Recipe:
    """The recipe with so many seconds for its method."""
    method = recipe.method
    if method.descent is not None:
        stopping = replace(method.descent.stopping, seconds=seconds)
        return _under(recipe, replace(method.descent, stopping=stopping))
    assert method.exact is not None
    exact = replace(method.exact, seconds=seconds)
    return recipe.model_copy(update={"method": method.model_copy(update={"exact": exact})})


METHODS: Final = (
    Method("exact", _exactly),
    Method("facets", _descent("facets")),
    Method("vertices", _descent("vertices")),
    Method("vertices, Sobolev p = 1", _descent("vertices", 1)),
    Method("vertices, Sobolev p = 2", _descent("vertices", 2)),
    Method("paper's energy", _descent("vertices", stability=0.0)),
    Method("paper's energy, Sobolev p = 2", _descent("vertices", 2, 0.0)),
)
"""All there are. The exact method goes on to rounding, whatever the tolerance, and no further.
The paper's energy is that of eq. 16 over vertices. Facets have no preconditioner."""


@dataclass(frozen=True)
class Run:
    """One method on one recipe.

    Attributes
    ----------
    recipe, method: their names; recipes that are compared have different ones.
    tolerance: largest |p - q| wanted.
    status: why it stopped: the name of a `Status`.
    evaluations: energies computed.
    hulls_built, hulls_reused: see `DesignResult`.
    die_error: largest |p - q| of the finished die, rests away from a labelled facet not counted.
    seconds, errors, energies: (n,) of every accepted step: time since the start, largest |p - q|
        over the clusters of rests, and the dice energy (eq. 12). That term is common to all
        methods; the others have weights that differ and change on the way.
    """

    recipe: str
    method: str
    tolerance: float
    status: str
    evaluations: int
    hulls_built: int
    hulls_reused: int
    die_error: float
    seconds: tuple[float, ...]
    errors: tuple[float, ...]
    energies: tuple[float, ...]

    @property
    def steps(self) -> int:
        """Accepted steps."""
        return len(self.seconds) - 1

    def error_after(self, seconds: float) -> float:
        """Smallest error up to a time, or that of the start."""
        count = max(1, int(np.searchsorted(self.seconds, seconds, side="right")))
        return min(self.errors[:count])


def run_method(
    recipe: Recipe,
    start: Start,
    method: Method,
    seconds: float,
    on_step: Callable[[DesignStep], None] | None = None,
) -> Run:
    """Design one recipe from its start by a method for at most so many seconds."""
    die = design_die(_limited(method.set_up(recipe), seconds), start, on_step=on_step)
    history = die.design.history
    return Run(
        recipe=recipe.name,
        method=method.name,
        tolerance=recipe.method.tolerance,
        status=die.status.name,
        evaluations=die.design.evaluations,
        hulls_built=die.design.hulls_built,
        hulls_reused=die.design.hulls_reused,
        die_error=die.verdict.max_abs_error,
        seconds=tuple(step.seconds for step in history),
        errors=tuple(step.error for step in history),
        energies=tuple(step.terms["dice"] for step in history),
    )


def methods_record(runs: Sequence[Run], limit: float) -> dict[str, Any]:
    """Everything measured, with date, machine and versions, for JSON; limit: seconds of a run."""
    described = machine_description("numpy", "scipy", "torch")
    return {**described, "limit_seconds": limit, "runs": [asdict(run) for run in runs]}


def methods_figure(runs: Sequence[Run]) -> Paper:
    """Error and dice energy over seconds, a row for each recipe."""
    from dicedesign.report.charts.time_curves import (
        DesignCurve,
        DesignPanel,
        design_methods_figure,
    )

    panels = []
    for recipe in dict.fromkeys(run.recipe for run in runs):
        own = [run for run in runs if run.recipe == recipe]
        curves = tuple(
            DesignCurve(r.method, r.seconds, r.errors, r.energies, r.status == "CONVERGED")
            for r in own
        )
        panels.append(DesignPanel(recipe, own[0].tolerance, curves))
    return design_methods_figure(panels)
