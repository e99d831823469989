"""dice for a table, the momentum model and the simulators, all against simulated throws

Three parts, or one by --part. `dice`: design the die of each recipe twice, for odds without
momentum and by the recipe's own method, for throws with refinement; throw both, as they are
printed, with random numbers that no design has used, and the latter also onto what its table may be
instead. `momentum`: throw random dice that the momentum model was not fitted to, three quarters
random polyhedra and a quarter designed, and compare how often each rest comes up with its odds
without momentum and by the model; and compare with printed dice of a file of throws. `simulators`:
throw dice in the package's own simulator, with a half and a quarter of its time step, with contacts
half and twice as stiff, and in others that are installed. Numbers are total variations; the floor
is the mean of right odds. Exits 1 where a design does not converge, or its throws are further from
the target than the recipe's refine.within and chance is not the reason.
"""

from __future__ import annotations

import argparse
import math
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any, Final

import numpy as np
import torch
from scipy.sparse.csgraph import connected_components

from benchmarks.dice import Work, add_recipes, continue_to, make_die, read_recipes, with_method
from benchmarks.frame import Report, panels, processes, time_in_turn
from benchmarks.training.random_dice import DICE_KINDS, random_die
from benchmarks.training.throws import Deviation, deviation, mean_deviations, throw_random_die
from dicedesign import (
    DiceError,
    EngravingError,
    InputError,
    Recipe,
    Table,
    evaluate_rests,
    rigid_body,
    simulate,
    table_named,
)
from dicedesign.extensions import ENGINES
from dicedesign.gradient.odds_model import ThrownOdds
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.bias import OFTEN
from dicedesign.throws.distances import measure_variation, noise_floor, total_variation
from dicedesign.throws.engines import ThrowStates, throw_states
from dicedesign.throws.goodness_of_fit import chi_square, two_sample_chi_square
from dicedesign.throws.momentum_model import MomentumModel, momentum_model, other_tables
from dicedesign.throws.momentum_odds import momentum_odds
from dicedesign.throws.rigid_body import RigidBody, released
from dicedesign.throws.simulation import DieOnTable
from dicedesign.throws.tables import posterior_tables
from dicedesign.throws.throw_counts import read_throw_counts

FRESH: Final = 2**64
"""First seed of the throws of dice, beyond all that designs and their verdicts take."""

UNSEEN: Final = 1_000_000
"""Seed of random dice and their throws; not one that a model is fitted with."""

RESTS: Final = (7, 13)
"""Fewest and most of random dice."""

ALIKE: Final = math.radians(3.0)
"""Angle between normals of rests that count as one: on which of two triangles of a face that is
not quite plane a die lies nobody can see."""

