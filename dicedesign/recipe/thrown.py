"""`method: exact` with thrown probabilities: a momentum model corrected by simulated throws."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import replace
from itertools import islice
from typing import Any

import numpy as np

from dicedesign.errors import InputError, NoStartError
from dicedesign.fabricate.die import Design, Solid
from dicedesign.geometry.meshes.body import Body, body_of, make_body
from dicedesign.gradient.probability_model import ThrowProbabilities
from dicedesign.optimize.coordinates import orbits_of_directions
from dicedesign.optimize.options import MOST_ROUNDS, RefineOptions
from dicedesign.optimize.preferences import Preferences
from dicedesign.optimize.solvers.candidate import DesignResult
from dicedesign.optimize.solvers.refinement import Refinement, Thrown, shape_measures
from dicedesign.optimize.starts.search import shapes_like
from dicedesign.optimize.starts.start import Start
from dicedesign.optimize.targets import Target
from dicedesign.recipe.convex import (
    find_starts,
    make_design,
    make_solver,
    normalized_center,
    wanted_of_directions,
)
from dicedesign.recipe.pipeline import Work
from dicedesign.results.parts import RoundOfThrows, Status, TableResult, ThrowForecast
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.bias import OFTEN, measure_tables
from dicedesign.throws.momentum_model import MomentumMixture, momentum_model, table_measures
from dicedesign.throws.momentum_probabilities import momentum_probabilities
from dicedesign.throws.simulation import DieOnTable, ThrownDie, throwing_threads
from dicedesign.throws.tables import mixture_tables

VERDICT_ROUND = MOST_ROUNDS + 1
"""Number of the round of throws of the finished die, after all rounds of the design."""

SEEDS_PER_RECIPE = VERDICT_ROUND + 1
"""Seeds of throws of one recipe's seed."""

DEFAULT_TABLE = "board-game"
"""Table of dice whose recipe names none."""

MAX_VARIATIONS = 12
"""Variations of a die from which a design starts, as it may get stuck at kinks of the momentum
model."""


def design_for_table(work: Work) -> Design:
    """Design a die by the momentum model of its table, and refine it by rounds of throws if the
    recipe has `refine`. Raises InputError if no start suits the target."""
    (target, _), options = wanted_of_directions(work.recipe), work.recipe.method.options
    thrown = ThrowProbabilities.on(options.table_with_hand)
    result = make_solver(work)(find_starts(work), target, thrown=thrown)
    rounds: tuple[RoundOfThrows, ...] = ()
    if options.refine is not None and result.status is Status.CONVERGED:
        with throwing_threads() as workers:
            result, rounds = _refine(work, result, thrown, options.refine, workers)
    return make_design(work, result, rounds)


def _refine(
    work: Work,
    die: DesignResult,
    model: ThrowProbabilities,
    refine: RefineOptions,
    workers: Executor,
) -> tuple[DesignResult, tuple[RoundOfThrows, ...]]:
    """Refine a die by rounds of throws at its printed size, and return the die and the rounds."""
    recipe, options, solve = work.recipe, work.recipe.method.options, make_solver(work)
    (target, outcome_of), group = wanted_of_directions(recipe), recipe.group()
    name = options.table_with_hand
    center = normalized_center(recipe, work.start)

    def throw(die: DesignResult, drops: int, number: int) -> Thrown:
        scale = recipe.size_mm / die.hull.diameter
        solid = make_body(scale * die.hull.vertices, name="die")
        com = None if center is None else scale * center
        placed = DieOnTable.of(solid, com, die.directions, name, outcome_of)
        seed = throw_seed(recipe.seed, number)
        throws = placed.simulate(drops, seed, **_throw_options(work, drops, workers))
        models = placed.momentum_by_table(model.mixture), placed.momentum(model.mixture)
        return Thrown(placed.counts(throws), *models)

    def design(die: DesignResult, probabilities: Floats, is_improved: bool) -> DesignResult | None:
        near = shapes_like(Start(die.hull.vertices, die.directions), recipe.seed, group)
        own = options if is_improved else replace(options, prefer=Preferences())
        try:
            result = solve(islice(near, MAX_VARIATIONS), probabilities, thrown=model, options=own)
        except NoStartError:
            return None
        return result if result.status is Status.CONVERGED else None

    orbits = np.arange(len(target))
    return Refinement(
        target=target,
        orbits=orbits if group is None else orbits_of_outcomes(die, group, outcome_of),
        tables=table_measures(mixture_tables(name)),
        drops=refine.drops,
        rounds=refine.rounds,
        within=refine.within,
        throw=throw,
        design=design,
        measures=lambda tried: shape_measures(tried, center),
        on_round=work.callbacks.on_round,
    ).refine(die)


def _throw_options(work: Work, whole: int, workers: Executor) -> dict[str, Any]:
    """Options of simulated throws that are kept in the checkpoint. whole: number of throws."""
    done = 0

    def progress(drops: int) -> None:
        nonlocal done
        done += drops
        work.callbacks.on_part(done, whole, "throws")

    progress(0)
    engine, saved = work.recipe.method.options.refine.engine, work.checkpoint
    return {"engine": engine, "workers": workers, "checkpoint": saved, "progress": progress}


