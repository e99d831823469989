"""Balance: move a surface's center of mass while its convex hull stays as it is.

Source: appendix B.2.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from dicedesign.concave.fill.elastic_energy import SOFT, ElasticEnergy, ElasticWeights
from dicedesign.concave.fill.result import FillResult, FillStatus, FillStep
from dicedesign.design.options import SobolevOptions
from dicedesign.design.solvers.sobolev import SobolevSolver, edge_laplacian
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Floats
from dicedesign.runtime.registry import STRICT

__all__ = ["BalanceOptions", "balance"]

OnStep = Callable[[FillStep], None]

DEPTH: Final = 1e-7
"""Depth inside the hull, over the diagonal, at which points do not move any more. The corners do
not move at all."""

BOLDEST: Final = 0.5
"""Part of its distance from the hull that no point moves farther than in one step."""

SHORTEST: Final = 1e-6
"""Part of the boldest step below which none is taken."""

NEAR: Final = 1e-3
"""Distance of the center of mass, over the diagonal, from which on Newton's method takes over."""

HEAVIEST: Final = 1e4
"""Weight of centering over that of the first steps beyond which it does not grow."""

DECREASE: Final = 1e-4
"""Part of the decrease that the slope promises which a step must achieve."""

EXACT: Final = 1e-13
"""The same at which it ends."""

REFINED: Final = 100
"""Most steps of Newton's method."""

USEFUL: Final = 0.999
"""Part of the distance of the center of mass that may be left by a step with another after it."""

SMOOTH: Final = SobolevOptions(smoothing=5.0, power=2)
"""Spreads a gradient over a few edges. More leaves a surface whose folds follow those of the
distance from the hull."""


@dataclass(frozen=True)
class BalanceOptions:
    """Options of the balance.

    Attributes
    ----------
    elastic: weights of membrane and bending energy.
    sobolev: smoothing and power of the operator that spreads gradients over the surface.
    centering: weight of the squared distance of the center of mass from where it is wanted, over
        the squared diagonal, in the first steps; positive.
    growth: factor by which that weight grows, above 1.
    steps: most steps at each weight, at least 1.
    tolerance: distance of the center of mass, over the diagonal, with which the balance is content;
        from 1e-12 on and below 1.
    """

    __pydantic_config__ = STRICT

    elastic: ElasticWeights = SOFT
    sobolev: SobolevOptions = SMOOTH
    centering: float = 100.0
    growth: float = 3.0
    steps: int = 20
    tolerance: float = 1e-9

    def __post_init__(self) -> None:
        if not 0.0 < self.centering < np.inf:
            raise InputError(
                f"centering: expected a positive number, got {self.centering:g}; leave it out for "
                "100"
            )
        if not 1.0 < self.growth < np.inf:
            raise InputError(
                f"growth: expected a number above 1, got {self.growth:g}; leave it out for 3"
            )
        if self.steps < 1:
            raise InputError(
                f"steps: expected a whole number above 0, got {self.steps}; leave it out for 20"
            )
        if not 1e-12 <= self.tolerance < 1.0:
            raise InputError(
                f"tolerance: expected a number from 1e-12 on and below 1, got {self.tolerance:g}; "
                "leave it out for 1e-9"
            )


def balance(
    reference: Surface,
    filled: Surface,
    hull: ConvexHull,
    center_of_mass: Floats,
    options: BalanceOptions,
    *,
    on_step: OnStep | None = None,
) -> FillResult:
    """Move a surface's center of mass to where it is wanted, the hull staying as it is to the last
    bit.

    First-order steps on the energy with a weight that grows (eq. 31, 35), and Newton's method for
    the center of mass alone, with moves of the same kind, for the rest. The paper multiplies the
    smoothed gradient by the distance of each point from the hull; here the gradient is multiplied
    by it too, which makes the operator symmetric, so that each step goes downhill.

    Parameters
    ----------
    reference: of the elastic energy.
    filled: the same triangles in the hull, as `fill_by_quadratic_programs` makes them.
    hull: of `filled`.
    center_of_mass: (3,) wanted for the uniform solid, strictly inside the hull.
    options: see `BalanceOptions`.
    on_step: called after every accepted step.

    Raises
    ------
    InputError: the center of mass is not inside the hull; a triangle of the reference without area.
    """
    depth = float(hull.heights(center_of_mass).min()) / reference.diagonal
    if not depth > 0.0:
        raise InputError(
            f"center of mass: expected one inside the hull, got one {-depth:.3g} diagonals outside "
            "or on it; move it inward"
        )
    return _Balance(reference, filled, hull, center_of_mass, options, on_step).run()


