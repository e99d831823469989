"""Exact and paper methods for convex dice, and the choice of a symmetry."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np

from dicedesign.errors import InputError, NoStartError
from dicedesign.fabricate.die import Design
from dicedesign.optimize.clusters import cluster
from dicedesign.optimize.coordinates import SymmetricCoordinates, orbits_of_directions
from dicedesign.optimize.preferences import Preferences
from dicedesign.optimize.solvers.candidate import DesignResult, DesignStep
from dicedesign.optimize.solvers.exact import solve_exact
from dicedesign.optimize.starts.orbit_layouts import fitting_groups
from dicedesign.optimize.starts.search import shapes_like
from dicedesign.optimize.starts.start import Start
from dicedesign.recipe.pipeline import Work
from dicedesign.recipe.recipe import Recipe
from dicedesign.recipe.solid import check_orbits
from dicedesign.rest.poses import analyze, rest_poses
from dicedesign.rest.prior import Prior
from dicedesign.results.parts import Status
from dicedesign.results.result import HullCounts, Step
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.workers import one_tensor_thread

if TYPE_CHECKING:
    from dicedesign.results.parts import RoundOfThrows

MAX_SEARCH_TURNS = 40
"""Turns of the search for starting shapes with a symmetry."""

MAX_SYMMETRIC_STARTS = 4
"""Starting shapes with a symmetry from which a design is tried."""


def design_exact(work: Work) -> Design:
    """Design a die from the recipe's start or from searched shapes. Raises InputError if no start
    suits the target."""
    wanted, _ = wanted_of_directions(work.recipe)
    return make_design(work, make_solver(work)(find_starts(work), wanted))


def design_paper(work: Work) -> Design:
    """Design a die from the recipe's start. Raises InputError if it does not suit the target."""
    from dicedesign.optimize.solvers.paper import solve_paper

    recipe, arguments = work.recipe, _solver_arguments(work)
    # Only the exact method searches shapes.
    assert work.start is not None
    result = solve_paper(
        work.start,
        wanted_of_directions(recipe)[0],
        seed=recipe.seed,
        on_evaluation=arguments["on_candidate"],
        **arguments,
    )
    # The mean of a cluster may be no rest: take its most probable one, which comes first. An empty
    # cluster keeps its direction.
    hull, directions, center = result.hull, result.directions.copy(), arguments["center_of_mass"]
    normals = analyze(hull, hull.centroid if center is None else center).normals
    clusters, first = np.unique(cluster(normals, directions).of_rest, return_index=True)
    directions[clusters] = normals[first]
    return make_design(work, replace(result, directions=directions))


def choose_symmetry(work: Work) -> None:
    """Set the recipe's symmetry to the most helpful point group of the start with which a design
    reaches the probabilities, or to none."""
    target, recipe = work.target, work.recipe
    with one_tensor_thread():
        names = fitting_groups(target.face_probabilities)
        for number, name in enumerate(names):
            work.callbacks.on_part(number, len(names), "symmetries")
            work.recipe = recipe.model_copy(update={"symmetry": name})
            if _reaches_target(work):
                break
        else:
            work.recipe = recipe.model_copy(update={"symmetry": None})
            work.notes.append("symmetry: no point group suits the target")
            return
    is_fair = len(set(target.face_probabilities)) == 1
    equal = "all outcomes" if is_fair else "equally probable outcomes"
    work.notes.append(f"symmetry: {name}, which keeps {equal} equally frequent on every table")


def _reaches_target(work: Work) -> bool:
    """Whether the recipe's symmetry suits a given start and its labels, and one of a few starts
    with it reaches the probabilities, without preferences."""
    from dicedesign.gradient.probability_model import ThrowProbabilities

    group, start, thrown = work.recipe.group(), work.start, None
    if start is not None and group is not None:
        try:
            check_orbits(work.recipe, start.directions)
            SymmetricCoordinates.of(start.points, np.zeros(3), group)
        except InputError:
            return False
        if orbits_of_directions(start.directions, group).max() + 1 == len(start.directions):
            return False
    (wanted, _), options = wanted_of_directions(work.recipe), work.recipe.method.options
    quick = replace(options, prefer=Preferences(), starts=MAX_SYMMETRIC_STARTS)
    if options.probabilities == "thrown":
        thrown = ThrowProbabilities.on(options.table_with_hand)
    starts = islice(find_starts(work), MAX_SEARCH_TURNS)
    try:
        result = make_solver(work)(starts, wanted, options=quick, thrown=thrown)
    except NoStartError:
        return False
    return result.status is Status.CONVERGED


