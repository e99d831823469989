"""Designing the hull of a surface by descent on the clustered energy, as in the paper."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from dicedesign.concave.hull.problem import DesignedHull, HullProblem
from dicedesign.optimize.options import SobolevOptions
from dicedesign.optimize.paper_options import PaperOptions, PaperWeights
from dicedesign.optimize.result import DesignStep
from dicedesign.optimize.solvers.paper import descend_as_paper
from dicedesign.optimize.starts.start import Start
from dicedesign.rest.outcomes import outcome_odds
from dicedesign.rest.poses import analyse
from dicedesign.runtime.arrays import Floats

__all__ = ["descend_hull"]

OPTIONS: Final = PaperOptions(
    sobolev=SobolevOptions(smoothing=5.0, power=2),
    weights=PaperWeights(coplanar=0.01, barycenter=0.01, neighbor=0.01, apart=0.0),
    perturbation=0.0,
    finish="none",
)
"""Sobolev-preconditioned steps, and the weights of figure 15's first row."""


def descend_hull(
    problem: HullProblem, directions: Floats, on_step: Callable[[float, float], None]
) -> DesignedHull:
    """The hull at the end of the descent, whatever its error.

    directions: (k, 3) unit directions of the outcomes; on_step: called with the energy and the
    largest |p - q| of every step. The corners are told by the least sum of squared distances from
    those of the original.
    """
    original = problem.hull

    def told(step: DesignStep) -> None:
        on_step(step.energy, step.error)

    start = Start(original.vertices, directions)
    design = descend_as_paper(
        start, problem.target, OPTIONS, center_of_mass=np.zeros(3), on_step=told
    )
    squares = cdist(design.hull.vertices, original.vertices, "sqeuclidean")
    chosen = linear_sum_assignment(squares)[1]
    moved = np.zeros_like(original.vertices)
    moved[chosen] = design.hull.vertices - original.vertices[chosen]
    clusters = outcome_odds(analyse(design.hull, np.zeros(3), "given"), design.directions)
    error = clusters.error(problem.target)
    return problem.designed(design.hull.vertices, chosen, moved, design.directions, error)
