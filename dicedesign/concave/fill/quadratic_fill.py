"""Hull fill by quadratic programs: a surface grows inside a wanted hull until it spans it.

As in appendix B.1, but for the corners of the hull, which draw on points of their own rather than
on the nearest of the surface: more and more strongly at first, until those points are put in place
exactly and the others follow.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np
from scipy.sparse import csc_array, diags_array, eye_array

from dicedesign.concave.fill.elastic_energy import ElasticEnergy
from dicedesign.concave.fill.quadratic_program import NO_SUMS, PointsInside
from dicedesign.concave.fill.result import FillResult, FillStatus, OnEnergy
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["fill_by_quadratic_programs"]

MARGIN: Final = 1e-6
"""Depth inside the hull, over the diagonal of the surface, that all points keep which are not put
onto a corner: the corners alone then span the hull, in single precision too."""

PROXIMAL: Final = 1e-6
"""Weight of squared moves: the elastic energy leaves some free."""

SHORTEST: Final = 1e-3
"""Part of a step below which none is taken."""

CLOSENESS: Final = (1.0, 10.0, 100.0)
"""Weights, step by step, of the mean squared distance of the hull's corners from their points, over
the squared diagonal."""

MOST_STEPS: Final = 20
"""Steps once the corners are in place."""

SETTLED: Final = 5e-3
"""Part of the energy that a last step must be worth."""


def fill_by_quadratic_programs(
    surface: Surface, hull: ConvexHull, corners: Integers, center_of_mass: Floats, on_step: OnEnergy
) -> FillResult:
    """Deform a surface as little as may be until its convex hull is a wanted one.

    The hull of the result has the corners of the wanted one to the last bit, and no other, unless
    the status says otherwise. The last steps lead to the center of mass: each meets it to first
    order, and `balance` does the rest.

    Parameters
    ----------
    surface: the reference of the elastic energy, and the start.
    hull: wanted.
    corners: (k,) different points of the surface that become the hull's corners, in the order of
        `hull.vertices`.
    center_of_mass: (3,) wanted for the uniform solid.
    on_step: see `OnEnergy`.

    Raises
    ------
    InputError: a triangle without area; Clarabel is not installed.
    """
    return _Fill(surface, hull, corners, center_of_mass, on_step).run()


class _Unsolved(Exception):
    """A quadratic program has no solution that can be found, or a triangle has become flat."""


@dataclass(eq=False)
class _Fill:
    """One fill, in units of the surface's diagonal about the hull's centroid."""

    surface: Surface
    hull: ConvexHull
    corners: Integers
    center_of_mass: Floats
    on_step: OnEnergy

    def __post_init__(self) -> None:
        self.unit, self.middle = self.surface.diagonal, self.hull.centroid
        self.scaled = self.surface.moved((self.surface.points - self.middle) / self.unit)
        self.targets = (self.hull.vertices - self.middle) / self.unit
        self.wanted_center = (self.center_of_mass - self.middle) / self.unit
        heights = self.hull.heights(self.middle) / self.unit
        self.inside = PointsInside(self.hull.normals, heights - MARGIN)
        self.elastic = ElasticEnergy.of(self.scaled)
        self.centering = 1.0
        self.points = self.inside.largest(self.scaled.points, self.scaled.centroid)

    def run(self) -> FillResult:
        status = FillStatus.UNSOLVED
        self.energy = self.drawn_energy(CLOSENESS[0], self.points)
        self.on_step(self.energy)
        with suppress(_Unsolved):
            for closeness in CLOSENESS:
                self.draw(closeness)
            status = self.settle()
        points = self.points * self.unit + self.middle
        if status is not FillStatus.UNSOLVED:
            points[self.corners] = self.hull.vertices
        return FillResult(points, self.energy, status)

    def drawn_energy(self, closeness: float, points: Floats) -> float:
        """The elastic energy, and that of the corners that draw on their points with a weight."""
        distances = norms(points[self.corners] - self.targets)
        drawn = closeness * float((distances * distances).mean())
        return sum(self.elastic.terms(points), drawn)

    def settled_energy(self, points: Floats) -> float:
        """The elastic energy, and the penalty on the center of mass."""
        return sum((*self.elastic.terms(points), self.centering * float(norms(self.miss(points)))))

    def miss(self, points: Floats) -> Floats:
        """(3,) from the center of mass to the wanted one."""
        return np.asarray(self.wanted_center - self.scaled.moved(points).centroid)

    def draw(self, closeness: float) -> None:
        """One step of eq. 29 and 30."""
        gradient, hessian = self.elastic.model(self.points)
        weights = np.zeros_like(self.points)
        weights[self.corners] = 2.0 * closeness / len(self.corners)
        gradient[self.corners] += weights[self.corners] * (self.points[self.corners] - self.targets)
        hessian = hessian + diags_array(weights.ravel(), format="csc")
        move = self.move(gradient, hessian, np.empty(0, dtype=np.int64), np.empty((0, 3)))
        self.descend(self.inside.mended(self.points + move), partial(self.drawn_energy, closeness))

    def settle(self) -> FillStatus:
        """Put the corners' points in place, and the others where the elastic energy is least."""
        gradient, hessian = self.elastic.model(self.points)
        to_targets = self.targets - self.points[self.corners]
        self.points = self.in_place(self.move(gradient, hessian, self.corners, to_targets))
        self.energy = self.settled_energy(self.points)
        self.on_step(self.energy)
        if not np.isfinite(self.energy):
            raise _Unsolved
        for _ in range(MOST_STEPS):
            gradient, hessian = self.elastic.model(self.points)
            miss = self.miss(self.points)
            sums = self.scaled.moved(self.points).centroid_derivatives(), miss
            still = np.zeros_like(self.targets)
            move = self.move(gradient, hessian, self.corners, still, sums)
            self.raise_centering(move, gradient, hessian, float(norms(miss)))
            before = self.settled_energy(self.points)
            self.descend(self.in_place(move), self.settled_energy)
            if before - self.energy <= SETTLED * before:
                return FillStatus.FITTED
        return FillStatus.STEP_LIMIT

    def in_place(self, move: Floats) -> Floats:
        """(n, 3) the points after a move, the corners' where they belong and the others inside."""
        points = self.inside.mended(self.points + move)
        points[self.corners] = self.targets
        return points

    def raise_centering(
        self, move: Floats, gradient: Floats, hessian: csc_array, distance: float
    ) -> None:
        """Let what a move brings to the center of mass, which is some distance off, outweigh what
        it costs in energy (Nocedal and Wright, Numerical Optimization, eq. 18.36)."""
        if distance > 0.0:
            flat = move.ravel()
            cost = float(gradient.ravel() @ flat + 0.5 * flat @ (hessian @ flat))
            self.centering = max(self.centering, 2.0 * cost / distance)

    def move(
        self,
        gradient: Floats,
        hessian: csc_array,
        known: Integers,
        moves: Floats,
        sums: tuple[Floats, Floats] = NO_SUMS,
    ) -> Floats:
        """(n, 3) to the minimum of a model of the energy, inside the hull."""
        hessian = csc_array(hessian + PROXIMAL * eye_array(hessian.shape[0]))
        move = self.inside.step(self.points, hessian, gradient, known, moves, sums)
        if move is None:
            raise _Unsolved
        return move

    def descend(self, trial: Floats, energy_of: Callable[[Floats], float]) -> None:
        """Go on to a trial, or as much of the way as lowers the energy."""
        self.energy = energy_of(self.points)
        part = 1.0
        while part >= SHORTEST:
            points = trial if part == 1.0 else self.points + part * (trial - self.points)
            energy = energy_of(points)
            if energy < self.energy:
                self.points, self.energy = points, energy
                break
            part *= 0.5
        self.on_step(self.energy)
