"""Smooth displacements of a surface that give sums of probabilities, with the least of it.

The unknowns are a displacement, a sum of wide Gaussians on the surface, and a shift of the center
of mass by cavities within the region that they reach. Each step solves the linearized sums exactly:
of all center shifts and displacements that do, it takes the displacement of least size and bending.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial.distance import cdist

from dicedesign.balance.regions import least_within
from dicedesign.concave.hull_problem import center_gradient, point_masses, spread_points
from dicedesign.errors import DiceError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.sphere import angle_between, norms
from dicedesign.geometry.triangles import Surface
from dicedesign.gradient.differentiable_rest import differentiable_rest
from dicedesign.rest.poses import RestPoses, analyze
from dicedesign.runtime.arrays import Floats, Integers

FIELDS = 120
"""Number of Gaussians, spread over the surface."""

WIDTH = 0.16
"""Width of the Gaussians, over the diagonal."""

BENT_LENGTH = 0.15
"""Length over the diagonal: waves of this length over 2 pi cost as much bending as size."""

SINGULAR = 1e-9
"""Regularization of the metric, relative to its mean diagonal; and least compliance of the sums,
relative to the largest."""

STEPS = 120
"""Maximum number of steps."""

MAX_STEP = 0.01
"""Maximum displacement, or shift of the center of mass, of a step, over the diagonal."""

PATIENCE = 8
"""Number of failed steps after which slopes are computed again."""

GOOD_STEP = 0.3
"""Error after a step over that before, up to which the slopes stay as they are."""

SHORTER = 0.5
"""Largest displacement of a try, over that of the one before."""

DECREASE = 0.01
"""Share of the predicted decrease of the error that a step must achieve (Armijo condition)."""

SAME_ANGLE = np.radians(3.0)
"""Angle to a rest of the body before within which a rest is taken to be this one."""

CENTERING = 1e-3
"""Cost of a center shift by its limits, over the cost of a displacement of all points by as much:
small, as nobody sees it."""


@dataclass(frozen=True, eq=False)
class BentSurface:
    """Surface with the target sums.

    Attributes
    ----------
    points: (n, 3) of the surface; center_of_mass: (3,), shifted by cavities.
    poses: rests; outcomes: (r,) outcome of each.
    """

    points: Floats
    center_of_mass: Floats
    poses: RestPoses
    outcomes: Integers

    def sums(self, count: int) -> Floats:
        """(k,) probabilities of a number of outcomes."""
        return np.asarray(np.bincount(self.outcomes, self.poses.probabilities, count))


@dataclass(frozen=True, eq=False)
class SmoothBending:
    """Smooth displacements of a surface with a diagonal of 1."""

    surface: Surface

    @cached_property
    def poses(self) -> RestPoses:
        """Rests of the surface before it is bent."""
        return analyze(convex_hull(self.surface.points), self.surface.centroid)

    @cached_property
    def fields(self) -> Floats:
        """(n, m) Gaussians at the points."""
        return np.asarray(np.exp(-self._squares))

    @cached_property
    def _squares(self) -> Floats:
        """(n, m) squared distances of the points from the middles of the Gaussians, over the
        squared width."""
        points = self.surface.points
        middles = points[spread_points(points, FIELDS)]
        return np.asarray(cdist(points, middles, "sqeuclidean") / WIDTH**2)

    @cached_property
    def _form(self) -> Floats:
        """(m, m) quadratic form of the fields' coefficients: the mean over the surface of the
        squared displacement, and of its squared Laplacian in space."""
        weights = point_masses(self.surface)[:, None]
        bent = (BENT_LENGTH / WIDTH) ** 2 * (4.0 * self._squares - 6.0) * self.fields
        form = self.fields.T @ (weights * self.fields) + bent.T @ (weights * bent)
        form += SINGULAR * np.trace(form) / len(form) * np.eye(len(form))
        return np.asarray(form)

    @cached_property
    def _factor(self) -> tuple[Floats, bool]:
        factor: tuple[Floats, bool] = cho_factor(self._form)
        return factor

    def bend(
        self,
        outcomes: Integers,
        target: Floats,
        tolerance: float,
        room: ConvexHull | None,
        on_step: Callable[[float, float], None],
    ) -> BentSurface | None:
        """Bend the surface until its outcomes have the target sums; None if steps stall.

        Sums have kinks wherever a path of steepest descent meets another edge, so exact slopes may
        hold for tiny steps only. Slopes are therefore corrected by what steps find, and computed
        anew only where this does not help.

        outcomes: (r,) outcome of each of `poses`; target: (k,)
        probabilities; tolerance: largest |p - q|. room: convex region of the shifts of the center
        of mass that cavities reach, around the origin; None for a solid die. on_step: receives the
        mean squared displacement and the largest |p - q| of each step.

        Source: Broyden, A class of methods for solving nonlinear simultaneous equations (1965).
        """
        count = len(target)
        now = BentSurface(self.surface.points, self.surface.centroid, self.poses, outcomes)
        # Coefficients of the fields, and the shift in the last row.
        place = np.zeros((self.fields.shape[1] + 1, 3))
        error = float(np.abs(now.sums(count) - target).max())
        radius, failures, slopes = MAX_STEP, 0, self._slopes(now, count)
        for _ in range(STEPS):
            on_step(float(np.square(norms(self.fields @ place[:-1])).mean()), error)
            if error <= tolerance:
                return now
            sums = now.sums(count)
            step = self._least(slopes, target - sums, place, room) - place
            longest = max(float(norms(self.fields @ step[:-1]).max()), float(norms(step[-1])))
            if longest == 0.0:
                return None
            size = min(1.0, radius / longest)
            step = size * step
            trial = self._follow(now, place + step)
            if trial is None:
                radius *= SHORTER
                continue
            reached = trial.sums(count)
            found = float(np.abs(reached - target).max())
            if found > GOOD_STEP * error:
                along = self._weigh(step)
                missed = reached - sums - np.einsum("kma,ma->k", slopes, step)
                slopes = slopes + missed[:, None, None] * (along / (along * step).sum())
            if found < error * (1.0 - DECREASE * size):
                now, place, error, failures = trial, place + step, found, 0
                radius = min(MAX_STEP, size * longest / SHORTER**2)
                continue
            failures += 1
            radius = SHORTER * size * longest
            if failures % PATIENCE == 0:
                if failures > 4 * PATIENCE:
                    return None
                slopes = self._slopes(trial, count)
                if failures % (2 * PATIENCE) == 0:
                    slopes = 0.5 * (slopes + self._slopes(now, count))
        return None

    def _weigh(self, place: Floats) -> Floats:
        """Gradient of the cost of coefficients and a shift (m + 1, 3)."""
        return np.concatenate([self._form @ place[:-1], CENTERING**2 * place[-1:]])

    def _least(
        self, slopes: Floats, change: Floats, place: Floats, room: ConvexHull | None
    ) -> Floats:
        """Coefficients and shift (m + 1, 3) of least cost whose sums change by (k,), for slopes
        (k, m + 1, 3) at a place (m + 1, 3)."""
        # The last sum follows from the others.
        rows, by_shift = slopes[:-1, :-1], slopes[:-1, -1]
        wanted = change[:-1] + np.einsum("kma,ma->k", slopes[:-1], place)
        compliant = cho_solve(self._factor, np.concatenate([*rows], axis=1))
        compliant = compliant.reshape(-1, len(rows), 3)
        values, vectors = np.linalg.eigh(np.einsum("kma,mja->kj", rows, compliant))
        # Rounding may leave sums that no displacement changes with any sign.
        values = np.where(values > SINGULAR * values[-1], values, np.inf)
        stiffness = (vectors / values) @ vectors.T
        shift = np.zeros(3)
        if room is not None:
            form = by_shift.T @ stiffness @ by_shift + CENTERING**2 * np.eye(3)
            slope = -by_shift.T @ stiffness @ wanted
            shift = least_within(form, slope, room.normals, room.heights(np.zeros(3)))
        forces = stiffness @ (wanted - by_shift @ shift)
        return np.vstack([np.einsum("mka,k->ma", compliant, forces), shift])

    def _follow(self, before: BentSurface, place: Floats) -> BentSurface | None:
        """Surface with other coefficients and another shift (m + 1, 3), whose rests keep the
        outcomes of those before; None if it is no body."""
        bent = self.surface.with_points(self.surface.points + self.fields @ place[:-1])
        center = bent.centroid + place[-1]
        with suppress(DiceError):
            poses = analyze(convex_hull(bent.points), center)
            angles = angle_between(poses.normals[:, None], before.poses.normals)
            rests = angles.argmin(axis=1)
            far = np.flatnonzero(angles.min(axis=1) > SAME_ANGLE)
            # Others have the outcome of the rest to which the body before rolls from there.
            rests[far] = before.poses.morse.basins_of(poses.normals[far])
            return BentSurface(bent.points, center, poses, before.outcomes[rests])
        return None

    def _slopes(self, now: BentSurface, count: int) -> Floats:
        """Derivatives (k, m + 1, 3) of the sums of the outcomes by the coefficients of the fields
        and by the shift of the center of mass."""
        points = torch.tensor(now.points, requires_grad=True)
        center = torch.tensor(now.center_of_mass, requires_grad=True)
        normals, probabilities = differentiable_rest(points, center)
        # Both lists are sorted by probability, in which nearly equal ones can change places.
        nearest = angle_between(normals.detach().numpy()[:, None], now.poses.normals)
        outcomes = torch.from_numpy(now.outcomes[nearest.argmin(axis=1)])
        sums = torch.zeros(count, dtype=torch.float64).index_add(0, outcomes, probabilities)
        rows = [torch.autograd.grad(each, (points, center), retain_graph=True) for each in sums]
        by_points, by_center = (np.stack([row[part].numpy() for row in rows]) for part in (0, 1))
        moved = center_gradient(self.surface.with_points(now.points))
        by_points += np.einsum("nab,kb->kna", moved, by_center)
        by_fields = np.einsum("nm,kna->kma", self.fields, by_points, optimize=True)
        return np.concatenate([by_fields, by_center[:, None]], axis=1)