def wanted_of_directions(recipe: Recipe) -> tuple[Floats, Integers | None]:
    """`Target.wanted`, with the faces in the order of the start's directions."""
    wanted, outcome_of = recipe.target.target().wanted
    order = recipe.face_of_direction()
    return (wanted[order], None) if outcome_of is None else (wanted, outcome_of[order])


def _solver_arguments(work: Work) -> dict[str, Any]:
    """Options, center of mass and callbacks for the solver of a recipe's method."""
    recipe, callbacks = work.recipe, work.callbacks
    order = np.argsort(recipe.face_of_direction())
    return {
        "options": recipe.method.options,
        "center_of_mass": normalized_center(recipe, work.start),
        "outcome_of": wanted_of_directions(recipe)[1],
        "on_step": lambda step: callbacks.on_step(_step(step)),
        "on_candidate": lambda shape: callbacks.on_shape(shape.rests.hull, shape.directions[order]),
    }


def make_solver(work: Work) -> Callable[..., DesignResult]:
    """`solve_exact` with all arguments of a recipe but starts and target."""
    recipe = work.recipe
    return partial(
        solve_exact,
        group=recipe.group(),
        least_circle=recipe.min_inradius_mm / recipe.size_mm,
        prior=recipe.density_prior(),
        **_solver_arguments(work),
    )


def find_starts(work: Work) -> Iterator[Start | None]:
    """Yield starting shapes for the target and call `on_start` for each; None after a while without
    one."""
    recipe, group, prior = work.recipe, work.recipe.group(), work.recipe.density_prior()
    target = work.target.face_probabilities[recipe.face_of_direction()]
    starts: Iterator[Start | None]
    if work.start is not None:
        starts = shapes_like(work.start, recipe.seed, group)
    else:
        search = recipe.start.kind.search
        assert search is not None
        starts = search(recipe.start.options, target, group, recipe.seed)
        if prior is not None:
            starts = (start and _rank_outcomes(start, target, prior) for start in starts)
    for number, start in enumerate(starts):
        work.callbacks.on_start(number)
        yield start


def _rank_outcomes(start: Start, target: Floats, prior: Prior) -> Start:
    """Assign faces with probabilities (f,) to the rests of a shape by rank under a prior."""
    poses = rest_poses(start.points, "hull").under(prior)
    probabilities = poses.probabilities[np.argmax(start.directions @ poses.normals.T, axis=1)]
    directions = np.empty_like(start.directions)
    order = np.argsort(-probabilities, kind="stable")
    directions[np.argsort(-target, kind="stable")] = start.directions[order]
    return replace(start, directions=directions)


def normalized_center(recipe: Recipe, start: Start | None) -> Floats | None:
    """(3,) given center of mass in the coordinates of `Start.points`; None for the uniform
    solid."""
    if recipe.center_of_mass is None or start is None:
        return None
    return start.normalize(np.array(recipe.center_of_mass))


def make_design(work: Work, result: DesignResult, rounds: tuple[RoundOfThrows, ...] = ()) -> Design:
    """Convert a solver's result to a `Design`, with faces in the order of the target."""
    recipe, target = work.recipe, work.target
    die = Design(
        status=result.status,
        hull=result.hull,
        directions=result.directions,
        error=result.error,
        steps=tuple(map(_step, result.history)),
        center_of_mass=normalized_center(recipe, work.start),
        terms=result.terms,
        starts=result.starts,
        evaluations=result.evaluations,
        hulls=HullCounts(result.hulls_built, result.hulls_reused),
        rounds=rounds,
        prior=recipe.density_prior(),
        outcome_of=target.outcome_of_face,
        symmetry=recipe.symmetry,
    )
    die = die.reorder(np.argsort(recipe.face_of_direction()))

    def sums(values: tuple[float, ...]) -> tuple[float, ...]:
        return tuple(target.sums(np.array(values)).tolist())

    rounds = tuple(
        replace(each, requested=sums(each.requested), frequencies=sums(each.frequencies))
        for each in die.rounds
    )
    return replace(die, rounds=rounds)


def _step(step: DesignStep) -> Step:
    return Step(step.step, step.seconds, step.energy, step.error, step.terms)
