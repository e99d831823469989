"""error against run time by the exact and the paper's method, over noise on the start

Design recipes of the paper's method without preferences, in four ways: by the exact method from
searched shapes, by the paper's with and without an exact finish, and by a line search on the
paper's own terms alone. For the paper's method the start has noise on its vertices, or its outcomes
are in a random order.

Seeds are those from 0 on and fresh ones that nobody chose. Errors are the largest |p - q|, each
rest counted for the nearest outcome. A die is good if its error is at most 0.02 and its outcomes
are 10 degrees apart. Exits 1 if, by the paper's method, fewer than 90 % of the dice are good with
noise of 0.1, or fewer than 80 % with 0.2 or a random order.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import repeat
from typing import Any

import numpy as np

from benchmarks.design import Ending, PaperProblem
from benchmarks.frame import (
    Report,
    add_recipes,
    add_seeds,
    make_die,
    panels,
    processes,
    read_recipes,
    take_seeds,
)
from dicedesign import InputError
from dicedesign.energies import Preferences
from dicedesign.methods import ExactOptions, solve_exact, solve_paper
from dicedesign.optimize.starts.search import shapes_near
from dicedesign.runtime.arrays import Floats

STARTS = {"0.001": 1e-3, "0.05": 0.05, "0.1": 0.1, "0.2": 0.2, "shuffled": None}
"""Standard deviations of the noise on a start whose half extent is 1; None for the first with the
outcomes in a random order."""

WANTED = {"0.1": 0.9, "0.2": 0.8, "shuffled": 0.8}
"""Part of the dice by the paper's method that must be good."""

PAPER = "paper"

WAYS: dict[str, dict[str, Any] | None] = {
    "exact": None,
    "paper, exact finish": {"finish": "exact"},
    PAPER: {"finish": "none"},
    "paper, line search": {"finish": "none", "step": "line_search"},
}
"""Options of the paper's method, a line search without `apart`; None for the exact method."""


@dataclass(frozen=True)
class Attempt:
    """A die: how it ended, seconds of processor time, and the errors of its steps over these
    seconds, (s, 2)."""

    end: Ending
    seconds: float
    curve: Floats


def add_options(parser: argparse.ArgumentParser) -> None:
    """What is designed."""
    add_recipes(parser)
    add_seeds(parser)


def run(options: argparse.Namespace, report: Report) -> bool:
    """A row for each way, kind of start and recipe, and one for all recipes."""
    seeds = [seed for part in take_seeds(options, report) for seed in part]
    problems = []
    for recipe in read_recipes(options)[: 2 if options.quick else None]:
        start = make_die(recipe, "start").start
        if start is None or recipe.method.paper is None:
            raise InputError(f"{recipe.name}: expected method: paper and a start; leave it out")
        problems.append(PaperProblem(recipe, start))
    # By way and kind of start, those of all recipes.
    together: dict[tuple[str, str], list[Attempt]] = {}
    add = row_of(report, "starts", "recipe 28s")
    axes: Any = np.empty((len(problems) + 1, 0))
    if options.out is not None:
        report.figure, flat = panels(len(WAYS) * len(axes), len(WAYS), (3.6, 2.7))
        axes = flat.reshape(len(axes), len(WAYS))
    with processes(options.jobs) as pool:
        for problem, own in zip(problems, axes[1:], strict=True):
            for place, (way, given) in enumerate(WAYS.items()):
                # The exact method looks for a start itself.
                kinds = {"searched": None} if given is None else STARTS
                for kind, noise in kinds.items():
                    tries = pool.map(attempt, repeat(problem), repeat(way), repeat(noise), seeds)
                    found = list(tries)
                    add((problem.recipe.name, way, kind), found)
                    together.setdefault((way, kind), []).extend(found)
                    if len(own) > 0:
                        draw_band(own[place], found, kind)
            for axis, way in zip(own, WAYS, strict=False):
                name = problem.recipe.name.removeprefix("paper_")
                axis.set_title(f"{name}, {way}", fontsize=8)
                axis.legend(fontsize=7)
    add = row_of(report, "all recipes", "")
    for names, tries in together.items():
        add(names, tries)
    if axes.size > 0:
        draw_success(axes[0], together)
    return all(
        np.mean([one.end.is_good() for one in together[PAPER, kind]]) >= part
        for kind, part in WANTED.items()
    )


