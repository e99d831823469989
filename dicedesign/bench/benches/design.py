"""Every method and preconditioner on the same recipes: error and dice energy over time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Final, Literal

import numpy as np

from dicedesign.bench.frame import BENCHES, RESULTS, Bench, Items, Run
from dicedesign.bench.options import Amount, recipes
from dicedesign.bench.rows import Row, column, hidden
from dicedesign.errors import InputError

if TYPE_CHECKING:
    from dicedesign.recipe.schema.recipe import Recipe
    from dicedesign.report.charts.paper import Paper
    from dicedesign.results.record import Step

__all__ = ["METHODS", "Extent", "Method", "MethodRow", "run_method"]

EARLY: Final = (0.1, 1.0)
"""Seconds at which the table gives the error."""


@dataclass(frozen=True)
class Method:
    """A way to design.

    Attributes
    ----------
    name: what tables and figures call it.
    coordinates: of descent; None for the exact method.
    sobolev_power: of the preconditioner of descent; None for none.
    stability: weight of descent, if other than the recipe's.
    """

    name: str
    coordinates: Literal["facets", "vertices"] | None = None
    sobolev_power: int | None = None
    stability: float | None = None

    def set_up(self, recipe: Recipe, seconds: float) -> Recipe:
        """The recipe with this method instead of its own, for at most so many seconds."""
        from dicedesign.bench.measures.recipes import with_method
        from dicedesign.optimize.options import DescentOptions, ExactOptions, SobolevOptions
        from dicedesign.optimize.preferences.preference import Preferences

        if self.coordinates is None:
            exact = recipe.method.exact or ExactOptions()
            exact = replace(exact, prefer=Preferences(), seconds=seconds)
            return with_method(recipe, exact=exact, descent=None)
        own, power = recipe.method.descent or DescentOptions(), self.sobolev_power
        stability = own.weights.stability if self.stability is None else self.stability
        descent = replace(
            own,
            coordinates=self.coordinates,
            sobolev=None if power is None else SobolevOptions(power=power),
            weights=own.weights.changed(stability=stability),
            stopping=replace(own.stopping, seconds=seconds),
        )
        return with_method(recipe, exact=None, descent=descent)


METHODS: Final = (
    Method("exact"),
    Method("facets", "facets"),
    Method("vertices", "vertices"),
    Method("vertices, Sobolev p = 1", "vertices", 1),
    Method("vertices, Sobolev p = 2", "vertices", 2),
    Method("paper's energy", "vertices", None, 0.0),
    Method("paper's energy, Sobolev p = 2", "vertices", 2, 0.0),
)
"""All there are. The exact method goes on to rounding, whatever the tolerance, and no further.
The paper's energy is that of eq. 16 over vertices. Facets have no preconditioner."""


@dataclass(frozen=True)
class Extent:
    """Longest time of each run, and the methods."""

    limit_seconds: float
    methods: tuple[Method, ...] = METHODS


@dataclass(frozen=True)
class MethodRow(Row):
    """One method on one recipe.

    Attributes
    ----------
    recipe, method: their names; recipes that are compared have different ones.
    status: why it stopped, in small letters.
    steps: accepted ones; evaluations: energies computed.
    hulls_built, hulls_reused: see `DesignResult`.
    last_seconds, last_error, last_energy: of the end; early_error, later_error: smallest errors up
        to the times of `EARLY`.
    die_error: largest |p - q| of the finished die, rests away from a labelled facet not counted.
    tolerance: largest |p - q| wanted.
    seconds, errors, energies: (n,) of every accepted step: time since the start, largest |p - q|
        over the clusters of rests, and the dice energy (eq. 12). That term is common to all
        methods; the others have weights that differ and change on the way.
    """

    table: ClassVar[str | None] = "runs"

    recipe: str = column("recipe", -21)
    method: str = column("method", -31)
    status: str = column("status", -12, lambda status: status.replace("_", " "))
    steps: int = column("steps", 6)
    evaluations: int = column("energies", 9)
    hulls_built: int = column("hulls", 7)
    hulls_reused: int = column("kept", 7)
    last_seconds: float = column("s", 7, ".2f")
    early_error: float = column(f"at {EARLY[0]:g} s", 9, ".1e")
    later_error: float = column(f"at {EARLY[1]:g} s", 9, ".1e")
    last_error: float = column("end", 9, ".1e")
    last_energy: float = column("energy", 9, ".1e")
    die_error: float = column("die", 9, ".1e")
    tolerance: float = hidden()
    seconds: tuple[float, ...] = hidden()
    errors: tuple[float, ...] = hidden()
    energies: tuple[float, ...] = hidden()


