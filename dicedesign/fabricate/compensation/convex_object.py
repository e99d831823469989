"""The object that is made of a plain convex shape: edges rounded, labels cut in, and what balances
them.

Lengths are in millimetres.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dicedesign.fabricate.finish_options import EdgeOptions, EngravingOptions
from dicedesign.fabricate.label_layout import Placement
from dicedesign.fabricate.rounded_edges import rounded
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.meshes.body import make_body
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.rest.outcomes import outcome_odds
from dicedesign.rest.poses import analyse, rest_poses
from dicedesign.rest.prior import Prior
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.momentum_model import MomentumModel
from dicedesign.throws.simulation import DieOnTable
from dicedesign.throws.tables import Table

__all__ = [
    "ConvexObject",
    "Measured",
    "measure_resting",
    "measure_thrown",
]


@dataclass(frozen=True)
class Measured:
    """What a solid does: its center of mass (3,) and the odds (k,) of its outcomes."""

    center_of_mass: Floats
    odds: Floats


@dataclass(frozen=True)
class ConvexObject:
    """How an object is made of its core, the shape inside the rounded edges.

    Attributes
    ----------
    labels: how they are cut, or None for no labels. edges: how they are rounded, or None for sharp
        ones.
    offset: (3,) from the centroid of the core to a center of mass that was given; None where it is
        that of the solid.
    """

    labels: EngravingOptions | None
    edges: EdgeOptions | None
    offset: Floats | None = None

    def unlabelled(self, core: ConvexHull) -> Surface:
        """The solid without labels."""
        hull = core
        if self.edges is not None:
            center = core.centroid if self.offset is None else core.centroid + self.offset
            hull = rounded(core, center, self.edges)
        return Surface(hull.vertices, hull.triangles)

    def balanced(self, core: ConvexHull, placements: Sequence[Placement]) -> Surface:
        """The solid by which the object is judged: engraved, with a hidden hollow where that is to
        balance it; whole where the labels are filled. Raises EngravingError."""
        plain = self.unlabelled(core)
        if self.labels is None or not placements or self.labels.balance == "fill":
            return plain
        return self._engraved(plain, placements)

    def engraved(self, core: ConvexHull, placements: Sequence[Placement]) -> Surface:
        """The solid with its labels cut in, whatever fills them. Raises EngravingError."""
        return self._engraved(self.unlabelled(core), placements)

    def _engraved(self, plain: Surface, placements: Sequence[Placement]) -> Surface:
        from dicedesign.fabricate.compensation.hidden_ball import hollowed
        from dicedesign.fabricate.engraving import engrave

        if self.labels is None:
            return plain
        marked = engrave(plain.points, plain.triangles, self.placed(placements), self.labels)
        if self.labels.balance != "opposite":
            return marked
        return hollowed(marked, plain.centroid)

    def inlay(self, core: ConvexHull, placements: Sequence[Placement]) -> Surface:
        """The bodies that fill the labels."""
        from dicedesign.fabricate.engraving import inlay

        assert self.labels is not None
        plain = self.unlabelled(core)
        return inlay(plain.points, plain.triangles, self.placed(placements), self.labels)

    def placed(self, placements: Sequence[Placement]) -> tuple[Placement, ...]:
        """Labels on the facets of the core moved outward onto those of the object."""
        if self.edges is None:
            return tuple(placements)
        lift = self.edges.radius_mm
        frames = [placement.frame.copy() for placement in placements]
        for frame in frames:
            frame[:3, 3] += lift * frame[:3, 2]
        return tuple(
            replace(placement, frame=frame)
            for placement, frame in zip(placements, frames, strict=True)
        )


def measure_resting(
    prior: Prior | None, offset: Floats | None = None
) -> Callable[[Surface, Floats], Measured]:
    """Odds without momentum, under a prior if there is one, of a solid whose outcomes have
    directions (k, 3).

    offset: (3,) of a center of mass that was given, from the centroid of the hull; None for that of
        the solid.
    """

    def measure(surface: Surface, directions: Floats) -> Measured:
        if offset is None:
            poses = rest_poses(make_body(surface.points, surface.triangles))
        else:
            hull = convex_hull(surface.points)
            poses = analyse(hull, hull.centroid + offset)
        odds = outcome_odds(poses.under(prior), directions).odds
        return Measured(poses.center_of_mass, odds)

    return measure


def measure_thrown(
    table: Table, model: MomentumModel | None
) -> Callable[[Surface, Floats], Measured]:
    """The same with odds by the momentum model of a table, which knows the solid's inertia."""

    def measure(surface: Surface, directions: Floats) -> Measured:
        body = make_body(surface.points, surface.triangles)
        die = DieOnTable.of(body, None, directions, table)
        return Measured(np.asarray(die.poses.center_of_mass), die.momentum(model))

    return measure
