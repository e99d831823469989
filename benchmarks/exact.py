"""the exact method on random targets, compared with the paper's, and on recipes

Design dice for random targets of 4 to 12 outcomes, the smallest at least 0.01, by the exact method
from searched shapes, without preferences, and by the paper's without a finish from evenly spread
facets, good with an error of at most 0.02. A die is solved where the forward model finds one rest
for each outcome and no other, and probabilities within 1e-12. Then make the engraved dice of
recipes; those for a table are left out. Seconds are on the wall.

Last, design a die for each of 60 targets twice: without symmetry, from the first shape that leads
there, and as by default, the most handsome of many. The measure of looks is that of
docs/designers.md; the picture has both dice of each target.

Exits 1 where a random target is not solved, or a die of the last part misses its probabilities, or
the chosen one is less handsome by more than a tenth.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import repeat
from statistics import median
from typing import Any

import numpy as np

from benchmarks.design import GOOD_ERROR
from benchmarks.frame import Report, add_recipes, make_die, panels, processes, read_recipes
from dicedesign import Recipe, parse_recipe, rest_poses
from dicedesign.energies import Preferences
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.methods import ExactOptions, PaperOptions, solve_exact, solve_paper
from dicedesign.optimize.looks import rate_looks
from dicedesign.optimize.starts.search import shapes_near
from dicedesign.recipe.reading import parse_target
from dicedesign.report.raster import Camera, frame_cameras
from dicedesign.report.renderer import RenderMesh, render
from dicedesign.runtime.arrays import Floats
from dicedesign.starts import repulsion

TOLERANCE = 1e-12
"""Largest |p - q| of a solved random target."""

MOST_STARTS = 40

SECONDS = 10.0
"""Limit of the exact method for each random target."""

SMALLEST = 0.01
"""Probability of a random target."""

TYPED_TARGETS = (
    *(f"d{sides}" for sides in range(2, 21)),
    *("1:1:1", "9:9:2", "49:49:2", "2:1:1", "2d4", "2d6", "3d6", "4dF"),
    *("1:2:3", "1:2:3:4", "5:1:1:1:1:1"),
)
"""Targets of dice whose looks are compared, beside `RANDOM_TARGETS` of 2 to 12 outcomes, each with
a probability of at least `SMALLEST_TYPED`."""

RANDOM_TARGETS, SMALLEST_TYPED = 30, 0.02

WORSE_LOOKS = 0.9
"""Smallest ratio of the measures of the chosen die and of the one without symmetry."""

PIXELS = 150
"""Width of the picture of a die."""


@dataclass(frozen=True)
class Attempt:
    """A random target by both methods.

    Attributes
    ----------
    error: largest |p - q|; infinite unless there is one rest for each outcome and no other.
    paper_error: of the paper's method.
    """

    outcomes: int
    error: float
    seconds: float
    paper_error: float
    paper_seconds: float

    @property
    def is_solved(self) -> bool:
        """Whether the die has the wanted rests and probabilities."""
        return self.error <= TOLERANCE


def add_options(parser: argparse.ArgumentParser) -> None:
    """What is designed."""
    add_recipes(parser, "*")
    parser.add_argument(
        "--targets", type=int, metavar="N", help="random targets (default: 200; quick: 18)"
    )
    parser.add_argument(
        "--part", choices=("targets", "recipes", "looks"), help="only one of the three"
    )


def run(options: argparse.Namespace, report: Report) -> bool:
    """Random targets, recipes, and looks."""
    # The first is not counted: torch takes longer at its first use in a process.
    attempt(0)
    is_good = True
    if options.part in (None, "targets"):
        is_good = solve_targets(options.targets or (18 if options.quick else 200), report)
    if options.part in (None, "recipes"):
        design_recipes(read_recipes(options), report)
    if options.part in (None, "looks"):
        is_good &= compare_looks(options, report)
    return is_good


def solve_targets(count: int, report: Report) -> bool:
    """A row for each number of outcomes; whether all targets are solved."""
    attempts = [attempt(number) for number in range(count)]
    row = report.table(
        "targets",
        "outcomes 8s | targets 7d | solved 7d | median s 9.3f | worst solved s 9.3f | "
        "paper's good 5d | median error 9.1e | error 90 % 9.1e | worst 9.1e | paper's s 9.3f",
    )
    groups = {str(k): [a for a in attempts if a.outcomes == k] for k in range(4, 13)}
    for name, group in {**groups, "all": attempts}.items():
        if group:
            solved = [one.seconds for one in group if one.is_solved]
            paper = [one.paper_error for one in group]
            row(
                *(name, len(group), len(solved)),
                *(median(one.seconds for one in group), max(solved, default=None)),
                sum(error <= GOOD_ERROR for error in paper),
                *(*np.quantile(paper, (0.5, 0.9)), max(paper)),
                median(one.paper_seconds for one in group),
            )
    return all(one.is_solved for one in attempts)


def design_recipes(recipes: Sequence[Recipe], report: Report) -> None:
    """A row for each recipe that is not for a table."""
    convex, concave = [], []
    for recipe in recipes:
        if not recipe.method.is_thrown:
            (convex if recipe.method.concave is None else concave).append(recipe)
    row = report.table(
        "recipes",
        "recipe 26s | outcomes 8d | rests 5d | status 12s | as designed 9.1e | in its file 9.1e | "
        "labels only cut in 9.1e | printed file 9.1e | circle mm 6.1f | margin deg 6.0f | "
        "met s 6.2f | design s 6.2f",
    )
    for recipe in convex:
        row(*design_recipe(recipe))
    row = report.table(
        "concave recipes",
        "recipe 26s | outcomes 8d | status 12s | max |p - q| 9.1e | elsewhere 9.1e | "
        "displacement 6.1% | printed file 9.1e | prints 6.4f | 9 in 10 7.4f | hull kept 10s | "
        "apart deg 6.0f | margin deg 6.0f | search s 6.1f",
    )
    for recipe in concave:
        row(*make_concave(recipe))


def attempt(number: int) -> Attempt:
    """A random target by both methods; the number seeds everything."""
    outcomes = 4 + number % 9
    shares = np.random.default_rng(number).dirichlet(np.ones(outcomes))
    target = SMALLEST + (1.0 - SMALLEST * outcomes) * shares
    exact = ExactOptions(
        tolerance=TOLERANCE, prefer=Preferences(), starts=MOST_STARTS, seconds=SECONDS
    )
    start = time.perf_counter()
    result = solve_exact(shapes_near(target, number), target, exact)
    middle = time.perf_counter()
    paper = paper_error(target, number)
    end = time.perf_counter()
    error = forward_error(result.hull.vertices, result.directions, target)
    return Attempt(outcomes, error, middle - start, paper, end - middle)


def forward_error(vertices: Floats, directions: Floats, target: Floats) -> float:
    """Largest |p - q| by the forward model: infinite unless each of the directions (k, 3) has one
    rest and there is no other."""
    poses = rest_poses(vertices)
    outcome = np.argmax(poses.normals @ directions.T, axis=1)
    if not np.array_equal(np.sort(outcome), np.arange(len(target))):
        return float("inf")
    return float(np.abs(poses.probabilities - target[outcome]).max())


def paper_error(target: Floats, seed: int) -> float:
    """Error at the end of the paper's method, from evenly spread facets in a random order."""
    order = np.random.default_rng(seed).permutation(len(target))
    start = repulsion(len(target), seed)
    return solve_paper(start, target[order], PaperOptions(finish="none"), seed=seed).error