@dataclass(eq=False)
class _Balance:
    """One balance, in units of the reference's diagonal about the wanted center of mass."""

    reference: Surface
    filled: Surface
    hull: ConvexHull
    center_of_mass: Floats
    options: BalanceOptions
    on_step: OnStep | None
    history: list[FillStep] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.started = time.perf_counter()
        unit = self.reference.diagonal
        scaled = self.reference.moved(self.reference.points / unit)
        self.surface = self.filled.moved((self.filled.points - self.center_of_mass) / unit)
        self.heights = self.hull.heights(self.center_of_mass) / unit
        self.elastic = ElasticEnergy.of(scaled, self.options.elastic)
        self.sobolev = SobolevSolver(
            # A closed oriented surface passes each edge once in each direction.
            edge_laplacian(
                scaled.triangles.ravel(),
                np.roll(scaled.triangles, -1, axis=1).ravel(),
                len(scaled.points),
            ),
            self.options.sobolev,
        )
        self.weight = self.options.centering
        self.part = 1.0

    def run(self) -> FillResult:
        self.record()
        while self.error > NEAR and self.weight <= HEAVIEST * self.options.centering:
            for _ in range(self.options.steps):
                if self.error <= NEAR or not self.descend():
                    break
            self.weight *= self.options.growth
        for _ in range(REFINED):
            before = self.error
            if before <= EXACT or not self.refine() or self.error > USEFUL * before:
                break
        met = self.error <= self.options.tolerance
        points = self.surface.points * self.reference.diagonal + self.center_of_mass
        still = self.depths() == 0.0
        points[still] = self.filled.points[still]
        return FillResult(
            points,
            self.history[-1].gap,
            tuple(self.history),
            FillStatus.FITTED if met else FillStatus.NO_PROGRESS,
        )

    @property
    def error(self) -> float:
        """Distance of the center of mass from where it is wanted."""
        return float(norms(self.surface.centroid))

    def depths(self) -> Floats:
        """(n,) distances of the points from the hull, 0 for those that may not move."""
        slacks = (self.heights - self.surface.points @ self.hull.normals.T).min(axis=1)
        return np.maximum(slacks - DEPTH, 0.0)

    def moves(self, gradients: Floats) -> tuple[Floats, Floats]:
        """Gradients (n, 3, d) spread over the surface, as moves (n, 3, d), and how far these go
        over the points' distances from the hull (n, 3, d)."""
        depths = self.depths()[:, None]
        flat = gradients.reshape(len(gradients), -1)
        spread = self.sobolev.solve(depths * flat)
        return (depths * spread).reshape(gradients.shape), spread.reshape(gradients.shape)

    def terms(self, surface: Surface) -> dict[str, float]:
        centroid = surface.centroid
        center = self.weight * float(centroid @ centroid)
        return {"centering": center, **self.elastic.terms(surface.points)}

    def descend(self) -> bool:
        """One step of eq. 35; whether there was any."""
        surface = self.surface
        centering = (
            2.0 * self.weight * np.tensordot(surface.centroid, surface.centroid_derivatives(), 1)
        )
        gradient = centering + self.elastic.gradient(surface.points)
        move, reach = self.moves(gradient)
        slope = float((gradient * move).sum())
        longest = BOLDEST / max(float(norms(reach).max()), np.finfo(np.float64).tiny)
        before = sum(self.terms(surface).values())
        self.part = min(1.0, 4.0 * self.part)
        while self.part >= SHORTEST:
            step = self.part * longest
            trial = surface.moved(surface.points - step * move)
            if sum(self.terms(trial).values()) <= before - DECREASE * step * slope:
                self.surface = trial
                self.record()
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
        self.record()
        return True

    def record(self) -> None:
        """Note where the surface is."""
        slacks = self.heights - self.surface.points @ self.hull.normals.T
        seconds = time.perf_counter() - self.started
        outside = max(-float(slacks.min()), 0.0)
        step = FillStep(len(self.history), seconds, self.terms(self.surface), 0.0, outside)
        self.history.append(step)
        if self.on_step is not None:
            self.on_step(step)
