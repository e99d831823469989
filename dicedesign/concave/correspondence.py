"""Hull fill by correspondence: a surface follows the corners of its hull to where they are wanted.

Every corner of the hull is a point of the surface, so there is nothing to search: those points are
fixed where they are wanted, and the others follow elastically. Points that would stick out of the
wanted hull lean against the inside of its facets, along which they may slide (`Contacts`), and the
center of mass is held by forces along its own gradient.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from dicedesign.concave.hull_problem import Elasticity, HeldCorners
from dicedesign.concave.result import FillResult, FillStatus, OnEnergy
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import norms
from dicedesign.runtime.arrays import Booleans, Floats, Integers, sums_by_index

CONTACT_REGULAR = 1e-10
"""Part by which the diagonal is larger, where contacts depend on each other."""

PATIENCE = 10
"""Changes of all contacts that are wrong at once that may fail to make them fewer."""

MOST_PIVOTS = 200
"""Changes in all."""

SLACK = 1e-9
"""Part of the largest bound by which a point may go too far."""


@dataclass
class Contacts:
    """Contacts without friction: a point may slide along a facet's plane and leave it inward.

    Attributes
    ----------
    held: the corners that are in place.
    points: (c,) number of each contact's point; one point may lean against several facets.
    facets: (c,) number of the facet.
    responses: (n, s) displacement of all points for a unit force on some.
    place: (n,) column of `responses` for each point, or -1.
    active: (c,) whether a contact bore the last time.
    """

    held: HeldCorners
    points: Integers = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    facets: Integers = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    responses: Floats = field(init=False)
    place: Integers = field(init=False)
    active: Booleans = field(default_factory=lambda: np.zeros(0, dtype=bool))

    def __post_init__(self) -> None:
        size = len(self.held.by_corner)
        self.responses = np.zeros((size, 0))
        self.place = np.full(size, -1, dtype=np.int64)

    def add(self, points: Integers, facets: Integers) -> None:
        """New contacts (c,); those that exist are left out."""
        known = set(zip(self.points.tolist(), self.facets.tolist(), strict=True))
        pairs = zip(points.tolist(), facets.tolist(), strict=True)
        fresh = np.array([pair not in known for pair in pairs], dtype=bool)
        self.points = np.concatenate([self.points, points[fresh]])
        self.facets = np.concatenate([self.facets, facets[fresh]])
        unknown = np.unique(self.points[self.place[self.points] < 0])
        self.place[unknown] = self.responses.shape[1] + np.arange(len(unknown))
        fresh_responses = self.held.hold(self.held.elasticity.responses(unknown))
        self.responses = np.hstack([self.responses, fresh_responses])

    def solve(
        self, normals: Floats, bounds: Floats, gradient: Floats, raised: Floats, misses: Floats
    ) -> Floats:
        """Displacement (n, 3) of least work that keeps to all contacts and meets three equations.

        normals: (c, 3) of the contacts' facets; bounds: (c,) how far each point may go along its
        normal; gradient: (n, 3, 3) of the three other values, last; raised: (n, 3, 3)
        displacements for forces along it; misses: (3,) what those values are to gain.

        Source: Judice and Pires, Comput. Oper. Res. 21(5), 1994 (block pivoting).
        """
        count = len(normals)
        system = np.zeros((count + 3, count + 3))
        among = self.responses[self.points][:, self.place[self.points]]
        system[:count, :count] = among * (normals @ normals.T)
        diagonal = np.arange(count)
        system[diagonal, diagonal] *= 1.0 + CONTACT_REGULAR
        system[:count, count:] = (raised[self.points] * normals[:, :, None]).sum(axis=1)
        along = np.tensordot(gradient, self.responses, (0, 0))[:, :, self.place[self.points]]
        system[count:, :count] = np.einsum("abs,sa->bs", along, normals)
        system[count:, count:] = np.einsum("nab,nac->bc", gradient, raised)
        values = np.concatenate([bounds, misses])
        fresh = np.ones(count - len(self.active), dtype=bool)
        strengths = _complementary(system, values, np.concatenate([self.active, fresh]))
        self.active = strengths[:count] < 0.0
        pushes = strengths[:count, None] * normals
        forces = sums_by_index(self.place[self.points], pushes, self.responses.shape[1])
        displacement: Floats = self.responses @ forces + raised @ strengths[count:]
        return displacement


def _complementary(system: Floats, values: Floats, active: Booleans) -> Floats:
    """Strengths x (c + 3,) with `system @ x = values` in the last three rows and in those of the
    bearing contacts, where x < 0, and `system @ x <= values` in the others, where x = 0."""
    count = len(active)
    fewest, patience = count + 1, PATIENCE
    strengths = np.zeros(count + 3)
    slack = SLACK * float(np.abs(values).max(initial=0.0))
    for _ in range(MOST_PIVOTS):
        active_rows = np.flatnonzero(active)
        bearing = cho_factor(system[np.ix_(active_rows, active_rows)])
        sides = np.column_stack([values[active_rows], system[active_rows, count:]])
        alone, mixed = np.split(cho_solve(bearing, sides), [1], axis=1)
        across = system[count:, active_rows]
        rest = np.linalg.solve(
            system[count:, count:] - across @ mixed, values[count:] - across @ alone[:, 0]
        )
        strengths[:] = 0.0
        strengths[active_rows], strengths[count:] = alone[:, 0] - mixed @ rest, rest
        over = system[:count] @ strengths - values[:count]
        wrong = np.where(active, strengths[:count] > 0.0, over > slack)
        changes = np.flatnonzero(wrong)
        if len(changes) == 0:
            break
        if len(changes) < fewest:
            fewest, patience = len(changes), PATIENCE
        elif patience > 0:
            patience -= 1
        else:
            changes = changes[-1:]
        active = active.copy()
        active[changes] = ~active[changes]
    return strengths


SINK = 2e-5
"""Depth inside the wanted hull, over the diagonal, that points keep which would stick out: its
corners alone then span it, in single precision too."""

MOST_ROUNDS = 30
"""Rounds in which contacts come and go; five to ten do, as a rule."""

FIRST_ROUNDS = 5
"""In these the whole displacement is the one of least work, later each further one alone: it is
small, and then Newton's method on the center of mass squares the error."""

