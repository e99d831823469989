"""Balance: move a surface's center of mass while its convex hull stays as it is.

Source: appendix B.2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dicedesign.concave.elastic_energy import ElasticEnergy
from dicedesign.concave.options import ConcavePaperOptions
from dicedesign.concave.result import FillResult, FillStatus, OnEnergy
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.triangles import Surface
from dicedesign.optimize.options import SobolevOptions
from dicedesign.optimize.solvers.sobolev import SobolevSolver, edge_laplacian
from dicedesign.runtime.arrays import Floats

DEPTH = 1e-7
"""Depth inside the hull, over the diagonal, at which points do not move any more. The corners do
not move at all."""

BOLDEST = 0.5
"""Part of its distance from the hull that no point moves farther than in one step."""

SHORTEST = 1e-6
"""Part of the boldest step below which none is taken."""

NEAR = 1e-3
"""Distance of the center of mass, over the diagonal, from which on Newton's method takes over."""

HEAVIEST = 1e6
"""lambda_CoM, in units of that of the first steps, beyond which it does not grow."""

STEPS = 20
"""Most steps at each weight."""

DECREASE = 1e-4
"""Part of the decrease that the slope promises which a step must achieve."""

EXACT = 1e-13
"""Distance of the center of mass, over the diagonal, at which Newton's method ends."""

CONTENT = 1e-9
"""The same with which the balance is content."""

REFINED = 100
"""Most steps of Newton's method."""

USEFUL = 0.999
"""Part of the distance of the center of mass that may be left by a step with another after it."""


def balance(
    reference: Surface,
    filled: Surface,
    hull: ConvexHull,
    center_of_mass: Floats,
    options: ConcavePaperOptions,
    on_step: OnEnergy,
) -> FillResult:
    """Move a surface's center of mass to where it is wanted, the hull staying as it is to the last
    bit.

    First-order steps on the energy with a weight that grows (eq. 31, 35), and Newton's method for
    the center of mass alone, with moves of the same kind, for the rest; see `hull_keeping_moves`.

    Parameters
    ----------
    reference: of the elastic energy.
    filled: the same triangles in the hull, as `fill_by_quadratic_programs` leaves them.
    hull: of `filled`.
    center_of_mass: (3,) wanted for the uniform solid, strictly inside the hull.
    options: lambda_CoM, lambda_m, lambda_b, the growth of the first, gamma and p.
    on_step: see `OnEnergy`.

    Raises
    ------
    InputError: a triangle of the reference has no area.
    """
    return _Balance(reference, filled, hull, center_of_mass, options, on_step).run()


def centering_gradient(surface: Surface, center_of_mass: Floats) -> Floats:
    """(n, 3) of the squared distance E_CoM of a surface's center of mass from a place (3,) (eq. 33,
    34)."""
    offset = surface.centroid - center_of_mass
    return np.asarray(2.0 * np.tensordot(offset, surface.centroid_derivatives(), 1))


def hull_keeping_moves(
    sobolev: SobolevSolver, depths: Floats, gradients: Floats
) -> tuple[Floats, Floats]:
    """Gradients (n, 3, ...) spread over a surface, as moves `D (I + gamma L)^-p D g` of the same
    shape, and how far these go over the depths.

    sobolev: applies `(I + gamma L)^-p`; depths: (n,) diagonal of D, distances from the hull.

    Source: eq. 35, but for the second D: with it the operator is symmetric, and each move goes
    downhill.
    """
    flat = gradients.reshape(len(gradients), -1)
    spread = sobolev.solve(depths[:, None] * flat)
    return (depths[:, None] * spread).reshape(gradients.shape), spread.reshape(gradients.shape)


