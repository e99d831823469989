"""`dicedesign bench thrown`: dice designed for throws, before and after, and on changed tables."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dicedesign.cli.benches.reporting import (
    add_json_option,
    json_text,
    print_row,
    require_figure_folder,
)
from dicedesign.cli.options import add_worker_options, check_worker_options, workers_of
from dicedesign.errors import InputError
from dicedesign.runtime.workers import Workers

if TYPE_CHECKING:
    from dicedesign.bench.measures.thrown_dice import Extent
    from dicedesign.bench.measures.thrown_rows import ThrownRow
    from dicedesign.recipe.schema.recipe import Recipe
    from dicedesign.throws.statistics.total_variation import MeasuredDistance

__all__ = ["add_parser"]

NAME_WIDTH = 18

WIDTHS = (8, 8, 17, 8, 11, 10, 7, 8, 9)

CHANGE_WIDTHS = (9, 13, 8)

QUICK_RECIPES = 2

KEY = """\
before: total variation from the target of the die designed for odds without momentum; after: of the
recipe's own, with its 95 % interval; floor: the mean of a perfect die. geometric, momentum: total
variation between that model's odds of the recipe's die and its throws. s: of its design, on the
wall; rounds, drops: of its refinement. *: thrown without labels. worst: the largest total variation
of the same die with one parameter of the table changed; as the largest of many it has more of
chance in it than one alone. less noise: sqrt(max(worst^2 - floor^2, 0)). Density cancels on a table
that does not move."""


def add_parser(benches: Any) -> None:
    """Add the bench to argparse's `benches`."""
    parser = benches.add_parser(
        "thrown",
        help="dice designed for throws: total variation before and after, and on changed tables",
        description="Design the die of each recipe twice, for odds without momentum and by the "
        "recipe's own method, for throws with refinement. Throw both, as they are printed, with "
        "random numbers that no design has used, and the latter also on tables with restitution, "
        "friction, height, speed, spin or size lowered or raised. Exit code 1 if a design does not "
        "converge, or its throws are further from the target than the recipe's refine.within and "
        "chance is not the reason.",
    )
    parser.add_argument(
        "recipes",
        nargs="+",
        type=Path,
        metavar="RECIPE",
        help="YAML file of method: {exact: {odds: thrown, refine: {...}}}",
    )
    parser.add_argument(
        "--drops",
        type=int,
        metavar="N",
        help="of each die (default: 100000, or 4000 with --quick)",
    )
    parser.add_argument(
        "--variation",
        type=float,
        metavar="PART",
        help="of each parameter that is taken away and added (default: 0.2)",
    )
    parser.add_argument(
        "--variation-drops",
        type=int,
        metavar="N",
        help="on each changed table (default: 20000, or 1000 with --quick)",
    )
    parser.add_argument(
        "--engine",
        default="native",
        metavar="NAME",
        help="that judges: native, the package's own; mujoco, which needs the extra 'throws'; or "
        "bullet, which needs the extra 'bullet' (default: native); designs keep to their own",
    )
    parser.add_argument(
        "--quick",
        action="store_true",
        help="the first two recipes, with few drops and one round, in less than a minute",
    )
    parser.add_argument(
        "--figure", type=Path, metavar="FILE.png", help="draw the total variations of all dice"
    )
    add_worker_options(
        parser,
        "how many tasks of throws at a time (default: one for each core); does not change the "
        "results",
    )
    add_json_option(parser)
    parser.set_defaults(command=_run)


def _run(options: argparse.Namespace) -> int:
    check_worker_options(options)
    require_figure_folder(options.figure)

    import torch

    from dicedesign.bench.machine import machine_description
    from dicedesign.bench.measures.thrown_dice import throw_recipe
    from dicedesign.throws.engines.engine import require_engine

    # As `dicedesign run` does.
    torch.set_num_threads(1)
    extent = _extent(options)
    recipes = _recipes(options.recipes[:QUICK_RECIPES] if options.quick else options.recipes)
    require_engine(extent.engine)
    rows: list[ThrownRow] = []
    if not options.json:
        print_row(_heading())
    with workers_of(options, "drops", len(recipes) * extent.all_drops) as workers:
        for number, recipe in enumerate(recipes, start=1):
            on_stage = _Stages(workers, f"{number} of {len(recipes)}: {recipe.name}")
            rows.append(
                throw_recipe(
                    recipe, extent, workers.executor, on_stage, workers.advance, workers.on_quiet
                )
            )
            if not options.json:
                print_row(_row(rows[-1]))
    if options.json:
        described = machine_description("numpy", "scipy", "torch", "mujoco")
        plain = [row.plain() for row in rows]
        print(json_text({**described, **asdict(extent), "rows": plain}))
    else:
        _print_changes(rows, extent)
        print_row("\n".join(["", KEY, "", *_verdict(rows)]))
    if options.figure is not None:
        from dicedesign.bench.thrown_figure import thrown_figure
        from dicedesign.report.charts.png import png_bytes
        from dicedesign.runtime.files import atomic_write

        atomic_write(options.figure, png_bytes(thrown_figure(rows, extent)))
        print(f"wrote {options.figure}", file=sys.stderr if options.json else sys.stdout)
    return 1 if any(row.missed for row in rows) else 0


