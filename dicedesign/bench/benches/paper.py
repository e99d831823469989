"""The paper's method over many seeds, beside the exact one, and without one term after the
other."""

from __future__ import annotations

import secrets
from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import median
from typing import TYPE_CHECKING, ClassVar, Final

from dicedesign.bench.frame import BENCHES, RESULTS, Bench, Items, Run
from dicedesign.bench.options import Amount, recipes
from dicedesign.bench.rows import Row, column, hidden, percent

if TYPE_CHECKING:
    from dicedesign.bench.measures.designs.paper_designs import Ending, PaperProblem, Seeded
    from dicedesign.recipe.schema.recipe import Recipe
    from dicedesign.report.charts.paper import Paper
    from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["AblationRow", "Extent", "SeedsRow", "SideRow"]

PUBLISHED: Final = {
    "paper_binomial_2": 0.0069,
    "paper_binomial_3": 0.0054,
    "paper_2d6_hendecahedron_v1": 0.0016,
    "paper_2d6_hendecahedron_v2": 0.0115,
    "paper_2d6_circus": 0.0151,
}
"""Largest |p - q| of the dice that the paper's authors published, by this model."""

GOOD_ERROR: Final = 2e-2

GOOD_ANGLE: Final = 10.0
"""What a die without finish is to have: an error of at most the one, and outcomes as many degrees
apart as the other."""

ABLATED: Final = ("paper_binomial_4", "paper_2d6_hendecahedron_v2")
"""Recipes that terms are left out of."""

TERMS: Final = {
    "all": (),
    "no coplanar": ("coplanar",),
    "no barycenter": ("barycenter",),
    "no neighbor": ("neighbor",),
    "no apart": ("apart",),
    "dice alone": ("coplanar", "barycenter", "neighbor", "apart"),
}
"""What is left out, by the name of the row."""

DROPS: Final = 20_000
"""Simulated throws of each die that stands side by side with another."""


@dataclass(frozen=True)
class Extent:
    """How many seeds from 0 on there are, how many fresh ones that nobody chose, and whether dice
    are compared with those of the exact method."""

    seeds: int
    fresh: int
    compared: bool


@dataclass(frozen=True)
class SeedsRow(Row):
    """A recipe over all seeds, without a finish or with the exact one.

    Attributes
    ----------
    recipe: its name; finish: "none" or "exact"; seeds: how many.
    good: those with the odds (within 0.02, or 1e-12 after an exact finish) and all outcomes at
        least 10 degrees apart.
    median_error, worst_error: largest |p - q|; published: of the published die.
    median_angle, least_angle: between two outcomes, in degrees.
    least_facet: part of the surface that the smallest outcome has, in the worst case.
    moved: median change of the shape by the finish, over the diameter.
    median_seconds, worst_seconds: on the wall; of the finish alone in its row.
    """

    table: ClassVar[str | None] = "seeds"

    recipe: str = column("recipe", -28)
    finish: str = column("finish", -7)
    seeds: int = column("seeds", 6)
    good: int = column("good", 6)
    median_error: float = column("median error", 14, ".1e")
    worst_error: float = column("worst", 9, ".1e")
    published: float | None = column("published", 11, ".1e")
    median_angle: float = column("angle deg", 11, ".1f")
    least_angle: float = column("least", 7, ".1f")
    least_facet: float = column("facet %", 9, percent(2))
    moved: float | None = column("moved %", 9, percent(1))
    median_seconds: float = column("s", 7, ".2f")
    worst_seconds: float = column("worst s", 9, ".2f")

    @classmethod
    def of(cls, name: str, runs: Sequence[Seeded], *, exact: bool) -> SeedsRow:
        """Of at least one run."""
        ends = [run.finished if exact else run.plain for run in runs]
        seconds = [run.finish_seconds if exact else run.seconds for run in runs]
        right = [run.converged if exact else run.plain.error <= GOOD_ERROR for run in runs]
        apart = [end.empty == 0 and end.least_angle >= GOOD_ANGLE for end in ends]
        return cls(
            recipe=name,
            finish="exact" if exact else "none",
            seeds=len(runs),
            good=sum(a and b for a, b in zip(right, apart, strict=True)),
            median_error=median(end.error for end in ends),
            worst_error=max(end.error for end in ends),
            published=None if exact else PUBLISHED.get(name),
            median_angle=median(end.least_angle for end in ends),
            least_angle=min(end.least_angle for end in ends),
            least_facet=min(end.least_facet for end in ends),
            moved=median(run.moved for run in runs) if exact else None,
            median_seconds=median(seconds),
            worst_seconds=max(seconds),
        )


