"""design methods over seeds, beside published dice, and the paper's ablation

Design recipes by every method, step rule and preconditioner, from the same starts with the same
seeds, without preferences. For recipes of the paper's method also:

- dice over seeds from 0 on and fresh ones that nobody chose, without a finish and with the exact
  one, beside the published dice;
- dice side by side by three ways, with the recipe's preferences;
- dice without one term of the energy after the other, as in the paper's figure 9.

Errors are the largest |p - q|, each rest counted for the nearest outcome. Exits 1 if fewer than
95 % of the paper's dice without finish are within 0.02 with all outcomes 10 degrees apart, or a
finished one is not exact to 1e-12.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import repeat
from statistics import median

import numpy as np

from benchmarks.frame import (
    Report,
    add_recipes,
    add_seeds,
    make_die,
    processes,
    read_recipes,
    take_seeds,
    with_method,
)
from dicedesign import InputError, Recipe, mixture_tables, rigid_body, simulate
from dicedesign.energies import Preferences, cluster
from dicedesign.methods import ExactOptions, PaperOptions, SobolevOptions, solve_paper
from dicedesign.optimize.solvers.candidate import DesignResult
from dicedesign.optimize.solvers.paper import finish_exactly
from dicedesign.recipe.convex import normalized_center, wanted_of_directions
from dicedesign.rest.poses import analyze
from dicedesign.runtime.arrays import Floats
from dicedesign.starts import Start
from dicedesign.throws.distances import total_variation

METHODS = {
    "exact": None,
    "paper, exact finish": {"step": "momentum", "finish": "exact"},
    **{
        f"paper, {step.replace('_', ' ')}{'' if power is None else f', Sobolev p = {power}'}": {
            "step": step,
            "finish": "none",
            "sobolev": power,
        }
        for step in ("momentum", "line_search")
        for power in (None, 1, 2)
    },
}
"""Options of the paper's method by name; None for the exact method."""

PUBLISHED = {
    "paper_binomial_2": 0.0069,
    "paper_binomial_3": 0.0054,
    "paper_binomial_4": 0.0086,
    "paper_2d6_hendecahedron_v1": 0.0016,
    "paper_2d6_hendecahedron_v2": 0.0115,
    "paper_2d6_circus": 0.0151,
}
"""Largest |p - q| of the dice that the paper's authors published, by this model."""

ABLATED = ("paper_binomial_4", "paper_2d6_hendecahedron_v2")
"""Recipes that terms are left out of."""

TERMS = {
    "all": (),
    "no coplanar": ("coplanar",),
    "no barycenter": ("barycenter",),
    "no neighbor": ("neighbor",),
    "no apart": ("apart",),
    "no hold or clear": ("hold", "clear"),
    "dice alone": ("coplanar", "barycenter", "neighbor", "apart", "hold", "clear"),
}
"""What is left out, by the name of the row."""

GOOD_ERROR, GOOD_ANGLE = 2e-2, 10.0
"""Of a die without finish: an error of at most the one, outcomes as many degrees apart as the
other."""

NEARBY = 15.0
"""Degrees from an outcome's main rest within which facets count as folds of its."""