@dataclass(eq=False)
class _Balance:
    """One balance, in units of the reference's diagonal about the wanted center of mass."""

    reference: Surface
    filled: Surface
    hull: ConvexHull
    center_of_mass: Floats
    options: ConcavePaperOptions
    on_step: OnEnergy

    def __post_init__(self) -> None:
        unit = self.reference.diagonal
        scaled = self.reference.moved(self.reference.points / unit)
        self.surface = self.filled.moved((self.filled.points - self.center_of_mass) / unit)
        self.heights = self.hull.heights(self.center_of_mass) / unit
        self.elastic = ElasticEnergy.of(scaled, self.options.membrane, self.options.bending)
        self.sobolev = SobolevSolver(
            # A closed oriented surface passes each edge once in each direction.
            edge_laplacian(
                scaled.triangles.ravel(),
                np.roll(scaled.triangles, -1, axis=1).ravel(),
                len(scaled.points),
            ),
            SobolevOptions(self.options.gamma, self.options.power),
        )
        self.weight = self.options.center_of_mass
        self.part = 1.0

    def run(self) -> FillResult:
        self.on_step(self.energy(self.surface))
        while self.error > NEAR and self.weight <= HEAVIEST * self.options.center_of_mass:
            for _ in range(STEPS):
                if self.error <= NEAR or not self.descend():
                    break
            self.weight *= self.options.growth
        for _ in range(REFINED):
            before = self.error
            if before <= EXACT or not self.refine() or self.error > USEFUL * before:
                break
        met = self.error <= CONTENT
        points = self.surface.points * self.reference.diagonal + self.center_of_mass
        still = self.depths() == 0.0
        points[still] = self.filled.points[still]
        status = FillStatus.FITTED if met else FillStatus.NO_PROGRESS
        return FillResult(points, self.energy(self.surface), status)

    @property
    def error(self) -> float:
        """Distance of the center of mass from where it is wanted."""
        return float(norms(self.surface.centroid))

    def depths(self) -> Floats:
        """(n,) distances of the points from the hull, 0 for those that may not move."""
        slacks = (self.heights - self.surface.points @ self.hull.normals.T).min(axis=1)
        return np.maximum(slacks - DEPTH, 0.0)

    def moves(self, gradients: Floats) -> tuple[Floats, Floats]:
        """See `hull_keeping_moves`."""
        return hull_keeping_moves(self.sobolev, self.depths(), gradients)

    def energy(self, surface: Surface) -> float:
        """That of a surface, with the weight of centering as it is now."""
        centroid = surface.centroid
        return self.elastic.value(surface.points) + self.weight * float(centroid @ centroid)

    def descend(self) -> bool:
        """One step of eq. 35; whether there was any."""
        surface = self.surface
        gradient = self.weight * centering_gradient(surface, np.zeros(3))
        gradient = gradient + self.elastic.gradient(surface.points)
        move, reach = self.moves(gradient)
        slope = float((gradient * move).sum())
        longest = BOLDEST / max(float(norms(reach).max()), np.finfo(np.float64).tiny)
        before = self.energy(surface)
        self.part = min(1.0, 4.0 * self.part)
        while self.part >= SHORTEST:
            step = self.part * longest
            trial = surface.moved(surface.points - step * move)
            if self.energy(trial) <= before - DECREASE * step * slope:
                self.surface = trial
                self.on_step(self.energy(self.surface))
                return True
            self.part *= 0.5
        self.part = 1.0
        return False

    def refine(self) -> bool:
        """One step of Newton's method for the center of mass, as far as the hull allows; whether
        any point may move."""
        derivatives = self.surface.centroid_derivatives()
        moves, reaches = self.moves(np.moveaxis(derivatives, 0, -1))
        system = np.einsum("kni,nij->kj", derivatives, moves)
        multipliers = np.linalg.lstsq(system, -self.surface.centroid, rcond=None)[0]
        longest = float(norms(reaches @ multipliers).max())
        if longest == 0.0:
            return False
        part = min(1.0, BOLDEST / longest)
        self.surface = self.surface.moved(self.surface.points + part * (moves @ multipliers))
        self.on_step(self.energy(self.surface))
        return True