def _rows(run: Run) -> Items:
    from dicedesign.bench.measures.recipes import begun
    from dicedesign.recipe.schema.reading import read_recipe

    recipes = [read_recipe(path) for path in run.options.recipes]
    _require_distinct_names(recipes, run.options.recipes)
    for recipe in recipes:
        if begun(recipe).start is None:
            raise InputError(
                f"{recipe.name}: expected a start that all methods can share, got "
                f"{'a surface' if recipe.method.concave else 'start.search'}; give it another start"
            )
    for recipe in recipes:
        for method in run.extent.methods:
            run.begin(f"{recipe.name}: {method.name}")
            yield run_method(recipe, method, run.extent.limit_seconds, lambda step: run.advance())
    return True


def _require_distinct_names(recipes: Sequence[Recipe], paths: Sequence[Path]) -> None:
    """Rows and panels are known by the names of their recipes."""
    known: dict[str, Path] = {}
    for recipe, path in zip(recipes, paths, strict=True):
        if recipe.name in known:
            raise InputError(
                f"{path}: expected a recipe of another name than those before, got "
                f"{recipe.name!r} as in {known[recipe.name]}; change the name of one"
            )
        known[recipe.name] = path


def run_method(
    recipe: Recipe,
    method: Method,
    seconds: float,
    on_step: Callable[[Step], None] | None = None,
) -> MethodRow:
    """Design one recipe from its start by a method for at most so many seconds."""
    from dicedesign.bench.measures.recipes import begun, checked, designed

    work = begun(method.set_up(recipe, seconds), on_step)
    designed(work)
    result = checked(work)
    times = tuple(step.seconds or 0.0 for step in result.history)
    errors = tuple(float(step.max_abs_error or 0.0) for step in result.history)
    energies = tuple(step.terms["dice"] for step in result.history)
    early, later = (smallest_until(times, errors, limit) for limit in EARLY)
    assert result.hulls is not None
    return MethodRow(
        recipe=recipe.name,
        method=method.name,
        status=result.status,
        steps=len(times) - 1,
        evaluations=result.evaluations or 0,
        hulls_built=result.hulls.built,
        hulls_reused=result.hulls.reused,
        last_seconds=times[-1],
        early_error=early,
        later_error=later,
        last_error=errors[-1],
        last_energy=energies[-1],
        die_error=result.design_max_abs_error,
        tolerance=recipe.method.tolerance,
        seconds=times,
        errors=errors,
        energies=energies,
    )


def smallest_until(times: Sequence[float], errors: Sequence[float], limit: float) -> float:
    """Smallest error up to a time, or the first one; times: ascending."""
    return min(errors[: max(1, int(np.searchsorted(times, limit, side="right")))])


def _figure(rows: Sequence[MethodRow], run: Run) -> Paper:
    """Error and dice energy over seconds, a row for each recipe."""
    from dicedesign.report.charts.time_curves import (
        DesignCurve,
        DesignPanel,
        design_methods_figure,
    )

    panels = []
    for recipe in dict.fromkeys(row.recipe for row in rows):
        own = [row for row in rows if row.recipe == recipe]
        curves = tuple(
            DesignCurve(r.method, r.seconds, r.errors, r.energies, r.status == "converged")
            for r in own
        )
        panels.append(DesignPanel(recipe, own[0].tolerance, curves))
    return design_methods_figure(panels)


BENCHES.register(
    Bench(
        name="design",
        line="error against run time, by every method of design",
        description="Design recipes by every method and preconditioner there is, from the same "
        "start, and compare error and dice energy over time. Errors are largest |p - q| over the "
        "clusters of rests, the smallest so far; the last column is that of the finished die, on "
        "which only rests near a labelled facet count. Of the energy only the dice term (eq. 12) "
        "is compared, as the other terms have weights that differ between methods.",
        rows=_rows,
        full=Extent(limit_seconds=15.0),
        quick=Extent(limit_seconds=1.0),
        amounts=(Amount("limit_seconds", "S", "longest time of each run", "--seconds", float),),
        options=(recipes("YAML file"),),
        packages=("numpy", "scipy", "torch"),
        unit="steps",
        figure=_figure,
        results=RESULTS,
    )
)
