"""Prints whose facets are off, made and measured one by one: what derivatives do not see.

A needle or a die near to losing a rest changes its odds by more than in proportion.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import torch

from dicedesign.errors import DiceError
from dicedesign.geometry.hulls.halfspaces import polyhedron_corners
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.gradient.rest_odds import evaluate_rests
from dicedesign.gradient.thrown_odds import ThrownOdds
from dicedesign.rest.outcomes import gathered
from dicedesign.rest.poses import RestPoses
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.statistics.chi_square_power import chance_noticed

__all__ = ["OffPrints"]

PRINTS: Final = 48
"""So many tell the part that is noticed to within some hundredths."""


@dataclass(frozen=True, eq=False)
class OffPrints:
    """Prints of a die.

    Attributes
    ----------
    poses: the rests of the file.
    directions: (k, 3) down in the outcomes.
    thrown: the model of odds when thrown, or None for odds without momentum.
    has_planes: whether the places of whole facets differ, or those of corners, see `OddsSpread`.
    """

    poses: RestPoses
    directions: Floats
    thrown: ThrownOdds | None = None
    has_planes: bool = True

    def noticed(self, offset: float, target: Floats, bias: Floats, rolls: int) -> float:
        """Part of the prints with facets off by a standard deviation in mm that a test of so many
        rolls notices; target, bias: (k,) see `chance_noticed`. The same prints for all offsets."""
        random = np.random.default_rng(0)
        still, right = np.zeros((len(target), len(target))), self._odds(self.poses.hull.vertices)
        chances = []
        for _ in range(PRINTS):
            try:
                change = self._odds(self._printed(offset, random)) - right
                chances.append(chance_noticed(target, rolls, still, bias + change))
            except DiceError:
                chances.append(1.0)
        return float(np.mean(chances))

    def _printed(self, offset: float, random: np.random.Generator) -> Floats:
        hull, middle = self.poses.hull, self.poses.hull.centroid
        if not self.has_planes:
            return hull.vertices + offset * random.normal(size=hull.vertices.shape)
        heights = hull.heights(middle) + offset * random.normal(size=len(hull.normals))
        return middle + polyhedron_corners(hull.normals, heights)

    def _odds(self, corners: Floats) -> Floats:
        """(k,) of the outcomes of a body with these corners."""
        center = self.poses.center_of_mass
        if self.has_planes and self.poses.center_of_mass_source != "given":
            # What labels take away stays as it is.
            center = center + convex_hull(corners).centroid - self.poses.hull.centroid
        rests = evaluate_rests(torch.from_numpy(corners), torch.from_numpy(center))
        odds = rests.odds if self.thrown is None else self.thrown.odds(rests)
        return gathered(rests.hull.normals[rests.facets], odds, self.directions).odds
