"""Hull fill by correspondence: every vertex of the designed hull is a point of the surface.

These points are fixed in their designed places, and the others follow elastically. Points that
would leave the hull are in contact with its facets, along which they can slide (`Contacts`), and
forces along the gradient of the center of mass hold it in place.
"""

from __future__ import annotations

import numpy as np

from dicedesign.concave.complementarity import solve_complementarity
from dicedesign.concave.hull_problem import HeldCorners, center_gradient, spread_points
from dicedesign.concave.result import Fill, OnEnergy
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import norms
from dicedesign.runtime.arrays import Booleans, Floats, Integers, sums_by_index

CONTACT_REGULARIZATION = 1e-10
"""Relative increase of the diagonal, as contacts may depend on each other."""


class Contacts:
    """Contacts without friction: a point can slide along the plane of a facet and leave it inward.

    Attributes
    ----------
    held: corners that are held in place.
    points: (c,) point of each contact; a point may touch several facets.
    facets: (c,) facet of each contact.
    responses: (n, s) displacements of all points for unit forces on the points in contact.
    place: (n,) column of `responses` of each point, or -1.
    active: (c,) whether a contact was pressed in the last solution.
    """

    def __init__(self, held: HeldCorners) -> None:
        size = len(held.by_corner)
        self.held = held
        self.points: Integers = np.zeros(0, dtype=np.int64)
        self.facets: Integers = np.zeros(0, dtype=np.int64)
        self.responses: Floats = np.zeros((size, 0))
        self.place: Integers = np.full(size, -1, dtype=np.int64)
        self.active: Booleans = np.zeros(0, dtype=bool)

    def add(self, points: Integers, facets: Integers) -> None:
        """Add contacts (c,) that do not exist yet."""
        known = set(zip(self.points.tolist(), self.facets.tolist(), strict=True))
        pairs = zip(points.tolist(), facets.tolist(), strict=True)
        fresh = np.array([pair not in known for pair in pairs], dtype=bool)
        self.points = np.concatenate([self.points, points[fresh]])
        self.facets = np.concatenate([self.facets, facets[fresh]])
        unknown = np.unique(self.points[self.place[self.points] < 0])
        if len(unknown) > 0:
            self.place[unknown] = self.responses.shape[1] + np.arange(len(unknown))
            fresh_responses = self.held.hold(self.held.elasticity.responses(unknown))
            self.responses = np.hstack([self.responses, fresh_responses])

    def solve(
        self, normals: Floats, bounds: Floats, gradient: Floats, raised: Floats, misses: Floats
    ) -> Floats:
        """Displacement (n, 3) of minimum work that respects all contacts and three equations.

        normals: (c, 3) normals of the contacts' facets; bounds: (c,) limits of the points along
        them; gradient: (n, 3, 3) gradient of the three values, which are last; raised: (n, 3, 3)
        displacements for forces along it; misses: (3,) required changes of the values.
        """
        count, columns = len(normals), self.place[self.points]
        system = np.zeros((count + 3, count + 3))
        system[:count, :count] = self.responses[np.ix_(self.points, columns)]
        system[:count, :count] *= normals @ normals.T
        diagonal = np.arange(count)
        system[diagonal, diagonal] *= 1.0 + CONTACT_REGULARIZATION
        system[:count, count:] = (raised[self.points] * normals[:, :, None]).sum(axis=1)
        along = np.tensordot(gradient, self.responses, (0, 0))[:, :, columns]
        system[count:, :count] = np.einsum("abs,sa->bs", along, normals)
        system[count:, count:] = np.einsum("nab,nac->bc", gradient, raised)
        values = np.concatenate([bounds, misses])
        fresh = np.ones(count - len(self.active), dtype=bool)
        strengths = solve_complementarity(system, values, np.concatenate([self.active, fresh]))
        self.active = strengths[:count] < 0.0
        pushes = strengths[:count, None] * normals
        forces = sums_by_index(columns, pushes, self.responses.shape[1])
        displacement: Floats = self.responses @ forces + raised @ strengths[count:]
        return displacement


DEPTH = 2e-5
"""Depth inside the designed hull, over the diagonal, of points that would leave it, so that its
vertices alone span the hull of the surface, also in single precision."""

MAX_ROUNDS = 30
"""Maximum number of rounds of changing contacts; 5 to 10 usually suffice."""

FIRST_ROUNDS = 5
"""Number of rounds in which the whole displacement has minimum work. Later only each further one
has: as it is small, Newton's method for the center of mass then converges quadratically."""

MAX_ADDED = 800
"""Maximum number of points that a round brings into contact, spread over those that are outside. A
round with more that are outside prolongs the first rounds by one."""

CENTERED = 1e-13
"""Distance of the center of mass from its required place, over the diagonal, that ends the
rounds."""


def fill_by_correspondence(
    held: HeldCorners,
    hull: ConvexHull,
    center_of_mass: Floats,
    on_step: OnEnergy,
) -> Fill | None:
    """Deform a surface until it has a required hull and center of mass.

    In the result the vertices of the hull are exact, every other point is inside, and the center of
    mass is accurate to rounding. None if the center of mass cannot be held, or points are still
    outside after the last round.

    Parameters
    ----------
    held: points of the surface that become the hull's vertices, in their order.
    hull: required hull, in the unit and near the place of the surface.
    center_of_mass: (3,) required center of mass of the uniform solid, inside the hull.
    on_step: see `OnEnergy`; the energy is the mean squared displacement.
    """
    elasticity, corners = held.elasticity, held.corners
    surface = elasticity.surface
    following = held.follow(hull.vertices - surface.points[corners])
    contacts, moved, first_rounds = Contacts(held), following.copy(), FIRST_ROUNDS
    middle = hull.vertices.mean(axis=0)
    room = hull.heights(middle) - DEPTH * surface.diagonal
    for number in range(MAX_ROUNDS):
        now = surface.with_points(surface.points + moved)
        # The forces move them there only to within rounding times their condition number.
        now.points[corners] = hull.vertices
        heights = (now.points - middle) @ hull.normals.T - room
        highest, excess = heights.argmax(axis=1), heights.max(axis=1)
        excess[corners] = -np.inf
        outside = max(float(excess.max()) / surface.diagonal - DEPTH, 0.0)
        energy = float((moved * moved).sum(-1).mean())
        on_step(energy)
        miss = center_of_mass - now.centroid
        if not norms(moved).max() <= surface.diagonal:
            break
        if outside == 0.0 and norms(miss) <= CENTERED * surface.diagonal:
            return now.points, energy
        out = np.flatnonzero(excess > 0.5 * DEPTH * surface.diagonal)
        if len(out) > MAX_ADDED:
            # Few of the others are still outside when these are pressed in.
            out = out[spread_points(surface.points[out], MAX_ADDED)]
            first_rounds += 1
        contacts.add(out, highest[out])
        if number < first_rounds:
            # The gradient halfway gives the change from start to end up to the third order.
            gradient = center_gradient(surface.with_points(surface.points + 0.5 * moved))
            miss = center_of_mass - surface.centroid - np.einsum("nab,na->b", gradient, following)
        else:
            following, gradient = moved.copy(), center_gradient(now)
        responses = elasticity.center_responses(gradient).reshape(-1, 9)
        raised = held.hold(responses).reshape(gradient.shape)
        normals, touching = hull.normals[contacts.facets], contacts.points
        places = surface.points[touching] + following[touching] - middle
        bounds = room[contacts.facets] - (places * normals).sum(-1)
        moved = following + contacts.solve(normals, bounds, gradient, raised, miss)
    return None
