"""dice for a table, the momentum model and the simulators, compared with simulated throws

Four parts, or one by --part. `dice`: design the die of each recipe for throws twice: for
probabilities without momentum, and by its own method; other dice once. Throw all, as they are
printed, with random numbers that no design has used, onto all tables of the mixture. Numbers are
means over the seeds, but `from` is the largest lower end of the 95 % intervals. `momentum`: throw
random dice that the momentum model was not fitted to, three quarters random polyhedra and a quarter
designed, and compare how often each rest comes up with its probabilities without momentum and by
the model. `simulators`: throw dice in the package's own simulator, with a half and a quarter of its
time step, and in others that are installed. `contacts`: impacts of single vertices in each
simulator against closed forms. Other numbers are total variations; the
floor is the mean of right probabilities. Exits 1 where a die by its own method does not converge,
or its throws are further from the target than the recipe's refine.within (of other dice: 0.01) and
chance is not the reason.
"""

from __future__ import annotations

import argparse
import math
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np
from scipy.sparse.csgraph import connected_components

from benchmarks.frame import (
    Report,
    add_recipes,
    make_die,
    panels,
    processes,
    read_recipes,
    with_method,
)
from benchmarks.random_dice import (
    DEVIATIONS,
    DICE_KINDS,
    deviations,
    random_die,
    summary,
    throw_random_die,
)
from dicedesign import (
    DiceError,
    EngravingError,
    InputError,
    Recipe,
    Table,
    load_table,
    rigid_body,
)
from dicedesign.extensions import ENGINES, Engine
from dicedesign.recipe.pipeline import run_stages
from dicedesign.results.parts import Status
from dicedesign.runtime.arrays import Integers
from dicedesign.throws.bias import measure_tables
from dicedesign.throws.distances import measure_variation, total_variation
from dicedesign.throws.engines import ThrowStates, throw_states
from dicedesign.throws.momentum_model import momentum_model, table_measures
from dicedesign.throws.rigid_body import RigidBody, release_states
from dicedesign.throws.simulation import DieOnTable
from dicedesign.throws.tables import mixture_tables
from examples.mujoco_engine import MUJOCO
from tests.reference.impacts import planar_impulse
from tests.reference.strikes import STRIKES, Strike, faceted_ball, lean, needle

FRESH = 2**64
"""First seed of the throws of dice, beyond all that designs and their verdicts take."""

UNSEEN = 1_000_000
"""Seed of random dice and their throws; not one that a model is fitted with."""

RESTS = (7, 13)
"""Fewest and most of random dice."""

ALIKE = math.radians(3.0)
"""Angle between normals of rests that count as one: on which of two triangles of a face that is
not quite plane a die lies nobody can see."""

TASK = 500
"""Drops."""

FAR = 0.01
"""Limit on the total variation of dice that are not designed for throws."""

