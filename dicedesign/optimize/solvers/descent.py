"""Steps downhill: gradients spread over the surface (Sobolev preconditioning), a line search, and
steps with momentum, which go over jumps of the energy.

The energy jumps wherever a rest comes or goes, and a line search ends in front of the first jump
up. Steps of a length that depends on time alone go on, and the design keeps the best of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.optimize.options import SobolevOptions
from dicedesign.runtime.arrays import Floats, Integers

if TYPE_CHECKING:
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import SuperLU

    from dicedesign.optimize.energy import Evaluation


def graph_laplacian(hull: ConvexHull) -> csc_array:
    """(n, n) Laplacian L of the hull's edge graph: degree on the diagonal, -1 for each edge."""
    return edge_laplacian(hull.tail, hull.head, len(hull.vertices))


def edge_laplacian(tails: Integers, heads: Integers, size: int) -> csc_array:
    """(size, size) Laplacian of any graph, whose edges (h,) are given in both directions."""
    # It takes longer to load than most dice to design, which need none.
    from scipy.sparse import csc_array, diags_array

    adjacency = csc_array((np.ones(len(tails)), (tails, heads)), shape=(size, size))
    return csc_array(diags_array(np.asarray(adjacency.sum(axis=0)).ravel()) - adjacency)


@dataclass(frozen=True)
class SobolevSolver:
    """`(I + lambda L)^-p` with its factorization, valid while the hull's edges stay.

    Attributes
    ----------
    laplacian: (n, n) symmetric positive semidefinite.
    options: lambda and p.
    """

    laplacian: csc_array
    options: SobolevOptions

    @cached_property
    def _factor(self) -> SuperLU:
        from scipy.sparse import csc_array, eye_array
        from scipy.sparse.linalg import splu

        size = self.laplacian.shape[0]
        return splu(csc_array(eye_array(size) + self.options.smoothing * self.laplacian))

    def solve(self, gradient: Floats) -> Floats:
        """Apply the operator to (n, d) right-hand sides."""
        for _ in range(self.options.power):
            gradient = self._factor.solve(gradient)
        return gradient


