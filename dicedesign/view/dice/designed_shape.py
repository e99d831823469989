"""A shape on the way of a design, and what it does."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.optimize.starts.start import Start
from dicedesign.rest.outcomes import OutcomeOdds, outcome_odds
from dicedesign.rest.poses import RestPoses, analyse
from dicedesign.runtime.arrays import Floats

__all__ = ["DesignedShape"]

SAME: Final = 1e-9
"""Largest difference of coordinates, whose extent is about 1, of corners that count as the same."""


@dataclass(frozen=True, eq=False)
class DesignedShape:
    """A convex die as designed so far, in a unit of the design's own.

    Attributes
    ----------
    hull: the shape, of uniform density.
    directions: (k, 3) down in the outcomes, in the order of the target.
    target: (k,) wanted odds.
    energy: what the step to it has lowered; terms: its weighted terms by name.
    """

    hull: ConvexHull
    directions: Floats
    target: Floats
    energy: float = 0.0
    terms: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def poses(self) -> RestPoses:
        """Its rests, by the forward model."""
        return analyse(self.hull, self.hull.centroid, "uniform solid")

    @cached_property
    def outcomes(self) -> OutcomeOdds:
        """Odds of the outcomes, and of all other rests."""
        return outcome_odds(self.poses, self.directions)

    @property
    def error(self) -> float:
        """Largest |p - q|, or the odds of all other rests where these are larger."""
        return self.outcomes.error(self.target)

    def is_like(self, other: DesignedShape) -> bool:
        """True for the same corners and outcomes, but for rounding."""
        return all(
            len(first) == len(second) and bool(np.abs(first - second).max() < SAME)
            for first, second in (
                (self.hull.vertices, other.hull.vertices),
                (self.directions, other.directions),
            )
        )

    def start(self, pinned: tuple[int, ...] = ()) -> Start:
        """A starting shape to go on from, of whose outcomes some keep their planes."""
        return Start(self.hull.vertices, self.directions, pinned=pinned)