def row_of(report: Report, name: str, first: str) -> Callable[[Sequence[str], list[Attempt]], None]:
    """A function that adds a row of attempts to a table."""
    columns = (first, "by 20s", "start 10s", "dice 5d", "good 5d", "error 10 % 9.1e")
    columns += ("median 9.1e", "error 90 % 9.1e", "s 6.2f", "s 90 % 6.2f")
    row = report.table(name, " | ".join(filter(None, columns)))

    def add(names: Sequence[str], tries: list[Attempt]) -> None:
        errors = np.quantile([one.end.error for one in tries], (0.1, 0.5, 0.9))
        taken = np.quantile([one.seconds for one in tries], (0.5, 0.9))
        row(*names, len(tries), sum(one.end.is_good() for one in tries), *errors, *taken)

    return add


def attempt(problem: PaperProblem, way: str, noise: float | None, seed: int) -> Attempt:
    """A die by one of `WAYS` from a start with noise, or with the outcomes in a random order."""
    options, target, given = problem.options, problem.target, WAYS[way]
    if noise is None:
        target = np.random.default_rng(seed).permutation(target)
    else:
        options = replace(options, perturbation=noise)
    wall, start = time.perf_counter(), time.process_time()
    if given is None:
        exact = ExactOptions(tolerance=1e-12, prefer=Preferences())
        shapes = shapes_near(target, seed)
        result = solve_exact(shapes, target, exact, center_of_mass=problem.center)
    else:
        options = replace(options, **given)
        if options.step == "line_search":
            options = replace(options, weights=options.weights.replace(apart=0.0))
        center = problem.center
        result = solve_paper(problem.start, target, options, center_of_mass=center, seed=seed)
    seconds = time.process_time() - start
    share = seconds / (time.perf_counter() - wall)
    curve = np.array([(share * step.seconds, step.error) for step in result.history])
    return Attempt(Ending.of(result, target, problem.center), seconds, curve)


def draw_band(axis: Any, tries: Sequence[Attempt], kind: str) -> None:
    """The least error up to each time: the median, and nine in ten of the attempts."""
    curves = [one.curve for one in tries]
    times = np.geomspace(2e-3, max(curve[-1, 0] for curve in curves) + 2e-3, 200)
    best = [
        np.minimum.accumulate(curve[:, 1])[
            np.maximum(np.searchsorted(curve[:, 0], times, side="right") - 1, 0)
        ]
        for curve in curves
    ]
    draw_quantiles(
        axis,
        times,
        np.array(best),
        kind,
        f"C{list(STARTS).index(kind)}" if kind in STARTS else "black",
    )
    axis.set(xlim=(2e-3, 5.0), ylim=(1e-16, 1.0))
    axis.set(xlabel="seconds of processor time", ylabel="largest |p - q|")


def draw_quantiles(axis: Any, at: Floats, values: Floats, name: str, color: str) -> None:
    """Median of values (n, a) at each place (a,), and nine in ten."""
    low, middle, high = np.quantile(np.maximum(values, 1e-16), (0.05, 0.5, 0.95), axis=0)
    axis.loglog(at, middle, color=color, label=name)
    axis.fill_between(at, low, high, color=color, alpha=0.15, linewidth=0)


def draw_success(axes: Sequence[Any], together: dict[tuple[str, str], list[Attempt]]) -> None:
    """Good dice, errors and seconds over the noise on the start, all recipes together."""
    good, error, seconds, blank = axes
    blank.axis("off")
    kinds = {kind: noise for kind, noise in STARTS.items() if noise is not None}
    noises = np.array(list(kinds.values()))
    for number, (way, given) in enumerate(WAYS.items()):
        if given is None:
            continue
        tries = [together[way, kind] for kind in kinds]
        part = [np.mean([one.end.is_good() for one in own]) for own in tries]
        good.semilogx(noises, part, "o-", color=f"C{number}", label=way)
        for axis, values in (
            (error, [[one.end.error for one in own] for own in tries]),
            (seconds, [[one.seconds for one in own] for own in tries]),
        ):
            draw_quantiles(axis, noises, np.array(values).T, way, f"C{number}")
    good.set(ylim=(-0.03, 1.03), ylabel="part of the dice that are good")
    error.set(ylabel="largest |p - q|")
    seconds.set(ylabel="seconds of processor time")
    for axis in (good, error, seconds):
        axis.set_xlabel("standard deviation of the noise on the start")
        axis.set_title("all recipes", fontsize=8)
    good.legend(fontsize=7)