@dataclass(frozen=True)
class SideRow(Row):
    """A recipe by one method, from the same start, with its preferences.

    Attributes
    ----------
    recipe: its name; method: "paper" without a finish, "finished" or "exact".
    status: of the die; error: largest |p - q| as designed.
    circle: radius of the smallest of the largest circles in the outcomes' facets, over the die's
        largest diameter; facet: part of the surface that the smallest outcome's facet has;
        border_deg: least angle from a rest to the border of its basin.
    least_angle: between two outcomes, in degrees.
    thrown: total variation of simulated throws onto the board-game table from the target.
    seconds: of the design on the wall.
    points, triangles: (n, 3) and (t, 3) of the hull.
    """

    table: ClassVar[str | None] = "side_by_side"

    recipe: str = column("recipe", -28)
    method: str = column("method", -10)
    status: str = column("status", -13, lambda status: status.replace("_", " "))
    error: float = column("max |p - q|", 12, ".1e")
    circle: float = column("circle %", 10, percent(1))
    facet: float = column("facet %", 9, percent(1))
    border_deg: float = column("border deg", 12, ".1f")
    least_angle: float = column("angle deg", 11, ".1f")
    thrown: float = column("thrown TV", 11, ".3f")
    seconds: float = column("s", 7, ".2f")
    points: Floats = hidden(repr=False, compare=False)
    triangles: Integers = hidden(repr=False, compare=False)


@dataclass(frozen=True)
class AblationRow(Row):
    """A recipe without some terms, medians over all seeds.

    Attributes
    ----------
    recipe: its name; left_out: terms that have no weight, in words.
    error: largest |p - q|; rests: over outcomes.
    stray, fold, least_angle: in degrees, see `Ending`.
    points, triangles: (n, 3) and (t, 3) of the first seed's hull.
    """

    table: ClassVar[str | None] = "ablation"

    recipe: str = column("recipe", -28)
    left_out: str = column("weights", -15)
    error: float = column("median error", 14, ".1e")
    rests: float = column("rests an outcome", 18, ".2f")
    stray: float = column("stray deg", 11, ".1f")
    fold: float = column("fold deg", 10, ".1f")
    least_angle: float = column("angle deg", 11, ".1f")
    points: Floats = hidden(repr=False, compare=False)
    triangles: Integers = hidden(repr=False, compare=False)

    @classmethod
    def of(
        cls,
        problem: PaperProblem,
        left_out: str,
        ends: Sequence[Ending],
        shape: tuple[Floats, Integers],
    ) -> AblationRow:
        """Of at least one ending."""
        return cls(
            recipe=problem.recipe.name,
            left_out=left_out,
            error=median(end.error for end in ends),
            rests=median(end.rests for end in ends) / len(problem.target),
            stray=median(end.stray for end in ends),
            fold=median(end.fold for end in ends),
            least_angle=median(end.least_angle for end in ends),
            points=shape[0],
            triangles=shape[1],
        )


def _rows(run: Run) -> Items:
    from dicedesign.bench.measures.designs.paper_designs import PaperProblem
    from dicedesign.recipe.schema.reading import read_recipe

    extent: Extent = run.extent
    problems = [PaperProblem.of(read_recipe(path)) for path in run.options.recipes]
    fresh = [secrets.randbelow(2**32) for _ in range(extent.fresh)]
    seeds = [*range(extent.seeds), *fresh]
    yield {"seeds_used": seeds}
    if fresh:
        yield f"fresh seeds: {', '.join(map(str, fresh))}"
    # Not counted: torch takes longer at its first use in a process.
    problems[0].seeded(0)
    good = True
    for problem in problems:
        name = problem.recipe.name
        run.begin(name)
        runs = []
        for seed in seeds:
            runs.append(problem.seeded(seed))
            run.advance()
        rows = [SeedsRow.of(name, runs, exact=exact) for exact in (False, True)]
        yield from rows
        good = good and rows[0].good >= 0.95 * len(seeds) and rows[1].good == len(seeds)
    if extent.compared:
        yield ""
        for problem in problems:
            run.begin(f"{problem.recipe.name}, side by side")
            yield from _side_by_side(problem.recipe)
            run.advance()
    yield ""
    for problem in problems:
        if problem.recipe.name in ABLATED:
            run.begin(f"{problem.recipe.name}, without terms")
            for left_out, terms in TERMS.items():
                ends = [problem.without(seed, *terms) for seed in seeds]
                hull = ends[0][0].hull
                shape = hull.vertices, hull.triangles
                yield AblationRow.of(problem, left_out, [end for _, end in ends], shape)
                run.advance()
    return good


