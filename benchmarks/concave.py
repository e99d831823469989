"""concave dice of many models: success rate, time and displacement

Make each model into a die for each target, with the options of a recipe that gives none, and
measure what the STL file of the die holds. As wanted is one with probabilities and probabilities
elsewhere within 0.005, nothing that meets, outcomes 45 degrees apart and margins of 10, in 60 s of
the processor. Prints are good if they are off by a total variation of .015 on average, and nine in
ten by at most .03. Exits 1 where fewer models become dice than the goal of the target, 90 % for
fair:2 and fair:3, 75 % for 1/2,1/3,1/6, 40 % for fair:4, or half of fewer than ten; or where fewer
than 85 % of the models have good prints as fair:3. With --fill paper all of the paper's method
makes them, decimated to 2,000 points (250 with --quick).
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from benchmarks.frame import Report, make_die, processes
from benchmarks.models import break_surface, is_model, model_names, random_model
from dicedesign import InputError, Result, parse_recipe
from dicedesign.concave.shapes import SHAPES, shape
from dicedesign.geometry.meshes.reading import stl_bytes
from dicedesign.geometry.surfaces.closed_surface import decimate
from dicedesign.recipe.pipeline import run_stages

GOALS = {"fair:2": 0.9, "fair:3": 0.9, "1/2,1/3,1/6": 0.75, "fair:4": 0.4}
"""Least share of the models that become dice, by target."""

PRINT_GOALS = {"fair:3": 0.85}
"""Least share of the models that become dice whose prints are good."""

MEAN_PRINTS, MOST_PRINTS = 0.015, 0.03
"""Largest total variation of good prints from the target, on average and of nine in ten."""

FEW = 10
"""Dice below which chance decides about such a share."""

LEAST_APART, LEAST_MARGIN, ANGLE_SLACK = 45.0, 10.0, 0.01
"""Degrees between outcomes, and by which a die must be tipped to leave one; both may be a little
less, as a search ends at the limits and files are rounded."""

LONGEST = 60.0
"""Processor seconds of a search, which a busy machine does not prolong."""

MEASURED = (
    "points",
    "s",
    "|p - q|",
    "elsewhere",
    "meet",
    "apart",
    "margin",
    "mean",
    "largest",
    "shape",
    "size",
    "corners",
    "prints",
    "9 in 10",
    "tried",
)
"""What is known of a die that was made, by the name of the column; apart and margin in degrees,
displacements over the diagonal, shape and size distortion, corners of the hull after and before,
total variation of prints on average and of nine in ten."""


@dataclass(frozen=True)
class Case:
    """A die that is to be made.

    Attributes
    ----------
    model: name of a built-in one, or path of a file. target: as typed; fill: as typed.
    seconds: after which a die as wanted is not brought nearer to its model; None for no limit.
    most_points: to which larger surfaces are decimated first; None to leave them.
    is_broken: whether a built-in model is broken first, and repaired by the recipe.
    """

    model: str
    target: str
    fill: str
    seconds: float | None
    most_points: int | None
    is_broken: bool = False


def add_options(parser: argparse.ArgumentParser) -> None:
    """What is made into dice."""
    parser.add_argument("meshes", nargs="*", type=Path, metavar="MESH")
    parser.add_argument("--models", type=Path, metavar="FOLDER", help="every mesh in a folder")
    parser.add_argument(
        "--model",
        action="append",
        metavar="NAME",
        help="one made at random such as blobs_03, or a shape such as kitten; may be repeated",
    )
    parser.add_argument(
        "--random",
        type=int,
        metavar="N",
        help="models made at random, of eleven kinds in turn (default: 40 if no others are named; "
        "quick: 3)",
    )
    parser.add_argument(
        "--target",
        action="append",
        metavar="TARGET",
        help="fair:K, or probabilities such as 1/2,1/3,1/6; may be repeated",
    )
    parser.add_argument(
        "--fill",
        choices=("correspondence", "paper", "both"),
        default="correspondence",
        help="how the surface is made to fill its hull (default: correspondence)",
    )
    parser.add_argument(
        "--broken", action="store_true", help="models have holes and loose parts, to be repaired"
    )
    parser.add_argument("--seconds", type=float, metavar="S", help="no improvement after that")


def run(options: argparse.Namespace, report: Report) -> bool:
    """A row for each die, then one for each target and fill: in tables of their own where fills are
    compared, and for the meshes that were given."""
    prefix = "fills " if options.fill == "both" else "broken " if options.broken else ""
    columns = (
        "model 17s | target 12s | fill 14s | points 6d | s 6.1f | |p - q| 8.1e | "
        "elsewhere 8.1e | meet 4d | apart 6.1f | margin 6.1f | mean 7.2% | largest 7.1% | "
        "shape 6.2f | size 6.2f | corners 9s | prints 6.4f | 9 in 10 7.4f | tried 5d | verdict 0s"
    )
    rows = [report.table(f"{prefix}{name}", columns) for name in ("models", "meshes")]
    attempts = []
    with processes(options.jobs) as workers:
        for case, (measures, reason) in zip(
            cases := list(cases_of(options)), workers.map(attempt, cases), strict=True
        ):
            cells = [measures.get(name) for name in MEASURED]
            row = rows[Path(case.model).is_file()]
            row(Path(case.model).stem, case.target, case.fill, *cells, reason or "as wanted")
            attempts.append((case, measures, reason))
    return summarize(attempts, report.table(f"{prefix}targets", SUMMARY))


def cases_of(options: argparse.Namespace) -> Iterator[Case]:
    """Every target with every model by every fill. Raises InputError for what is none."""
    models = [*map(str, options.meshes), *(options.model or ())]
    if options.models is not None:
        models += [str(path) for path in sorted(options.models.iterdir()) if path.is_file()]
    if options.random is not None or not models:
        models += model_names(options.random or (3 if options.quick else 40))
    for model in models:
        if not (Path(model).is_file() or model in SHAPES or is_model(model)):
            raise InputError(
                f"{model}: expected a mesh file, a shape such as kitten, or a model such as "
                "blobs_03, got none of these; check the name"
            )
    fills = ("correspondence", "paper") if options.fill == "both" else (options.fill,)
    most_points = 250 if options.quick else 2000
    seconds = options.seconds or (20.0 if options.quick else None)
    for target in options.target or (("fair:3",) if options.quick else GOALS):
        for model in models:
            for fill in fills:
                most = most_points if fill == "paper" else None
                yield Case(model, target, fill, seconds, most, options.broken)


def attempt(case: Case) -> tuple[dict[str, Any], str]:
    """What was measured, and why the die is not as wanted, or ""."""
    measures: dict[str, Any] = {}
    try:
        with TemporaryDirectory() as folder:
            path = Path(case.model)
            if not path.is_file():
                name = case.model
                surface = shape(name) if name in SHAPES else random_model(name)
                if case.is_broken:
                    surface = break_surface(surface, len(surface.points))
                path = Path(folder) / "model.stl"
                path.write_bytes(stl_bytes(surface))
            work = make_die(parse_recipe(entries_of(case, path)), "start")
        if case.most_points is not None and len(work.surface.points) > case.most_points:
            work.surface, _ = decimate(work.surface, case.most_points)
        measures["points"] = len(work.surface.points)
        start = time.process_time()
        try:
            run_stages(work, after="start", last="design")
        finally:
            measures["s"] = time.process_time() - start
        run_stages(work, after="design", last="tolerances")
        measures |= measure(work.result())
        return measures, "; ".join(shortfalls(measures, work.recipe.method.tolerance))
    except Exception as error:  # a bench goes on with the next case, whatever went wrong in one
        return measures, f"{type(error).__name__}: {error}"


def entries_of(case: Case, path: Path) -> dict[str, Any]:
    """A recipe that gives no options but those of the case."""
    kind, colon, count = case.target.partition(":")
    target: dict[str, Any] = {"probabilities": [part.strip() for part in case.target.split(",")]}
    if colon:
        target = {kind: int(count)}
    concave: dict[str, Any] = {} if case.seconds is None else {"seconds": case.seconds}
    if case.fill == "paper":
        concave |= {"hull": "paper", "fill": "paper", "attempts": 3}
    start = {"mesh": {"path": str(path), "repair": case.is_broken}}
    return {"name": "die", "target": target, "start": start, "method": {"concave": concave}}


def measure(die: Result) -> dict[str, Any]:
    """The row, by the STL file of the die."""
    concave = die.concave
    distortion = concave.surface_quality["distortion"]
    return {
        "|p - q|": die.max_abs_error,
        "elsewhere": die.elsewhere,
        "meet": concave.self_intersections,
        "apart": die.least_angle_deg,
        "margin": die.least_margin_deg,
        "mean": concave.displacement.mean,
        "largest": concave.displacement.largest,
        "shape": distortion["shape_mean"],
        "size": distortion["size_mean"],
        "corners": f"{concave.hull.vertices_after}/{concave.hull.vertices_before}",
        "prints": None if die.tolerances is None else die.tolerances.total_variation,
        "9 in 10": None if die.tolerances is None else die.tolerances.nine_in_ten,
        "tried": die.search.attempts,
    }


def shortfalls(measures: dict[str, Any], tolerance: float) -> Iterator[str]:
    """Why a die is not as wanted."""
    if measures["|p - q|"] > tolerance:
        yield f"probabilities off by {measures['|p - q|']:.1e}"
    if measures["elsewhere"] > tolerance:
        yield f"probabilities of {measures['elsewhere']:.1e} elsewhere"
    if measures["meet"]:
        yield f"{measures['meet']} pairs of triangles meet"
    if measures["apart"] < LEAST_APART - ANGLE_SLACK:
        yield f"outcomes {measures['apart']:.1f} degrees apart"
    if measures["margin"] < LEAST_MARGIN - ANGLE_SLACK:
        yield f"an outcome tips over at {measures['margin']:.1f} degrees"
    if measures["s"] > LONGEST:
        yield f"took {measures['s']:.0f} s"


def has_good_prints(measures: dict[str, Any]) -> bool:
    """Whether prints of a die are as good as wanted."""
    mean = measures["prints"]
    return mean is not None and mean <= MEAN_PRINTS and measures["9 in 10"] <= MOST_PRINTS


SUMMARY = (
    "target 12s | fill 14s | models 6d | as wanted 6.1% | goal 5.0% | good prints 6.1% | "
    "their goal 5.0% | median s 6.1f | 90 % s 6.1f | most s 6.1f | mean 7.2% | not as wanted 0s"
)


def summarize(attempts: list[tuple[Case, dict[str, Any], str]], row: Callable[..., None]) -> bool:
    """A row for each target and fill; whether the goals are reached, which are for the fill by
    correspondence."""
    is_good = True
    for target, fill in dict.fromkeys((case.target, case.fill) for case, *_ in attempts):
        mine = [one for case, *one in attempts if (case.target, case.fill) == (target, fill)]
        missed = [
            Path(case.model).stem
            for case, _, reason in attempts
            if reason and (case.target, case.fill) == (target, fill)
        ]
        moved = [measures["mean"] for measures, reason in mine if not reason]
        seconds = [measures["s"] for measures, _ in mine if "s" in measures]
        took = np.quantile(seconds, [0.5, 0.9, 1.0]).tolist() if seconds else [None] * 3
        sound = [measures for measures, reason in mine if not reason and has_good_prints(measures)]
        shares = [len(some) / len(mine) for some in (moved, sound)]
        goals = [each.get(target) for each in (GOALS, PRINT_GOALS)]
        if fill != "correspondence":
            goals = [None, None]
        middle = float(np.median(moved)) if moved else None
        both = [cell for pair in zip(shares, goals, strict=True) for cell in pair]
        row(target, fill, len(mine), *both, *took, middle, ", ".join(missed))
        for share, goal in zip(shares, goals, strict=True):
            is_good &= share >= ((goal or 0.0) if len(mine) >= FEW else min(goal or 0.0, 0.5))
    return is_good
