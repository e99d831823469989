"""Several rests for one outcome: rests of a surface are grouped, and the groups shared out.

A rest that is divided from another by a low saddle comes and goes with the errors of a print, so
both belong to one group: the persistence of the height on the Gauss sphere decides. The groups are
then shared out among the outcomes so that sums are near the target, and the rests of an outcome
near each other and far from all others.
"""

from __future__ import annotations

import math

import numpy as np

from dicedesign.geometry.sphere import angle_between, norms
from dicedesign.rest.outcomes import RARE_REST
from dicedesign.rest.poses import RestPoses
from dicedesign.runtime.arrays import Floats, Integers

LEAST_GROUP = 0.01
"""Probability below which a group always joins the one across its lowest saddle."""

BEAM = 1000
"""Partial ways to share groups out that are followed."""

SPREAD_PENALTY = 0.1
"""Penalty for the rests of an outcome that are at right angles to its main group, over their
probability."""

GAP_PENALTY = 0.05
"""Penalty for two outcomes with rests in one direction."""

PREFERRED_GAP = math.radians(25.0)
"""Angle between rests of different outcomes above which a larger one is not preferred."""


def group_rests(poses: RestPoses, barrier: float, similar: float = 0.0) -> Integers:
    """(r,) group of each rest, numbered from 0.

    barrier: rise of the center of mass from a group's lowest rest to its lowest saddle, in the unit
        of the body, up to which the group joins the one beyond.
    similar: angle in radians between two rests, not rare ones, below which their groups are one.

    Source: persistence of a function's minima, as in Edelsbrunner, Letscher and Zomorodian,
    Topological persistence and simplification (2002).
    """
    morse, probabilities = poses.morse, poses.probabilities.copy()
    radii = morse.equilibria.radii
    parent = np.arange(len(poses.normals))
    low = (radii @ poses.normals.T).max(axis=0)
    heights = (radii @ morse.saddles.T).max(axis=0)

    def root(rest: int) -> int:
        while parent[rest] != rest:
            rest = int(parent[rest])
        return rest

    for saddle in np.argsort(heights, kind="stable"):
        deep, shallow = sorted(map(root, morse.saddle_basins[saddle]), key=lambda rest: low[rest])
        is_low = heights[saddle] - low[shallow] < barrier
        if deep != shallow and (is_low or probabilities[shallow] < LEAST_GROUP):
            parent[shallow] = deep
            probabilities[deep] += probabilities[shallow]
    shown = np.flatnonzero(poses.probabilities > RARE_REST)
    angles = angle_between(poses.normals[shown][:, None], poses.normals[shown])
    for one, other in shown[np.argwhere(np.triu(angles < similar, 1))].tolist():
        parent[root(other)] = root(one)
    roots = [root(rest) for rest in range(len(parent))]
    return np.asarray(np.unique(roots, return_inverse=True)[1])


def outcome_gap(normals: Floats, probabilities: Floats, outcomes: Integers) -> float:
    """Least angle in radians between rests of different outcomes, of those that are not rare; pi
    without any. normals: (r, 3); probabilities, outcomes: (r,)."""
    shown = probabilities > RARE_REST
    angles = angle_between(normals[shown][:, None], normals[shown][None])
    differs = outcomes[shown][:, None] != outcomes[shown]
    return float(angles[differs].min(initial=np.pi))


def share_groups(poses: RestPoses, groups: Integers, target: Floats, most: int) -> list[Integers]:
    """Up to `most` ways to give groups of rests to outcomes, the most promising first: (r,) outcome
    of each rest. Empty if there are fewer groups than outcomes.

    groups: (r,) from `group_rests`; target: (k,) probabilities of the outcomes.
    """
    count, outcomes = int(groups.max()) + 1, len(target)
    if count < outcomes:
        return []
    weights = np.bincount(groups, poses.probabilities, count)
    directions = np.zeros((count, 3))
    np.add.at(directions, groups, poses.probabilities[:, None] * poses.normals)
    directions /= np.maximum(norms(directions), np.finfo(np.float64).tiny)[:, None]
    order = np.argsort(-weights, kind="stable")
    is_like = target[:, None] == target
    # Groups are given out one after the other, the most probable first; of ways that have all
    # outcomes' sums and spreads so far, the best are followed.
    ways: Integers = np.zeros((1, 0), dtype=np.int64)
    sums, spread = np.zeros((1, outcomes)), np.zeros(1)
    mains = np.full((1, outcomes), -1)
    for number, group in enumerate(order.tolist()):
        left = count - number - 1
        way, outcome = np.divmod(np.arange(len(ways) * outcomes), outcomes)
        # Of outcomes that are alike, the first without a group comes first.
        is_free = mains[way] < 0
        before = np.arange(outcomes) < outcome[:, None]
        allowed = ~((is_free & before & is_like[outcome]).any(axis=1) & (mains[way, outcome] < 0))
        missing = is_free.sum(axis=1) - (mains[way, outcome] < 0)
        allowed &= missing <= left
        way, outcome = way[allowed], outcome[allowed]
        main = np.where(mains[way, outcome] < 0, group, mains[way, outcome])
        cosine = (directions[main] * directions[group]).sum(axis=1)
        spread = spread[way] + weights[group] * (1.0 - cosine)
        sums, mains, rows = sums[way], mains[way], np.arange(len(way))
        sums[rows, outcome] += weights[group]
        mains[rows, outcome] = main
        ways = np.column_stack([ways[way], outcome])
        over = np.maximum(sums - target, 0.0).sum(axis=1) * 2.0
        best = np.argsort(over + SPREAD_PENALTY * spread, kind="stable")[:BEAM]
        ways, sums, spread, mains = ways[best], sums[best], spread[best], mains[best]
    place = np.argsort(order)
    found = [way[place][groups] for way in ways]
    gaps = [outcome_gap(poses.normals, poses.probabilities, one) for one in found]
    off = np.abs(sums - target).sum(axis=1) + SPREAD_PENALTY * spread
    off += GAP_PENALTY * np.maximum(1.0 - np.array(gaps) / PREFERRED_GAP, 0.0)
    return [found[number] for number in np.argsort(off, kind="stable")[:most]]
