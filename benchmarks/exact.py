"""the exact method on random targets, compared with the paper's, and on recipes

Design dice for random targets of 4 to 12 outcomes, the smallest at least 0.01, by the exact method
from searched shapes, without preferences, and by the paper's without a finish from evenly spread
facets, good with an error of at most 0.02. Then run recipes of convex dice as they are. A die is
solved where the forward model finds one rest for each outcome and no other, and probabilities
within 1e-12 or the recipe's tolerance. Seconds are on the wall. Exits 1 where a target is not
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
from dicedesign import NoStartError, Recipe, rest_poses
from dicedesign.energies import Preferences
from dicedesign.methods import ExactOptions, PaperOptions, solve_exact, solve_paper
from dicedesign.optimize.starts.search import shapes_near
from dicedesign.recipe.pipeline import run_stages
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
    row = report.table(
        "recipes",
        "recipe 26s | method 7s | verdict 12s | outcomes 8d | rests 5d | max |p - q| 9.1e | "
        "probabilities s 7.3f | s 7.3f",
    )
    for recipe in read_recipes(options):
        if recipe.method.concave is None and not recipe.method.is_thrown:
            row(*design_recipe(recipe))
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
    """A row: what the die is, the seconds until its probabilities were met first, and those of the
    whole design, with the search of shapes and the improvement by preference."""
    labels, tolerance = recipe.target.target().labels, recipe.method.tolerance
    head = (recipe.name, recipe.method.name)
    work = make_die(recipe, "start")
    start = time.perf_counter()
    try:
        run_stages(work, after="start", last="design")
    except NoStartError:
        return (*head, "no die", len(labels), None, None, None, time.perf_counter() - start)
    seconds = time.perf_counter() - start
    run_stages(work, after="design", last="check")
    die = work.result()
    met = (step.seconds for step in die.history if (step.max_abs_error or 0.0) <= tolerance)
    is_whole = sorted(facet.label or "" for facet in die.facets) == sorted(labels)
    verdict = "solved" if is_whole and die.status == "converged" else die.status.replace("_", " ")
    error = die.design.max_abs_error if is_whole else None
    return (*head, verdict, len(labels), len(die.facets), error, next(met, None), seconds)
