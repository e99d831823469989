"""Transitions of a body from rest to rest as integers, and their features for the momentum model.

A transition leads from one rest over a saddle to another; each dividing saddle has two, one in each
direction. Two successive transitions over different saddles are a carry.

Lengths are in units of the radius, the largest distance of a corner from the center of mass, and
moments of inertia in units of mass times squared radius. The features are invariant under motions,
reflections and scaling of the body.

Formulas are written once, for NumPy and torch; `dicedesign.kernels.ops` has them compiled.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.rest.morse import Separatrices
from dicedesign.runtime.arrays import Booleans, Integers, ragged_ranges


@dataclass(frozen=True)
class Transitions:
    """Transitions and carries of a body, as integers.

    Attributes
    ----------
    corners: (k, c) vertices of each rest's facet, counter-clockwise seen from outside, padded with
        the first one.
    real: (k, c) False for padding.
    tail, head: (m,) ends of the edge of each transition's saddle.
    source, target: (m,) rests before and after each transition.
    first, second: (t,) transitions of each carry.
    """

    corners: Integers
    real: Booleans
    tail: Integers
    head: Integers
    source: Integers
    target: Integers
    first: Integers
    second: Integers

    @classmethod
    def of(cls, hull: ConvexHull, paths: Separatrices) -> Transitions:
        """Transitions of a hull with its separatrices; rests are numbered as in `paths.rests`."""
        start, end = hull.facet_start[paths.rests], hull.facet_start[paths.rests + 1]
        counts = end - start
        corners = np.repeat(hull.tail[start][:, None], int(counts.max()), axis=1)
        owner, half_edges = ragged_ranges(start, counts)
        corners[owner, half_edges - start[owner]] = hull.tail[half_edges]
        real = np.arange(corners.shape[1]) < counts[:, None]
        tail, head = np.concatenate([paths.saddle_ends, paths.saddle_ends]).T
        source, target = np.concatenate([paths.basins, paths.basins[:, ::-1]]).T
        saddle = np.tile(np.arange(len(paths.basins)), 2)
        first, second = np.nonzero((target[:, None] == source) & (saddle[:, None] != saddle))
        return cls(corners, real, tail, head, source, target, first, second)

    @property
    def rests(self) -> int:
        """Number of rests."""
        return len(self.corners)


TRANSITION_FEATURES = 29
"""Number of columns of `Features.transitions`."""

CARRY_FEATURES = 14
"""Number of columns of `Features.carries`."""

LOG_SOFTENING = 0.003
"""Length added to a barrier in its logarithm."""

SPEED_SOFTENING = 0.01
"""Squared ratio of speeds at which the positive part of a ratio is smoothed."""

ENERGY_SOFTENING = 0.02
"""Share of energy added to a divisor."""

MOST_LACKING = 3.0
"""Upper bound of the energy that a carry lacks."""

SHARPNESS = 10.0
"""Sharpness of the smoothed positive part of the lacking energy."""

SMOOTHING = (LOG_SOFTENING, SPEED_SOFTENING, ENERGY_SOFTENING, MOST_LACKING, SHARPNESS)
"""These constants in the order of the kernels."""


@dataclass(frozen=True)
class Features:
    """Features of a body for the momentum model, NumPy or torch.

    Attributes
    ----------
    probabilities: (k,) of the rests without momentum.
    barriers: (m,) height of each transition's saddle over its source.
    transitions: (m, 29) barriers forward and back; their logarithms; height of the saddle;
        logarithm of its narrowness; angles to the saddle from source and target, and between these;
        inertia about the hinge; shares of the speed kept by rocking and by landing, and distances
        of the corners that hit; trace of the inertia. Then, for source and target: logarithm of the
        probability, area, logarithm of the polar dual's area, inner and outer radius of the facet,
        share of the speed kept by rocking around it, and inertia about its normal.
    exits: (t,) height of the second saddle of each carry over the rest in between.
    carries: (t, 14) shares of speed and energy kept; straightness; second barrier; drop from the
        first saddle; lacking energy; whether it is a return; smoothed lacking energy; of the first
        transition the share kept by landing, angle from the saddle, inertia about the hinge and
        distance of the corner that hits; of the second the angle to its saddle and its
        narrowness.
    """

    probabilities: Any
    barriers: Any
    transitions: Any
    exits: Any
    carries: Any


def body_features(
    transitions: Transitions,
    vertices: Any,
    center: Any,
    inertia: Any,
    probabilities: Any,
    xp: ModuleType,
) -> Features:
    """Features of a body.

    vertices: (n, 3) of the hull, any unit; center: (3,) center of mass; inertia: (3, 3) tensor of
    inertia about it per mass, in the squared unit; probabilities: (k,) of the rests without
    momentum.
    """
    arms = vertices - center
    radius = xp.sqrt(_dot(arms, arms).max())
    arms, inertia = arms / radius, inertia / radius**2
    corners, normals, heights, columns = _measure_rests(
        transitions, arms, inertia, probabilities, xp
    )
    i, j = transitions.source, transitions.target
    tail, head = arms[transitions.tail], arms[transitions.head]
    edge = _unit(head - tail, xp)
    foot = _across(tail, edge)
    height = _norm(foot, xp)
    saddle = foot / height[:, None]
    hinge = _dot(edge, edge @ inertia)
    narrowness = xp.log(1.0 / _dot(foot - tail, edge) + 1.0 / _dot(head - foot, edge))

    def land(rests: Integers) -> tuple[Any, Any]:
        """Share of the angular speed that a body keeps when it turns about the hinge, lands flat on
        a rest's facet and hits with the corner farthest from the hinge; and distance of the
        corner."""
        own, tangent = corners[rests], _unit(_across(saddle, normals[rests]), xp)
        along = -_dot(own - foot[:, None], tangent[:, None])
        farthest = xp.arange(len(rests)), along.argmax(-1)
        far = _across(own[farthest], edge)
        return (hinge + _dot(foot, far)) / (hinge + _dot(far, far)), along[farthest]

    rocking, reach = land(i)
    landing, reach_after = land(j)
    up, down = height - heights[i], height - heights[j]
    to_saddle, from_saddle = _angle(normals[i], saddle, xp), _angle(normals[j], saddle, xp)
    of_transitions = [
        up,
        down,
        xp.log(up + LOG_SOFTENING),
        xp.log(down + LOG_SOFTENING),
        height,
        narrowness,
        to_saddle,
        from_saddle,
        _angle(normals[i], normals[j], xp),
        hinge,
        rocking,
        landing,
        reach,
        reach_after,
        0.0 * up + inertia.trace(),
        *(column[rests] for column in columns for rests in (i, j)),
    ]
    a, b = transitions.first, transitions.second
    # The body turns about the hinge from i to j.
    forward = _dot(xp.linalg.cross(_across(normals[j], saddle), saddle), edge) > 0.0
    axis = edge * (forward * 2.0 - 1.0)[:, None]
    # It lands on the second hinge without slip.
    velocity = xp.linalg.cross(axis[a], -foot[a])
    momentum = _dot(axis[b], axis[a] @ inertia)
    momentum = momentum + _dot(axis[b], xp.linalg.cross(-foot[b], velocity))
    swing = hinge + _dot(foot, foot)
    momentum_share = momentum / xp.sqrt(swing[a] * swing[b])
    energy = (
        (momentum_share + xp.sqrt(momentum_share * momentum_share + SPEED_SOFTENING)) / 2.0
    ) ** 2
    # Cosine of the angle by which the path bends on the facet in between.
    coming, going = (_unit(_across(saddle[way], normals[j[a]]), xp) for way in (a, b))
    exits, drop = height[b] - heights[j[a]], height[a] - heights[j[a]]
    lacking = exits / (energy + ENERGY_SOFTENING) - drop
    lacking = xp.where(lacking < MOST_LACKING, lacking, MOST_LACKING)
    of_carries = [
        momentum_share,
        energy,
        -_dot(coming, going),
        exits,
        drop,
        lacking,
        xp.asarray((i[a] == j[b]) * 1.0),
        xp.logaddexp(0.0 * lacking, SHARPNESS * lacking),
        landing[a],
        from_saddle[a],
        hinge[a],
        reach_after[a],
        to_saddle[b],
        narrowness[b],
    ]
    return Features(
        probabilities, up, xp.stack(of_transitions, -1), exits, xp.stack(of_carries, -1)
    )


def _measure_rests(
    transitions: Transitions, arms: Any, inertia: Any, probabilities: Any, xp: ModuleType
) -> tuple[Any, Any, Any, tuple[Any, ...]]:
    """Corners (k, c, 3), normals (k, 3) and heights (k,) of the rests' facets, and columns (k,) of
    `Features.transitions` that depend on one rest only."""
    real = xp.asarray(transitions.real)
    a = arms[transitions.corners]
    b = xp.roll(a, -1, 1)
    vectors = 0.5 * xp.linalg.cross(a - a[:, :1], b - a[:, :1]).sum(1)
    area = _norm(vectors, xp)
    normals = vectors / area[:, None]
    normal = normals[:, None]
    heights = _dot(normals, a[:, 0])
    edge = xp.where(real[..., None], b - a, a[:, :1] - b[:, :1])
    length = _norm(edge, xp)
    edge = edge / length[..., None]
    outward = xp.linalg.cross(edge, normal)
    distance = _dot(outward, a)
    inner = _values(xp.where(real, distance, distance[:, :1]).min(-1))
    outer = _values(_norm(a - normal * heights[:, None, None], xp).max(-1))
    # Corners of the polar dual of the facet about the foot of the center of mass.
    dual = outward / distance[..., None]
    dual = xp.where(real[..., None], dual, dual[:, :1])
    polar = 0.5 * _dot(xp.linalg.cross(dual, xp.roll(dual, -1, 1)), normal).sum(-1)
    depth = _values((-_dot(a[:, None] - a[:, :, None], outward[:, :, None])).max(-1))
    feet = _across(a, edge)
    far = feet - outward * depth[..., None]
    about = _dot(edge, edge @ inertia)
    spin_share = (about + _dot(feet, far)) / (about + _dot(far, far))
    weight = xp.where(real, length, 0.0)
    rocking = (spin_share * weight).sum(-1) / weight.sum(-1)
    spinning = _dot(normals, normals @ inertia)
    columns = (xp.log(probabilities), area, xp.log(polar), inner, outer, rocking, spinning)
    return a, normals, heights, columns


def _values(value: Any) -> Any:
    """Values of a minimum or maximum, which torch returns with their places."""
    return getattr(value, "values", value)


def _dot(a: Any, b: Any) -> Any:
    """(...) dot products of vectors (..., 3)."""
    return (a * b).sum(-1)


def _across(vector: Any, axis: Any) -> Any:
    """Components of vectors (..., 3) normal to unit vectors (..., 3)."""
    return vector - axis * _dot(axis, vector)[..., None]


def _norm(a: Any, xp: ModuleType) -> Any:
    return xp.sqrt(_dot(a, a))


def _unit(a: Any, xp: ModuleType) -> Any:
    return a / _norm(a, xp)[..., None]


def _angle(a: Any, b: Any, xp: ModuleType) -> Any:
    """Angles (...) between unit vectors (..., 3); the derivative is 0 where they are parallel."""
    turned = xp.linalg.cross(a, b)
    squared = _dot(turned, turned)
    aslant = squared > 0.0
    sine = xp.where(aslant, xp.sqrt(xp.where(aslant, squared, 1.0)), 0.0)
    return xp.arctan2(sine, _dot(a, b))
