"""Facet coordinates in which facets that lie almost in one plane move as one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull, HullMaker, convex_hull
from dicedesign.optimize.coordinates.facets import FacetCoordinates
from dicedesign.optimize.coordinates.shape import Shape
from dicedesign.runtime.arrays import Floats

if TYPE_CHECKING:
    from torch import Tensor

    from dicedesign.gradient.rest_odds import RestEvaluation

__all__ = ["TiedCoordinates"]


@dataclass(frozen=True)
class TiedCoordinates:
    """Parameters are changes of the normals and of the logarithms of the distances, shared by the
    facets of a group.

    Attributes
    ----------
    facets: coordinates of all m facets. whole: (4 m,) their parameters before any change.
    expansion: (4 m, r) with orthonormal columns, from the parameters (r,) to the changes.
    """

    facets: FacetCoordinates
    whole: Floats
    expansion: Floats

    @classmethod
    def of(
        cls, hull: ConvexHull, directions: Floats, angle: float
    ) -> tuple[FacetCoordinates | TiedCoordinates, Floats]:
        """Coordinates about the centroid of a hull, and its parameters.

        Each facet is tied to the nearest of those with normals `directions` (k, 3), if that is
        within an angle in radians. Where there is nothing to tie, these are facet coordinates.
        """
        facets, whole = FacetCoordinates.of(hull.vertices, hull.centroid)
        normals = whole[: 3 * len(whole) // 4].reshape(-1, 3)
        leaders = np.argmax(normals @ directions.T, axis=0)
        cosines = normals @ normals[leaders].T
        nearest = leaders[np.argmax(cosines, axis=1)]
        group = np.where(cosines.max(axis=1) > np.cos(angle), nearest, np.arange(len(normals)))
        # A leader is nearest to itself, but for rounding.
        group[leaders] = leaders
        members = (group[:, None] == np.unique(group)).astype(np.float64)
        if members.shape[1] == len(normals):
            return facets, whole
        members /= np.sqrt(members.sum(axis=0))
        normals_part = np.kron(members, np.eye(3))
        expansion = np.zeros((len(whole), 4 * members.shape[1]))
        expansion[: len(normals_part), : normals_part.shape[1]] = normals_part
        expansion[len(normals_part) :, normals_part.shape[1] :] = members
        return cls(facets, whole, expansion), np.zeros(expansion.shape[1])

    def half_spaces(self, parameters: Floats) -> Floats:
        """(4 m,) parameters of all facets."""
        moved: Floats = self.whole + self.expansion @ parameters
        return moved

    def shape(self, parameters: Floats, hull_of: HullMaker = convex_hull) -> Shape:
        """See `FacetCoordinates`."""
        shape = self.facets.shape(self.half_spaces(parameters), hull_of)
        return Shape(shape.points, lambda rows: shape.pulled_back(rows) @ self.expansion)

    def points(self, parameters: Tensor, hull_of: HullMaker = convex_hull) -> Tensor:
        """See `Coordinates`."""
        import torch

        moved = torch.from_numpy(self.whole) + torch.from_numpy(self.expansion) @ parameters
        return self.facets.points(moved, hull_of)

    def pruned(self, parameters: Floats, rests: RestEvaluation) -> Floats:
        """See `FacetCoordinates`."""
        return parameters
