"""Transitions of a body from rest to rest as integers, and their features for the momentum model.

A transition leads from one rest over a saddle to another; every dividing saddle is two, there and
back. Two transitions in a row, the second of which leaves the rest that the first leads to, are a
carry.

Lengths are in units of the radius, the largest distance of a corner from the center of mass, and
moments of inertia in units of mass times squared radius. The features do not change when the body
is moved, turned, mirrored or scaled.

Formulas are written once, for NumPy and torch alike; `dicedesign.kernels.ops` has them compiled.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from types import ModuleType
from typing import Any, Final

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.rest.morse import Separatrices
from dicedesign.runtime.arrays import Booleans, Floats, Integers, ragged_ranges


@dataclass(frozen=True)
class Transitions:
    """The transitions and carries of a body, as integers.

    Attributes
    ----------
    corners: (k, c) vertices of each rest's facet, counter-clockwise seen from outside; after the
        last comes the first again.
    real: (k, c) whether an edge begins at each of them.
    tail, head: (m,) ends of the edge of each transition's saddle.
    source, target: (m,) rest that each transition leaves, and leads to.
    first, second: (t,) the transitions of each carry.
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
        """Those of a hull with its separatrices; rests are numbered as in `paths.rests`."""
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

    @cached_property
    def is_return(self) -> Floats:
        """(t,) 1 for carries back to the rest that they came from."""
        return (self.source[self.first] == self.target[self.second]).astype(np.float64)


TRANSITION_FEATURES: Final = (
    "barrier",
    "barrier back",
    "log barrier",
    "log barrier back",
    "saddle height",
    "log narrowness",
    "angle to saddle",
    "angle from saddle",
    "angle of rests",
    "hinge inertia",
    "rocking",
    "landing",
    "reach",
    "reach after",
    "trace of inertia",
    "log odds",
    "log odds after",
    "area",
    "area after",
    "log polar area",
    "log polar area after",
    "inner radius",
    "inner radius after",
    "outer radius",
    "outer radius after",
    "rocking around",
    "rocking around after",
    "spinning inertia",
    "spinning inertia after",
)
"""Columns of `Features.transitions`."""

CARRY_FEATURES: Final = (
    "speed kept",
    "energy kept",
    "straightness",
    "barrier",
    "drop",
    "energy lacking",
    "return",
    "softened energy lacking",
    "landing",
    "angle from saddle",
    "hinge inertia",
    "reach after",
    "angle to next saddle",
    "log narrowness of next saddle",
)
"""Columns of `Features.carries`."""

LOG_SOFTENING: Final = 0.003
"""Added to a barrier before its logarithm is taken."""

SPEED_SOFTENING: Final = 0.01
"""Squared ratio of speeds to which one below 0, which turns back, is smoothed."""

ENERGY_SOFTENING: Final = 0.02
"""Added to the part of the energy that is kept before it divides."""

MOST_LACKING: Final = 3.0
"""Of the energy that a carry may lack."""

SHARPNESS: Final = 10.0
"""Of the smoothed positive part of the energy lacking."""

SMOOTHING: Final = (LOG_SOFTENING, SPEED_SOFTENING, ENERGY_SOFTENING, MOST_LACKING, SHARPNESS)
"""These constants in the order in which kernels take them."""


@dataclass(frozen=True)
class Features:
    """Everything that the momentum model knows of a body, NumPy or torch.

    Attributes
    ----------
    odds: (k,) of the rests without momentum.
    barriers: (m,) height of each transition's saddle over the rest that it leaves.
    transitions: (m, 29) the columns of `TRANSITION_FEATURES`.
    exits: (t,) height of the second saddle of each carry over the rest between.
    carries: (t, 14) the columns of `CARRY_FEATURES`.
    """

    odds: Any
    barriers: Any
    transitions: Any
    exits: Any
    carries: Any


