"""Hull fill by correspondence: a surface follows the corners of its hull to where they are wanted.

Every corner of the hull is a point of the surface, so there is nothing to search: those points are
fixed where they are wanted, and the others follow elastically. Points that would stick out of the
wanted hull lean against the inside of its facets, along which they may slide (`Contacts`), and the
center of mass is held by forces along its own gradient.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from dicedesign.concave.fill.contact import Contacts
from dicedesign.concave.fill.result import FillResult, FillStatus, OnEnergy
from dicedesign.concave.fill.space_elasticity import Elasticity, HeldCorners
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import norms
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["fill_by_correspondence"]

SINK: Final = 2e-5
"""Depth inside the wanted hull, over the diagonal, that points keep which would stick out: its
corners alone then span it, in single precision too."""

MOST_ROUNDS: Final = 30
"""Rounds in which contacts come and go; five to ten do, as a rule."""

FIRST_ROUNDS: Final = 5
"""In these the whole displacement is the one of least work, later each further one alone: it is
small, and then Newton's method on the center of mass squares the error."""

CENTERED: Final = 1e-13
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
    following = held.followed(hull.vertices - surface.points[corners])
    contacts, moved = Contacts(held), following.copy()
    middle = hull.vertices.mean(axis=0)
    room = hull.heights(middle) - SINK * surface.diagonal
    status = FillStatus.STEP_LIMIT
    for number in range(MOST_ROUNDS):
        now = surface.moved(surface.points + moved)
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
            halfway = surface.moved(surface.points + 0.5 * moved)
            whole = np.moveaxis(halfway.centroid_derivatives(), 0, -1)
            misses = center_of_mass - surface.centroid - np.einsum("nab,na->b", whole, following)
        else:
            following, misses = moved.copy(), miss
            whole = np.moveaxis(now.centroid_derivatives(), 0, -1)
        raised = held.held(elasticity.center_responses(whole).reshape(-1, 9)).reshape(whole.shape)
        normals, at = hull.normals[contacts.facets], contacts.points
        places = surface.points[at] + following[at] - middle
        bounds = room[contacts.facets] - (places * normals).sum(-1)
        change = contacts.solve(normals, bounds, whole, raised, misses)
        moved = following + change
    return FillResult(now.points, energy, status)
