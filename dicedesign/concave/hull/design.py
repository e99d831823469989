"""Designing the hull of a surface for wanted odds, its center of mass held where it is.

The hull stays dense: its corners are moved as smoothly and as little as the odds allow. First all
rests but the wanted ones are made to drain (`SlopeMemory`) while the odds of their clusters go to
the target, by Gauss-Newton steps in the metric of `HullMetric`; from there Levenberg-Marquardt
steps meet the odds to rounding; then the hull goes back toward the original as far as it can.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from dicedesign.concave.hull.draft import (
    HullDraft,
    change_of_least_work,
    designed_hull,
    exact_draft,
)
from dicedesign.concave.hull.easing import nearer_draft, settled_draft
from dicedesign.concave.hull.problem import DesignedHull, HullMetric, HullProblem
from dicedesign.concave.hull.slopes import SlopeMemory, SlopeOptions
from dicedesign.geometry.sphere import norms
from dicedesign.runtime.arrays import Floats

__all__ = ["design_hull"]

STAGE_STEPS: Final = 18
"""Steps in each of the metrics, one after the other."""

LARGEST_STEP: Final = 0.03
"""Farthest that a corner moves in one of them, over the circumscribed radius."""

NEAR: Final = 0.03
"""Largest |p - q| from which on the last steps go."""

SOFTENING: Final = tuple(
    HullMetric(tether=0.5, smoothing=5.0, elastic=elastic) for elastic in (1.0, 0.1, 0.01, 0.003)
)
"""Metrics of the first steps: the stiffest in which a hull comes about is kept."""


def design_hull(
    problem: HullProblem,
    directions: Floats,
    slopes: SlopeOptions,
    on_step: Callable[[float, float], None],
) -> DesignedHull | None:
    """A hull with the wanted odds and no other rests, or None where this way leads to none.

    directions: (k, 3) unit directions of the outcomes, of rests of the original or not; on_step:
    called with the energy and the largest |p - q| of every step.
    """
    drained = _drained(problem, directions, slopes, on_step)
    if drained is None:
        return None
    best = nearer_draft(problem, drained, slopes)
    best = settled_draft(problem, best)
    moved = best.corners - problem.hull.vertices
    on_step(float((moved**2).sum()), best.error(problem.target))
    return designed_hull(problem, best)


def _drained(
    problem: HullProblem,
    directions: Floats,
    slopes: SlopeOptions,
    on_step: Callable[[float, float], None],
) -> HullDraft | None:
    """A hull near the original that leaves little but the wanted rests, with odds near enough to
    the target; None where it does not come about."""
    memory = SlopeMemory(slopes)
    corners = problem.hull.vertices
    for step in range(STAGE_STEPS * len(SOFTENING)):
        draft = HullDraft.of(corners, directions)
        if draft is None:
            return None
        error = draft.error(problem.target)
        on_step(float(((problem.target - draft.odds) ** 2).sum()), error)
        if error <= problem.tolerance:
            return draft
        if draft.alone and error < NEAR:
            exact = exact_draft(problem, draft)
            if exact is not None:
                return exact
        compliance = problem.compliance(SOFTENING[step // STAGE_STEPS])
        change = change_of_least_work(problem, draft, compliance, memory, directions, step)
        longest = float(norms(change).max())
        corners = corners + min(1.0, LARGEST_STEP / max(longest, LARGEST_STEP)) * change
    return None
