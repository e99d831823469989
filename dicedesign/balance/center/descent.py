"""Descent of a sum of squares in the three coordinates of a center of mass, within half-spaces."""

from __future__ import annotations

from typing import Final

import numpy as np

from dicedesign.balance.center.objectives import Objective, ServedGoal
from dicedesign.balance.center.regions import Halfspaces
from dicedesign.balance.center.rests_at import Rests, rests_at
from dicedesign.concave.hollow.least_within import least_within
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.runtime.arrays import Floats

__all__ = ["Descent"]

ENOUGH: Final = 1e-12
"""Root of the sum of squares at which odds are as wanted."""

DAMPING: Final = (1e-3, 0.2, 8.0, 1e12)
"""Of the first step, relative to the largest squared slope; its factors after a step that was taken
and after one that was not; and the most, where the descent stops."""

FIRST_SEARCH: Final = 0.02
"""Length of the first steps along the axes, over the size of the body."""

LAST_SEARCH: Final = 1e-5
"""Length below which none is tried."""


class Descent:
    """Descents of one objective for one hull.

    share: how much it counts that little is left to other poses.
    """

    def __init__(
        self, hull: ConvexHull, objective: Objective, within: Halfspaces, share: float
    ) -> None:
        self.hull, self.objective, self.within, self.share = hull, objective, within, share

    def value(self, center: Floats) -> float:
        """The sum of squares, infinite where the center of mass (3,) is not allowed."""
        return self._served(center)[0]

    def from_center(self, center: Floats, steps: int) -> tuple[Floats, float]:
        """The center of mass that is reached, and the sum of squares there.

        Steps are those of Levenberg and Marquardt, each the least of its quadratic model within the
        half-spaces; where no such step leads down, as the odds jump or have a kink, steps along the
        axes are tried, of smaller and smaller length. steps: most of each.
        """
        value = self.value(center)
        for _ in range(3):
            center, now = self.by_squares(center, value, steps)
            center, now = self._along_axes(center, now, steps)
            if now <= ENOUGH**2 or now >= (1.0 - 1e-6) * value:
                return center, now
            value = now
        return center, value

    def by_squares(self, center: Floats, value: float, steps: int) -> tuple[Floats, float]:
        """The same by steps of Levenberg and Marquardt alone; value: the sum of squares at the
        start."""
        damping, factor_less, factor_more, most = DAMPING
        found = self._served(center)
        for _ in range(steps):
            value, rests, served = found
            if rests is None or served is None or value <= ENOUGH**2:
                break
            slopes = rests.slopes(served.weights)
            form, slope = slopes.T @ slopes, slopes.T @ served.residuals
            largest = float(np.diag(form).max())
            heights = self.within.heights(center).clip(0.0)
            while damping <= most and largest > 0.0:
                damped = form + damping * largest * np.eye(3)
                step = least_within(damped, slope, self.within.normals, heights)
                following = self._served(center + step)
                if following[0] < value:
                    center, found, damping = center + step, following, damping * factor_less
                    break
                damping *= factor_more
            else:
                break
            if found[0] > (1.0 - 1e-9) * value:
                break
        return center, found[0]

    def _served(self, center: Floats) -> tuple[float, Rests | None, ServedGoal | None]:
        if (self.within.heights(center) < -1e-12 * self.hull.diameter).any():
            return np.inf, None, None
        rests = rests_at(self.hull, center)
        if rests is None:
            return np.inf, None, None
        served = self.objective(rests, self.share)
        return float(served.residuals @ served.residuals), rests, served

    def _along_axes(self, center: Floats, value: float, steps: int) -> tuple[Floats, float]:
        length = FIRST_SEARCH * self.hull.diameter
        axes = np.concatenate([np.eye(3), -np.eye(3)])
        for _ in range(steps):
            if value <= ENOUGH**2 or length < LAST_SEARCH * self.hull.diameter:
                break
            values = [self.value(center + length * axis) for axis in axes]
            least = int(np.argmin(values))
            if values[least] < value:
                center, value = center + length * axes[least], values[least]
            else:
                length *= 0.5
        return center, value