def _side_by_side(recipe: Recipe) -> list[SideRow]:
    """A recipe without a finish, as it is, and by the exact method from the same start."""
    from dicedesign.bench.measures.recipes import with_method
    from dicedesign.optimize.options import ExactOptions

    paper = recipe.method.paper
    assert paper is not None
    ways = {
        "paper": with_method(recipe, paper=replace(paper, finish="none", tolerance=None)),
        "finished": recipe,
        "exact": with_method(recipe, paper=None, exact=ExactOptions()),
    }
    return [_side(recipe.name, method, way) for method, way in ways.items()]


def _side(name: str, method: str, recipe: Recipe) -> SideRow:
    from concurrent.futures import ThreadPoolExecutor

    from dicedesign.bench.measures.recipes import begun, checked, designed
    from dicedesign.throws.distances import total_variation
    from dicedesign.throws.simulation import DieOnTable
    from dicedesign.throws.tables import table_named

    work = begun(recipe)
    seconds = designed(work)
    result = checked(work)
    body = work.plain.body
    on_table = DieOnTable.of(
        body, work.solid.center_of_mass, work.die.directions, table_named("board-game")
    )
    with ThreadPoolExecutor(2) as workers:
        counts = on_table.counts(on_table.simulated(DROPS, recipe.seed, "native", workers))
    wanted = [*work.target.probabilities.tolist(), 0.0]
    hull = work.die.hull
    return SideRow(
        recipe=name,
        method=method,
        status=result.status,
        error=result.design.max_abs_error,
        circle=min(facet.inradius_mm for facet in result.facets) / recipe.size_mm,
        facet=min(
            float(work.solid.poses.areas[rest]) for rest in work.solid.outcomes.main if rest >= 0
        )
        / float(work.solid.poses.hull.areas.sum()),
        border_deg=min(facet.border_deg for facet in result.facets),
        least_angle=result.least_angle_deg,
        thrown=total_variation(counts / counts.sum(), wanted),
        seconds=seconds,
        points=hull.vertices,
        triangles=hull.triangles,
    )


def _figure(rows: Sequence[Row], run: Run) -> Paper:
    """Dice side by side, a row for each recipe, and dice of the ablation."""
    from dicedesign.report.render.solids import solids_figure

    sides = [row for row in rows if isinstance(row, SideRow)]
    ablated = [row for row in rows if isinstance(row, AblationRow)]
    groups = [[_shown(row, row.method) for row in sides]]
    for name in dict.fromkeys(row.recipe for row in ablated):
        groups.append([_shown(row, row.left_out) for row in ablated if row.recipe == name])
    return solids_figure(groups, columns=len(TERMS))


def _shown(row: SideRow | AblationRow, what: str) -> tuple[str, Floats, Integers]:
    return f"{row.recipe.removeprefix('paper_')}\n{what}", row.points, row.triangles


BENCHES.register(
    Bench(
        name="paper",
        line="the paper's method over many seeds, beside the exact one, and without its terms",
        description="Run recipes of method paper with many seeds, without a finish and with the "
        "exact one, neither with preferences: medians and worst cases beside the published dice. "
        "Seeds are those from 0 on and fresh ones that are printed. Then put dice of each recipe "
        "side by side, by the paper's method, with its exact finish, and by the exact method from "
        "the same start, with 20,000 simulated throws of each. At last leave out one term of the "
        "energy after the other, as in the paper's figure 9. The exit code is 1 where fewer than "
        "95 % of the dice without finish are within 0.02 with all outcomes 10 degrees apart, or a "
        "finished one is not exact to 1e-12.",
        rows=_rows,
        full=Extent(seeds=10, fresh=10, compared=True),
        quick=Extent(seeds=2, fresh=0, compared=False),
        amounts=(
            Amount("seeds", "N", "seeds from 0 on"),
            Amount("fresh", "N", "seeds that nobody chose", least=0),
        ),
        options=(recipes("YAML file of method paper"),),
        packages=("numpy", "scipy", "torch"),
        unit="designs",
        figure=_figure,
        results=RESULTS,
    )
)