def body_features(
    transitions: Transitions, vertices: Any, center: Any, inertia: Any, odds: Any, xp: ModuleType
) -> Features:
    """The features of a body.

    vertices: (n, 3) of the hull, any unit; center: (3,) center of mass; inertia: (3, 3) tensor of
    inertia about it over the mass, in the squared unit; odds: (k,) of the rests without momentum.
    """
    arms = vertices - center
    radius = xp.sqrt((arms * arms).sum(-1).max())
    arms, inertia = arms / radius, inertia / radius**2
    rest = _Rests(transitions, arms, inertia, odds, xp)
    i, j = transitions.source, transitions.target
    tail, head = arms[transitions.tail], arms[transitions.head]
    edge = _unit(head - tail, xp)
    foot = tail - edge * _dot(edge, tail)
    height = _norm(foot, xp)
    saddle = foot / height[:, None]
    hinge = _dot(edge, edge @ inertia)[:, 0]
    narrowness = xp.log(1.0 / _dot(foot - tail, edge) + 1.0 / _dot(head - foot, edge))[:, 0]
    rocking, reach = _rocking(rest, i, edge, foot, saddle, hinge, xp)
    landing, reach_after = _rocking(rest, j, edge, foot, saddle, hinge, xp)
    up, down = height - rest.height[i], height - rest.height[j]
    to_saddle, from_saddle = _angle(rest.normal[i], saddle, xp), _angle(rest.normal[j], saddle, xp)
    both = [column[rests] for column in rest.columns for rests in (i, j)]
    table = xp.stack(
        [
            up,
            down,
            xp.log(up + LOG_SOFTENING),
            xp.log(down + LOG_SOFTENING),
            height,
            narrowness,
            to_saddle,
            from_saddle,
            _angle(rest.normal[i], rest.normal[j], xp),
            hinge,
            rocking,
            landing,
            reach,
            reach_after,
            (0.0 * up + 1.0) * (inertia[0, 0] + inertia[1, 1] + inertia[2, 2]),
            *both,
        ],
        -1,
    )
    a, b = transitions.first, transitions.second
    # The body turns about the hinge from i to j.
    across = rest.normal[j] - saddle * _dot(rest.normal[j], saddle)
    forward = (_dot(xp.linalg.cross(across, saddle), edge) > 0.0) * 2.0 - 1.0
    axis = edge * forward
    kept, energy, straight = _carried(
        axis[a], axis[b], foot[a], foot[b], hinge[a], hinge[b], inertia, rest.normal[j[a]], xp
    )
    exits, drop = height[b] - rest.height[j[a]], height[a] - rest.height[j[a]]
    lacking = exits / (energy + ENERGY_SOFTENING) - drop
    lacking = xp.where(lacking < MOST_LACKING, lacking, 0.0 * lacking + MOST_LACKING)
    carries = xp.stack(
        [
            kept,
            energy,
            straight,
            exits,
            drop,
            lacking,
            xp.asarray(transitions.is_return),
            xp.logaddexp(0.0 * lacking, SHARPNESS * lacking),
            landing[a],
            from_saddle[a],
            hinge[a],
            reach_after[a],
            to_saddle[b],
            narrowness[b],
        ],
        -1,
    )
    return Features(odds, up, table, exits, carries)


class _Rests:
    """Measures of each rest; see `TRANSITION_FEATURES`."""

    def __init__(
        self, transitions: Transitions, arms: Any, inertia: Any, odds: Any, xp: ModuleType
    ) -> None:
        real = xp.asarray(transitions.real)
        a = arms[transitions.corners]
        b = xp.roll(a, -1, 1)
        vectors = 0.5 * xp.linalg.cross(a - a[:, :1], b - a[:, :1]).sum(1)
        area = _norm(vectors, xp)
        self.corners = a
        self.normal = vectors / area[:, None]
        normal = self.normal[:, None]
        self.height = (self.normal * a[:, 0]).sum(-1)
        edge = xp.where(real[..., None], b - a, a[:, :1] - b[:, :1])
        length = _norm(edge, xp)
        edge = edge / length[..., None]
        outward = xp.linalg.cross(edge, normal + 0.0 * edge)
        distance = (outward * a).sum(-1)
        inner = xp.where(real, distance, distance[:, :1]).min(-1)
        inner = inner if xp is np else inner.values
        flat = a - normal * self.height[:, None, None]
        outer = _norm(flat, xp).max(-1)
        outer = outer if xp is np else outer.values
        # Corners of the polar dual of the facet about the foot of the center of mass.
        dual = xp.where(
            real[..., None], outward / distance[..., None], _first_dual(outward, distance)
        )
        turned = xp.linalg.cross(dual, xp.roll(dual, -1, 1))
        polar = 0.5 * (turned * normal).sum((-1, -2))
        feet = a - edge * _dot(edge, a)
        back = -((a[:, None] - a[:, :, None]) * outward[:, :, None]).sum(-1)
        depth = back.max(-1)
        depth = depth if xp is np else depth.values
        far = feet - outward * depth[..., None]
        about = _dot(edge, edge @ inertia)[..., 0]
        kept = (about + (feet * far).sum(-1)) / (about + (far * far).sum(-1))
        weight = xp.where(real, length, 0.0 * length)
        rocking = (kept * weight).sum(-1) / weight.sum(-1)
        spinning = _dot(self.normal, self.normal @ inertia)[:, 0]
        self.columns = (
            xp.log(odds),
            area,
            xp.log(polar),
            inner,
            outer,
            rocking,
            spinning,
        )


