"""Hull fill by quadratic programs: a surface grows inside a wanted hull until it spans it
(appendix B.1).

The corners of the hull draw on the points of the surface that are closest to them, more and more
strongly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from scipy.sparse import csc_array, eye_array

from dicedesign.concave.fill.closest_point_energy import ClosestPointEnergy
from dicedesign.concave.fill.elastic_energy import ElasticEnergy
from dicedesign.concave.fill.paper_options import ConcavePaperOptions
from dicedesign.concave.fill.quadratic_program import PointsInside
from dicedesign.concave.fill.result import FillResult, FillStatus, OnEnergy
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Floats

__all__ = ["fill_by_quadratic_programs"]

MARGIN: Final = 1e-6
"""Depth inside the hull, over the diagonal of the surface, that all points keep."""

PROXIMAL: Final = 1e-6
"""Weight of squared moves: the elastic energy leaves some free."""

SHORTEST: Final = 1e-3
"""Part of a step below which none is taken."""

CLOSE: Final = 1e-3
"""Mean distance of the hull's corners from the surface, over its diagonal, that will do: nearer
corners than the surface has points for share one, and are never all met."""

MOST_STEPS: Final = 40
"""Most programs."""


def fill_by_quadratic_programs(
    surface: Surface, hull: ConvexHull, options: ConcavePaperOptions, on_step: OnEnergy
) -> FillResult:
    """Deform a surface as little as may be until its convex hull is a wanted one (eq. 26, 27).

    Parameters
    ----------
    surface: the reference of the elastic energy, and the start.
    hull: wanted.
    options: lambda_CP, lambda_m, lambda_b and the growth of the first.
    on_step: see `OnEnergy`.

    Returns
    -------
    FITTED with the corners of the hull close to the surface, on the mean; STEP_LIMIT with a surface
    that is not as close, UNSOLVED with the one of which no program was solved.

    Raises
    ------
    InputError: a triangle without area; Clarabel is not installed.
    """
    return _Fill(surface, hull, options, on_step).run()


@dataclass(eq=False)
class _Fill:
    """One fill, in units of the surface's diagonal about the hull's centroid."""

    surface: Surface
    hull: ConvexHull
    options: ConcavePaperOptions
    on_step: OnEnergy

    def __post_init__(self) -> None:
        self.unit, self.middle = self.surface.diagonal, self.hull.centroid
        self.scaled = self.surface.moved((self.surface.points - self.middle) / self.unit)
        self.targets = (self.hull.vertices - self.middle) / self.unit
        heights = self.hull.heights(self.middle) / self.unit
        self.inside = PointsInside(self.hull.normals, heights - MARGIN)
        self.elastic = ElasticEnergy.of(self.scaled, self.options.membrane, self.options.bending)
        self.points = self.inside.largest(self.scaled.points)
        self.energy = 0.0

    def run(self) -> FillResult:
        """Steps of eq. 29 and 30, with a weight that grows, until the surface is close to all
        corners."""
        options, weight = self.options, self.options.closest_point
        status = FillStatus.STEP_LIMIT
        for number in range(MOST_STEPS + 1):
            closest = ClosestPointEnergy.of(self.scaled.moved(self.points), self.targets)
            if number == 0:
                self.energy = self.energy_of(self.points, weight, closest)
                self.on_step(self.energy)
            if norms(closest.offsets(self.points)).mean() <= CLOSE:
                status = FillStatus.FITTED
                break
            if number == MOST_STEPS:
                break
            gradient, hessian = self.elastic.model(self.points)
            gradient = gradient + weight * closest.gradient(self.points)
            hessian = hessian + weight * closest.hessian + PROXIMAL * eye_array(3 * len(gradient))
            move = self.inside.step(self.points, csc_array(hessian), gradient)
            if move is None:
                status = FillStatus.UNSOLVED
                break
            if self.descend(self.inside.mended(self.points + move), weight, closest):
                weight *= options.growth
        return FillResult(self.points * self.unit + self.middle, self.energy, status)

    def energy_of(self, points: Floats, weight: float, closest: ClosestPointEnergy) -> float:
        """Of eq. 26, at points (n, 3)."""
        return sum(self.elastic.terms(points), weight * closest.value(points))

    def descend(self, trial: Floats, weight: float, closest: ClosestPointEnergy) -> bool:
        """Go on to a trial, or as much of the way as lowers the energy; whether all of it does."""
        before = self.energy = self.energy_of(self.points, weight, closest)
        part = 1.0
        while part >= SHORTEST:
            points = trial if part == 1.0 else self.points + part * (trial - self.points)
            energy = self.energy_of(points, weight, closest)
            if energy < before:
                self.points, self.energy = points, energy
                break
            part *= 0.5
        self.on_step(self.energy)
        return part == 1.0 or part < SHORTEST
