"""the exact method on random targets, compared with the paper's, and on recipes

Design dice for random targets of 4 to 12 outcomes, the smallest at least 0.01, by the exact method
from searched shapes, without preferences, and by the paper's without a finish from evenly spread
facets, good with an error of at most 0.02. A die is solved where the forward model finds one rest
for each outcome and no other, and probabilities within 1e-12. Then make the engraved dice of
recipes; those for a table are left out. Seconds are on the wall. Exits 1 where a target is not
solved.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from statistics import median

import numpy as np

from benchmarks.design import GOOD_ERROR
from benchmarks.frame import Report, add_recipes, make_die, read_recipes
from dicedesign import Recipe, rest_poses
from dicedesign.energies import Preferences
from dicedesign.methods import ExactOptions, PaperOptions, solve_exact, solve_paper
from dicedesign.optimize.starts.search import shapes_near
from dicedesign.runtime.arrays import Floats
from dicedesign.starts import repulsion

TOLERANCE = 1e-12
"""Largest |p - q| of a solved random target."""

MOST_STARTS = 40

SECONDS = 10.0
"""Limit of the exact method for each random target."""

SMALLEST = 0.01
"""Probability of a random target."""


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


def run(options: argparse.Namespace, report: Report) -> bool:
    """Random targets, then recipes."""
    # The first is not counted: torch takes longer at its first use in a process.
    attempt(0)
    count = options.targets or (18 if options.quick else 200)
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
    convex, concave = [], []
    for recipe in read_recipes(options):
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
    return all(one.is_solved for one in attempts)


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