DROPS = 20_000
"""Simulated throws of each die that stands side by side with another."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """What is designed."""
    add_recipes(parser)
    add_seeds(parser)
    parser.add_argument(
        "--part",
        choices=("methods", "seeds", "sides", "ablation"),
        help="only one of the tables",
    )


def run(options: argparse.Namespace, report: Report) -> bool:
    """All tables, or one."""
    recipes = read_recipes(options)
    seeds, fresh = take_seeds(options, report)
    starts = [make_die(recipe, "start").start for recipe in recipes]
    for recipe, start in zip(recipes, starts, strict=True):
        if start is None:
            raise InputError(
                f"{recipe.name}: expected a start that all methods can share, got a search or a "
                "surface; give it another start, or leave it out"
            )
    paper = [PaperProblem(*one) for one in zip(recipes, starts, strict=True) if one[0].method.paper]
    # Not counted: torch takes longer at its first use in a process.
    make_die(set_up(recipes[0], "exact", 0), "design")
    if options.part in (None, "methods"):
        compare_methods(recipes, seeds, options.jobs, report)
    seeds += fresh
    is_good = True
    if options.part in (None, "seeds"):
        is_good = sum(problem.over_seeds(seeds, report) for problem in paper) == len(paper)
    if options.part == "sides" or (options.part is None and not options.quick):
        for problem in paper:
            compare_sides(problem.recipe, report)
    if options.part in (None, "ablation"):
        for problem in paper:
            if problem.recipe.name in ABLATED:
                problem.ablate(seeds, report)
    return is_good


def set_up(recipe: Recipe, method: str, seed: int) -> Recipe:
    """The recipe by one of `METHODS`, with another seed."""
    recipe = recipe.model_copy(update={"seed": seed})
    others = {"exact": None, "paper": None, "concave": None}
    given = METHODS[method]
    if given is None:
        exact = replace(recipe.method.exact or ExactOptions(), prefer=Preferences())
        return with_method(recipe, **{**others, "exact": exact})
    power = given.get("sobolev")
    sobolev = None if power is None else SobolevOptions(power=power)
    own = recipe.method.paper or PaperOptions()
    paper = replace(own, **{**given, "sobolev": sobolev}, tolerance=None, prefer=Preferences())
    return with_method(recipe, **{**others, "paper": paper})


def compare_methods(
    recipes: Sequence[Recipe], seeds: Sequence[int], jobs: int, report: Report
) -> None:
    """Every method on every recipe."""
    row = report.table(
        "methods",
        "recipe 28s | method 35s | seeds 5d | done 5d | median error 9.1e | s 7.2f",
    )
    with processes(jobs) as pool:
        for recipe in recipes:
            for method in METHODS:
                tries = pool.map(try_method, repeat(recipe), repeat(method), seeds)
                errors, are_done, taken = zip(*tries, strict=True)
                row(recipe.name, method, len(seeds), sum(are_done), median(errors), median(taken))


def try_method(recipe: Recipe, method: str, seed: int) -> tuple[float, bool, float]:
    """Error of a die, whether it is within the method's tolerance, and seconds."""
    work = make_die(set_up(recipe, method, seed))
    error = float(work.die.error)
    seconds = work.result().history[-1].seconds or 0.0
    return error, error <= work.recipe.method.tolerance, seconds


@dataclass(frozen=True)
class Ending:
    """A shape by the forward model, angles in degrees; the main rest of an outcome is its most
    probable one.

    Attributes
    ----------
    error: largest |p - q|; rests: how many; is_whole: whether each outcome has one.
    least_angle: between the main rests of two outcomes.
    stray: largest angle from a rest to the main rest of its outcome.
    fold: largest angle of a facet to an outcome's main rest among those within `NEARBY` of it.
    least_facet: smallest part of the surface that an outcome's rests have.
    """

    error: float
    rests: int
    is_whole: bool
    least_angle: float
    stray: float
    fold: float
    least_facet: float

    def is_good(self, error: float = GOOD_ERROR) -> bool:
        """Whether each outcome has a rest, far enough from the others, and probabilities are
        right."""
        return self.is_whole and self.least_angle >= GOOD_ANGLE and self.error <= error

    @classmethod
    def of(cls, result: DesignResult, target: Floats, center: Floats | None) -> Ending:
        """Of a design for (k,) probabilities, with a center of mass (3,) or that of the solid."""
        hull = result.hull
        poses = analyze(hull, hull.centroid if center is None else center)
        of_rest = cluster(poses.normals, result.directions).of_rest
        sums = np.bincount(of_rest, poses.probabilities, len(target))
        # Rests come the most probable first.
        filled, first = np.unique(of_rest, return_index=True)
        mains = np.zeros((len(target), 3))
        mains[filled] = poses.normals[first]
        between = degrees(mains[filled] @ mains[filled].T)[np.triu_indices(len(filled), 1)]
        around = degrees(hull.normals @ mains[filled].T)
        areas = np.bincount(of_rest, hull.areas[poses.facets], len(target))
        return cls(
            error=float(np.abs(sums - target).max()),
            rests=len(of_rest),
            is_whole=len(filled) == len(target),
            least_angle=float(between.min(initial=180.0)),
            stray=float(degrees((poses.normals * mains[of_rest]).sum(1)).max()),
            fold=float(around[around < NEARBY].max(initial=0.0)),
            least_facet=float(areas.min() / hull.areas.sum()),
        )


def degrees(cosines: Floats) -> Floats:
    """Angles of cosines, which rounding may have taken beyond 1."""
    return np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0)))


