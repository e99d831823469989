"""`method: exact`: a convex die whose odds are the target's to rounding."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial

import numpy as np

from dicedesign.fabricate.die import Design
from dicedesign.optimize.options import ExactOptions
from dicedesign.optimize.result import DesignResult
from dicedesign.optimize.solvers.exact import solve_exactly
from dicedesign.optimize.starts.start import Start
from dicedesign.optimize.starts.variations import shapes_like
from dicedesign.recipe.methods.convex import (
    designed_die,
    normalised_center,
    shape_listener,
    step_listener,
    told_starts,
    wanted_odds,
)
from dicedesign.recipe.planning.work import Work
from dicedesign.recipe.schema.recipe import Recipe
from dicedesign.rest.poses import rest_poses
from dicedesign.rest.prior import Prior
from dicedesign.runtime.arrays import Floats

__all__ = ["design", "exact_options", "solver", "starts_of"]


def design(work: Work) -> Design:
    """The die of a recipe, from its start or from shapes that are searched.

    Raises InputError if no start suits the target.
    """
    wanted = wanted_odds(work.recipe)
    return designed_die(work, solver(work)(starts_of(work, wanted), wanted))


def exact_options(recipe: Recipe) -> ExactOptions:
    """The options of a recipe whose method is exact."""
    assert recipe.method.exact is not None
    return recipe.method.exact


def solver(work: Work) -> Callable[..., DesignResult]:
    """`solve_exactly` with all that a recipe says but the starts and the target."""
    recipe = work.recipe
    return partial(
        solve_exactly,
        options=exact_options(recipe),
        center_of_mass=normalised_center(recipe, work.start),
        group=recipe.group(),
        least_circle=recipe.min_inradius_mm / recipe.size_mm,
        prior=recipe.prior_read(),
        on_step=step_listener(work),
        on_candidate=shape_listener(work),
    )


def starts_of(work: Work, wanted: Floats) -> Iterable[Start | None]:
    """What the solver begins with, one after the other; None where nothing was found for a
    while."""
    recipe, group = work.recipe, work.recipe.group()
    if work.start is not None:
        like = shapes_like(work.start, recipe.seed, group, any_order=recipe.any_order)
        return told_starts(work, like)
    search = recipe.start.kind.search
    assert search is not None
    found = search(recipe.start.options, wanted, group, recipe.seed)
    prior = recipe.prior_read()
    if prior is not None:
        found = (_ranked(start, wanted, prior) for start in found)
    return told_starts(work, found)


def _ranked(start: Start | None, wanted: Floats, prior: Prior) -> Start | None:
    """A shape whose outcomes, with odds (k,), have changed places: the likelier ones have the rests
    that are likelier under a prior."""
    if start is None:
        return None
    poses = rest_poses(start.points, "hull").under(prior)
    odds = poses.probabilities[np.argmax(start.directions @ poses.normals.T, axis=1)]
    directions = np.empty_like(start.directions)
    order = np.argsort(-odds, kind="stable")
    directions[np.argsort(-wanted, kind="stable")] = start.directions[order]
    return replace(start, directions=directions)
