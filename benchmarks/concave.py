"""concave dice of many models: success rate, time and displacement

Make each model into a die for each target, with the options of a recipe that gives none, and
measure what the STL file of the die holds. As wanted is one with probabilities and probabilities
elsewhere within 0.005, nothing that meets, outcomes 45 degrees apart and margins of 10, in 60 s of
the processor. Prints are good if they are off by a total variation of .015 on average, and nine in
ten by at most .03. Exits 1 where fewer models become dice than the goal of the target, 90 % for
fair:2 and fair:3, 75 % for 1/2,1/3,1/6, 40 % for fair:4, or half of fewer than ten; or where fewer
than 85 % of the models have good prints as fair:3. With --fill paper all of the paper's method
makes them, decimated to 2,000 points (250 with --quick).

Random models are unions that nobody tuned to, of four kinds in turn. Each is closed, one piece,
does not intersect itself, has between 1,500 and 4,000 points, at most three tunnels, and leaves at
least a sixth of its hull empty. A name gives the same model each time; last bits of its coordinates
may differ between processors.
"""

from __future__ import annotations

import argparse
import re
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice, product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from manifold3d import CrossSection, Manifold, OpType
from scipy.spatial.transform import Rotation

from benchmarks.frame import Report, make_die, processes
from dicedesign import InputError, Result, parse_recipe
from dicedesign.concave.shapes import SHAPES, shape
from dicedesign.errors import DegenerateBodyError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.body import make_body
from dicedesign.geometry.meshes.manifold import mesh_of
from dicedesign.geometry.meshes.reading import stl_bytes
from dicedesign.geometry.sphere import unit_vectors
from dicedesign.geometry.surfaces.closed_surface import decimate, make_surface, refine
from dicedesign.geometry.triangles import Surface
from dicedesign.recipe.pipeline import run_stages
from dicedesign.runtime.arrays import Floats

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

SEED = 2024
"""Seed of all random models."""

MIN_POINTS, MAX_POINTS = 1500, 4000

MIN_FILL, MAX_FILL = 0.02, 5.0 / 6.0
"""Limits of the part of its hull that a model fills."""

MAX_TUNNELS = 3

SEGMENTS = 24
"""Number of edges around a ball."""

SLIVER = 0.02
"""Length of edges that are removed; the radius of a model is about 1."""

WAVES = {"blobs": 0.03, "rings": 0.02}
"""Largest amplitude of the waves on models of some kinds."""

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


SEVERAL = (
    "points",
    "s",
    "|p - q|",
    "gap",
    "mean",
    "largest",
    "turned",
    "99 %",
    "edge before",
    "after",
    "peaks",
    "prints",
    "9 in 10",
    "tried",
)
"""What is known of a die whose outcomes have several rests: angles in degrees between rests of
different outcomes, by which the surface turned on average and 99 % of it at most, and of its
sharpest edge; the others as in `MEASURED`."""


@dataclass(frozen=True)
class Case:
    """A die that is to be made.

    Attributes
    ----------
    model: name of a built-in one, or path of a file. target: as typed; fill: as typed.
    rests: "one" for each outcome, or "several"; the latter for dice of 50 mm.
    wall_mm: thickness of walls around a cavity; None for a solid die.
    seconds: after which a die as wanted is not brought nearer to its model; None for no limit.
    most_points: to which larger surfaces are decimated first; None to leave them.
    """

    model: str
    target: str
    fill: str
    seconds: float | None
    most_points: int | None
    rests: str = "one"
    wall_mm: float | None = None


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
        help="models made at random, of four kinds in turn (default: 40 if no others are named; "
        "quick: 2)",
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
        "--rests",
        choices=("one", "several"),
        default="one",
        help="rests for each outcome (default: one)",
    )
    parser.add_argument(
        "--wall-mm", type=float, metavar="MM", help="hollow dice of several rests, with such walls"
    )
    parser.add_argument("--seconds", type=float, metavar="S", help="no improvement after that")


def run(options: argparse.Namespace, report: Report) -> bool:
    """A row for each die, then one for each target and fill: in tables of their own where fills are
    compared, and for the meshes that were given."""
    if options.rests == "several":
        return run_several(options, report)
    prefix = "fills " if options.fill == "both" else ""
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


