"""Every method of design on the same recipes and seeds: error and dice energy over time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, ClassVar, Final, Literal

import numpy as np

from dicedesign.bench.frame import BENCHES, RESULTS, Bench, Items, Run
from dicedesign.bench.options import Amount, recipes
from dicedesign.bench.rows import Row, column, hidden
from dicedesign.errors import InputError

if TYPE_CHECKING:
    from dicedesign.recipe.schema.recipe import Recipe
    from dicedesign.report.charts.paper import Paper
    from dicedesign.results.result import Step
    from dicedesign.runtime.arrays import Floats

__all__ = ["METHODS", "Extent", "Method", "MethodRow", "SeedRun", "run_method"]

NEAR: Final = 1e-3
"""Error of a die that comes near its target."""

TIMES: Final = 200
"""Points of a median curve, evenly spread in the logarithm of time."""


@dataclass(frozen=True)
class Method:
    """A way to design, without preferences.

    Attributes
    ----------
    name: what tables and figures call it.
    step: rule of the paper's method; None for the exact method.
    sobolev_power: of its preconditioner; None for none.
    finish: how it ends.
    """

    name: str
    step: Literal["momentum", "line_search"] | None = None
    sobolev_power: int | None = None
    finish: Literal["exact", "none"] = "none"

    def set_up(self, recipe: Recipe, seed: int) -> Recipe:
        """The recipe with this method instead of its own, and another seed."""
        from dicedesign.bench.measures.recipes import with_method
        from dicedesign.optimize.options import ExactOptions, SobolevOptions
        from dicedesign.optimize.paper_options import PaperOptions
        from dicedesign.optimize.preferences.preference import Preferences

        recipe = recipe.model_copy(update={"seed": seed})
        others = {"exact": None, "paper": None, "concave": None}
        if self.step is None:
            exact = recipe.method.exact or ExactOptions()
            exact = replace(exact, prefer=Preferences())
            return with_method(recipe, **{**others, "exact": exact})
        power = self.sobolev_power
        paper = replace(
            recipe.method.paper or PaperOptions(),
            step=self.step,
            sobolev=None if power is None else SobolevOptions(power=power),
            finish=self.finish,
            tolerance=None,
            prefer=Preferences(),
        )
        return with_method(recipe, **{**others, "paper": paper})


METHODS: Final = (
    Method("exact"),
    Method("paper, exact finish", "momentum", None, "exact"),
    Method("paper, momentum", "momentum"),
    Method("paper, momentum, Sobolev p = 1", "momentum", 1),
    Method("paper, momentum, Sobolev p = 2", "momentum", 2),
    Method("paper, line search", "line_search"),
    Method("paper, line search, Sobolev p = 1", "line_search", 1),
    Method("paper, line search, Sobolev p = 2", "line_search", 2),
)
"""All there are."""


@dataclass(frozen=True)
class Extent:
    """How many seeds there are, and the methods."""

    seeds: int
    methods: tuple[Method, ...] = METHODS


@dataclass(frozen=True)
class SeedRun:
    """One design.

    Attributes
    ----------
    converged: whether it ended within the tolerance of its method.
    error: largest |p - q| of the result, over the clusters of rests.
    evaluations: energies computed.
    die_error: largest |p - q| of the finished die, rests away from a labelled facet not counted.
    seconds, errors, energies: (n,) of every accepted step: time since the start, largest |p - q|
        over the clusters of rests, and the dice energy (eq. 12).
    """

    converged: bool
    error: float
    evaluations: int
    die_error: float
    seconds: tuple[float, ...]
    errors: tuple[float, ...]
    energies: tuple[float, ...]


@dataclass(frozen=True)
class MethodRow(Row):
    """One method on one recipe, over all seeds.

    Attributes
    ----------
    recipe, method: their names; recipes that are compared have different ones.
    seeds: how many; converged: those that ended within the method's tolerance, near: within 1e-3.
    median_error, worst_error: largest |p - q| at the end, over the clusters of rests.
    die_error: median largest |p - q| of the finished die, on which rests away from a labelled facet
        do not count.
    median_seconds, worst_seconds: of the design; evaluations: median number of energies.
    seconds, errors, energies: (t,) medians over the seeds of the smallest error and dice energy up
        to some times. The dice energy is common to all methods.
    tolerance: largest |p - q| that a method takes for reached.
    """

    table: ClassVar[str | None] = "runs"

    recipe: str = column("recipe", -28)
    method: str = column("method", -35)
    seeds: int = column("seeds", 6)
    converged: int = column("done", 6)
    near: int = column("<1e-3", 7)
    median_error: float = column("median error", 14, ".1e")
    worst_error: float = column("worst", 9, ".1e")
    die_error: float = column("die", 9, ".1e")
    evaluations: float = column("energies", 10, ".0f")
    median_seconds: float = column("s", 7, ".2f")
    worst_seconds: float = column("worst s", 9, ".2f")
    tolerance: float = hidden()
    seconds: tuple[float, ...] = hidden()
    errors: tuple[float, ...] = hidden()
    energies: tuple[float, ...] = hidden()

    @classmethod
    def of(cls, recipe: Recipe, method: Method, runs: Sequence[SeedRun]) -> MethodRow:
        """Of at least one run."""
        ends = [run.error for run in runs]
        last = [run.seconds[-1] for run in runs]
        times = np.geomspace(max(min(last) / 100.0, 1e-4), max(max(last), 2e-4), TIMES)
        return cls(
            recipe=recipe.name,
            method=method.name,
            seeds=len(runs),
            converged=sum(run.converged for run in runs),
            near=sum(error <= NEAR for error in ends),
            median_error=median(ends),
            worst_error=max(ends),
            die_error=median(run.die_error for run in runs),
            evaluations=median(run.evaluations for run in runs),
            median_seconds=median(last),
            worst_seconds=max(last),
            tolerance=method.set_up(recipe, 0).method.tolerance,
            seconds=tuple(times.tolist()),
            errors=_medians(times, [(run.seconds, run.errors) for run in runs]),
            energies=_medians(times, [(run.seconds, run.energies) for run in runs]),
        )


def _medians(
    times: Floats, curves: Sequence[tuple[Sequence[float], Sequence[float]]]
) -> tuple[float, ...]:
    """(t,) medians over curves of the smallest value up to each time, or the first one."""
    best = [
        np.minimum.accumulate(values)[
            np.maximum(np.searchsorted(seconds, times, side="right") - 1, 0)
        ]
        for seconds, values in curves
    ]
    return tuple(np.median(best, axis=0).tolist())


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
    # Not counted: torch takes longer at its first use in a process.
    run_method(recipes[0], METHODS[0], 0)
    for recipe in recipes:
        for method in run.extent.methods:
            run.begin(f"{recipe.name}: {method.name}")
            runs = []
            for seed in range(run.extent.seeds):
                runs.append(run_method(recipe, method, seed))
                run.advance()
            yield MethodRow.of(recipe, method, runs)
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
    seed: int,
    on_step: Callable[[Step], None] | None = None,
) -> SeedRun:
    """Design one recipe from its start by a method with a seed."""
    from dicedesign.bench.measures.recipes import begun, checked, designed

    work = begun(method.set_up(recipe, seed), on_step)
    designed(work)
    result = checked(work)
    return SeedRun(
        converged=float(work.die.error) <= work.recipe.method.tolerance,
        error=float(work.die.error),
        evaluations=result.design.evaluations or 0,
        die_error=result.design.max_abs_error,
        seconds=tuple(step.seconds or 0.0 for step in result.history),
        errors=tuple(float(step.max_abs_error or 0.0) for step in result.history),
        energies=tuple(step.terms["dice"] for step in result.history),
    )


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
            DesignCurve(r.method, r.seconds, r.errors, r.energies, 2 * r.converged > r.seeds)
            for r in own
        )
        panels.append(DesignPanel(recipe, max(row.tolerance for row in own), curves))
    return design_methods_figure(panels)


BENCHES.register(
    Bench(
        name="design",
        line="error against run time, by every method of design, over seeds",
        description="Design recipes by every method, step rule and preconditioner there is, from "
        "the same starts with the same seeds, without preferences, and compare medians of error "
        "and dice energy over time. Errors are largest |p - q| over the clusters of rests; that in "
        "the column of the die is of the finished one, on which only rests near a labelled facet "
        "count. Of the energy only the dice term (eq. 12) is compared, which all methods have.",
        rows=_rows,
        full=Extent(seeds=10),
        quick=Extent(seeds=1),
        amounts=(Amount("seeds", "N", "seeds from 0 on"),),
        options=(recipes("YAML file"),),
        packages=("numpy", "scipy", "torch"),
        unit="designs",
        figure=_figure,
        results=RESULTS,
    )
)
