"""`method: paper`: a convex die by the paper's descent over vertices, with an exact finish."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dicedesign.fabricate.die import Design
from dicedesign.optimize.energy.clusters import cluster
from dicedesign.optimize.result import DesignResult
from dicedesign.optimize.solvers.paper import descend_as_paper
from dicedesign.recipe.methods.convex import (
    designed_die,
    normalised_center,
    shape_listener,
    step_listener,
    wanted_odds,
)
from dicedesign.recipe.planning.work import Work
from dicedesign.rest.poses import analyse
from dicedesign.runtime.arrays import Floats

__all__ = ["design"]


def design(work: Work) -> Design:
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
        on_evaluation=shape_listener(work),
        on_candidate=shape_listener(work),
    )
    return designed_die(work, replace(result, directions=_own_directions(result, center)))


def _own_directions(result: DesignResult, center: Floats | None) -> Floats:
    """(k, 3) normals of the most probable rest of each cluster, whose mean may be no rest at all;
    an empty cluster keeps its direction."""
    hull, directions = result.hull, result.directions.copy()
    poses = analyse(hull, hull.centroid if center is None else center)
    # Rests come the most probable first.
    clusters, first = np.unique(cluster(poses.normals, directions).of_rest, return_index=True)
    directions[clusters] = poses.normals[first]
    return directions
