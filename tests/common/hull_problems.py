"""Hull problems of small bodies, and their solutions."""

from __future__ import annotations

import numpy as np
from common.bumpy import unit

from dicedesign.concave.hull_design import design_hull
from dicedesign.concave.hull_draft import HullDraft
from dicedesign.concave.hull_problem import HullProblem
from dicedesign.concave.outcome_directions import outcome_choices
from dicedesign.geometry.triangles import Surface
from dicedesign.runtime.arrays import Floats

TOLERANCE = 0.004
SHEAR = np.array([[1.0, 0.05, -0.03], [0.0, 1.0, 0.07], [0.0, 0.0, 1.0]])


def problem_of(
    surface: Surface,
    target: list[float],
    apart_deg: float = 45.0,
    margin_deg: float = 10.0,
    clearance: float = 0.002,
) -> HullProblem:
    """Problem of a sheared surface, because symmetric bodies have ties."""
    return HullProblem(
        unit(surface.with_points(surface.points @ SHEAR)),
        np.array(target),
        TOLERANCE,
        float(np.radians(apart_deg)),
        float(np.radians(margin_deg)),
        clearance,
        coarse=True,
    )


def choices_of(problem: HullProblem) -> list[Floats]:
    """Choices of directions at the required angles."""
    return outcome_choices(problem.hull, problem.target, problem.apart, 0)


def original_draft(problem: HullProblem, choice: int = 0) -> HullDraft:
    """Hull of the surface, with a choice of directions."""
    draft = HullDraft.of(problem.hull.vertices, choices_of(problem)[choice])
    assert draft is not None
    return draft


def design_draft(problem: HullProblem) -> HullDraft:
    """Hull without a shortfall, for the first choice of directions that leads to one."""
    for choice in range(len(choices_of(problem))):
        draft = design_hull(problem, original_draft(problem, choice))
        if draft.shortfall(problem) == 0.0:
            return draft
    raise AssertionError("no choice of directions leads to a hull without a shortfall")