def design_recipe(recipe: Recipe) -> tuple[object, ...]:
    """A row: errors of the die as designed, in its plain file, with labels and no correction, and
    in the printed file; the largest circle in its smallest labeled facet, and the least angle to
    tip it; and the seconds until its probabilities were met first, and of the whole design."""
    work = make_die(recipe, "engrave")
    die = work.result()
    met = [
        step.seconds
        for step in die.history
        if (step.max_abs_error or 0.0) <= recipe.method.tolerance
    ]
    labeled = [facet for facet in die.facets if facet.label is not None]
    balance = None if die.engraved is None else die.engraved.balance
    return (
        *(recipe.name, len(die.labels), len(die.facets), die.status),
        *(die.design.max_abs_error, die.max_abs_error),
        None if balance is None else balance.errors[0],
        None if die.engraved is None else die.engraved.max_abs_error,
        2.0 * min(facet.inradius_mm for facet in labeled),
        min(facet.margin_deg for facet in labeled),
        next(iter(met), None),
        next(stage.seconds for stage in die.stages if stage.name == "design"),
    )


def make_concave(recipe: Recipe) -> tuple[object, ...]:
    """A row: what the plain file and the printed one hold, and how far the surface was bent."""
    die = make_die(recipe, "tolerances").result()
    hull, prints = die.concave.hull, die.tolerances
    return (
        *(recipe.name, len(die.labels), die.status, die.max_abs_error, die.elsewhere),
        die.concave.displacement.mean,
        None if die.engraved is None else die.engraved.max_abs_error,
        *((None, None) if prints is None else (prints.total_variation, prints.nine_in_ten)),
        f"{hull.vertices_after} of {hull.vertices_before}",
        *(die.least_angle_deg, die.least_margin_deg, die.search.seconds),
    )