def run_several(options: argparse.Namespace, report: Report) -> bool:
    """A row for each die whose outcomes have several rests; whether all are as wanted."""
    row = report.table(
        "several " + ("solid" if options.wall_mm is None else "hollow"),
        "model 17s | target 12s | points 6d | s 6.1f | |p - q| 8.1e | gap 6.1f | "
        "mean 7.2% | largest 7.1% | turned 6.2f | 99 % 6.2f | edge before 5.0f | after 5.0f | "
        "peaks 4d | prints 6.4f | 9 in 10 7.4f | tried 5d | verdict 0s",
    )
    is_good = True
    with processes(options.jobs) as workers:
        for case, (measures, reason) in zip(
            cases := list(cases_of(options)), workers.map(attempt, cases), strict=True
        ):
            cells = [measures.get(name) for name in SEVERAL]
            row(Path(case.model).stem, case.target, *cells, reason or "as wanted")
            is_good &= not reason
    return is_good


def cases_of(options: argparse.Namespace) -> Iterator[Case]:
    """Every target with every model by every fill. Raises InputError for what is none."""
    models = [*map(str, options.meshes), *(options.model or ())]
    if options.models is not None:
        models += [str(path) for path in sorted(options.models.iterdir()) if path.is_file()]
    if options.random is not None or not models:
        models += model_names(options.random or (2 if options.quick else 40))
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
                kind = options.rests, options.wall_mm
                yield Case(model, target, fill, seconds, most, *kind)


def attempt(case: Case) -> tuple[dict[str, Any], str]:
    """What was measured, and why the die is not as wanted, or ""."""
    measures: dict[str, Any] = {}
    try:
        with TemporaryDirectory() as folder:
            path = Path(case.model)
            if not path.is_file():
                name = case.model
                surface = shape(name) if name in SHAPES else random_model(name)
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
        return measures, "; ".join(shortfalls(measures, work.recipe.method.tolerance, case.rests))
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
    start = {"mesh": {"path": str(path)}}
    more: dict[str, Any] = {}
    if case.rests == "several":
        concave |= {"rests": "several"}
        concave |= {} if case.wall_mm is None else {"hollow": {"wall_mm": case.wall_mm}}
        more = {"size_mm": 50}
    return more | {"name": "die", "target": target, "start": start, "method": {"concave": concave}}


