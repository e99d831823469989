"""A center of mass with few rests: facets are left by linear programs, one after the other."""

from __future__ import annotations

from typing import Final

import numpy as np

from dicedesign.balance.center.regions import Halfspaces
from dicedesign.balance.center.stability import Stability
from dicedesign.runtime.arrays import Floats

__all__ = ["fewest_rests", "steadiest"]

NOTHING: Final = 1e-9
"""Distance over the size of the body that a center of mass has to be beyond a side by."""


def fewest_rests(
    stability: Stability, within: Halfspaces, centers: Floats, steps: int
) -> tuple[Floats, int]:
    """The center of mass with fewest rests that is found from some (n, 3), and how many facets the
    body rests on then.

    From each, one facet after the other is left: over one of its edges, while the center of mass
    stays beyond a side of each facet that the body does not rest on. That is a linear program for
    each edge, which finds the center farthest beyond; it is solved for the facets first whose sides
    are nearest. No way is known to all that would tell the least number of all centers.

    within: where it may be; steps: most facets that are left from each.
    """
    best, fewest = centers[0], len(stability.hull.normals) + 1
    for start in centers:
        center, count = start, int(stability.counts(start[None])[0])
        for _ in range(steps):
            following = _one_less(stability, within, center)
            if following is None:
                break
            center, count = following, int(stability.counts(following[None])[0])
        if count < fewest:
            best, fewest = center, count
        if fewest == 1:
            break
    return steadiest(stability, within, best), fewest


def steadiest(stability: Stability, within: Halfspaces, center: Floats) -> Floats:
    """The center of mass farthest from where a rest appears, with no facet to rest on that there is
    not with a center (3,)."""
    edges, least = stability.outermost(center)
    place, depth = within.and_within(stability.beyond(edges[least <= 0.0])).deepest
    if not 0.0 < depth < np.inf or stability.counts(place[None])[0] > (least > 0.0).sum():
        return center
    return place


def _one_less(stability: Stability, within: Halfspaces, center: Floats) -> Floats | None:
    """A center of mass with which the body does not rest on one facet that it does now, and on no
    other; None where none is found."""
    hull = stability.hull
    edges, least = stability.outermost(center)
    room = within.and_within(stability.beyond(edges[least <= 0.0]))
    resting = np.flatnonzero(least > 0.0)
    if len(resting) == 1:
        return None
    heights = stability.sides.heights(center)
    own = np.flatnonzero(np.isin(hull.facet, resting))
    for edge in own[np.argsort(heights[own], kind="stable")]:
        place, depth = room.and_within(stability.beyond(np.array([edge]))).deepest
        if NOTHING * hull.diameter < depth < np.inf:
            return place
    return None
