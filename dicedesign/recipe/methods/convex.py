"""What the methods for convex dice share: what they are asked for, and what they return."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from dicedesign.fabricate.die import Design
from dicedesign.optimize.result import DesignResult, DesignStep
from dicedesign.optimize.starts.start import Start
from dicedesign.recipe.planning.work import Work
from dicedesign.recipe.schema.recipe import Recipe
from dicedesign.results.result import HullsMade, Step
from dicedesign.runtime.arrays import Floats

if TYPE_CHECKING:
    from dicedesign.gradient.rest_odds import RestEvaluation
    from dicedesign.optimize.refinement.rounds import Round

__all__ = [
    "designed_die",
    "normalised_center",
    "shape_listener",
    "step_listener",
    "told_starts",
    "wanted_odds",
]


class Shaped(Protocol):
    """A shape that a solver tells of."""

    @property
    def rests(self) -> RestEvaluation:
        """Its hull and rests."""

    @property
    def directions(self) -> Floats:
        """(k, 3) of the outcomes, in the order of the start's."""


def wanted_odds(recipe: Recipe) -> Floats:
    """(k,) target in the order of the start's directions."""
    return recipe.target.target().probabilities[recipe.outcome_of_direction()]


def normalised_center(recipe: Recipe, start: Start | None) -> Floats | None:
    """(3,) the given center of mass in the coordinates of `Start.points`; None for the uniform
    solid."""
    if recipe.center_of_mass is None or start is None:
        return None
    return start.normalised(np.array(recipe.center_of_mass))


def step_listener(work: Work) -> Callable[[DesignStep], None]:
    """What tells a run's listener of a solver's steps."""
    return lambda step: work.listeners.on_step(_step(step))


def shape_listener(work: Work) -> Callable[[Shaped], None]:
    """What tells a run's listener of the shapes of a solver."""
    order = np.argsort(work.recipe.outcome_of_direction())
    return lambda shape: work.listeners.on_shape(shape.rests.hull, shape.directions[order])


def told_starts(work: Work, starts: Iterable[Start | None]) -> Iterator[Start | None]:
    """The starting shapes, each of which a run's listener is told of."""
    for number, start in enumerate(starts):
        work.listeners.on_start(number)
        yield start


def designed_die(work: Work, result: DesignResult, rounds: tuple[Round, ...] = ()) -> Design:
    """The die of a solver's result."""
    recipe = work.recipe
    order = np.argsort(recipe.outcome_of_direction())
    return Design(
        status=result.status,
        hull=result.hull,
        directions=result.directions[order],
        error=result.error,
        steps=tuple(map(_step, result.history)),
        center_of_mass=normalised_center(recipe, work.start),
        terms=result.terms,
        starts=result.starts,
        evaluations=result.evaluations,
        hulls=HullsMade(result.hulls_built, result.hulls_reused),
        rounds=tuple(
            replace(done, asked=done.asked[order], frequencies=done.frequencies[order])
            for done in rounds
        ),
        prior=recipe.prior_read(),
    )


def _step(step: DesignStep) -> Step:
    return Step(step.step, step.seconds, step.energy, step.error, step.terms)
