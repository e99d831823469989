"""Prints whose facets are off, made and measured one by one: what derivatives do not see.

A needle or a die near to losing a rest changes its odds by more than in proportion.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import Final

import numpy as np
import torch

from dicedesign.errors import DiceError
from dicedesign.geometry.hulls.halfspaces import polyhedron_corners
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.gradient.odds_model import OddsModel
from dicedesign.gradient.rest_odds import evaluate_rests
from dicedesign.rest.outcomes import gathered
from dicedesign.rest.poses import RestPoses
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.statistics.chi_square_power import chances_noticed

__all__ = ["OffPrints"]

PRINTS: Final = 32
"""So many tell the part that is noticed to within some hundredths."""


@dataclass(frozen=True, eq=False)
class OffPrints:
    """Prints of a die.

    Attributes
    ----------
    poses: the rests of the file.
    directions: (k, 3) down in the outcomes.
    has_planes: whether the places of whole facets differ, or those of corners, see `OddsSpread`.
    model: of the odds under a prior, or None where any side is down alike at first.
    """

    poses: RestPoses
    directions: Floats
    has_planes: bool = True
    model: OddsModel | None = None

    def noticed(self, offset: float, target: Floats, bias: Floats, rolls: int) -> float:
        """Part of the prints with facets off by a standard deviation in mm that a test of so many
        rolls notices; target, bias: (k,) see `chance_noticed`. The same prints for all offsets;
        those that are no body are noticed."""
        random = np.random.default_rng(0)
        right = self._odds(self.poses.hull.vertices)
        biases = []
        for _ in range(PRINTS):
            with suppress(DiceError):
                biases.append(bias + self._odds(self._printed(offset, random)) - right)
        lost = PRINTS - len(biases)
        chances = chances_noticed(target, rolls, np.reshape(biases, (-1, len(target))))
        return float(chances.sum() + lost) / PRINTS

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
        odds = rests.odds if self.model is None else self.model.odds(rests)
        return gathered(rests.hull.normals[rests.facets], odds, self.directions).odds
