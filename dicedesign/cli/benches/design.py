"""`dicedesign bench design`: every method of design on the same recipes."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dicedesign.cli.benches.reporting import (
    add_folder_option,
    add_json_option,
    print_row,
    progress_bar,
    require_positive_seconds,
    write_results,
)
from dicedesign.errors import InputError
from dicedesign.runtime.files import make_writable_folder

if TYPE_CHECKING:
    from dicedesign.bench.design import Run
    from dicedesign.design.result import DesignStep
    from dicedesign.design.starts.start import Start
    from dicedesign.recipe.schema.recipe import Recipe

__all__ = ["add_parser"]

EARLY = (0.1, 1.0)
"""Seconds at which the table gives the error."""


def add_parser(benches: Any) -> None:
    """Add the bench to argparse's `benches`."""
    parser = benches.add_parser(
        "design",
        help="error against run time, by every method of design",
        description="Design recipes by every method and preconditioner there is, from the same "
        "start, and compare error and dice energy over time. Errors are largest |p - q| over the "
        "clusters of rests, the smallest so far; the last column is that of the finished die, on "
        "which only rests near a labelled facet count. Of the energy only the dice term (eq. 12) "
        "is compared, as the other terms have weights that differ between methods.",
    )
    parser.add_argument("recipes", nargs="+", type=Path, metavar="RECIPE", help="YAML file")
    parser.add_argument(
        "--seconds",
        type=float,
        default=15.0,
        metavar="S",
        help="longest time of each run (default: 15)",
    )
    add_folder_option(parser, "design")
    add_json_option(parser)
    parser.set_defaults(command=_run)


def _run(options: argparse.Namespace) -> int:
    import torch

    from dicedesign.bench.design import METHODS, methods_figure, methods_record, run_method
    from dicedesign.recipe.schema.reading import read_recipe

    # Tensors here are far too small to share among threads.
    torch.set_num_threads(1)
    require_positive_seconds(options.seconds)
    recipes = [read_recipe(path) for path in options.recipes]
    _require_distinct_names(recipes, options.recipes)
    starts = [_start(recipe) for recipe in recipes]
    make_writable_folder(options.out)
    runs = []
    with progress_bar("steps") as bar:

        def on_step(step: DesignStep) -> None:
            bar.update()
            bar.set_postfix_str(f"max |p - q| {step.error:.2e}")

        if not options.json:
            print_row(_heading())
        for recipe, start in zip(recipes, starts, strict=True):
            for method in METHODS:
                bar.set_description_str(f"{recipe.name}: {method.name}")
                runs.append(run_method(recipe, start, method, options.seconds, on_step))
                if not options.json:
                    print_row(_row(runs[-1]))
    write_results(
        options.out,
        "design",
        methods_figure(runs),
        methods_record(runs, options.seconds),
        as_json=options.json,
    )
    return 0


def _start(recipe: Recipe) -> Start:
    from dicedesign.recipe.design_stage import make_start

    start = make_start(recipe)
    if start is None:
        raise InputError(
            f"{recipe.name}: expected a start that all methods can share, got start.search; give "
            "it another start"
        )
    return start


def _require_distinct_names(recipes: list[Recipe], paths: list[Path]) -> None:
    """Rows and panels are known by the names of their recipes."""
    known: dict[str, Path] = {}
    for recipe, path in zip(recipes, paths, strict=True):
        if recipe.name in known:
            raise InputError(
                f"{path}: expected a recipe of another name than those before, got "
                f"{recipe.name!r} as in {known[recipe.name]}; change the name of one"
            )
        known[recipe.name] = path


def _heading() -> str:
    errors = (*(f"at {seconds:g} s" for seconds in EARLY), "end")
    return _line(
        "recipe",
        "method",
        "status",
        "steps",
        "energies",
        "hulls",
        "kept",
        "s",
        *errors,
        "energy",
        "die",
    )


def _row(run: Run) -> str:
    return _line(
        run.recipe,
        run.method,
        run.status.lower().replace("_", " "),
        str(run.steps),
        str(run.evaluations),
        str(run.hulls_built),
        str(run.hulls_reused),
        f"{run.seconds[-1]:.2f}",
        *(f"{run.error_after(seconds):.1e}" for seconds in EARLY),
        f"{run.errors[-1]:.1e}",
        f"{run.energies[-1]:.1e}",
        f"{run.die_error:.1e}",
    )


def _line(recipe: str, method: str, status: str, *values: str) -> str:
    widths = (6, 9, 7, 7, 7, 9, 9, 9, 9, 9)
    cells = "".join(f"{value:>{width}}" for value, width in zip(values, widths, strict=True))
    return f"{recipe:<20} {method:<30} {status:<12}{cells}"
