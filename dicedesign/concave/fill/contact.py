"""Points of an elastic surface that lean against the inside of a convex hull."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from dicedesign.concave.fill.space_elasticity import HeldCorners
from dicedesign.runtime.arrays import Booleans, Floats, Integers, sums_by_index

__all__ = ["Contacts"]

REGULAR: Final = 1e-10
"""Part by which the diagonal is larger, where contacts depend on each other."""

PATIENCE: Final = 10
"""Changes of all contacts that are wrong at once that may fail to make them fewer."""

MOST_PIVOTS: Final = 200
"""Changes in all."""

SLACK: Final = 1e-9
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
        fresh_responses = self.held.held(self.held.elasticity.responses(unknown))
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
        system[diagonal, diagonal] *= 1.0 + REGULAR
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
        kept = np.flatnonzero(active)
        bearing = cho_factor(system[np.ix_(kept, kept)])
        sides = np.column_stack([values[kept], system[kept, count:]])
        alone, mixed = np.split(cho_solve(bearing, sides), [1], axis=1)
        across = system[count:, kept]
        rest = np.linalg.solve(
            system[count:, count:] - across @ mixed, values[count:] - across @ alone[:, 0]
        )
        strengths[:] = 0.0
        strengths[kept], strengths[count:] = alone[:, 0] - mixed @ rest, rest
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
