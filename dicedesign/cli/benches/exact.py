"""`dicedesign bench exact`: the exact method on random targets, and any method on recipes."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dicedesign.cli.benches.reporting import (
    add_json_option,
    json_text,
    print_row,
    progress_bar,
    require_positive_seconds,
)
from dicedesign.errors import InputError

if TYPE_CHECKING:
    from dicedesign.bench.exact import Attempt, Summary
    from dicedesign.bench.measures.recipe_attempts import RecipeAttempt
    from dicedesign.design.starts.start import Start
    from dicedesign.recipe.schema.recipe import Recipe

__all__ = ["add_parser"]

WIDTHS = (8, 9, 8, 11, 16, 17, 16)

RECIPE_WIDTHS = (9, 7, 13, 9, 9, 11, 12)


def add_parser(benches: Any) -> None:
    """Add the bench to argparse's `benches`."""
    parser = benches.add_parser(
        "exact",
        help="the exact method on random targets, beside descent in the same time, and recipes",
        description="Design dice for random targets of 4 to 12 outcomes, the smallest at least "
        "0.01, by the exact method from searched shapes, without preferences, and by descent in "
        "the same time. Then run recipes as they are, each by its own method. A die is solved when "
        "the forward model finds one rest for each outcome and no other, and odds within 1e-12 or "
        "the recipe's tolerance; for a recipe, its design must have converged too. Of recipes the "
        "table gives seconds until the odds were met and in all, with the improvement by "
        "preference; the radius of the smallest of the largest circles in the outcomes' facets; "
        "and the least angle from a rest to the border of its basin. Seconds are wall-clock time; "
        "a first target is solved uncounted, since torch takes longer at its first use in a "
        "process.",
    )
    parser.add_argument(
        "recipes", nargs="*", type=Path, metavar="RECIPE", help="YAML file of a convex die"
    )
    parser.add_argument(
        "--targets", type=int, default=200, metavar="N", help="how many targets (default: 200)"
    )
    parser.add_argument(
        "--seconds",
        type=float,
        default=10.0,
        metavar="S",
        help="limit of the exact method for each random target (default: 10)",
    )
    add_json_option(parser)
    parser.set_defaults(command=_run)


def _run(options: argparse.Namespace) -> int:
    if options.targets < 1:
        raise InputError(f"--targets: expected at least 1, got {options.targets}; give more")
    require_positive_seconds(options.seconds)

    import torch

    from dicedesign.bench.exact import STARTS, run_targets, summaries
    from dicedesign.bench.machine import machine_description
    from dicedesign.recipe.design_stage import make_start
    from dicedesign.recipe.schema.reading import read_recipe

    # As `dicedesign run` does.
    torch.set_num_threads(1)
    given = [read_recipe(path) for path in options.recipes]
    recipes = [
        recipe for recipe in given if recipe.method.concave is None and not recipe.method.thrown
    ]
    if len(recipes) < len(given):
        left_out = len(given) - len(recipes)
        print(f"note: {left_out} recipes of concave or thrown dice are left out", file=sys.stderr)
    starts = [make_start(recipe) for recipe in recipes]
    attempts = []
    with progress_bar("targets") as bar:
        bar.reset(total=options.targets)
        for attempt in run_targets(options.targets, options.seconds, bar.set_description_str):
            bar.update()
            attempts.append(attempt)
    rows = summaries(attempts)
    if not options.json:
        _print_targets(rows, attempts)
    designed = _run_recipes(recipes, starts, show=not options.json)
    if options.json:
        record = {
            **machine_description("numpy", "scipy", "torch"),
            "limit_seconds": options.seconds,
            "limit_starts": STARTS,
            "rows": [asdict(row) for row in rows],
            "targets": [attempt.plain() for attempt in attempts],
            "recipes": [attempt.plain() for attempt in designed],
        }
        print(json_text(record))
    return 0


def _run_recipes(
    recipes: Sequence[Recipe], starts: Sequence[Start | None], *, show: bool
) -> list[RecipeAttempt]:
    """Design one recipe after the other. show: print the row of each as it comes."""
    from dicedesign.bench.measures.recipe_attempts import attempt_recipe

    attempts: list[RecipeAttempt] = []
    if not recipes:
        return attempts
    if show:
        print_row(f"\n{_recipe_heading()}")
    with progress_bar("recipes") as bar:
        bar.reset(total=len(recipes))
        for recipe, start in zip(recipes, starts, strict=True):
            bar.set_description_str(recipe.name)
            attempts.append(attempt_recipe(recipe, start))
            bar.update()
            if show:
                print_row(_recipe_row(attempts[-1]))
    return attempts


def _print_targets(rows: Sequence[Summary], attempts: Sequence[Attempt]) -> None:
    print_row(
        _line(
            "outcomes", "targets", "solved", "median s", "worst solved s", "median descent", "worst"
        )
    )
    for row in rows:
        print_row(_table_row(row))
    for attempt in attempts:
        if not attempt.solved:
            print_row(_unsolved(attempt))


def _table_row(row: Summary) -> str:
    return _line(
        "all" if row.outcomes is None else str(row.outcomes),
        str(row.targets),
        str(row.solved),
        f"{row.median_seconds:.3f}",
        f"{row.worst_seconds:.3f}" if row.solved else "-",
        f"{row.median_descent_error:.1e}",
        f"{row.worst_descent_error:.1e}",
    )


def _unsolved(attempt: Attempt) -> str:
    wanted = ", ".join(f"{probability:.4f}" for probability in attempt.target)
    return (
        f"not solved: target {attempt.number} ({wanted}), error {attempt.error:.1e} with "
        f"{attempt.rests} rests after {attempt.seconds:.1f} s, {attempt.status}"
    )


def _line(*cells: str) -> str:
    return "".join(f"{cell:>{width}}" for cell, width in zip(cells, WIDTHS, strict=True))


def _recipe_heading() -> str:
    return _recipe_line(
        "recipe",
        "method",
        "verdict",
        "outcomes",
        "rests",
        "max |p - q|",
        "odds s",
        "s",
        "circle mm",
        "border deg",
    )


def _recipe_row(attempt: RecipeAttempt) -> str:
    return _recipe_line(
        attempt.name,
        attempt.method,
        "solved" if attempt.solved else attempt.status.lower().replace("_", " "),
        str(attempt.outcomes),
        str(attempt.rests),
        _number(attempt.error, ".1e"),
        _number(attempt.odds_seconds, ".3f"),
        _number(attempt.seconds, ".3f"),
        _number(attempt.inradius_mm, ".2f"),
        _number(attempt.border_deg, ".1f"),
    )


def _number(value: float, form: str) -> str:
    return format(value, form) if math.isfinite(value) else "-"


def _recipe_line(recipe: str, method: str, verdict: str, *cells: str) -> str:
    values = "".join(f"{cell:>{width}}" for cell, width in zip(cells, RECIPE_WIDTHS, strict=True))
    return f"{recipe:<26} {method:<8} {verdict:<12}{values}"