@dataclass(frozen=True)
class RatedDie:
    """A die with its measure of looks, largest |p - q| in double precision, and seconds of its
    design."""

    hull: ConvexHull
    looks: float
    error: float
    seconds: float


def compare_looks(options: argparse.Namespace, report: Report) -> bool:
    """Medians over the targets; whether the chosen dice are as good."""
    targets = {text: text for text in TYPED_TARGETS}
    targets |= {f"random {seed}": random_target(seed) for seed in range(1, RANDOM_TARGETS + 1)}
    names = list(targets)[:: 12 if options.quick else 1]
    texts = [targets[name] for name in names]
    with processes(options.jobs) as workers:
        plain = workers.map(rate_die, texts, repeat("none"))
        pairs = list(zip(plain, workers.map(rate_die, texts, repeat("auto")), strict=True))
    row = report.table(
        "looks",
        "dice 8d | without 8.3f | chosen 8.3f | s 6.2f | s to choose 6.2f | 90 % s 6.2f | "
        "least ratio 6.2f | max |p - q| 8.1e",
    )
    looks, seconds, errors = (
        np.array([[getattr(die, name) for die in pair] for pair in pairs])
        for name in ("looks", "seconds", "error")
    )
    ratio, worst = float((looks[:, 1] / looks[:, 0]).min()), float(errors.max())
    medians = (*np.median(looks, axis=0), *np.median(seconds, axis=0))
    row(len(pairs), *medians, np.quantile(seconds[:, 1], 0.9), ratio, worst)
    if options.out is not None:
        report.figure = draw_dice(names, pairs)
    return ratio >= WORSE_LOOKS and worst <= TOLERANCE


def random_target(seed: int) -> str:
    """Probabilities as typed."""
    rng = np.random.default_rng(seed)
    outcomes = int(rng.integers(2, 13))
    spread = 1.0 - SMALLEST_TYPED * outcomes
    return ", ".join(
        map(repr, (SMALLEST_TYPED + spread * rng.dirichlet(np.ones(outcomes))).tolist())
    )


def rate_die(text: str, symmetry: str) -> RatedDie:
    """The die of a target as typed, without labels."""
    entries = {"name": "die", "engrave": False, "symmetry": symmetry}
    # torch takes longer at its first use in a process.
    make_die(parse_recipe({**entries, "target": {"fair": 4}}), "design")
    start = time.perf_counter()
    work = make_die(parse_recipe({**entries, "target": parse_target(text)}))
    seconds = time.perf_counter() - start
    looks = rate_looks(work.die.hull, work.die.directions).measure
    return RatedDie(work.die.hull, looks, work.design_error, seconds)


def draw_dice(names: Sequence[str], pairs: Sequence[tuple[RatedDie, RatedDie]]) -> Any:
    """Both dice of each target, with their measures."""
    figure, axes = panels(len(pairs), 6, (3.2, 1.9))
    for axis, name, dice in zip(axes, names, pairs, strict=True):
        pictures = []
        for die in dice:
            points = die.hull.vertices - die.hull.centroid
            camera = Camera(np.array([0.5, -0.7, 0.5]), np.array([0.0, 0.0, 1.0]))
            (framed,) = frame_cameras([camera], [points])
            body = RenderMesh(points, die.hull.triangles, smooth=False)
            pictures.append(render(body, framed, PIXELS))
        axis.imshow(np.concatenate(pictures, axis=1))
        axis.set_title(f"{name}: {dice[0].looks:.2f}, {dice[1].looks:.2f}", fontsize=8)
        axis.axis("off")
    return figure