def orbits_of_outcomes(die: DesignResult, group: Floats, outcome_of: Integers | None) -> Integers:
    """(k,) number of the orbit of each outcome: a symmetry of the die maps the faces of one to
    those of the others."""
    orbits = orbits_of_directions(die.directions, group)
    if outcome_of is None:
        return orbits
    faces = [tuple(sorted(orbits[outcome_of == k])) for k in range(outcome_of.max() + 1)]
    return np.unique([faces.index(orbit) for orbit in faces], return_inverse=True)[1]


def throw_seed(seed: int, number: int) -> int:
    """Seed of a round's throws for a recipe's seed. Throws of the finished die are round
    `VERDICT_ROUND`."""
    return SEEDS_PER_RECIPE * seed + number


def forecast_throws(
    work: Work, solid: Solid, design: Design, target: Target, body: Body | None = None
) -> ThrowForecast | None:
    """Expected frequencies of a die on the table of the recipe, board-game by default, by the
    momentum model; None for a table on which it does not fit or that the model does not know.

    body: finished die; by default the hull of the solid.
    """
    name = getattr(work.recipe.method.options, "table_with_hand", DEFAULT_TABLE)
    body = body or make_body(solid.hull_points)
    try:
        mixture = momentum_model(name)
        placed = DieOnTable.of(
            body, solid.center_of_mass, design.directions, name, design.outcome_of
        )
    except InputError:
        return None
    scale = np.ones(len(placed.poses.facets))
    if design.throw_bias is not None:
        face = np.argmax(placed.poses.normals @ design.directions.T, axis=1)
        scale = np.exp(design.throw_bias[face])

    def thrown(model: MomentumMixture | None) -> Floats:
        rests = scale * momentum_probabilities(placed.poses, placed.body, model)
        return placed.outcomes.sums(rests / rests.sum())

    near = [None if mixture is None else mixture.near(table) for table in placed.tables]
    by_hand, wanted = np.array([thrown(model) for model in near]), target.probabilities
    mean = by_hand.mean(axis=0)
    if mixture is not None:
        # Few tables represent all of the mixture.
        models = [thrown(MomentumMixture.alone(model)) for model in mixture.models]
        mean = mixture.weights @ np.array(models)
    off = np.abs(by_hand - wanted).sum(axis=1) / 2.0
    return ThrowForecast(
        table=name,
        probabilities=tuple(mean.tolist()),
        total_variation=float(np.abs(mean - wanted).sum()) / 2.0,
        nine_in_ten=float(np.quantile(off, OFTEN)),
    )


def forecast(work: Work) -> None:
    """Set the expected frequencies of the finished die when thrown.

    The momentum model is made from dice with sharp edges, and takes the strips of rounded ones for
    facets to roll over; so the hull inside rounded edges stands for the die.
    """
    body, core = work.final.body, work.finished.core
    if work.recipe.edges is not None and core is not None:
        body = body_of(core.surface)
    work.forecast = forecast_throws(work, work.solid, work.die, work.target, body)


def throw(work: Work) -> None:
    """Throw the finished die with new random numbers if the recipe has `refine`; set its status.

    The die is thrown with its labels, unless the center of mass was given: the effect of labels on
    it is then unknown."""
    options = work.recipe.method.options
    name, refine = options.table_with_hand, options.refine
    target, mixture = work.target.probabilities, momentum_model(name)
    placed, of_face = (work.solid.center_of_mass, work.die.directions), work.die.outcome_of
    die = DieOnTable.of(work.final.body, *placed, name, of_face)
    throws = by_table = None
    if refine is not None:
        with throwing_threads() as workers:
            share = _throw_options(work, refine.verdict, workers)
            throws = die.simulate(
                refine.verdict, throw_seed(work.recipe.seed, VERDICT_ROUND), **share
            )
        if len(die.tables) > 1:
            models, counts = die.momentum_by_table(mixture), die.counts(throws)[:, :-1]
            by_table = measure_tables(target, table_measures(die.tables), models, counts)
    work.thrown = ThrownDie(die, die.momentum(mixture), throws)
    measured = work.thrown.measure(target)
    work.throws = TableResult(
        table=die.table.as_dict(),
        momentum=tuple(work.thrown.momentum.tolist()),
        rounds=work.die.rounds,
        simulated=measured,
        by_table=by_table,
    )
    if measured is None or refine is None:
        return
    if work.status is Status.CONVERGED and measured.total_variation > refine.within:
        work.status = Status.OFF_TABLE
    if work.status is Status.OFF_TABLE:
        work.remarks[:] = [work.status.value]
    if by_table is not None:
        work.remarks.insert(
            work.status is Status.OFF_TABLE,
            f"for nine in ten hands the total variation is at most {by_table.often:.2g}, and in "
            f"1,000 rolls by an unknown hand you would notice in {100.0 * by_table.noticed:.2g} of "
            "100 cases",
        )
