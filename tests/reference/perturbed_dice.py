"""Probabilities of dice with random print errors, without derivatives."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dicedesign.errors import DiceError
from dicedesign.fabricate.printers import PrintErrors
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull, polyhedron_corners
from dicedesign.geometry.triangles import second_moments, solid_properties
from dicedesign.rest.outcomes import outcome_probabilities
from dicedesign.rest.poses import rest_poses
from dicedesign.runtime.arrays import Floats


def only(errors: PrintErrors, name: str) -> PrintErrors:
    """Print errors, all 0 but one."""
    return replace(PrintErrors(0.0, 0.0, 0.0, 0.0, 0.0), **{name: getattr(errors, name)})


@dataclass(frozen=True, eq=False)
class PrintedDie:
    """A uniform convex die that is printed repeatedly.

    Attributes
    ----------
    hull: as it was designed, in mm, with its center of mass at the origin.
    directions: (k, 3) down in the outcomes.
    center: (3,) of mass if it is given, which prints keep up to shrinkage.
    """

    hull: ConvexHull
    directions: Floats
    center: Floats | None = None

    def probabilities(self, errors: PrintErrors, prints: int, seed: int) -> Floats:
        """Probabilities (prints, k) without momentum of a number of prints; NaN for a print that is
        no die."""
        random = np.random.default_rng(seed)
        return np.stack([self._printed(errors, random) for _ in range(prints)])

    def _printed(self, errors: PrintErrors, random: np.random.Generator) -> Floats:
        hull = self.hull
        moves = errors.dimensional_mm * random.normal(size=len(hull.normals))
        stretch = 1.0 + errors.shrinkage * random.normal(size=3)
        gradient = errors.density_gradient * random.normal()
        try:
            corners = polyhedron_corners(hull.normals, hull.heights(np.zeros(3)) + moves) * stretch
            printed = convex_hull(corners)
            volume, center = solid_properties(printed.vertices, printed.triangles)
            offsets = printed.vertices - center
            moments, _ = second_moments(offsets, printed.triangles, np)
            moved = gradient / np.ptp(offsets[:, 2]) * moments[:, 2] / volume
            hole = _inside(printed, random) - center
            moved = moved - hole * errors.bubble_mm3 / (volume - errors.bubble_mm3)
            if self.center is not None:
                center = self.center * stretch
            return outcome_probabilities(
                rest_poses(corners, center + moved), self.directions
            ).probabilities
        except DiceError:
            return np.full(len(self.directions), np.nan)


def _inside(hull: ConvexHull, random: np.random.Generator) -> Floats:
    """Draw a point (3,) in a hull."""
    low, high = hull.vertices.min(axis=0), hull.vertices.max(axis=0)
    while True:
        point = random.uniform(low, high)
        if (hull.heights(point) >= 0.0).all():
            return point