TASK: Final = 500
"""Drops."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """What is thrown, and how often."""
    add_recipes(parser, "*")
    parser.add_argument("--part", choices=("dice", "momentum", "simulators"), help="only this one")
    parser.add_argument(
        "--table", default="board-game", metavar="TABLE", help="of random dice (board-game)"
    )
    parser.add_argument("--throws", type=Path, metavar="CSV", help="of printed dice")
    parser.add_argument("--random", type=int, metavar="N", help="dice that no model was fitted to")
    parser.add_argument("--drops", type=int, metavar="N", help="of each die")


def run(options: argparse.Namespace, report: Report) -> bool:
    """All parts, or one."""
    is_good = True
    recipes = read_recipes(options)
    with processes(options.jobs) as workers:
        if options.part in (None, "dice"):
            thrown = [one for one in recipes if one.method.thrown]
            is_good = throw_recipes(thrown, options, workers, report)
        if options.part in (None, "momentum"):
            judge_model(options, workers, report)
        if options.part in (None, "simulators"):
            plain = [recipe for recipe in recipes if not recipe.method.thrown]
            compare_simulators(plain, options, workers, report)
    return is_good


def throw_recipes(
    recipes: Sequence[Recipe], options: argparse.Namespace, workers: Executor, report: Report
) -> bool:
    """Dice designed for throws: before and after, and on other tables."""
    drops = options.drops or (4_000 if options.quick else 100_000)
    row = report.table(
        "dice",
        {"recipe": "18s", "design": "14s", "status": "10s", "TV to target": "7.4f", "from": "7.4f"}
        | {"to": "7.4f", "floor": "7.4f", "geometric": "7.4f", "momentum": "7.4f", "s": "6.1f"}
        | {"rounds": "6d", "within": "7.4f"},
    )
    elsewhere, is_good = [], True
    for recipe in recipes:
        exact = recipe.method.exact
        if exact is None or exact.refine is None:
            raise InputError(
                f"{recipe.name}: expected method: {{exact: {{odds: thrown, refine: {{}}}}}}, got "
                "none that is refined; change the method, or leave the recipe out"
            )
        if options.quick:
            refine = replace(exact.refine, drops=min(exact.refine.drops, 2_000), rounds=1)
            exact = replace(exact, refine=refine)
        seeds = iter(range(FRESH + 100 * recipe.seed, FRESH + 100 * recipe.seed + 100))
        for name, method in {
            "resting": replace(exact, odds="resting", refine=None),
            "thrown": exact,
        }.items():
            start = time.perf_counter()
            work = make_die(with_method(recipe, exact=method), "check")
            seconds = time.perf_counter() - start
            with suppress(EngravingError):
                continue_to(work, "engrave", after="check")
            die = on_table(work, exact.thrown_onto)
            counts = die.counts(die.simulated(drops, next(seeds), "native", workers))
            frequencies = counts[:-1] / counts.sum()
            target = np.append(work.target.probabilities, 0.0)
            found = measure_variation(counts, target, 0.95)
            geometric = die.outcomes.sums(die.poses.probabilities)
            momentum = die.momentum(momentum_model(exact.thrown_onto))
            status = work.status.name.lower()
            row(
                *(recipe.name, name, status, found.value, *found.interval, found.noise_floor),
                total_variation(geometric, frequencies),
                total_variation(momentum, frequencies),
                *(seconds, len(work.die.rounds), exact.refine.within if name == "thrown" else None),
            )
        is_good &= status == "converged" and found.interval[0] <= exact.refine.within
        table = exact.thrown_onto
        others = posterior_tables(table) or other_tables(table_named(table))
        each = drops // 20 if options.quick else drops // 5
        varied = [
            measure_variation(die.counts(throws), target, 0.95).value
            for throws in (
                simulate(die.body, other.lifted(die.table.size), each, next(seeds), workers=workers)
                for other in others
            )
        ]
        chance = perfect(work.target.probabilities, each, len(varied))
        elsewhere.append((recipe.name, len(varied), float(np.quantile(varied, OFTEN)), chance[0]))
        elsewhere[-1] += (max(varied), chance[1])
    row = report.table(
        "other tables",
        {"recipe": "18s", "tables": "6d", "90 %": "7.4f", "chance": "7.4f", "worst": "7.4f"}
        | {"worst by chance": "7.4f"},
    )
    for cells in elsewhere:
        row(*cells)
    return is_good


def on_table(work: Work, table: str) -> DieOnTable:
    """A die as it is printed, with labels if it has them."""
    finished = work.plain if work.engraved is None else work.engraved.assessment
    center = work.solid.center_of_mass
    return DieOnTable.of(finished.body, center, work.die.directions, table_named(table))


def perfect(target: Floats, drops: int, tables: int) -> tuple[float, float]:
    """What a die of the target's odds (k,) shows on the mean, where nine tables in ten are no
    worse, and where it is worst."""
    counts = np.random.default_rng(0).multinomial(drops, target, (200, tables))
    found = np.abs(counts / drops - target).sum(axis=2) / 2.0
    return float(np.quantile(found, OFTEN, axis=1).mean()), float(found.max(axis=1).mean())


def judge_model(options: argparse.Namespace, workers: Executor, report: Report) -> None:
    """The momentum model against throws of dice that it was not fitted to, and of printed ones."""
    table, model = table_named(options.table), momentum_model(options.table)
    if model is None:
        raise InputError(
            f"--table {options.table}: expected a table on which dice have momentum, got one with "
            "drag; take another, such as board-game"
        )
    count = options.random or (12 if options.quick else 100)
    drops = options.drops or (1_000 if options.quick else 20_000)
    task = partial(throw_unseen, throws=[(table, drops)])
    thrown = list(workers.map(task, range(count)))
    deviations = [deviation(one, model) for one in thrown]
    row = report.table(
        "momentum",
        {"random dice": "23s", "dice": "5d", "geometric": "7.4f", "worst": "7.3f"}
        | {"momentum": "7.4f", "worst by it": "7.3f", "floor": "7.4f"},
    )
    for kind in ("all", *DICE_KINDS):
        alike = [one for one in deviations if kind in ("all", one.kind)]
        if alike:
            row(kind, *vars(mean_deviations(alike)).values())
    times = []
    for one in thrown:
        poses = one.die.poses
        is_uniform = poses.center_of_mass_source == "uniform solid hull"
        center = None if is_uniform else torch.from_numpy(poses.center_of_mass)
        rests = evaluate_rests(torch.from_numpy(poses.hull.vertices), center)
        # It keeps what it has computed.
        rests.odds.sum()
        works: list[Callable[[], Any]] = [
            partial(momentum_odds, poses, one.die.body, model),
            partial(ThrownOdds.on(options.table).jacobian, rests),
        ]
        times.append(time_in_turn(works, 0.0, rounds=3, row=2e-3))
    odds, jacobian = (median(column) for column in zip(*times, strict=True))
    report.record["seconds"] = {"odds": odds, "jacobian": jacobian}
    report.line(f"\nmedians: odds {1e3 * odds:.3f} ms, Jacobian {1e3 * jacobian:.3f} ms")
    if options.throws is not None:
        judge_printed(options.throws, table, model, drops, workers, report)
    if options.out is not None:
        report.figure = draw(deviations)


def throw_unseen(number: int, throws: list[tuple[Table, int]]) -> Any:
    """A random die of `RESTS` rests, thrown onto one table."""
    return throw_random_die(number, UNSEEN, throws, RESTS)[0]


def judge_printed(
    path: Path, table: Table, model: MomentumModel, drops: int, workers: Executor, report: Report
) -> None:
    """Three predictions of printed dice beside what came up."""
    row = report.table(
        "printed dice",
        {"printed die": "23s", "throws": "6d", "odds": "10s", "chi-square": "8.2f", "degrees": "6d"}
        | {"p": "8.2g", "TV": "7.4f", "floor": "7.4f"},
    )
    for die in read_throw_counts(path):
        sized = table.sized(die.size)
        counts = die.by_outcome(simulate(die.body, sized, drops, UNSEEN, workers=workers).counts)
        shown = die.group_of_rest >= 0
        by_rest = momentum_odds(die.poses, die.body, model)
        momentum = np.bincount(die.group_of_rest[shown], by_rest[shown], minlength=len(die.labels))
        momentum = momentum / momentum.sum()
        throws = int(die.counts.sum())
        for name, odds, test in (
            ("geometric", die.geometric, chi_square(die.counts, die.geometric)),
            ("momentum", momentum, chi_square(die.counts, momentum)),
            ("simulated", counts / counts.sum(), two_sample_chi_square(die.counts, counts)),
        ):
            variation = total_variation(die.counts / throws, odds)
            floor = noise_floor(odds, throws)
            row(
                *(die.name, throws, name, test.statistic, test.degrees, test.p_value),
                *(variation, floor),
            )


def draw(deviations: Sequence[Deviation]) -> Any:
    """Each die's total variation without momentum and by the model."""
    figure, (axis,) = panels(1, 1, (8.0, 4.5))
    ordered = sorted(deviations, key=lambda one: one.geometric)
    places = range(len(ordered))
    axis.bar(places, [one.geometric for one in ordered], label="without momentum")
    axis.bar(places, [one.momentum for one in ordered], label="momentum model")
    axis.plot(places, [one.noise_floor for one in ordered], color="black", label="right odds")
    axis.set(xlabel="random dice", ylabel="total variation to simulated throws")
    axis.legend()
    return figure