class _Stages:
    """Says beside the bar what is being done to which recipe."""

    def __init__(self, workers: Workers, recipe: str) -> None:
        self.workers, self.recipe = workers, recipe

    def __call__(self, stage: str) -> None:
        self.workers.bar.set_description_str(f"{self.recipe}, {stage}")


def _extent(options: argparse.Namespace) -> Extent:
    from dicedesign.bench.measures.thrown_dice import FULL, QUICK
    from dicedesign.throws.simulation.simulation import check_throws

    extent = replace(QUICK if options.quick else FULL, engine=options.engine)
    for name in ("drops", "variation_drops"):
        given = getattr(options, name)
        if given is not None:
            if given < 1:
                flag = name.replace("_", "-")
                raise InputError(
                    f"--{flag}: expected a whole number above 0, got {given}; raise it"
                )
            extent = replace(extent, **{name: given})
    if options.variation is not None:
        if not 0.0 < options.variation < 1.0:
            raise InputError(
                f"--variation: expected a number in (0, 1), got {options.variation:g}; leave it "
                "out for 0.2"
            )
        extent = replace(extent, variation=options.variation)
    check_throws(extent.drops, 0, extent.engine, "uniform")
    return extent


def _recipes(paths: Sequence[Path]) -> list[Recipe]:
    """All recipes; what is wrong with one is said before anything is designed."""
    from dicedesign.bench.measures.thrown_dice import refinement_of
    from dicedesign.recipe.schema.reading import read_recipe

    recipes = []
    for path in paths:
        recipe = read_recipe(path)
        try:
            refinement_of(recipe)
        except InputError as error:
            raise InputError(f"{path}: {error}") from error
        recipes.append(recipe)
    return recipes


def _heading() -> str:
    return f"total variation from the target\n{'recipe':<{NAME_WIDTH}}" + _cells(
        WIDTHS,
        "before",
        "after",
        "",
        "floor",
        "geometric",
        "momentum",
        "s",
        "rounds",
        "drops",
    )


def _row(row: ThrownRow) -> str:
    cells = ["-"] * len(WIDTHS)
    if row.before is not None:
        cells[0] = f"{row.before.to_target.value:.4f}{_mark(row.before.engraved)}"
    if row.after is not None:
        found, after = row.after.to_target, row.after
        cells[1:] = [
            f"{found.value:.4f}{_mark(after.engraved)}",
            _interval(found),
            f"{found.noise_floor:.4f}",
            f"{after.geometric:.4f}",
            f"{after.momentum:.4f}",
            f"{after.seconds:.0f}",
            str(after.rounds),
            str(after.round_drops),
        ]
    return f"{row.name:<{NAME_WIDTH}}{_cells(WIDTHS, *cells)}  {row.note}".rstrip()


def _mark(engraved: bool) -> str:
    return "" if engraved else "*"


def _interval(found: MeasuredDistance) -> str:
    return f"{found.interval[0]:.4f}-{found.interval[1]:.4f}"


def _print_changes(rows: Sequence[ThrownRow], extent: Extent) -> None:
    """The worst of each die, and what was left out."""
    part = f"{100.0 * extent.variation:g} %"
    print_row(
        f"\nwith one parameter of the table changed by -{part} or +{part}, {extent.variation_drops}"
        f" drops at each\n{'recipe':<{NAME_WIDTH}}"
        + _cells(CHANGE_WIDTHS, "worst", "less noise", "floor")
        + "  at"
    )
    for row in rows:
        worst = row.worst
        if worst is not None:
            found = worst.to_target
            cells = _cells(
                CHANGE_WIDTHS,
                f"{found.value:.4f}",
                f"{worst.above_noise:.4f}",
                f"{found.noise_floor:.4f}",
            )
            at = f"{worst.parameter} {100.0 * (worst.factor - 1.0):+.0f} %"
            print_row(f"{row.name:<{NAME_WIDTH}}{cells}  {at}")
        for reason in row.left_out:
            print_row(f"{row.name:<{NAME_WIDTH}}  left out: {reason}")


def _verdict(rows: Sequence[ThrownRow]) -> list[str]:
    """How many dice are where they are meant to be, and which are not."""
    from dicedesign.bench.measures.thrown_dice import ROBUST

    counted = [
        row.name for row in rows if row.after is None or row.after.to_target.value > row.within
    ]
    moved = [row.name for row in rows if row.worst is None or row.worst.above_noise > ROBUST]
    return [
        _line(rows, counted, "within what their recipes ask for, as counted"),
        _line(rows, moved, f"within {ROBUST:g} on every changed table, less noise"),
    ]


def _line(rows: Sequence[ThrownRow], others: Sequence[str], what: str) -> str:
    text = f"{len(rows) - len(others)} of {len(rows)} dice {what}"
    return f"{text}; not {', '.join(others)}" if others else text


def _cells(widths: Sequence[int], *cells: str) -> str:
    return "".join(f"{cell:>{width}}" for cell, width in zip(cells, widths, strict=True))
