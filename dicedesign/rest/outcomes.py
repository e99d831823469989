"""Outcomes of rests, for every kind of die.

An outcome has a direction that is meant to be down, or one for each of its faces. The own rest of a
face is the most probable one within `SAME_REST_ANGLE` of its direction. Every rest within this
angle of a face's own rest counts for its outcome, or for that of the nearest face if there are
several: a facet that broke in two still looks like one. All other rests are elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dicedesign.geometry.sphere import angle_between, norms
from dicedesign.rest.poses import RestPoses
from dicedesign.runtime.arrays import Booleans, Floats, Integers
from dicedesign.tolerances import SAME_REST_ANGLE


@dataclass(frozen=True)
class OutcomeProbabilities:
    """Probabilities by outcome.

    Attributes
    ----------
    probabilities: (k,) of the rests that count for each outcome.
    main: (f,) number of each face's own rest among the rests; -1 where it has none. There is one
        face for each outcome unless said otherwise.
    outcome_of_rest: (r,) or -1.
    elsewhere: probabilities of all rests that count for none, together.
    least_angle: between two faces' own rests, in radians; pi with fewer than two. Where outcomes
        have several faces, between those of two outcomes, without rare ones (`RARE_REST`).
    """

    probabilities: Floats
    main: Integers
    outcome_of_rest: Integers
    elsewhere: float
    least_angle: float

    @property
    def rest_counts(self) -> Integers:
        """(k,) rests that count for each outcome."""
        return self.sums(np.ones(len(self.outcome_of_rest), dtype=np.int64))

    def sums(self, of_rests: NDArray[Any]) -> NDArray[Any]:
        """Sums (k,) of values (r,) over the rests of each outcome."""
        return sums_by_outcome(of_rests, self.outcome_of_rest, len(self.probabilities))

    def max_abs_error(self, target: Floats) -> float:
        """Largest |p - q|."""
        return float(np.abs(self.probabilities - target).max())

    def error(self, target: Floats) -> float:
        """The larger of `max_abs_error` and `elsewhere`."""
        return max(self.max_abs_error(target), self.elsewhere)


def outcome_probabilities(
    poses: RestPoses,
    directions: Floats,
    outcome_of: Integers | None = None,
    within: float = SAME_REST_ANGLE,
) -> OutcomeProbabilities:
    """Probabilities of the outcomes of a body; see `assign_rests`."""
    return assign_rests(poses.normals, poses.probabilities, directions, outcome_of, within)


def assign_rests(
    normals: Floats,
    probabilities: Floats,
    directions: Floats,
    outcome_of: Integers | None = None,
    within: float = SAME_REST_ANGLE,
) -> OutcomeProbabilities:
    """Outcomes of rests with normals (r, 3) and probabilities (r,), for unit directions (f, 3) that
    are down when a die rests on its labeled faces.

    Where no rest is within `SAME_REST_ANGLE` of a face's direction, its own rest is the nearest of
    the rests that are nearer to it than to any other direction, if there are any.

    outcome_of: (f,) outcome that each face shows, from 0 to k - 1; None for one outcome each.
    within: largest angle in radians from a face's own rest to others that count for its outcome;
        pi if each rest counts for the nearest face.
    """
    angles = angle_between(normals[:, None, :], directions[None, :, :])
    own = angles.argmin(axis=1)[:, None] == np.arange(len(directions))
    # Near rests before others; among near rests by probability, among others by angle.
    worth = np.where(angles <= within, np.pi + probabilities[:, None], np.pi - angles)
    worth = np.where(own, worth, -1.0)
    main = np.where(own.any(axis=0), worth.argmax(axis=0), -1)
    shown = np.flatnonzero(main >= 0)
    nearest = facet_of_rest(normals, normals[main[shown]], within)
    of_face = np.arange(len(directions)) if outcome_of is None else outcome_of
    of_rest = np.where(nearest >= 0, of_face[shown[nearest]], -1)
    by_outcome = sums_by_outcome(probabilities, of_rest, int(of_face.max()) + 1)
    elsewhere = float(probabilities[of_rest < 0].sum())
    kept, outcomes = main[shown], of_face[shown]
    is_apart = np.ones((len(shown), len(shown)), dtype=bool)
    if len(by_outcome) < len(of_face):
        is_kept = ~_is_rare(probabilities, of_rest, len(by_outcome))[kept]
        kept, outcomes = kept[is_kept], outcomes[is_kept]
        is_apart = outcomes[:, None] != outcomes
    pairs = np.nonzero(np.triu(is_apart, 1))
    least = float(angle_between(*normals[kept][np.array(pairs)]).min(initial=np.pi))
    return OutcomeProbabilities(by_outcome, main, of_rest, elsewhere, least)


RARE_REST = 0.002
"""Probability up to which a rest is rare, if its outcome has more probable ones: nobody sees it."""


def _is_rare(probabilities: Floats, outcome_of_rest: Integers, outcomes: int) -> Booleans:
    """(r,) whether rests are rare."""
    best = np.zeros(outcomes + 1)
    np.maximum.at(best, outcome_of_rest, probabilities)
    return (probabilities <= RARE_REST) & (probabilities < best[outcome_of_rest])


def outcome_margins(poses: RestPoses, outcomes: OutcomeProbabilities) -> Floats:
    """(k,) least angle in radians by which a body must be tipped to leave each outcome, from the
    normal of one of its rests to the nearest saddle with another outcome beyond; pi where there is
    no such saddle, or no rest. Where outcomes have several faces, rare rests do not count."""
    sides = outcomes.outcome_of_rest[poses.morse.saddle_basins]
    count = len(outcomes.probabilities)
    margins = np.full(count + 1, np.pi)
    is_rare = np.zeros(len(poses.normals), dtype=bool)
    if count < len(outcomes.main):
        is_rare = _is_rare(poses.probabilities, outcomes.outcome_of_rest, count)
    for basin, side in zip(poses.morse.saddle_basins.T, sides.T, strict=True):
        angles = angle_between(poses.normals[basin], poses.morse.saddles)
        leaves = (sides[:, 0] != sides[:, 1]) & ~is_rare[basin]
        # The last place gathers rests of no outcome.
        np.minimum.at(margins, side[leaves], angles[leaves])
    return margins[:-1]


def asymmetry(poses: RestPoses) -> float:
    """The asymmetry rho of a body, 0 to 1/2 times the number of pairs of neighboring basins.

    A pair counts once, at the lowest saddle of its border, over which a body rolls at the least
    speed. If every saddle counted, the asymmetry of a coin would grow with the corners of its
    polygon: 0.56 for 40 in place of 0.014.

    Source: eq. 20, 21.
    """
    morse = poses.morse
    pairs = np.sort(morse.saddle_basins, axis=1)
    heights = (morse.equilibria.radii @ morse.saddles.T).max(axis=0)
    lowest_first = np.argsort(heights, kind="stable")
    # The first of each pair.
    _, first = np.unique(pairs[lowest_first], axis=0, return_index=True)
    saddles = lowest_first[first]
    basins = pairs[saddles]
    angles = angle_between(poses.normals[basins], morse.saddles[saddles, None])
    # phi - 1/2
    unequal = angles.max(axis=1) / angles.sum(axis=1) - 0.5
    return float((poses.probabilities[basins].min(axis=1) * unequal).sum())


def border_margins(poses: RestPoses) -> Floats:
    """(k,) least angle in radians from each rest's normal to the border of its basin; pi for a body
    with one rest."""
    a, b = poses.morse.branches[:, :-1], poses.morse.branches[:, 1:]
    plane = np.linalg.cross(a, b)
    margins = np.full(len(poses.normals), np.pi)
    for basins in poses.morse.saddle_basins.T:
        basin = np.repeat(basins, 2)
        normal = poses.normals[basin][:, None]
        # The foot on the great circle counts if it is on the arc.
        above = (np.linalg.cross(plane, a) * normal).sum(-1) > 0.0
        below = (np.linalg.cross(b, plane) * normal).sum(-1) > 0.0
        height = np.arctan2(np.abs((plane * normal).sum(-1)), norms(np.linalg.cross(plane, normal)))
        ends = np.minimum(angle_between(a, normal), angle_between(b, normal))
        angles = np.where(above & below, height, ends)
        np.minimum.at(margins, basin, angles.min(axis=1))
    return margins


def facet_of_rest(normals: Floats, shown: Floats, within: float = SAME_REST_ANGLE) -> Integers:
    """(k,) the facet of each rest: the nearest one, or -1 if its normal is farther from the rest's
    than an angle in radians. normals: (k, 3) of the rests; shown: (f, 3) of the facets."""
    if len(shown) == 0:
        return np.full(len(normals), -1)
    angles = angle_between(normals[:, None], shown[None])
    return np.where(angles.min(axis=1) <= within, angles.argmin(axis=1), -1)


def sums_by_outcome(
    of_rests: NDArray[Any], outcome_of_rest: Integers, outcomes: int
) -> NDArray[Any]:
    """Sums (g,) of values (k,) over the rests of each outcome; rests of none (-1) are skipped."""
    sums = np.zeros(outcomes, dtype=of_rests.dtype)
    shown = outcome_of_rest >= 0
    np.add.at(sums, outcome_of_rest[shown], of_rests[shown])
    return sums
