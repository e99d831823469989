"""Hull problems of small bodies, and their solutions."""

from __future__ import annotations

import numpy as np
from common.bumpy import unit

from dicedesign.concave.hull_design import HullDraft, design_hull
from dicedesign.concave.hull_problem import HullProblem
from dicedesign.concave.outcome_directions import outcome_choices
from dicedesign.concave.slopes import SlopeOptions
from dicedesign.geometry.triangles import Surface
from dicedesign.runtime.arrays import Floats

SLOPES = SlopeOptions(fall=3e-3, rise=4e-3, circle=float(np.radians(7.5)))
TOLERANCE = 0.004
SHEAR = np.array([[1.0, 0.05, -0.03], [0.0, 1.0, 0.07], [0.0, 0.0, 1.0]])


def problem_of(
    surface: Surface, target: list[float], apart_deg: float = 45.0, margin_deg: float = 10.0
) -> HullProblem:
    """Problem of a sheared surface, because symmetric bodies have ties."""
    return HullProblem(
        unit(surface.with_points(surface.points @ SHEAR)),
        np.array(target),
        TOLERANCE,
        float(np.radians(apart_deg)),
        float(np.radians(margin_deg)),
    )


def choices_of(problem: HullProblem) -> list[Floats]:
    """Choices of directions at the required angles."""
    return outcome_choices(problem.hull, problem.target, problem.apart, 0)


def original_draft(problem: HullProblem) -> HullDraft:
    """Hull of the surface, with the first choice of directions."""
    draft = HullDraft.of(problem.hull.vertices, choices_of(problem)[0])
    assert draft is not None
    return draft


def design_draft(problem: HullProblem) -> HullDraft:
    """Hull without a shortfall, for the first choice of directions that leads to one."""
    for directions in choices_of(problem):
        draft = design_hull(problem, directions, SLOPES, lambda *step: None)
        if draft is not None and draft.shortfall(problem) == 0.0:
            return draft
    raise AssertionError("no choice of directions leads to a hull without a shortfall")
