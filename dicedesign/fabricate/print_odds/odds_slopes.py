"""First derivatives of a printed body's odds in what can go wrong with it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.solid import is_closed, second_moments
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.triangles import doubled_area_vectors
from dicedesign.gradient.facet_offsets import offset_derivatives
from dicedesign.gradient.odds_model import OddsModel
from dicedesign.gradient.rest_odds import RestEvaluation
from dicedesign.rest.basins import Basins
from dicedesign.rest.outcomes import OutcomeOdds
from dicedesign.rest.poses import RestPoses
from dicedesign.runtime.arrays import Floats

__all__ = ["OddsSlopes"]


@dataclass(frozen=True, eq=False)
class OddsSlopes:
    """Derivatives of the odds of k outcomes at a body with n corners and m facets.

    Attributes
    ----------
    hull: of the body.
    center: (3,) its center of mass.
    volume: of the body; inside: (3, 3) mean of the products of two coordinates over it, about the
        center of mass.
    by_corners: (k, n, 3) in the corners, the center of mass staying where it is.
    by_planes: (k, m) in the offsets of the facets, likewise.
    is_uniform: whether the center of mass is that of the solid, and so moves with what is added.
    """

    hull: ConvexHull
    center: Floats
    volume: float
    inside: Floats
    by_corners: Floats
    by_planes: Floats
    is_uniform: bool

    @classmethod
    def of(
        cls,
        body: Body,
        poses: RestPoses,
        outcomes: OutcomeOdds,
        model: OddsModel | None = None,
    ) -> OddsSlopes:
        """Those of a body and its rests; of a tied one the mean over the bodies beside it.

        outcomes: what its rests count for; model: of the odds, where they are not those
        without momentum and with any side down alike; is_uniform: False for a center of mass that
        was given.
        """
        place = np.full(len(poses.hull.normals), -1)
        place[poses.facets] = outcomes.outcome_of_rest
        rows, planes = [], []
        for side in poses.basins:
            rests = _evaluation(side)
            jacobian = rests.jacobian if model is None else model.jacobian(rests)
            of_outcomes = np.zeros((len(outcomes.odds), jacobian.shape[1]))
            of_rests = place[side.paths.rests]
            np.add.at(of_outcomes, of_rests[of_rests >= 0], jacobian[of_rests >= 0])
            rows.append(of_outcomes)
            planes.append(offset_derivatives(rests, of_outcomes))
        volume, inside = _moments(body, poses)
        return cls(
            hull=poses.hull,
            center=poses.center_of_mass,
            volume=volume,
            inside=inside,
            by_corners=np.mean(rows, axis=0).reshape(len(outcomes.odds), -1, 3),
            by_planes=np.mean(planes, axis=0),
            is_uniform=poses.center_of_mass_source != "given",
        )

    @cached_property
    def by_center(self) -> Floats:
        """(k, 3) in the center of mass: a body that moves as a whole keeps its odds."""
        return -self.by_corners.sum(axis=1)

    @cached_property
    def by_offsets(self) -> Floats:
        """(k, m) in the offsets of the facets, with which the center of mass moves by the material
        that comes on."""
        if not self.is_uniform:
            return self.by_planes
        corners = self.hull.vertices[self.hull.triangles]
        areas = norms(doubled_area_vectors(self.hull.vertices, self.hull.triangles)) / 2.0
        first = self.hull.facet_start[:-1] - 2 * np.arange(len(self.hull.normals))
        added = areas[:, None] * (corners.mean(axis=1) - self.center) / self.volume
        return self.by_planes + self.by_center @ np.add.reduceat(added, first, axis=0).T

    def by_stretches(self, axes: Floats) -> Floats:
        """(k, 3) in the relative lengths along orthonormal axes (3, 3), one a row."""
        radii = (self.hull.vertices - self.center) @ axes.T
        along = self.by_corners @ axes.T
        return np.asarray((along * radii).sum(axis=1))

    def by_gradient(self, axis: Floats) -> Floats:
        """(k,) in the relative change of the density from one end of the body to the other along a
        unit axis (3,)."""
        heights = self.hull.vertices @ axis
        return np.asarray(self.by_center @ (self.inside @ axis) / np.ptp(heights))

    def of_bubble(self) -> Floats:
        """(k, k) covariance of the odds for a bubble of volume 1 anywhere in the body: the center
        of mass moves away from it by its part of the volume."""
        return np.asarray(self.by_center @ self.inside @ self.by_center.T / self.volume**2)


def _evaluation(side: Basins) -> RestEvaluation:
    vertices = torch.from_numpy(side.equilibria.hull.vertices)
    center = torch.from_numpy(side.equilibria.center_of_mass)
    return RestEvaluation(side.equilibria, vertices, center, side)


def _moments(body: Body, poses: RestPoses) -> tuple[float, Floats]:
    """Volume of the body, or where its surface is open of its hull, and the mean (3, 3) of the
    products of two coordinates about the center of mass."""
    points, triangles = body.points, body.triangles
    if triangles is None or not is_closed(triangles):
        points, triangles = poses.hull.vertices, poses.hull.triangles
    moments, volume = second_moments(points - poses.center_of_mass, triangles, np)
    return float(volume), np.asarray(moments / volume)
