"""Descent steps: Sobolev preconditioning of gradients, a line search, and steps with momentum.

The energy jumps wherever a rest comes or goes, and a line search ends at the first jump up. Steps
whose lengths depend on time alone continue, and the design keeps the best of them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.optimize.options import SobolevOptions
from dicedesign.runtime.arrays import Floats, Integers

if TYPE_CHECKING:
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import SuperLU

    from dicedesign.optimize.energy import Evaluation


def graph_laplacian(hull: ConvexHull) -> csc_array:
    """(n, n) Laplacian of the edge graph of a hull: degrees on the diagonal, -1 for each edge."""
    return edge_laplacian(hull.tail, hull.head, len(hull.vertices))


def edge_laplacian(tails: Integers, heads: Integers, size: int) -> csc_array:
    """(size, size) Laplacian of a graph whose edges (h,) are given in both directions."""
    # Loading takes longer than most designs, which do without.
    from scipy.sparse import csc_array, diags_array

    adjacency = csc_array((np.ones(len(tails)), (tails, heads)), shape=(size, size))
    return csc_array(diags_array(np.asarray(adjacency.sum(axis=0)).ravel()) - adjacency)


@dataclass(frozen=True)
class SobolevSolver:
    """`(I + lambda L)^-p` with its factorization.

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
    """Preconditioner of gradients in vertices, which keeps the factorization for the last hull.

    Attributes
    ----------
    options: of the operator, or None for the identity.
    drift: whether the mean of the hull's vertices may move.
    """

    options: SobolevOptions | None
    drift: bool = True
    _last: tuple[ConvexHull, SobolevSolver] | None = field(default=None, init=False)

    def of(self, gradient: Floats, hull: ConvexHull) -> Floats:
        """Preconditioned gradients (3 n, ...) in points; 0 for points inside the hull."""
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


FIRST_STEP = 0.02
"""Step length without a known curvature."""

SMALLEST_GUESS = 1e-8
"""Least first step length of a search."""

SMALLEST_STEP = 1e-9
"""Least step length of backtracking, for a direction clipped to size 1."""

LARGEST_STEP = 10.0
"""Largest first step length of a search."""

LARGEST_MOVE = 0.1
"""Largest change of any parameter in one step."""

LARGEST_SLOPE = 1e100
"""Largest entry of a usable gradient, whose square must be finite."""

SUFFICIENT_DECREASE = 1e-4
"""Armijo constant: least decrease of an accepted step, over the decrease by its slope or the whole
energy."""

MEMORY = 5
"""Number of last energies, the worst of which is the reference of a step."""


def has_slope(*directions: Floats) -> bool:
    """Whether all entries of gradients and directions are usable."""
    return all(bool((np.abs(vector) <= LARGEST_SLOPE).all()) for vector in directions)


@dataclass
class LineSearch:
    """Nonmonotone backtracking line search from a Barzilai-Borwein step length.

    The step length uses the curvature along the last step. A step must improve on the worst of the
    last `MEMORY` energies, which works in narrow valleys. It must also make a solid, lose no
    outcome, and move no parameter by more than `LARGEST_MOVE`, as other solutions with other rests
    are farther away.

    That limit also damps gradients that are large where a path grazes the end of an arc; only their
    direction counts then. Gradients that are not finite, or beyond `LARGEST_SLOPE`, end the search.

    Sources: Barzilai and Borwein, IMA J. Numer. Anal. 8, 1988; Grippo, Lampariello and Lucidi,
    SIAM J. Numer. Anal. 23, 1986.
    """

    _energies: list[float] = field(default_factory=list)
    _last: tuple[Floats, Floats, Floats, float] | None = None
    _steps: int = 0

    def restart(self) -> None:
        """Forget earlier steps after a change of objective or parameters."""
        self._energies.clear()
        self._last = None

    def search(self, at: Evaluation, ascent: Floats) -> Evaluation | None:
        """Acceptable evaluation at `at.parameters - step * ascent`, or None.

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
        # The long and the short step length in turn, in the metric of the preconditioner.
        if self._steps % 2 == 0:
            numerator, denominator = old_step * abs(float(moved @ old_gradient)), curvature
        else:
            numerator, denominator = curvature, abs(float(bent @ (ascent - old_ascent)))
        if denominator == 0.0:
            return min(2.0 * old_step, LARGEST_STEP)
        return float(np.clip(numerator / denominator, SMALLEST_GUESS, LARGEST_STEP))


LENGTH = 0.004
"""Length of the first steps: root mean square change of the parameters, for an even slope."""

DIRECTION_MEMORY = 0.9
"""Decay of the mean direction per step."""

SCALE_MEMORY = 0.99
"""Decay of the mean square per step."""

LARGEST = 5.0
"""Limit on the entries of a direction, in units of the root mean square."""

SHORTER = 0.5
"""Factor on the length after a refused step."""

SHORTEST = 0.02
"""Least product of the factors."""

LONGER = 1.1
"""Factor on the length after an accepted step, while the product is below 1."""

MOST_REFUSED = 12
"""Limit on successive refused steps."""


@dataclass
class Momentum:
    """Steps along the mean of the last directions, in units of their root mean square entry.

    One number scales all entries, so that the result turns with the die and a preconditioner keeps
    its metric. Step lengths decrease by a cosine in time. A step is refused only if it makes no
    solid, or leaves an outcome without a rest; then the mean restarts. Other jumps of the energy
    are ignored.

    Source: Kingma and Ba, "Adam", ICLR 2015, with a scalar second moment.

    Attributes
    ----------
    steps: number of steps in all.
    evaluations: number of dice tried so far.
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
        """Next evaluation, of any energy and refreshed, or None if all tries are refused.

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
                trial = trial.refresh()
                if np.isfinite(trial.value):
                    self._length = min(LONGER * self._length, 1.0)
                    return trial
            self._length = max(SHORTER * self._length, SHORTEST)
            self._forget()
        return None