def _first_dual(outward: Any, distance: Any) -> Any:
    return outward[:, :1] / distance[:, :1, None]


def _rocking(
    rest: _Rests, of: Integers, edge: Any, foot: Any, saddle: Any, hinge: Any, xp: ModuleType
) -> tuple[Any, Any]:
    """The part of its angular speed that a body keeps when it lands flat on a rest's facet, having
    turned about a hinge, and hits with the corner farthest from that; and how far that is."""
    normal = rest.normal[of]
    tangent = _unit(saddle - normal * _dot(normal, saddle), xp)
    corners = rest.corners[of]
    along = -((corners - foot[:, None]) * tangent[:, None]).sum(-1)
    farthest = along.argmax(-1)
    which = xp.arange(len(of))
    far = corners[which, farthest]
    far = far - edge * _dot(far, edge)
    kept = (hinge + (foot * far).sum(-1)) / (hinge + (far * far).sum(-1))
    return kept, along[which, farthest]


def _carried(
    axis: Any,
    axis_after: Any,
    foot: Any,
    foot_after: Any,
    hinge: Any,
    hinge_after: Any,
    inertia: Any,
    normal: Any,
    xp: ModuleType,
) -> tuple[Any, Any, Any]:
    """Speed and energy about a second hinge that are left of those about a first when the body
    lands on the second with no slip, and the cosine of the angle by which its way across the facet
    between them, of normal `normal`, bends."""
    first, second = hinge + (foot * foot).sum(-1), hinge_after + (foot_after * foot_after).sum(-1)
    velocity = xp.linalg.cross(axis, -foot)
    momentum = _dot(axis_after, axis @ inertia)[:, 0]
    momentum = momentum + (axis_after * xp.linalg.cross(-foot_after, velocity)).sum(-1)
    kept = momentum / xp.sqrt(first * second)
    energy = ((kept + xp.sqrt(kept * kept + SPEED_SOFTENING)) / 2.0) ** 2
    coming = foot / _norm(foot, xp)[:, None]
    going = foot_after / _norm(foot_after, xp)[:, None]
    coming = _unit(coming - normal * _dot(normal, coming), xp)
    going = _unit(going - normal * _dot(normal, going), xp)
    return kept, energy, -(coming * going).sum(-1)


def _dot(a: Any, b: Any) -> Any:
    """(..., 1) products of vectors (..., 3)."""
    return (a * b).sum(-1)[..., None]


def _norm(a: Any, xp: ModuleType) -> Any:
    return xp.sqrt((a * a).sum(-1))


def _unit(a: Any, xp: ModuleType) -> Any:
    return a / _norm(a, xp)[..., None]


def _angle(a: Any, b: Any, xp: ModuleType) -> Any:
    """Angles (...) between unit vectors (..., 3); the derivative is 0 where they are parallel."""
    turned = xp.linalg.cross(a, b)
    squared = (turned * turned).sum(-1)
    aslant = squared > 0.0
    sine = xp.where(aslant, xp.sqrt(xp.where(aslant, squared, 1.0)), 0.0)
    return xp.arctan2(sine, (a * b).sum(-1))
