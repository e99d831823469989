"""`method: paper`: a convex die by the paper's descent over vertices, with an exact finish."""

from __future__ import annotations

from dataclasses import replace

from dicedesign.fabricate.designed_die import DesignedDie
from dicedesign.optimize.solvers.paper import descend_as_paper
from dicedesign.recipe.methods.convex import (
    designed_die,
    normalised_center,
    own_directions,
    step_listener,
    wanted_odds,
)
from dicedesign.recipe.planning.work import Work

__all__ = ["design"]


def design(work: Work) -> DesignedDie:
    """The die of a recipe, from its start. Raises InputError if that does not suit the target."""
    recipe, start = work.recipe, work.start
    center = normalised_center(recipe, start)
    # Only the exact method searches.
    assert start is not None
    assert recipe.method.paper is not None
    result = descend_as_paper(
        start,
        wanted_odds(recipe),
        recipe.method.paper,
        center_of_mass=center,
        seed=recipe.seed,
        on_step=step_listener(work),
    )
    return designed_die(work, replace(result, directions=own_directions(result, center)))
