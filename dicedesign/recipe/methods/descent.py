"""`method: descent`: a convex die by descent on the paper's energy."""

from __future__ import annotations

from dataclasses import replace

from dicedesign.fabricate.designed_die import DesignedDie
from dicedesign.optimize.solvers.descent import descend_to_target
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
    assert recipe.method.descent is not None
    result = descend_to_target(
        start,
        wanted_odds(recipe),
        recipe.method.descent,
        center_of_mass=center,
        seed=recipe.seed,
        on_step=step_listener(work),
    )
    return designed_die(work, replace(result, directions=own_directions(result, center)))
