"""Slopes of the support function that leave only the outcomes' rests, and the displacement of
minimum work that gives them.

At the down direction d, the height U(d) of the center of mass over the table has the slope r . t
along the tangent t, where r is the vertex that touches the table. If U falls along the great circle
from every direction to some outcome, the outcomes are the only rests. This is required where it
fails: along the arcs from other rests to outcomes, and at facets that are nearly rests. Around each
outcome U must rise. Each condition is linear in one vertex.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import solve
from scipy.sparse import csr_array

from dicedesign.geometry.sphere import angle_between, norms, unit_vectors
from dicedesign.gradient.rest_probabilities import RestEvaluation
from dicedesign.runtime.arrays import Floats, Integers

STRIDE = math.radians(1.0)
"""Angle between the directions of an arc that get conditions."""

CLIMB_STRIDE = math.radians(4.0)
"""Angle between the directions of an arc whose heights are compared."""

MAX_HEIGHTS = 500_000
"""Maximum number of vertices times arcs whose heights are computed together."""

CELL = 0.03
"""Size of the cells of the sphere, each of which remembers one direction."""

LIFETIME = 12
"""Steps after which a direction is forgotten if no arc meets its cell again."""

NEARLY_LOWEST = 0.01
"""Height over the table, over the circumscribed radius, up to which vertices get conditions, as
they may soon touch it."""

NEARLY_STABLE = 0.04
"""Largest distance of the foot of the center of mass outside a facet that is nearly a rest, over
the circumscribed radius."""

CIRCLE_DIRECTIONS = 16
"""Directions on each of the two circles around an outcome."""

LARGEST_RESERVE = 0.05
"""Amount by which a condition is met above which it is left out."""

TANGENT_CELL = 0.3
"""Size of the cells of tangents; for each vertex and cell one condition is kept."""

TANGENT_CELLS = 2 * math.ceil(1.0 / TANGENT_CELL) + 1
"""Number of cells along each coordinate of a unit vector."""

OPPOSITE = 1e-9
"""Sine of the angle below which two directions count as opposite or equal."""


@dataclass(frozen=True)
class SlopeOptions:
    """Required slopes, for a body of circumscribed radius about 1.

    Attributes
    ----------
    fall: minimum slope toward outcomes, positive.
    rise: minimum slope away from an outcome, around it, positive.
    circle: angle around an outcome within which the height rises, in radians.
    """

    fall: float
    rise: float
    circle: float


@dataclass(frozen=True)
class SlopeConditions:
    """Conditions `tangents . corner <= -least` on points of which a hull is made.

    Attributes
    ----------
    tangents: (s, 3).
    corners: (s,) index of the point of each condition.
    least: (s,) required slopes.
    """

    tangents: Floats
    corners: Integers
    least: Floats

    def excess(self, points: Floats) -> Floats:
        """(s,) violations by points (n, 3), negative if a condition holds."""
        return (self.tangents * points[self.corners]).sum(-1) + self.least


def climbs(vertices: Floats, starts: Floats, ends: Floats) -> Floats:
    """(r, k) largest rise of the height along the great arc from each unit direction (r, 3) to each
    other (k, 3); 0 if it only falls. vertices: (n, 3)."""
    if len(starts) == 0:
        return np.zeros((0, len(ends)))
    if len(starts) > 1 and len(starts) * len(ends) * len(vertices) > MAX_HEIGHTS:
        halves = np.array_split(starts, 2)
        return np.concatenate([climbs(vertices, half, ends) for half in halves])
    arcs = great_arcs(starts, ends, CLIMB_STRIDE)
    return largest_rise((arcs @ vertices.T).max(axis=-1))


def largest_rise(heights: Floats) -> Floats:
    """(...) largest rise from one of the heights (..., m) to a later one."""
    later = np.maximum.accumulate(heights[..., ::-1], axis=-1)[..., ::-1]
    return np.asarray((later - heights).max(axis=-1))


@dataclass
class SlopeMemory:
    """Directions with required slopes. They are remembered for some steps after their conditions
    are met, as the surface would spring back otherwise.

    Attributes
    ----------
    options: required slopes.
    cells: for each cell of the sphere a direction, its outcome, and the step of its last arc.
    """

    options: SlopeOptions
    cells: dict[tuple[int, ...], tuple[Floats, int, int]] = field(default_factory=dict)

    def conditions(
        self, rests: RestEvaluation, outcomes: Floats, outcome_of_rest: Integers, step: int
    ) -> SlopeConditions:
        """Conditions on a hull whose center of mass is the origin.

        outcomes: (k, 3) directions of the outcomes; outcome_of_rest: (r,) outcome of each rest;
        step: number of the step.
        """
        hull, options = rests.hull, self.options
        least_cosine = math.cos(options.circle)
        self._remember(hull.normals[rests.paths.rests], outcomes, outcome_of_rest, step)
        # On two circles around each outcome.
        angles = np.linspace(0.0, 2.0 * np.pi, CIRCLE_DIRECTIONS, endpoint=False)
        circles = []
        for outcome in outcomes:
            across = np.linalg.svd(outcome[None])[2][1:]
            aside = np.cos(angles)[:, None] * across[0] + np.sin(angles)[:, None] * across[1]
            for radius in (options.circle, 1.5 * options.circle):
                circles.append(math.cos(radius) * outcome + math.sin(radius) * aside)
        around = np.concatenate(circles)
        ends = np.repeat(outcomes, 2 * CIRCLE_DIRECTIONS, axis=0)
        parts = [(around, _tangents(around, ends), options.rise)]
        if self.cells:
            directions = np.array([cell[0] for cell in self.cells.values()])
            ends = outcomes[[cell[1] for cell in self.cells.values()]]
            parts.append((directions, _tangents(directions, ends), options.fall))
        conditions = []
        for directions, tangents, slope in parts:
            heights = directions @ hull.vertices.T
            at, corner = np.nonzero(heights >= heights.max(axis=1, keepdims=True) - NEARLY_LOWEST)
            conditions.append((tangents[at], corner, np.full(len(at), slope)))
        apart = (hull.normals @ outcomes.T).max(axis=1) < least_cosine
        facets = np.flatnonzero((rests.depths > -NEARLY_STABLE) & apart)
        if len(facets) > 0:
            normals = hull.normals[facets]
            ends = outcomes[np.argmin(climbs(hull.vertices, normals, outcomes), axis=1)]
            counts = np.diff(hull.facet_start)[facets]
            tangents = np.repeat(_tangents(normals, ends), counts, axis=0)
            corner = hull.tail[np.isin(hull.facet, facets)]
            conditions.append((tangents, corner, np.full(len(corner), options.fall)))
        along, at, least = map(np.concatenate, zip(*conditions, strict=True))
        # Conditions that fail or nearly fail; the strictest of each vertex and cell.
        near = np.flatnonzero((along * hull.vertices[at]).sum(-1) + least > -LARGEST_RESERVE)
        near = near[np.argsort(-least[near], kind="stable")]
        x, y, z = np.round(along[near] / TANGENT_CELL).astype(np.int64).T + TANGENT_CELLS // 2
        cells = ((at[near] * TANGENT_CELLS + x) * TANGENT_CELLS + y) * TANGENT_CELLS + z
        kept = np.sort(near[np.unique(cells, return_index=True)[1]])
        return SlopeConditions(along[kept], hull.source[at[kept]], least[kept])

    def _remember(
        self, normals: Floats, outcomes: Floats, outcome_of_rest: Integers, step: int
    ) -> None:
        """Remember the arcs from rests outside the circles to their outcomes, and forget old
        directions."""
        least_cosine = math.cos(self.options.circle)
        far = (normals * outcomes[outcome_of_rest]).sum(-1) < least_cosine
        for normal, outcome in zip(normals[far], outcome_of_rest[far].tolist(), strict=True):
            arc = great_arcs(normal[None], outcomes[outcome][None], STRIDE)[0, 0]
            arc = arc[arc @ outcomes[outcome] < least_cosine]
            for cell, direction in zip(np.round(arc / CELL).astype(int).tolist(), arc, strict=True):
                self.cells[tuple(cell)] = (direction, outcome, step)
        self.cells = {
            cell: entry for cell, entry in self.cells.items() if step - entry[2] < LIFETIME
        }


def _tangents(directions: Floats, ends: Floats) -> Floats:
    """(s, 3) unit tangents of the great circles at directions (s, 3) toward ends (s, 3); any
    tangents for opposite directions, as all arcs are then equally long."""
    aside = ends - (directions * ends).sum(-1)[:, None] * directions
    opposite = norms(aside) < OPPOSITE
    if opposite.any():
        axes = np.eye(3)[np.abs(directions[opposite]).argmin(axis=1)]
        aside[opposite] = np.linalg.cross(directions[opposite], axes)
    return unit_vectors(aside)


def great_arcs(starts: Floats, ends: Floats, stride: float, fewest: int = 2) -> Floats:
    """(r, k, m, 3) directions from each start (r, 3) to each end (k, 3), both included, at most a
    stride apart, in radians. fewest: minimum of m."""
    shape = len(starts), len(ends)
    first = np.repeat(starts, shape[1], axis=0)
    last = np.tile(ends, (shape[0], 1))
    angles = angle_between(first, last)
    parts = np.linspace(0.0, 1.0, max(fewest, math.ceil(float(angles.max()) / stride) + 1))
    steps = angles[:, None, None] * parts[:, None]
    aside = _tangents(first, last)[:, None]
    arcs: Floats = np.cos(steps) * first[:, None] + np.sin(steps) * aside
    return arcs.reshape(*shape, len(parts), 3)


SOFTNESS = 2e-3
"""Compliance of an inequality over the mean compliance of a vertex: conditions may contradict each
other, and none must be met at any cost."""

REGULARIZATION = 1e-9
"""Share of the trace, and of that softness, added to the diagonal of the equations, which may
depend on each other."""

MAX_CHANGES = 4
"""Maximum number of changes of the set of active inequalities in one step."""

MET = 1e-9
"""Violation up to which an inequality counts as met."""


def least_displacement(
    compliance: Floats,
    displacement: Floats,
    conditions: SlopeConditions,
    excess: Floats,
    jacobian: Floats,
    misses: Floats,
) -> Floats:
    """Displacement (n, 3) of minimum work from the original that meets linearized equations and,
    softly, inequalities. It is computed from the forces of the equations and active inequalities.

    Parameters
    ----------
    compliance: (n, 3, n, 3) displacement for forces, symmetric positive definite.
    displacement: (n, 3) current displacement.
    conditions, excess: inequalities, and their current violations (s,).
    jacobian, misses: (k, n, 3) derivatives and (k,) required changes of the equations' values.
    """
    tangents, corners = conditions.tangents, conditions.corners
    bound = (tangents * displacement[corners]).sum(-1) - excess
    wanted = misses + np.einsum("knc,nc->k", jacobian, displacement)
    size = displacement.size
    flat = compliance.reshape(size, size)
    # The inequalities as a sparse matrix.
    columns = 3 * corners[:, None] + np.arange(3)
    starts = np.arange(0, columns.size + 1, 3)
    along = csr_array((tangents.ravel(), columns.ravel(), starts), shape=(len(corners), size))
    equations = jacobian.reshape(len(jacobian), size)
    raised = equations @ flat
    own = raised @ equations.T
    softness = SOFTNESS * float(np.trace(flat)) / size
    own += REGULARIZATION * (np.trace(own) + softness) * np.eye(len(own))
    mixed = along @ raised.T
    by_condition = along @ flat
    pairs = along @ by_condition.T
    active = excess > 0.0
    for _ in range(MAX_CHANGES):
        rows = np.flatnonzero(active)
        count = len(rows)
        between = pairs[np.ix_(rows, rows)] + softness * np.eye(count)
        system = np.block([[between, mixed[rows]], [mixed[rows].T, own]])
        forces = solve(system, np.concatenate([bound[rows], wanted]), assume_a="pos")
        moved = forces[:count] @ by_condition[rows] + forces[count:] @ raised
        failing = along @ moved - bound > MET
        if np.array_equal(failing, active):
            break
        active = failing
    return np.asarray(moved.reshape(displacement.shape), dtype=np.float64)