def ways() -> Iterator[tuple[str, ThrowStates]]:
    """Ways to simulate throws; the first is held against all others, the second is the same with
    other random numbers."""
    yield "native", throw_states
    yield "native again", throw_states
    yield "half the step", partial(throw_states, refinement=2.0)
    yield "a quarter of it", partial(throw_states, refinement=4.0)
    yield "half as stiff", partial(throw_states, stiffness=0.5)
    yield "twice as stiff", partial(throw_states, stiffness=2.0)
    for engine in ENGINES:
        with suppress(InputError):
            engine.require()
            if engine.name != "native":
                yield engine.title, engine.throw_states


def compare_simulators(
    recipes: Sequence[Recipe], options: argparse.Namespace, workers: Executor, report: Report
) -> None:
    """Dice of recipes, without labels, and random ones in every way."""
    table = table_named(options.table)
    count = options.random or (2 if options.quick else 10)
    drops = options.drops or (500 if options.quick else 20_000)
    dice = [rigid_body(die.plain.body, die.plain.poses) for die in map(make_die, recipes)]
    dice += random_bodies(count)
    found: dict[str, list[Integers]] = {}
    for place, (name, throw) in enumerate(ways()):
        # Others are a hundred times slower.
        wanted = drops if place < 6 else max(drops // 10, 50)
        tasks = [
            (die, table, throw, min(TASK, wanted - first), (number, place, first))
            for number, die in enumerate(dice)
            for first in range(0, wanted, TASK)
        ]
        parts = list(workers.map(throw_part, tasks))
        each = len(tasks) // len(dice)
        found[name] = [np.sum(parts[k : k + each], axis=0) for k in range(0, len(parts), each)]
    row = report.table(
        "simulators",
        {"against native": "16s", "drops": "7d", "mean TV": "7.4f", "chance": "7.4f"}
        | {"worst": "7.4f", "99 % of chance": "7.4f", "beyond": "6d"},
    )
    reference = found.pop("native")
    for name, counts in found.items():
        varied = [against(*pair) for pair in zip(reference, counts, strict=True)]
        worst = max(varied)
        beyond = sum(value > limit for value, _, limit in varied)
        means = np.mean(varied, axis=0)
        row(name, int(counts[0].sum()), means[0], means[1], worst[0], worst[2], beyond)


def random_bodies(count: int) -> list[RigidBody]:
    """So many random dice, of all kinds in turn."""
    taken, number, bodies = Counter[str](), 0, list[RigidBody]()
    while len(bodies) < count:
        with suppress(DiceError):
            die = random_die(number, 2 * UNSEEN)
            if taken[die.kind] <= len(bodies) // len(DICE_KINDS):
                taken[die.kind] += 1
                bodies.append(die.body)
        number += 1
    return bodies


def throw_part(task: tuple[RigidBody, Table, ThrowStates, int, tuple[int, ...]]) -> Integers:
    """Counts (g + 1,) of the outcomes of a die, and of drops that came to none."""
    body, table, throw, drops, seed = task
    rng = np.random.default_rng([2 * UNSEEN, *seed])
    rests = throw(body, table, released(body, table, np.arange(drops), "uniform", rng))
    close = body.rest_normals @ body.rest_normals.T > math.cos(ALIKE)
    count, outcome = connected_components(close)
    return np.bincount(np.append(outcome, count)[rests], minlength=count + 1)


def against(first: Integers, second: Integers) -> tuple[float, float, float]:
    """Total variation of the frequencies of two samples, its mean and its 99 % quantile where both
    have the same odds."""
    sizes = int(first[:-1].sum()), int(second[:-1].sum())
    odds = (first + second)[:-1] / sum(sizes)
    rng = np.random.default_rng(0)
    drawn = [rng.multinomial(size, odds, 4_000) / size for size in sizes]
    chance = np.abs(drawn[0] - drawn[1]).sum(axis=1) / 2.0
    value = total_variation(first[:-1] / sizes[0], second[:-1] / sizes[1])
    return value, float(chance.mean()), float(np.quantile(chance, 0.99))
