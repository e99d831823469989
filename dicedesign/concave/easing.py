"""Hulls that stay as good and take the surface less work."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from dicedesign.concave.hull_design import (
    HullDraft,
    change_of_least_work,
    designed_hull,
    exact_draft,
)
from dicedesign.concave.hull_problem import DesignedHull, HullMetric, HullProblem
from dicedesign.concave.slopes import SlopeMemory, SlopeOptions
from dicedesign.concave.space_elasticity import HeldCorners, spread_points
from dicedesign.runtime.arrays import Floats

ROUNDS = 5
"""Most rounds back toward the original."""

WORTH = 0.98
"""Part of the displacement that may be left by a round with another after it."""

SWEEPS = 4
"""Sweeps over the hull in each."""

PLACES = 40
"""Places in each sweep, spread over the hull."""

PLACE_WIDTH = 1.0
"""Width of a place, times the root of their number, over the circumscribed radius."""

HALVINGS = 3
"""Tries of half the length each."""

CORRECTIONS = 6
"""Newton steps to the odds, at the end."""

EASED = 16
"""Most groups of corners that are eased at a time."""

NEAREST = HullMetric(tether=0.1, smoothing=0.2, elastic=0.01, displaced=1.0)
"""Metric of the steps: the displacement of the surface, above all."""

UNCROSSED = HullMetric(tether=0.1, smoothing=0.3, elastic=1.0, displaced=0.1)
"""Metric where the surface meets itself: the work that it takes, above all."""


def nearer_draft(
    problem: HullProblem,
    draft: HullDraft,
    slopes: SlopeOptions,
    metric: HullMetric = NEAREST,
) -> HullDraft:
    """A hull that is as good and nearer to the original: steps to the least displacement among
    hulls with these odds, of all corners and then of those about one place after the other. Each
    goes as far as it makes nothing worse that will do."""
    for _ in range(ROUNDS):
        nearer = _nearer(problem, draft, slopes, metric)
        before, after = (
            problem.displacement(hull.corners - problem.hull.vertices) for hull in (draft, nearer)
        )
        if after < before:
            draft = nearer
        if after >= WORTH * before:
            break
    return draft


def _nearer(
    problem: HullProblem, draft: HullDraft, slopes: SlopeOptions, metric: HullMetric
) -> HullDraft:
    """A draft after one round."""
    compliance, memory = problem.compliance(metric), SlopeMemory(slopes)
    original = problem.hull.vertices
    centers = original[spread_points(original, PLACES)]
    widths = PLACE_WIDTH / np.sqrt(len(centers))
    squares = cdist(centers, original, "sqeuclidean")
    about = np.exp(-squares / (2.0 * widths**2))[:, :, None]
    missing = draft.shortfall(problem)
    for sweep in range(SWEEPS):
        first = draft
        goal = draft.corners + change_of_least_work(
            problem, draft, compliance, memory, draft.normals, sweep
        )
        for part in (np.ones((1, 1)), *about):
            change = part * (goal - draft.corners)
            draft = _moved(problem, draft, change, missing) or draft
        if draft is first:
            break
    return draft


def _moved(
    problem: HullProblem, draft: HullDraft, change: Floats, missing: float
) -> HullDraft | None:
    """A draft after a change (n, 3) of its corners, or the first half, ... of it, from which no
    more is missing than so much; None where more is all the way."""
    for halving in range(HALVINGS):
        following = HullDraft.of(draft.corners + 0.5**halving * change, draft.normals)
        if following is not None and following.lacks_at_most(problem, missing):
            return following
    return None


def settled_draft(problem: HullProblem, draft: HullDraft) -> HullDraft:
    """The hull whose odds are met as well as can be, next to one where they nearly are."""
    exact = exact_draft(problem, draft)
    if exact is not None:
        return exact
    compliance = problem.compliance(NEAREST)
    for _ in range(CORRECTIONS):
        # The last of the equations follows from the others.
        jacobian = draft.jacobian[:-1]
        raised = np.tensordot(jacobian, compliance, 2)
        square = np.tensordot(jacobian, raised, ((1, 2), (1, 2)))
        misses = (problem.target - draft.odds)[:-1]
        step = np.tensordot(np.linalg.lstsq(square, misses)[0], raised, 1)
        following = HullDraft.of(draft.corners + step, draft.normals)
        if following is None or not following.error(problem.target) < draft.error(problem.target):
            break
        draft = following
    return draft


def eased_hull(
    problem: HullProblem, design: DesignedHull, places: Floats, width: float
) -> DesignedHull | None:
    """A design whose corners near some places (p, 3) of the original surface go where the others
    would take them, as far as that makes nothing worse that will do; None where it does at once.

    width: distance from a place within which corners are eased, over the circumscribed radius.
    """
    original = problem.hull.vertices
    near = np.flatnonzero(cKDTree(places).query(original)[0] < width)
    draft = HullDraft.of(original + design.moved, design.directions)
    if draft is None or len(near) == 0:
        return None
    missing = draft.shortfall(problem)
    middles = original[near][spread_points(original[near], EASED)]
    owner = cKDTree(middles).query(original)
    # Where the corners are when the surface is not bent.
    unbent, eased = original - design.shift, False
    for place in range(len(middles)):
        group = np.flatnonzero((owner[1] == place) & (owner[0] < width))
        others = np.setdiff1d(np.arange(len(original)), group)
        held = HeldCorners(problem.elasticity, problem.source[others])
        followed = held.followed((draft.corners - unbent)[others])
        goal = draft.corners.copy()
        goal[group] = unbent[group] + followed[problem.source[group]]
        following = _moved(problem, draft, goal - draft.corners, missing)
        if following is not None:
            draft, eased = following, True
    if not eased:
        return None
    return designed_hull(problem, settled_draft(problem, draft))