class PaperProblem:
    """A recipe of the paper's method, ready for many seeds, without preferences."""

    def __init__(self, recipe: Recipe, start: Start) -> None:
        self.recipe, self.start = recipe, start
        self.options = replace(recipe.method.paper, prefer=Preferences(), tolerance=None)
        self.target, _ = wanted_of_directions(recipe)
        self.center = normalized_center(recipe, start)

    def descend(
        self, seed: int, options: PaperOptions, target: Floats | None = None
    ) -> DesignResult:
        """The descent alone."""
        options = replace(options, finish="none")
        center, target = self.center, self.target if target is None else target
        return solve_paper(self.start, target, options, center_of_mass=center, seed=seed)

    def over_seeds(self, seeds: Sequence[int], report: Report) -> bool:
        """Two rows, without a finish and with it; whether enough dice are good."""
        row = report.table(
            "seeds",
            "recipe 28s | finish 6s | seeds 5d | good 5d | median error 9.1e | worst 9.1e | "
            "published 9.1e | least angle 6.1f | least facet 7.2% | moved 7.2% | s 6.2f",
        )
        ends: dict[str, list[Ending]] = {"none": [], "exact": []}
        taken: dict[str, list[float]] = {"none": [], "exact": []}
        moved = []
        for seed in seeds:
            start = time.perf_counter()
            plain = self.descend(seed, self.options)
            middle = time.perf_counter()
            exact = finish_exactly(plain, self.target, self.options, center_of_mass=self.center)
            end = time.perf_counter()
            moved.append(largest_change(plain, exact))
            for name, result, seconds in (
                ("none", plain, middle - start),
                ("exact", exact, end - middle),
            ):
                ends[name].append(Ending.of(result, self.target, self.center))
                taken[name].append(seconds)
        good = {}
        for name, own in ends.items():
            is_plain = name == "none"
            good[name] = sum(
                one.is_good(GOOD_ERROR if is_plain else 1e-12)
                and (is_plain or one.rests == len(self.target))
                for one in own
            )
            errors = [one.error for one in own]
            row(
                *(self.recipe.name, name, len(seeds), good[name], median(errors), max(errors)),
                PUBLISHED.get(self.recipe.name) if is_plain else None,
                *(min(one.least_angle for one in own), min(one.least_facet for one in own)),
                *(None if is_plain else median(moved), median(taken[name])),
            )
        return good["none"] >= 0.95 * len(seeds) and good["exact"] == len(seeds)

    def ablate(self, seeds: Sequence[int], report: Report) -> None:
        """Medians over the seeds without some terms, without a finish."""
        row = report.table(
            "ablation",
            "recipe 28s | weights 14s | median error 9.1e | rests an outcome 6.2f | "
            "stray deg 6.1f | fold deg 6.1f | angle deg 6.1f",
        )
        for name, terms in TERMS.items():
            weights = self.options.weights.replace(**dict.fromkeys(terms, 0.0))
            options = replace(self.options, weights=weights)
            ends = [
                Ending.of(self.descend(seed, options), self.target, self.center) for seed in seeds
            ]
            middle = {
                key: median(getattr(end, key) for end in ends)
                for key in ("error", "rests", "stray", "fold", "least_angle")
            }
            middle["rests"] /= len(self.target)
            row(self.recipe.name, name, *middle.values())


def largest_change(before: DesignResult, after: DesignResult) -> float:
    """Largest difference of support functions about the centroids, over the diameter."""
    outward = np.random.default_rng(0).normal(size=(2000, 3))
    outward /= np.linalg.norm(outward, axis=1)[:, None]
    heights = [
        ((one.hull.vertices - one.hull.centroid) @ outward.T).max(axis=0) for one in (before, after)
    ]
    return float(np.abs(heights[0] - heights[1]).max() / before.hull.diameter)


def compare_sides(recipe: Recipe, report: Report) -> None:
    """The recipe without a finish, as it is, and by the exact method from the same start, each with
    its preferences, and simulated throws onto the tables of board-game."""
    row = report.table(
        "sides",
        "recipe 28s | by 9s | status 12s | max |p - q| 9.1e | circle 7.1% | facet 7.1% | "
        "margin deg 6.1f | angle deg 6.1f | thrown 7.3f | s 6.2f",
    )
    plain = replace(recipe.method.paper, finish="none", tolerance=None)
    for name, way in {
        "paper": with_method(recipe, paper=plain),
        "finished": recipe,
        "exact": with_method(recipe, paper=None, exact=ExactOptions()),
    }.items():
        start = time.perf_counter()
        work = make_die(way)
        seconds = time.perf_counter() - start
        die, solid = work.result(), work.solid
        main = [rest for rest in solid.outcomes.main if rest >= 0]
        facet = min(float(solid.poses.areas[rest]) for rest in main) / solid.poses.hull.areas.sum()
        body = rigid_body(work.plain.body, work.plain.poses)
        size = 2e-3 * body.radius
        tables = [table.for_size_above(size) for table in mixture_tables("board-game")]
        throws = simulate(body, tables, DROPS, 1)
        counts = work.plain.outcomes.sums(throws.counts)
        frequencies = np.append(counts, DROPS - counts.sum()) / DROPS
        row(
            *(recipe.name, name, die.status, die.design.max_abs_error),
            *(min(facet.inradius_mm for facet in die.facets) / recipe.size_mm, facet),
            *(min(facet.border_deg for facet in die.facets), die.least_angle_deg),
            total_variation(frequencies, np.append(work.target.probabilities, 0.0)),
            seconds,
        )