def measure(die: Result) -> dict[str, Any]:
    """The row, by the STL file of the die."""
    concave = die.concave
    distortion = concave.surface_quality["distortion"]
    turns = concave.surface_quality["turns"]
    return {
        "gap": die.least_angle_deg,
        "turned": turns["mean_degrees"],
        "99 %": turns["most_degrees"],
        "edge before": turns["edge_before_degrees"],
        "after": turns["edge_after_degrees"],
        "peaks": turns["peaks"],
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


def shortfalls(measures: dict[str, Any], tolerance: float, rests: str = "one") -> Iterator[str]:
    """Why a die is not as wanted. rests: see `Case`."""
    least_apart, least_margin = (LEAST_APART, LEAST_MARGIN) if rests == "one" else (5.0, 0.1)
    if measures["|p - q|"] > tolerance:
        yield f"probabilities off by {measures['|p - q|']:.1e}"
    if measures["elsewhere"] > tolerance:
        yield f"probabilities of {measures['elsewhere']:.1e} elsewhere"
    if measures["meet"]:
        yield f"{measures['meet']} pairs of triangles meet"
    if measures["apart"] < least_apart - ANGLE_SLACK:
        yield f"outcomes {measures['apart']:.1f} degrees apart"
    if measures["margin"] < least_margin - ANGLE_SLACK:
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


def model_names(count: int) -> tuple[str, ...]:
    """Names of the first models; kinds take turns."""
    every = product(range(1, count + 1), KINDS)
    return tuple(f"{kind}_{number:02d}" for number, kind in islice(every, count))


def is_model(name: str) -> bool:
    """Whether a name is a model's: a kind, and a number of two digits or more."""
    return re.fullmatch(rf"({'|'.join(KINDS)})_\d\d+", name) is not None


def random_model(name: str) -> Surface:
    """Model of a name such as blobs_03, which `is_model` accepts."""
    kind, number = name.split("_")
    rng = np.random.default_rng([SEED, list(KINDS).index(kind), int(number)])
    while True:
        with suppress(InputError, DegenerateBodyError):
            surface = _surface(rng, KINDS[kind](rng), WAVES.get(kind, 0.0))
            make_surface(make_body(surface.points, surface.triangles, "model"))
            points, triangles = len(surface.points), len(surface.triangles)
            fill = surface.volume / convex_hull(surface.points).surface.volume
            if (
                MIN_POINTS <= points <= MAX_POINTS
                and MIN_FILL <= fill <= MAX_FILL
                and 1 - (points - triangles // 2) // 2 <= MAX_TUNNELS
            ):
                return surface


def _blobs(rng: np.random.Generator) -> Manifold:
    """Ellipsoids, each about a place on an earlier one."""
    centers, radii = [np.zeros(3)], [rng.uniform(0.4, 0.9, size=3)]
    for _ in range(int(rng.integers(3, 8))):
        base = int(rng.integers(len(centers)))
        centers.append(centers[base] + 1.1 * radii[base] * _direction(rng))
        radii.append(rng.uniform([0.2, 0.2, 0.45], [0.4, 0.4, 0.9]))
    balls = [Manifold.sphere(1.0, SEGMENTS).scale(half_axes) for half_axes in radii]
    return _union(map(_place, balls, Rotation.random(len(balls), rng), centers))


def _rings(rng: np.random.Generator) -> Manifold:
    """One to four rings that hold on to each other."""
    rings, center = list[Manifold](), np.zeros(3)
    for turn in Rotation.random(int(rng.integers(1, 5)), rng):
        radius, thickness = rng.uniform(0.55, 1.1), rng.uniform(0.16, 0.34)
        section = CrossSection.circle(thickness, SEGMENTS // 2).translate((radius, 0.0))
        rings.append(_place(section.revolve(SEGMENTS), turn, center))
        center = center + 1.9 * radius * turn.as_matrix()[:, 0]
    return _union(rings)


def _spider(rng: np.random.Generator) -> Manifold:
    """A small body on long legs with knees, in all directions."""
    parts = [Manifold.sphere(1.0, SEGMENTS).scale(rng.uniform(0.3, 0.6, size=3))]
    ball = Manifold.sphere(rng.uniform(0.13, 0.18), SEGMENTS // 2)
    for _ in range(int(rng.integers(5, 9))):
        direction, bend = _direction(rng), 0.6 * _direction(rng)
        knee = rng.uniform(0.8, 1.3) * direction
        foot = knee + rng.uniform(0.5, 0.9) * (direction + bend)
        hip, middle, end = ball.scale(np.full(3, 1.5)), ball.translate(knee), ball.translate(foot)
        parts += [Manifold.batch_hull([hip, middle]), Manifold.batch_hull([middle, end])]
    return _union(parts)


def _blocks(rng: np.random.Generator) -> Manifold:
    """Two to five solids of few faces as one, and up to two bores, with the long triangles of drawn
    solids."""
    body = Manifold.cube(tuple(rng.uniform([1.0, 0.5, 0.3], [2.2, 1.2, 0.9])), True)
    low, high = np.split(np.array(body.bounding_box()), 2)
    for _ in range(int(rng.integers(1, 5))):
        place = rng.uniform(0.8 * low, 0.8 * high)
        if rng.random() < 0.5:
            part = Manifold.cube(tuple(rng.uniform([0.3, 0.3, 0.6], [0.8, 0.8, 2.0])), True)
        else:
            wide, narrow = rng.uniform([0.25, 0.12], [0.6, 0.5])
            sides = int(rng.integers(3, 10))
            part = Manifold.cylinder(rng.uniform(0.6, 2.0), wide, narrow, sides, True)
        if rng.random() < 0.5:
            part = part.rotate(tuple(rng.uniform(-90.0, 90.0, size=3)))
        body += part.translate(tuple(place))
    for _ in range(int(rng.integers(0, 3))):
        bore = Manifold.cylinder(6.0, rng.uniform(0.12, 0.25), -1.0, 8, True)
        angles = 90.0 * rng.integers(0, 2, size=3)
        body -= bore.rotate(tuple(angles)).translate(tuple(rng.uniform(0.6 * low, 0.6 * high)))
    return body


KINDS = {"blobs": _blobs, "rings": _rings, "spider": _spider, "blocks": _blocks}
"""Functions that draw a model, good or not, by kind."""


def _direction(rng: np.random.Generator) -> Floats:
    """Random unit vector (3,)."""
    return unit_vectors(rng.normal(size=3))


def _place(body: Manifold, turn: Rotation, center: Floats) -> Manifold:
    """Body about the origin, rotated, then moved to a center."""
    return body.transform(np.column_stack([turn.as_matrix(), center]))


def _union(parts: Iterable[Manifold]) -> Manifold:
    return Manifold.batch_boolean(list(parts), OpType.Add)


def _surface(rng: np.random.Generator, body: Manifold, height: float) -> Surface:
    """Surface without slivers and long edges, displaced by four waves of up to a height."""
    surface, _ = refine(mesh_of(body.simplify(SLIVER)), int(rng.integers(1700, 3600)))
    waves = rng.uniform(1.5, 5.0, size=(4, 1)) * unit_vectors(rng.normal(size=(4, 3)))
    phases, shifts = rng.uniform(0.0, 2.0 * np.pi, size=4), rng.normal(size=(4, 3))
    shifts *= rng.uniform(0.0, height)
    return surface.with_points(surface.points + np.sin(surface.points @ waves.T + phases) @ shifts)
