"""Slopes of the support function that a wanted set of rests asks for, and the least displacement of
a hull's corners that gives them.

The height U(d) of the center of mass over the table has the slope r . t at the direction d along
the tangent t, where r is the corner that the body stands on. If U falls along the great circle
from every direction to that of some outcome, the outcomes' directions are the only rests. That is
asked where it fails: along the arcs from unwanted rests to outcomes, and at facets that are nearly
rests; and rising slopes are asked around each outcome. Each condition is linear in one corner.
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
"""Between directions of an arc at which slopes are asked for."""

CLIMB_STRIDE = math.radians(4.0)
"""Between directions of an arc at which heights are compared."""

MOST_HEIGHTS = 500_000
"""Corners times arcs whose heights are held at a time."""

CELL = 0.03
"""Size of the cells of the sphere, of which each remembers one direction."""

LIFETIME = 12
"""Steps for which a direction is remembered that no arc meets again."""

NEARLY_LOWEST = 0.01
"""Height over the corner that the body stands on, over the circumscribed radius, of others that it
may soon stand on instead: slopes are asked of them too."""

NEARLY_STABLE = 0.04
"""A facet is nearly a rest when the foot of the center of mass is no farther outside it, over the
circumscribed radius."""

RING = 16
"""Directions on each of the two circles around an outcome."""

FARTHEST = 0.05
"""Slopes that are better than asked by more than this are left out."""

CELL_SIZE = 0.3
"""Of conditions on one corner whose tangents differ by less than about this, one is kept."""

CELL_COUNT = 2 * math.ceil(1.0 / CELL_SIZE) + 1
"""Multiples of that in a coordinate of a unit vector."""

OPPOSITE = 1e-9
"""Sine of the angle below which directions count as opposite, if they are not the same."""


@dataclass(frozen=True)
class SlopeOptions:
    """Slopes to ask for, and where, of a body of circumscribed radius about 1.

    Attributes
    ----------
    fall: least slope toward outcomes, positive.
    rise: least slope away from an outcome, around it, positive.
    circle: angle around an outcome within which nothing falls, in radians.
    """

    fall: float
    rise: float
    circle: float


@dataclass(frozen=True)
class SlopeConditions:
    """`tangents . corner <= -least` for the corners of a hull.

    Attributes
    ----------
    tangents: (s, 3).
    corners: (s,) number of the point that the body stands on there, of those its hull is made of.
    least: (s,) slope that is asked for.
    """

    tangents: Floats
    corners: Integers
    least: Floats

    def excess(self, points: Floats) -> Floats:
        """(s,) how much each fails for points (n, 3); negative where it holds."""
        return (self.tangents * points[self.corners]).sum(-1) + self.least


def climbs(vertices: Floats, starts: Floats, ends: Floats) -> Floats:
    """(r, k) how high one has to climb, at most, on the great arc from each start (r, 3) to each
    end (k, 3), unit directions; 0 where it is downhill all the way. vertices: (n, 3)."""
    if len(starts) == 0:
        return np.zeros((0, len(ends)))
    if len(starts) > 1 and len(starts) * len(ends) * len(vertices) > MOST_HEIGHTS:
        halves = np.array_split(starts, 2)
        return np.concatenate([climbs(vertices, half, ends) for half in halves])
    arcs = great_arcs(starts, ends, CLIMB_STRIDE)
    return largest_rise((arcs @ vertices.T).max(axis=-1))


def largest_rise(heights: Floats) -> Floats:
    """(...) most by which heights (..., m) rise from one on to a later one."""
    later = np.maximum.accumulate(heights[..., ::-1], axis=-1)[..., ::-1]
    return np.asarray((later - heights).max(axis=-1))


@dataclass
class SlopeMemory:
    """Directions in which slopes have been asked for: conditions that are met stay until they are
    forgotten, as else the surface would spring back.

    Attributes
    ----------
    options: see there.
    cells: the directions by cell of the sphere: direction, outcome, and step of the last arc.
    """

    options: SlopeOptions
    cells: dict[tuple[int, ...], tuple[Floats, int, int]] = field(default_factory=dict)

    def conditions(
        self, rests: RestEvaluation, outcomes: Floats, outcome_of_rest: Integers, step: int
    ) -> SlopeConditions:
        """Conditions on a hull whose center of mass is the origin.

        outcomes: (k, 3) their directions; outcome_of_rest: (r,); step: number of the step.
        """
        hull = rests.hull
        self._remember(hull.normals[rests.paths.rests], outcomes, outcome_of_rest, step)
        parts = [self._around(outcomes)]
        if self.cells:
            directions = np.array([cell[0] for cell in self.cells.values()])
            ends = outcomes[[cell[1] for cell in self.cells.values()]]
            parts.append((directions, _tangents(directions, ends), self.options.fall))
        tangents, corners, least = [], [], []
        for directions, along, slope in parts:
            heights = directions @ hull.vertices.T
            at, corner = np.nonzero(heights >= heights.max(axis=1, keepdims=True) - NEARLY_LOWEST)
            tangents.append(along[at])
            corners.append(corner)
            least.append(np.full(len(at), slope))
        apart = (hull.normals @ outcomes.T).max(axis=1) < math.cos(self.options.circle)
        facets = np.flatnonzero((rests.depths > -NEARLY_STABLE) & apart)
        if len(facets) > 0:
            normals = hull.normals[facets]
            ends = outcomes[np.argmin(climbs(hull.vertices, normals, outcomes), axis=1)]
            counts = np.diff(hull.facet_start)[facets]
            half_edges = np.flatnonzero(np.isin(hull.facet, facets))
            tangents.append(np.repeat(_tangents(normals, ends), counts, axis=0))
            corners.append(hull.tail[half_edges])
            least.append(np.full(len(half_edges), self.options.fall))
        along, at, least_slopes = (
            np.concatenate(tangents),
            np.concatenate(corners),
            np.concatenate(least),
        )
        # Those that fail or nearly; of those in one cell, the one that asks for most.
        near = np.flatnonzero((along * hull.vertices[at]).sum(-1) + least_slopes > -FARTHEST)
        near = near[np.argsort(-least_slopes[near], kind="stable")]
        x, y, z = np.round(along[near] / CELL_SIZE).astype(np.int64).T + CELL_COUNT // 2
        cells = ((at[near] * CELL_COUNT + x) * CELL_COUNT + y) * CELL_COUNT + z
        unique_rows = np.sort(near[np.unique(cells, return_index=True)[1]])
        return SlopeConditions(
            along[unique_rows], hull.source[at[unique_rows]], least_slopes[unique_rows]
        )

    def _remember(
        self, normals: Floats, outcomes: Floats, outcome_of_rest: Integers, step: int
    ) -> None:
        far = (normals * outcomes[outcome_of_rest]).sum(-1) < math.cos(self.options.circle)
        for normal, outcome in zip(normals[far], outcome_of_rest[far].tolist(), strict=True):
            arc = great_arcs(normal[None], outcomes[outcome][None], STRIDE)[0, 0]
            arc = arc[arc @ outcomes[outcome] < math.cos(self.options.circle)]
            for cell, direction in zip(np.round(arc / CELL).astype(int).tolist(), arc, strict=True):
                self.cells[tuple(cell)] = (direction, outcome, step)
        self.cells = {
            cell: entry for cell, entry in self.cells.items() if step - entry[2] < LIFETIME
        }

    def _around(self, outcomes: Floats) -> tuple[Floats, Floats, float]:
        """Directions on circles around outcomes and tangents to the inside."""
        angles = np.linspace(0.0, 2.0 * np.pi, RING, endpoint=False)
        directions = []
        for outcome in outcomes:
            across = np.linalg.svd(outcome[None])[2][1:]
            aside = np.cos(angles)[:, None] * across[0] + np.sin(angles)[:, None] * across[1]
            for radius in (self.options.circle, 1.5 * self.options.circle):
                directions.append(math.cos(radius) * outcome + math.sin(radius) * aside)
        around = np.concatenate(directions)
        ends = np.repeat(outcomes, 2 * RING, axis=0)
        return around, _tangents(around, ends), self.options.rise


def _tangents(directions: Floats, ends: Floats) -> Floats:
    """(s, 3) unit tangents of great circles at directions (s, 3) toward ends (s, 3); any tangents
    where those are opposite, as then all ways are as long."""
    aside = ends - (directions * ends).sum(-1)[:, None] * directions
    opposite = norms(aside) < OPPOSITE
    if opposite.any():
        axes = np.eye(3)[np.abs(directions[opposite]).argmin(axis=1)]
        aside[opposite] = np.linalg.cross(directions[opposite], axes)
    return unit_vectors(aside)


def great_arcs(starts: Floats, ends: Floats, stride: float, fewest: int = 2) -> Floats:
    """(r, k, m, 3) directions from each start (r, 3) to each end (k, 3), both included, no farther
    apart than the stride, in radians."""
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
"""Compliance by which an inequality gives way, over the mean compliance of a corner: conditions may
contradict each other, and none is worth every price."""

REGULAR = 1e-9
"""Part of the trace, and of that softness, that is added where equations may depend on each other
or say nothing."""

MOST_CHANGES = 4
"""Changes of the set of inequalities that count; what is left is for the next step."""

MET = 1e-9
"""An inequality that fails by no more than this is met."""


def least_displacement(
    compliance: Floats,
    displacement: Floats,
    conditions: SlopeConditions,
    excess: Floats,
    jacobian: Floats,
    misses: Floats,
) -> Floats:
    """(n, 3) the displacement from the original that takes least work, among those that meet the
    linearized equations and, softly, the inequalities.

    Parameters
    ----------
    compliance: (n, 3, n, 3) symmetric positive definite: displacement for force.
    displacement: (n, 3) the present one.
    conditions, excess: (s,) inequalities and how much they fail at present.
    jacobian: (k, n, 3) of the equations; misses: (k,) what their values are to gain.

    Solved for the forces: k of the equations, and one for each inequality that would else fail.
    """
    tangents, corners = conditions.tangents, conditions.corners
    bound = (tangents * displacement[corners]).sum(-1) - excess
    wanted = misses + np.einsum("knc,nc->k", jacobian, displacement)
    size = displacement.size
    flat = compliance.reshape(size, size)
    # The inequalities, for displacements as one vector.
    columns = 3 * corners[:, None] + np.arange(3)
    starts = np.arange(0, columns.size + 1, 3)
    along = csr_array((tangents.ravel(), columns.ravel(), starts), shape=(len(corners), size))
    raised = jacobian.reshape(len(jacobian), size) @ flat
    own = raised @ jacobian.reshape(len(jacobian), size).T
    softness = SOFTNESS * float(np.trace(flat)) / size
    own += REGULAR * (np.trace(own) + softness) * np.eye(len(own))
    mixed = along @ raised.T
    by_condition = along @ flat
    pairs = along @ by_condition.T
    active = excess > 0.0
    for _ in range(MOST_CHANGES):
        active_rows = np.flatnonzero(active)
        between = pairs[np.ix_(active_rows, active_rows)] + softness * np.eye(len(active_rows))
        system = np.block([[between, mixed[active_rows]], [mixed[active_rows].T, own]])
        forces = solve(system, np.concatenate([bound[active_rows], wanted]), assume_a="pos")
        moved = (
            forces[: len(active_rows)] @ by_condition[active_rows]
            + forces[len(active_rows) :] @ raised
        )
        failing = along @ moved - bound > MET
        if np.array_equal(failing, active):
            break
        active = failing
    return np.asarray(moved.reshape(displacement.shape), dtype=np.float64)
