"""Designing the hull of a surface for wanted odds, its center of mass held where it is.

The hull stays dense: its corners are moved as smoothly and as little as the odds allow. All rests
but the wanted ones are made to drain (`SlopeMemory`) while the odds of their clusters go to the
target, by Gauss-Newton steps in the metric of `HullMetric`; the outcomes' directions follow their
own rests on the way. From there Levenberg-Marquardt steps meet the odds to rounding.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from dicedesign.concave.hull.draft import HullDraft, change_of_least_work, exact_draft
from dicedesign.concave.hull.problem import HullMetric, HullProblem
from dicedesign.concave.hull.slopes import SlopeMemory, SlopeOptions
from dicedesign.geometry.sphere import norms, unit_vectors
from dicedesign.runtime.arrays import Floats

__all__ = ["design_hull"]

STAGE_STEPS: Final = 24
"""Steps in each of the metrics, one after the other."""

LARGEST_STEP: Final = 0.03
"""Farthest that a corner moves in one of them, over the circumscribed radius."""

NEAR: Final = 0.05
"""Largest |p - q| from which on the last steps go."""

SOFTENING: Final = tuple(
    HullMetric(tether=0.2, smoothing=1.0, elastic=elastic, displaced=1.0)
    for elastic in (0.1, 0.03, 0.01)
)
"""Metrics of the steps: the stiffest in which a hull comes about is kept."""

FOLLOWED: Final = 0.5
"""Part of the way to its own rest that an outcome's direction goes in each step."""

FOLLOWING: Final = math.cos(math.radians(35.0))
"""Cosine of the angle beyond which it does not."""

ROOM: Final = math.radians(5.0)
"""Angle beyond the least one between outcomes that their directions keep."""

HOPELESS: Final = 0.3
"""Mean displacement of the corners, over the circumscribed radius, at which nothing is hoped for
any more."""


def design_hull(
    problem: HullProblem,
    directions: Floats,
    slopes: SlopeOptions,
    on_step: Callable[[float, float], None],
) -> HullDraft | None:
    """A hull with the wanted odds and no other rests; where this way leads to none, the one on it
    that was off by least, or None where there was no hull at all.

    directions: (k, 3) unit directions of the outcomes, of rests of the original or not; on_step:
    called with the energy and the largest |p - q| of every step.
    """
    memory, best = SlopeMemory(slopes), None
    corners, least = problem.hull.vertices, math.inf
    for step in range(STAGE_STEPS * len(SOFTENING)):
        draft = HullDraft.of(corners, directions)
        if draft is None:
            break
        error = draft.error(problem.target)
        on_step(float(((problem.target - draft.odds) ** 2).sum()), error)
        if draft.alone and error < NEAR:
            exact = exact_draft(problem, draft)
            if exact is not None and exact.shortfall(problem) == 0.0:
                return exact
        missing = draft.shortfall(problem)
        if missing == 0.0:
            return draft
        if missing < least:
            best, least = draft, missing
        directions = _followed(problem, draft, directions)
        compliance = problem.compliance(SOFTENING[step // STAGE_STEPS])
        change = change_of_least_work(problem, draft, compliance, memory, directions, step)
        longest = float(norms(change).max())
        corners = corners + min(1.0, LARGEST_STEP / max(longest, LARGEST_STEP)) * change
        if norms(corners - problem.hull.vertices).mean() > HOPELESS:
            break
    return best


def _followed(problem: HullProblem, draft: HullDraft, directions: Floats) -> Floats:
    """The outcomes' directions (k, 3) on the way to their own rests, as far as they stay apart."""
    followed = directions.copy()
    normals = draft.normals
    for number, main in enumerate(draft.main):
        alone = np.count_nonzero(draft.main == main) == 1
        if not alone or normals[number] @ directions[number] < FOLLOWING:
            continue
        nearer = unit_vectors((1.0 - FOLLOWED) * directions[number] + FOLLOWED * normals[number])
        others = np.delete(followed, number, axis=0)
        if (others @ nearer).max(initial=-1.0) < math.cos(problem.apart + ROOM):
            followed[number] = nearer
    return followed
