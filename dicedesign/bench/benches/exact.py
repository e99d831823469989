"""The exact method on random targets, beside the paper's from as many starts, and recipes as they
are."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import median
from typing import TYPE_CHECKING, ClassVar

from dicedesign.bench.frame import BENCHES, Bench, Items, Run
from dicedesign.bench.options import Amount, recipes
from dicedesign.bench.rows import Row, column, hidden

if TYPE_CHECKING:
    from dicedesign.bench.measures.designs.random_targets import Attempt
    from dicedesign.bench.measures.recipes import Work
    from dicedesign.recipe.schema.recipe import Recipe
    from dicedesign.results.result import Result

__all__ = [
    "Extent",
    "RecipeRow",
    "TargetsRow",
    "attempt_recipe",
    "summaries",
]


@dataclass(frozen=True)
class Extent:
    """How many random targets there are, and the limit of the exact method for each."""

    targets: int
    limit_seconds: float


@dataclass(frozen=True)
class TargetsRow(Row):
    """Attempts at targets of so many outcomes.

    Attributes
    ----------
    outcomes: how many, or None for all attempts.
    targets, solved: how many were tried and how many solved.
    median_seconds: of the exact method, solved or not.
    worst_seconds: of the solved ones, nan if there are none.
    median_paper_error, worst_paper_error: of the paper's method from as many starts, which takes
        `median_paper_seconds`.
    """

    outcomes: int | None = column("outcomes", 8, none="all")
    targets: int = column("targets", 9)
    solved: int = column("solved", 8)
    median_seconds: float = column("median s", 11, ".3f")
    worst_seconds: float = column("worst solved s", 16, ".3f")
    median_paper_error: float = column("median of paper's", 19, ".1e")
    worst_paper_error: float = column("worst", 9, ".1e")
    median_paper_seconds: float = column("median s", 10, ".3f")

    @classmethod
    def of(cls, outcomes: int | None, attempts: Sequence[Attempt]) -> TargetsRow:
        """Of at least one attempt."""
        solved = [attempt.seconds for attempt in attempts if attempt.solved]
        paper = [attempt.paper_error for attempt in attempts]
        paper_seconds = median(attempt.paper_seconds for attempt in attempts)
        seconds = median(attempt.seconds for attempt in attempts)
        worst = max(solved, default=float("nan"))
        count = len(attempts)
        return cls(
            outcomes, count, len(solved), seconds, worst, median(paper), max(paper), paper_seconds
        )


@dataclass(frozen=True)
class RecipeRow(Row):
    """One recipe by its own method.

    Attributes
    ----------
    name: of the recipe; method: by its key.
    verdict: "solved" if the die is all that the recipe wants, with one rest for each outcome; else
        why the design stopped.
    outcomes: how many the target has; rests: stable facets of the die by the forward model.
    error: largest |p - q| by the forward model, as designed; infinite unless there is one rest for
        each outcome and no other.
    odds_seconds: wall-clock time after which the design was within the tolerance first, by its
        history; nan if never.
    seconds: wall-clock time of the whole design, the search for starting shapes and the improvement
        by preference included.
    inradius_mm: radius of the smallest of the largest circles in the outcomes' facets; border_deg:
        least angle from a rest's normal to the border of its basin; nan where `error` is infinite.
    status: why the design stopped, in small letters.
    tolerance: largest |p - q| that the recipe takes for reached.
    """

    table: ClassVar[str | None] = "recipes"
    computed: ClassVar[tuple[str, ...]] = ("solved",)

    name: str = column("recipe", -27)
    method: str = column("method", -9)
    verdict: str = column("verdict", -12)
    outcomes: int = column("outcomes", 9)
    rests: int = column("rests", 7)
    error: float = column("max |p - q|", 13, ".1e")
    odds_seconds: float = column("odds s", 9, ".3f")
    seconds: float = column("s", 9, ".3f")
    inradius_mm: float = column("circle mm", 11, ".2f")
    border_deg: float = column("border deg", 12, ".1f")
    status: str = hidden()
    tolerance: float = hidden()

    @property
    def solved(self) -> bool:
        """Whether the verdict is that."""
        return self.verdict == "solved"

    @classmethod
    def of(cls, recipe: Recipe, seconds: float, die: Result | None) -> RecipeRow:
        """A recipe's die, if there is one, which took so long."""
        tolerance, labels = recipe.method.tolerance, recipe.target.target().labels
        row = cls(
            name=recipe.name,
            method=recipe.method.name,
            verdict="no die",
            outcomes=len(labels),
            rests=0,
            error=float("inf"),
            odds_seconds=float("nan"),
            seconds=seconds,
            inradius_mm=float("nan"),
            border_deg=float("nan"),
            status="no_die",
            tolerance=tolerance,
        )
        if die is None:
            return row
        met = (s.seconds or 0.0 for s in die.history if (s.max_abs_error or 0.0) <= tolerance)
        row = replace(
            row,
            verdict=die.status.replace("_", " "),
            rests=len(die.facets),
            odds_seconds=next(met, float("nan")),
            status=die.status,
        )
        if sorted(facet.label or "" for facet in die.facets) != sorted(labels):
            return row
        return replace(
            row,
            verdict="solved" if die.converged else row.verdict,
            error=die.design.max_abs_error,
            inradius_mm=min(facet.inradius_mm for facet in die.facets),
            border_deg=min(facet.border_deg for facet in die.facets),
        )


