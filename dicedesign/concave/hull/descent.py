"""Designing the hull of a surface by descent on the clustered energy, as in the paper."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from dicedesign.concave.hull.problem import DesignedHull, HullProblem
from dicedesign.design.energy.term import EnergyWeights
from dicedesign.design.options import DescentOptions, SobolevOptions
from dicedesign.design.result import DesignStep
from dicedesign.design.solvers.descent import descend_to_target
from dicedesign.design.starts.start import Start
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.rest.outcomes import outcome_odds
from dicedesign.rest.poses import analyse
from dicedesign.runtime.arrays import Floats

__all__ = ["descend_hull"]

OPTIONS: Final = DescentOptions(
    coordinates="vertices",
    sobolev=SobolevOptions(smoothing=5.0, power=2),
    weights=EnergyWeights(coplanar=0.01, barycenter=0.01, neighbor=0.01, stability=0.0),
    perturbation=0.0,
)
"""Sobolev-preconditioned steps, and the weights of figure 15's first row."""


def descend_hull(
    problem: HullProblem, directions: Floats, on_step: Callable[[float, float], None]
) -> DesignedHull:
    """Where the descent ends, whatever its error.

    directions: (k, 3) unit directions of the outcomes; on_step: called with the energy and the
    largest |p - q| of every step. The corners are told by the least sum of squared distances from
    those of the original.
    """
    original = problem.hull

    def told(step: DesignStep) -> None:
        on_step(step.energy, step.error)

    start = Start(original.vertices, directions)
    design = descend_to_target(
        start, problem.target, OPTIONS, center_of_mass=np.zeros(3), on_step=told
    )
    squares = cdist(design.hull.vertices, original.vertices, "sqeuclidean")
    chosen = linear_sum_assignment(squares)[1]
    moved = np.zeros_like(original.vertices)
    moved[chosen] = design.hull.vertices - original.vertices[chosen]
    center = np.tensordot(moved, problem.relative[1], 2)
    hull = convex_hull(design.hull.vertices + center)
    corners = original.source[chosen][hull.source]
    clusters = outcome_odds(analyse(design.hull, np.zeros(3), "given"), design.directions)
    error = clusters.error(problem.target)
    return DesignedHull(hull, corners, center, design.directions, error, moved)