SLIPS = (0.0, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
"""Slips of impacts, in units of the approach."""

FRICTIONS = (0.0, 0.15, 0.3, 0.6, 0.9)

RESTITUTIONS = (0.0, 0.25, 0.5, 0.75, 0.95)

NEEDLE_ANGLES = (0.35, 0.8, -0.8)
"""Of a needle that hits the table with one end, to the vertical, in radians."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """What is thrown, and how often."""
    add_recipes(parser, "*")
    parser.add_argument(
        "--part", choices=("dice", "momentum", "simulators", "contacts"), help="only this one"
    )
    parser.add_argument(
        "--table", default="board-game", metavar="TABLE", help="of random dice (board-game)"
    )
    parser.add_argument("--random", type=int, metavar="N", help="dice that no model was fitted to")
    parser.add_argument("--drops", type=int, metavar="N", help="of each die")
    parser.add_argument("--seeds", type=int, default=1, metavar="N", help="of each recipe (1)")


def run(options: argparse.Namespace, report: Report) -> bool:
    """All parts, or one."""
    is_good = True
    recipes = read_recipes(options)
    with processes(options.jobs) as workers:
        if options.part in (None, "dice"):
            dice = [
                one
                for one in recipes
                if one.method.is_thrown or (one.target.faces and one.method.exact)
            ]
            is_good = throw_recipes(dice, options, workers, report)
        if options.part in (None, "momentum"):
            judge_model(options, workers, report)
        if options.part in (None, "simulators"):
            plain = [recipe for recipe in recipes if not recipe.method.is_thrown]
            compare_simulators(plain, options, workers, report)
    if options.part in (None, "contacts"):
        compare_contacts(options, report)
    return is_good


def throw_recipes(
    recipes: Sequence[Recipe], options: argparse.Namespace, workers: Executor, report: Report
) -> bool:
    """Dice on the mean of a mixture and on its single tables: means over seeds."""
    row = report.table(
        "dice",
        "recipe 18s | design 8s | converged 9s | TV to target 7.4f | from 7.4f | floor 7.4f | "
        "momentum 7.4f | s 6.1f | 90 % of hands 7.4f | chance 7.4f | worst 7.4f | noticed 7.3f",
    )
    is_good = True
    for recipe in recipes:
        exact = recipe.method.exact
        assert exact is not None
        within, table, designs = FAR, options.table, {"own": exact}
        if recipe.method.is_thrown:
            if exact.refine is None:
                raise InputError(
                    f"{recipe.name}: expected method: "
                    f"{{exact: {{probabilities: thrown, refine: {{}}}}}}, got "
                    "none that is refined; change the method, or leave the recipe out"
                )
            within, table, refine = exact.refine.within, exact.table_with_hand, exact.refine
            if options.quick:
                refine = replace(refine, drops=min(refine.drops, 2_000), rounds=1)
            exact = replace(exact, refine=refine)
            resting = replace(exact, probabilities="resting", refine=None)
            designs = {"resting": resting, "own": exact}
        for name, method in designs.items():
            own = with_method(recipe, exact=method)
            dice = [
                throw_die(own.model_copy(update={"seed": recipe.seed + k}), table, options, workers)
                for k in range(max(options.seeds, 1))
            ]
            right = sum(die[0] for die in dice)
            numbers = np.transpose([die[1:] for die in dice])
            means = numbers.mean(axis=1)
            means[1] = numbers[1].max()
            row(recipe.name, name, f"{right} of {len(dice)}", *means)
            is_last = name == list(designs)[-1]
            is_good &= not is_last or (right == len(dice) and means[1] <= within)
    return is_good


def throw_die(
    recipe: Recipe, table: str, options: argparse.Namespace, workers: Executor
) -> tuple[bool | float, ...]:
    """Design a die, and throw it as it is printed with random numbers that no design has used.

    Returns whether it converged; the total variation from its target, the lower end of its 95 %
    interval, the mean of a perfect die, and the variation from the momentum model; seconds of the
    design; variation on nine in ten tables, by chance alone, on the worst, and share noticed.
    """
    start = time.perf_counter()
    work = make_die(recipe)
    seconds = time.perf_counter() - start
    with suppress(EngravingError):
        run_stages(work, after="check", last="engrave")
    finished = work.plain if work.engraved is None else work.engraved.assessment
    placed = work.solid.center_of_mass, work.die.directions
    die = DieOnTable.of(finished.body, *placed, table, work.die.outcome_of)
    drops = options.drops or (4_000 if options.quick else 100_000)
    by_table = die.counts(die.simulate(drops, FRESH + recipe.seed, workers=workers))
    counts, wanted = by_table.sum(axis=0), work.target.probabilities
    variation = measure_variation(counts, np.append(wanted, 0.0), 0.95)
    mixture = momentum_model(table)
    hands = measure_tables(
        wanted, table_measures(die.tables), die.momentum_by_table(mixture), by_table[:, :-1]
    )
    return (
        work.status is Status.CONVERGED,
        *(variation.value, variation.interval[0], variation.noise_floor),
        *(total_variation(die.momentum(mixture), counts[:-1] / counts.sum()), seconds),
        *(hands.often, hands.chance_often, hands.worst, hands.noticed),
    )


def judge_model(options: argparse.Namespace, workers: Executor, report: Report) -> None:
    """The momentum model against throws of dice that it was not fitted to."""
    tables, model = mixture_tables(options.table), momentum_model(options.table)
    if model is None:
        raise InputError(
            f"--table {options.table}: expected a table on which dice have momentum, got one with "
            "drag; take another, such as board-game"
        )
    count = options.random or (12 if options.quick else 100)
    drops = options.drops or (1_000 if options.quick else 20_000)
    task = partial(throw_random_die, seed=UNSEEN, throws=[(tables, drops)], rests=RESTS)
    thrown = [one for (one,) in workers.map(task, range(count))]
    variations = deviations(thrown, model)
    row = report.table("momentum", f"random dice 23s | {DEVIATIONS}")
    for kind in ("all", *DICE_KINDS):
        pairs = zip(thrown, variations, strict=True)
        if alike := [one for die, one in pairs if kind in ("all", die.die.kind)]:
            row(kind, *summary(alike))
    if options.out is not None:
        report.figure, (axis,) = panels(1, 1, (8.0, 4.5))
        geometric, momentum, floor = np.transpose(sorted(variations))
        axis.bar(range(count), geometric, label="without momentum")
        axis.bar(range(count), momentum, label="momentum model")
        axis.plot(range(count), floor, color="black", label="right probabilities")
        axis.set(xlabel="random dice", ylabel="total variation to simulated throws")
        axis.legend()


def ways() -> Iterator[tuple[str, ThrowStates, bool]]:
    """Ways to simulate throws, and whether they are a hundred times slower than the others; the
    first is held against all others, the second is the same with other random numbers."""
    yield "native", throw_states, False
    yield "native again", throw_states, False
    yield "half the step", partial(throw_states, refinement=2.0), False
    yield "a quarter of it", partial(throw_states, refinement=4.0), False
    for engine in installed_engines():
        if engine.name != "native":
            yield engine.title, engine.throw_states, True


def installed_engines() -> Iterator[Engine]:
    """Simulators that can throw here."""
    for engine in (*ENGINES, MUJOCO):
        with suppress(InputError):
            engine.require()
            yield engine


def compare_simulators(
    recipes: Sequence[Recipe], options: argparse.Namespace, workers: Executor, report: Report
) -> None:
    """Dice of recipes, without labels, and random ones in every way."""
    table = load_table(options.table)
    count = options.random or (2 if options.quick else 10)
    drops = options.drops or (500 if options.quick else 20_000)
    dice = [rigid_body(die.plain.body, die.plain.poses) for die in map(make_die, recipes)]
    dice += random_bodies(count)
    counts_by_engine: dict[str, list[Integers]] = {}
    for place, (name, throw, is_slow) in enumerate(ways()):
        wanted = max(drops // 10, 50) if is_slow else drops
        tasks = [
            (die, table, throw, min(TASK, wanted - first), (number, place, first))
            for number, die in enumerate(dice)
            for first in range(0, wanted, TASK)
        ]
        parts = list(workers.map(throw_part, tasks))
        each = len(tasks) // len(dice)
        counts_by_engine[name] = [
            np.sum(parts[k : k + each], axis=0) for k in range(0, len(parts), each)
        ]
    row = report.table(
        "simulators",
        "against native 16s | drops 7d | mean TV 7.4f | chance 7.4f | worst 7.4f | "
        "99 % of chance 7.4f | beyond 6d",
    )
    reference = counts_by_engine.pop("native")
    for name, counts in counts_by_engine.items():
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
    rests = throw(body, table, release_states(body, table, drops, rng))
    close = body.rest_normals @ body.rest_normals.T > math.cos(ALIKE)
    count, outcome = connected_components(close)
    return np.bincount(np.append(outcome, count)[rests], minlength=count + 1)


def against(first: Integers, second: Integers) -> tuple[float, float, float]:
    """Total variation of the frequencies of two samples, its mean and its 99 % quantile where both
    have the same probabilities."""
    sizes = int(first[:-1].sum()), int(second[:-1].sum())
    probabilities = (first + second)[:-1] / sum(sizes)
    rng = np.random.default_rng(0)
    drawn = [rng.multinomial(size, probabilities, 4_000) / size for size in sizes]
    chance = np.abs(drawn[0] - drawn[1]).sum(axis=1) / 2.0
    value = total_variation(first[:-1] / sizes[0], second[:-1] / sizes[1])
    return value, float(chance.mean()), float(np.quantile(chance, 0.99))


def compare_contacts(options: argparse.Namespace, report: Report) -> None:
    """A row for each simulator and body: how far the speed of a bounce and the friction are from
    the closed form, per approach and per normal impulse; then throws per second."""
    engines = [engine for engine in installed_engines() if engine.name in STRIKES]
    row = report.table(
        "contacts",
        "engine 9s | body 6s | impacts 7d | worst restitution 17.4f | mean 7.4f | "
        "worst friction 14.4f | mean friction 13.4f",
    )
    for engine in engines:
        for name, (body, vertex), angles in (
            ("ball", faceted_ball(), (0.0,)),
            ("needle", needle(), NEEDLE_ANGLES),
        ):
            errors = np.array(
                [
                    deviation(engine, Strike(body, vertex, lean(body, vertex, angle), *impact))
                    for angle in angles
                    for impact in impacts(options.quick)
                ]
            )
            worst, mean = errors.max(axis=0), errors.mean(axis=0)
            row(engine.title, name, len(errors), worst[0], mean[0], worst[1], mean[1])


def impacts(is_quick: bool) -> Iterator[tuple[np.ndarray, float, float]]:
    """Slips (2,), restitutions and frictions."""
    each = 2 if is_quick else 1
    for slip, restitution, friction in product(
        SLIPS[::each], RESTITUTIONS[::each], FRICTIONS[::each]
    ):
        yield np.array([slip, 0.0]), restitution, friction


def deviation(engine: Engine, strike: Strike) -> tuple[float, float]:
    """Difference of the speed after an impact, per approach, and of friction's impulse, per normal
    impulse, from the closed form."""
    wanted = planar_impulse(strike.response, strike.velocity, strike.restitution, strike.friction)
    impulse = STRIKES[engine.name](strike)
    bounce = strike.response[2] @ (impulse - wanted) / -strike.velocity[2]
    return abs(float(bounce)), abs(float(impulse[0] - wanted[0])) / wanted[2]