@dataclass
class SobolevGradient:
    """Gradients in vertices, made smooth over the hull; it keeps the factor of the last hull.

    Attributes
    ----------
    options: of the operator, or None to leave gradients as they are.
    drift: whether the mean of the hull's vertices may move.
    """

    options: SobolevOptions | None
    drift: bool = True
    _last: tuple[ConvexHull, SobolevSolver] | None = field(default=None, init=False)

    def of(self, gradient: Floats, hull: ConvexHull) -> Floats:
        """Preconditioned gradients (3 n, ...) in points, of which the hull has its vertices; 0 for
        inner points."""
        if self.options is None and self.drift:
            return gradient
        by_point = gradient.reshape(len(gradient) // 3, -1)
        spread = by_point[hull.source]
        if self.options is not None:
            if self._last is None or not _same_edges(self._last[0], hull):
                self._last = hull, SobolevSolver(graph_laplacian(hull), self.options)
            spread = self._last[1].solve(spread)
        if not self.drift:
            spread = spread - spread.mean(axis=0)
        smooth = np.zeros_like(by_point)
        smooth[hull.source] = spread
        return smooth.reshape(gradient.shape)


def _same_edges(a: ConvexHull, b: ConvexHull) -> bool:
    pairs = (a.tail, b.tail), (a.twin, b.twin)
    return len(a.vertices) == len(b.vertices) and all(np.array_equal(*pair) for pair in pairs)


FIRST_STEP: Final = 0.02
"""Step length where nothing is known of the curvature."""

SMALLEST_GUESS: Final = 1e-8
"""Step length below which no search begins."""

SMALLEST_STEP: Final = 1e-9
"""Step length at which backtracking gives up, in units of a direction clipped to size 1."""

LARGEST_STEP: Final = 10.0
"""Step length above which no search begins."""

LARGEST_MOVE: Final = 0.1
"""Largest change of any parameter in one step."""

LARGEST_SLOPE: Final = 1e100
"""Largest entry of a gradient that counts as finite: its square must be."""

SUFFICIENT_DECREASE: Final = 1e-4
"""Part of the decrease that the slope promises, at most the whole energy, which a step must
achieve."""

MEMORY: Final = 5
"""Number of last energies of which the worst is the one to get below."""


def has_slope(*directions: Floats) -> bool:
    """True where gradients and what was made of them are numbers that can be worked with."""
    return all(bool((np.abs(vector) <= LARGEST_SLOPE).all()) for vector in directions)


@dataclass
class LineSearch:
    """Backtracking from a Barzilai-Borwein guess, measured against the worst of the last steps.

    The guess knows the curvature along the last step; comparing with the worst of the last
    `MEMORY` energies rather than the last one lets it work in narrow valleys. A step is taken only
    if it makes a solid, loses no outcome, and moves no parameter by more than `LARGEST_MOVE`: far
    enough away lies another solution with another set of rests.

    That limit also damps a gradient that is large without meaning much: where a path grazes the end
    of an arc it grows without bound, and then only its direction counts. Where
    it is no number, or beyond `LARGEST_SLOPE`, there is no step.

    Sources: Barzilai and Borwein, IMA J. Numer. Anal. 8, 1988; Grippo, Lampariello and Lucidi,
    SIAM J. Numer. Anal. 23, 1986.

    Attributes
    ----------
    evaluations: energies computed so far.
    """

    evaluations: int = 0
    _energies: list[float] = field(default_factory=list)
    _last: tuple[Floats, Floats, Floats, float] | None = None
    _steps: int = 0

    def restart(self) -> None:
        """Forget the past, after a change of objective or parameters."""
        self._energies.clear()
        self._last = None

    def search(self, at: Evaluation, ascent: Floats) -> Evaluation | None:
        """An acceptable evaluation at `at.parameters - step * ascent`, or None.

        ascent: direction uphill, a preconditioned gradient with positive slope.
        """
        gradient, parameters = at.gradient, at.parameters
        if not has_slope(gradient, ascent):
            return None
        slope = float(gradient @ ascent)
        if slope <= 0.0:
            return None
        self._energies = [*self._energies[-(MEMORY - 1) :], at.value]
        bound, size = max(self._energies), float(np.abs(ascent).max())
        step = min(self._guess(parameters, gradient, ascent), LARGEST_MOVE / size)
        while step * max(1.0, size) > SMALLEST_STEP:
            self.evaluations += 1
            trial = at.objective.attempt(parameters - step * ascent, at.directions)
            enough = bound - SUFFICIENT_DECREASE * min(step * slope, at.value)
            if trial is not None and trial.value <= enough and trial.flaws <= at.flaws:
                self._last = (parameters, gradient, ascent, step)
                self._steps += 1
                return trial
            step *= 0.5
        return None

    def _guess(self, parameters: Floats, gradient: Floats, ascent: Floats) -> float:
        if self._last is None:
            return FIRST_STEP
        old_parameters, old_gradient, old_ascent, old_step = self._last
        moved, bent = parameters - old_parameters, gradient - old_gradient
        curvature = abs(float(moved @ bent))
        # The long and the short guess in turn, both in the metric of the preconditioner.
        if self._steps % 2 == 0:
            numerator, denominator = old_step * abs(float(moved @ old_gradient)), curvature
        else:
            numerator, denominator = curvature, abs(float(bent @ (ascent - old_ascent)))
        if denominator == 0.0:
            return min(2.0 * old_step, LARGEST_STEP)
        return float(np.clip(numerator / denominator, SMALLEST_GUESS, LARGEST_STEP))


LENGTH: Final = 0.004
"""Length of the first steps: root mean square of the changes of parameters, for an even slope."""

DIRECTION_MEMORY: Final = 0.9
"""Part of the mean direction that a step keeps."""

SCALE_MEMORY: Final = 0.99
"""The same of the mean square."""

LARGEST: Final = 5.0
"""Largest entry of a direction in units of the root mean square; longer ones are shortened."""

SHORTER: Final = 0.5
"""Factor on the length after a step that is refused."""

SHORTEST: Final = 0.02
"""The factors' smallest product."""

LONGER: Final = 1.1
"""Factor after one that is taken, as long as the product is below 1."""

MOST_REFUSED: Final = 12
"""Refused steps in a row after which there is no way on."""


@dataclass
class Momentum:
    """Along the mean of the last directions, in units of the root mean square of their entries.

    One number scales all entries: so a turned die is led to the turned result, and a preconditioner
    keeps its metric. Steps grow shorter by a cosine in time. A step is refused only where there is
    no solid, or an outcome would be left without a rest (or has one too many, where a term with a
    weight minds that); then the mean restarts. Of other jumps
    the energy takes no notice.

    Kingma and Ba, "Adam", ICLR 2015, with a scalar second moment.

    Attributes
    ----------
    steps: how many are made in all.
    evaluations: dice that were tried so far.
    """

    steps: int
    evaluations: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        self._length = 1.0
        self._forget()

    def _forget(self) -> None:
        self._mean: Floats | float = 0.0
        self._square, self._count = 0.0, 0

    def search(self, at: Evaluation, ascent: Floats) -> Evaluation | None:
        """The next evaluation, of higher energy or lower, or None where there is none.

        ascent: (n,) direction uphill, a preconditioned gradient.
        """
        if not has_slope(ascent):
            return None
        mean_square = float((ascent * ascent).mean())
        for _ in range(MOST_REFUSED):
            self._mean = DIRECTION_MEMORY * self._mean + (1.0 - DIRECTION_MEMORY) * ascent
            self._square = SCALE_MEMORY * self._square + (1.0 - SCALE_MEMORY) * mean_square
            self._count += 1
            direction = self._mean / (1.0 - DIRECTION_MEMORY**self._count)
            scale = np.sqrt(self._square / (1.0 - SCALE_MEMORY**self._count))
            if scale > 0.0:
                direction = direction / scale
                direction /= max(1.0, float(np.abs(direction).max()) / LARGEST)
            part = min(self.evaluations / self.steps, 1.0)
            length = 0.5 * (1.0 + np.cos(np.pi * part)) * LENGTH * self._length
            self.evaluations += 1
            trial = at.objective.attempt(at.parameters - length * direction, at.directions)
            if trial is not None and trial.flaws <= at.flaws:
                self._length = min(LONGER * self._length, 1.0)
                return trial
            self._length = max(SHORTER * self._length, SHORTEST)
            self._forget()
        return None