CENTERED = 1e-13
"""Distance from the wanted center of mass, over the diagonal, at which they end."""


def fill_by_correspondence(
    elasticity: Elasticity,
    hull: ConvexHull,
    corners: Integers,
    center_of_mass: Floats,
    on_step: OnEnergy,
) -> FillResult:
    """Deform a surface until its hull and its center of mass are the wanted ones.

    Parameters
    ----------
    elasticity: of the surface.
    hull: the wanted one, in the surface's own unit and place, or near.
    corners: (v,) distinct numbers of the surface's points that are to become its corners.
    center_of_mass: (3,) that of the uniform solid that is wanted, inside the hull.
    on_step: see `OnEnergy`; the energy is the mean squared displacement.

    Returns
    -------
    FITTED with the hull's corners exactly in place, every other point inside, and the center of
    mass to rounding; NO_PROGRESS where the center cannot be held, STEP_LIMIT where points still
    stick out after the last round.
    """
    surface, held = elasticity.surface, HeldCorners(elasticity, corners)
    following = held.follow(hull.vertices - surface.points[corners])
    contacts, moved = Contacts(held), following.copy()
    middle = hull.vertices.mean(axis=0)
    room = hull.heights(middle) - SINK * surface.diagonal
    status = FillStatus.STEP_LIMIT
    for number in range(MOST_ROUNDS):
        now = surface.with_points(surface.points + moved)
        # By the forces they come there to within rounding times the condition of those.
        now.points[corners] = hull.vertices
        heights = (now.points - middle) @ hull.normals.T - room
        highest = heights.argmax(axis=1)
        worst = heights[np.arange(len(heights)), highest]
        worst[corners] = -np.inf
        outside = max(float(worst.max()) / surface.diagonal - SINK, 0.0)
        energy = float((moved * moved).sum(-1).mean())
        on_step(energy)
        miss = center_of_mass - now.centroid
        if not norms(moved).max() <= surface.diagonal:
            status = FillStatus.NO_PROGRESS
            break
        if outside == 0.0 and norms(miss) <= CENTERED * surface.diagonal:
            status = FillStatus.FITTED
            break
        out = np.flatnonzero(worst > 0.5 * SINK * surface.diagonal)
        contacts.add(out, highest[out])
        if number < FIRST_ROUNDS:
            # Of a change from start to end its gradient half way tells all but the third order.
            halfway = surface.with_points(surface.points + 0.5 * moved)
            whole = np.moveaxis(halfway.centroid_derivatives(), 0, -1)
            misses = center_of_mass - surface.centroid - np.einsum("nab,na->b", whole, following)
        else:
            following, misses = moved.copy(), miss
            whole = np.moveaxis(now.centroid_derivatives(), 0, -1)
        raised = held.hold(elasticity.center_responses(whole).reshape(-1, 9)).reshape(whole.shape)
        normals, at = hull.normals[contacts.facets], contacts.points
        places = surface.points[at] + following[at] - middle
        bounds = room[contacts.facets] - (places * normals).sum(-1)
        change = contacts.solve(normals, bounds, whole, raised, misses)
        moved = following + change
    return FillResult(now.points, energy, status)