def _rows(run: Run) -> Items:
    from dicedesign.bench.measures.designs.random_targets import STARTS, attempt_target
    from dicedesign.bench.measures.recipes import begun
    from dicedesign.recipe.schema.reading import read_recipe

    extent: Extent = run.extent
    given = [read_recipe(path) for path in run.options.recipes]
    recipes = [
        recipe for recipe in given if recipe.method.concave is None and not recipe.method.thrown
    ]
    if len(recipes) < len(given):
        run.note(f"{len(given) - len(recipes)} recipes of concave or thrown dice are left out")
    works = [begun(recipe) for recipe in recipes]
    yield {"limit_starts": STARTS, "recipes": []}
    # Not counted: torch takes longer at its first use in a process.
    attempt_target(extent.targets, extent.limit_seconds)
    attempts = []
    for number in range(extent.targets):
        run.begin(f"target {number}")
        attempts.append(attempt_target(number, extent.limit_seconds))
        yield attempts[-1]
        run.advance()
    yield from summaries(attempts)
    for attempt in attempts:
        if not attempt.solved:
            wanted = ", ".join(f"{probability:.4f}" for probability in attempt.target)
            yield (
                f"not solved: target {attempt.number} ({wanted}), error {attempt.error:.1e} with "
                f"{attempt.rests} rests after {attempt.seconds:.1f} s, {attempt.status}"
            )
    yield ""
    for work in works:
        run.begin(work.recipe.name)
        yield attempt_recipe(work)
        run.advance()
    return True


def summaries(attempts: Sequence[Attempt]) -> list[TargetsRow]:
    """A row for each number of outcomes, and the last one of all; attempts: at least one."""
    numbers = sorted({attempt.outcomes for attempt in attempts})
    groups = [(k, [a for a in attempts if a.outcomes == k]) for k in numbers]
    return [TargetsRow.of(outcomes, group) for outcomes, group in [*groups, (None, attempts)]]


def attempt_recipe(work: Work) -> RecipeRow:
    """Design the die of a recipe that was begun, which is neither engraved nor written, and measure
    it.

    Raises InputError if the start does not suit the target.
    """
    from dicedesign.bench.measures.recipes import checked, designed
    from dicedesign.errors import NoStartError

    started = time.perf_counter()
    try:
        seconds = designed(work)
    except NoStartError:
        return RecipeRow.of(work.recipe, time.perf_counter() - started, None)
    return RecipeRow.of(work.recipe, seconds, checked(work))


BENCHES.register(
    Bench(
        name="exact",
        line="the exact method on random targets, beside the paper's, and recipes as they are",
        description="Design dice for random targets of 4 to 12 outcomes, the smallest at least "
        "0.01, by the exact method from searched shapes, without preferences, and by the paper's "
        "without a finish from as many evenly spread shapes. Then run recipes as they are, each by "
        "its own method. A die is solved when the forward model finds one rest for each outcome "
        "and no other, and odds within 1e-12 or the recipe's tolerance; for a recipe, its design "
        "must have converged too. Of recipes the table gives seconds until the odds were met and "
        "in all, with the improvement by preference; the radius of the smallest of the largest "
        "circles in the outcomes' facets; and the least angle from a rest to the border of its "
        "basin. Seconds are wall-clock time; a first target is solved uncounted, since torch takes "
        "longer at its first use in a process.",
        rows=_rows,
        full=Extent(targets=200, limit_seconds=10.0),
        quick=Extent(targets=18, limit_seconds=10.0),
        amounts=(
            Amount("targets", "N", "how many targets"),
            Amount(
                "limit_seconds",
                "S",
                "limit of the exact method for each random target",
                "--seconds",
                float,
            ),
        ),
        options=(recipes("YAML file of a convex die", "*"),),
        packages=("numpy", "scipy", "torch"),
        unit="dice",
    )
)
