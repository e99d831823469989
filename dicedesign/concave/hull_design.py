"""Design of the hull of a surface: the least displacement that gives it the target probabilities.

A hull keeps its probabilities in prints if the foot of the center of mass is deep inside the facet
of each outcome and well outside of every other facet. How deep it is in a facet changes linearly
with the facet's corners, in small steps. So a step is a quadratic program: the least work under
bounds on the depths and equations for the probabilities. From the original hull steps first restore
the limits, which change along curves; later steps go back toward the original as far as the limits
allow.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from dicedesign.concave.complementarity import solve_complementarity
from dicedesign.concave.hull_draft import HullDraft
from dicedesign.concave.hull_problem import NEAREST, HullMetric, HullProblem
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import norms
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import SAME_REST_ANGLE

REST_DEPTH = 0.1
"""Least depth of the foot of the center of mass in the facets of outcomes, over the circumscribed
radius: less lets bumps under a print tilt it by more than a rest may lean."""

RESERVE = 1.2
"""Factor of the required clearance that steps aim at."""

ANGLE_RESERVE = 1.02
"""Factor of the required tipping margin that steps aim at."""

CORNER_ERROR = 0.009
"""Error of corners for which narrow facets are given more clearance, over the circumscribed radius:
nearly twice the standard deviation of an ordinary printer (`PrintErrors`) at 30 mm."""

MAX_EXTRA_CLEARANCE = 0.04
"""Largest clearance for this error, over the circumscribed radius."""

NEARBY = 0.08
"""Distance beyond the least clearance or depth, over the circumscribed radius, from which a facet
is left out of the program; a later step takes it in if it comes nearer."""

REGULARIZATION = 1e-8
"""Relative increase of the diagonal, as bounds may depend on each other."""

MAX_STEP = 0.1
"""Largest length of a step, over the circumscribed radius. Long steps pass over rests that short
ones are caught by."""

MAX_GAIN = 0.05
"""Maximum change of a probability that one step aims at."""

MAX_STEPS = 40
"""Maximum number of steps."""

MAX_BOLD_STEPS = 24
"""Number of steps that are not shortened until the limits are met for the first time."""

MAX_REPAIRS = 2
"""Maximum number of steps after each one that only restore the limits."""

LONGER, SHORTER, HALF = 1.3, 0.7, 0.5
"""Factors of the length of steps after one that keeps all limits, one that does not, and one that
leads nowhere."""

SHORTEST_STEP = 1e-3
"""Length of a step at which the search ends, over the circumscribed radius."""


def design_hull(
    problem: HullProblem,
    draft: HullDraft,
    on_step: Callable[[float, float], None] = lambda energy, error: None,
    metric: HullMetric = NEAREST,
    firmness: float = 1.0,
) -> HullDraft:
    """Hull with the target probabilities, no other rests, and little displacement; the draft with
    the smallest shortfall where no steps lead to one.

    Steps aim at a depth and at more clearance for narrow facets, but the shortfall and the
    displacement decide.

    draft: the original hull with the directions of the outcomes, which may be no rests of it, or
    another hull to begin with. on_step: receives the mean squared displacement of the surface over
    its squared diagonal and the largest |p - q| of every step. metric: of the work. firmness:
    factor of the depths and of the corner errors that steps aim at.
    """
    size, original = draft.corners.size, problem.hull.vertices
    compliance = problem.compliance(metric).reshape(size, size)
    best, violation = draft, draft.shortfall(problem)
    least = problem.displacement(draft.corners - original)
    length = MAX_STEP
    for step in range(MAX_STEPS):
        following = _step(problem, draft, compliance, length, 1.0, firmness)
        missing = math.inf if following is None else following.shortfall(problem)
        for _ in range(MAX_REPAIRS):
            if following is None or missing <= violation:
                break
            repaired = _step(problem, following, compliance, length, 0.0, firmness)
            left = math.inf if repaired is None else repaired.shortfall(problem)
            if left >= missing:
                break
            following, missing = repaired, left
        if following is None:
            length *= HALF
        else:
            draft = following
            displacement = problem.displacement(draft.corners - original)
            on_step(displacement**2, draft.error(problem.target))
            if missing <= violation and (missing < violation or displacement < least):
                best, violation, least = draft, missing, displacement
            if missing <= violation:
                length = min(MAX_STEP, LONGER * length)
            elif violation == 0.0 or step >= MAX_BOLD_STEPS:
                length *= SHORTER
        if length < SHORTEST_STEP:
            break
    return best


def _step(
    problem: HullProblem,
    draft: HullDraft,
    compliance: Floats,
    length: float,
    back: float,
    firmness: float,
) -> HullDraft | None:
    """Draft one step on, or None if the step leads nowhere.

    compliance: (3 n, 3 n) of the corners. length: move of a corner that a step aims at, and
    violation of a bound that it removes at most, over the circumscribed radius; moves are at most
    twice as long. back: largest share of the way back to the original, of which the step takes what
    length and bounds leave; 0 for the least work that restores bounds and probabilities.
    firmness: see `design_hull`.
    """
    displacement = draft.corners - problem.hull.vertices
    moved = (displacement + problem.shift(displacement)).ravel()
    bounded, bounds = _depth_bounds(problem, draft, firmness)
    # A facet without a basin has no derivatives yet; the last equation follows from the others.
    resting = np.flatnonzero(np.isin(draft.facets, draft.rests.paths.rests))[:-1]
    jacobian = draft.jacobian[resting].reshape(len(resting), len(moved))
    gains = np.clip(problem.target - draft.probabilities, -MAX_GAIN, MAX_GAIN)[resting]
    conditions = np.concatenate([bounded, jacobian])
    values = np.concatenate([np.maximum(bounds, -length), gains])
    by_condition = conditions @ compliance
    system = by_condition @ conditions.T
    system[np.diag_indices(len(system))] *= 1.0 + REGULARIZATION
    inactive = np.zeros(len(bounds), dtype=bool)

    def change(back: float) -> Floats:
        """(n, 3) step for a share of the way back."""
        wanted = values + back * (conditions @ moved)
        strengths = solve_complementarity(system, wanted, inactive)
        return np.asarray((strengths @ by_condition - back * moved).reshape(-1, 3))

    try:
        step = change(back)
        longest = float(norms(step).max())
        if back > 0.0 and longest > length:
            step = change(back * length / longest)
            longest = float(norms(step).max())
    except np.linalg.LinAlgError:
        return None
    corners = draft.corners + min(1.0, 2.0 * length / max(longest, length)) * step
    return HullDraft.of(corners, draft.normals)


def _depth_bounds(problem: HullProblem, draft: HullDraft, firmness: float) -> tuple[Floats, Floats]:
    """Bounds `rows @ change <= bounds` on a change (3 n) of the corners, with rows (s, 3 n).

    The foot of the center of mass is to be `REST_DEPTH` inside the facet of each outcome, or as
    deep as the tipping margin needs, and a clearance outside of the nearest edge of other facets,
    but not of those near an outcome's; for narrow facets more, as errors of their corners tilt them
    more.
    """
    hull = draft.rests.hull
    depths, slopes, corners = edge_depths(hull)
    clearance = RESERVE * problem.clearance
    aside = (hull.normals @ draft.normals.T).max(axis=1) < math.cos(SAME_REST_ANGLE)
    nearest = np.lexsort((depths, hull.facet))[hull.facet_start[:-1]]
    outer = nearest[aside[hull.facet[nearest]] & (depths[nearest] > -clearance - NEARBY)]
    extra = firmness * CORNER_ERROR * np.sqrt((slopes[outer] ** 2).sum((-2, -1)))
    inner = np.flatnonzero(np.isin(hull.facet, draft.facets))
    heights = (hull.normals[hull.facet[inner]] * hull.vertices[hull.tail[inner]]).sum(-1)
    deep = np.maximum(firmness * REST_DEPTH, heights * math.tan(ANGLE_RESERVE * problem.margin))
    inner, deep = (values[depths[inner] < deep + NEARBY] for values in (inner, deep))
    rows = np.zeros((len(outer) + len(inner), len(draft.corners), 3))
    along = np.concatenate([slopes[outer], -slopes[inner]])
    at = hull.source[np.concatenate([corners[outer], corners[inner]])]
    for corner in range(3):
        rows[np.arange(len(rows)), at[:, corner]] += along[:, corner]
    away = clearance + np.minimum(extra, firmness * MAX_EXTRA_CLEARANCE)
    bounds = np.concatenate([-away - depths[outer], depths[inner] - deep])
    return rows.reshape(len(rows), draft.corners.size), bounds


def edge_depths(hull: ConvexHull) -> tuple[Floats, Floats, Integers]:
    """How far the foot of the origin on the facet left of each half-edge is inside of its line.

    Returns depths (h,), negative outside; their derivatives (h, 3, 3) by three corners, which the
    plane of the facet goes through; and these corners (h, 3) as vertices of the hull: both ends of
    the half-edge and another of the facet.
    """
    third = hull.head[hull.next]
    tail, head = hull.vertices[hull.tail], hull.vertices[hull.head]
    normal, edge, aside = hull.normals[hull.facet], head - tail, hull.vertices[third] - tail
    length = norms(edge)
    along = edge / length[:, None]
    inward = np.linalg.cross(normal, along)
    depths, height = -(tail * inward).sum(-1), (tail * normal).sum(-1)
    # Places of the foot and the third corner along the edge, and the distance of that corner.
    foot, place = -(tail * along).sum(-1) / length, (aside * along).sum(-1) / length
    distance = (aside * inward).sum(-1)
    # A move in the plane moves the line; one out of it tilts the plane, and moves the foot.
    shares = np.stack([1.0 - foot, foot, np.zeros_like(foot)], axis=1)
    tilts = np.stack([place - 1.0, -place, np.ones_like(place)], axis=1) / distance[:, None]
    slopes = -shares[:, :, None] * inward[:, None]
    slopes = slopes - (height[:, None] * tilts)[:, :, None] * normal[:, None]
    return depths, slopes, np.stack([hull.tail, hull.head, third], axis=1)
