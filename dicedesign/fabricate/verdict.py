"""What a finished die really does, in millimetres, by the forward model alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dicedesign.design.energy.clusters import cluster
from dicedesign.design.targets import Target
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.sphere import angle_between
from dicedesign.rest.poses import RestPoses, analyse
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import SAME_REST_ANGLE

__all__ = ["Verdict", "judge"]


@dataclass(frozen=True)
class Verdict:
    """A die of its final size and its odds.

    Attributes
    ----------
    hull: the die in mm, center of mass at the origin.
    poses: its rests.
    facet_of_outcome: (k,) facet of `hull` that bears each label, or -1 where an outcome has none.
    outcome_of_rest: (r,) outcome each rest counts for, or -1: a rest counts if it lies within
        `SAME_REST_ANGLE` of the facet with the label.
    probabilities: (k,) of the outcomes; what is missing to 1 lies on rests without a label.
    max_abs_error: largest |p - q|.
    uniform: the center of mass is that of the uniform solid, not a given one.
    """

    hull: ConvexHull
    poses: RestPoses
    facet_of_outcome: Integers
    outcome_of_rest: Integers
    probabilities: Floats
    max_abs_error: float
    uniform: bool


def judge(
    hull: ConvexHull,
    directions: Floats,
    target: Target,
    size_mm: float,
    center_of_mass: Floats | None = None,
) -> Verdict:
    """Scale a designed hull and find the odds of its outcomes.

    Parameters
    ----------
    hull: the design, any unit.
    directions: (k, 3) where the outcomes are meant to be, in the order of the target.
    target: outcomes.
    size_mm: largest vertex-to-vertex distance, positive.
    center_of_mass: (3,) in the design's unit, or None for the uniform solid.
    """
    center = hull.centroid if center_of_mass is None else center_of_mass
    scale = size_mm / hull.diameter
    sized = convex_hull((hull.vertices - center) * scale)
    uniform = center_of_mass is None
    at = sized.centroid if uniform else np.zeros(3)
    poses = analyse(sized, at, "uniform solid" if uniform else "given")
    of_rest = cluster(poses.normals, directions).of_rest
    outcomes = len(target.labels)
    main = np.full(outcomes, -1, dtype=np.int64)
    # Rests come the most probable first, so the first of each cluster bears the label.
    clusters, first = np.unique(of_rest, return_index=True)
    main[clusters] = first
    counted = of_rest.copy()
    apart = angle_between(poses.normals, poses.normals[main[of_rest]]) > SAME_REST_ANGLE
    counted[apart] = -1
    sums = np.zeros(outcomes)
    np.add.at(sums, counted[~apart], poses.probabilities[~apart])
    return Verdict(
        hull=sized,
        poses=poses,
        facet_of_outcome=np.where(main >= 0, poses.facets[main], -1),
        outcome_of_rest=counted,
        probabilities=sums,
        max_abs_error=float(np.abs(sums - target.probabilities).max()),
        uniform=uniform,
    )
