"""Axes of charts, their ticks, and the place between them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from dicedesign.runtime.arrays import Floats

__all__ = ["Axes", "Axis"]

_MOST_TICKS: Final = 9

_RAISED: Final = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class Axis:
    """One axis of a chart.

    Attributes
    ----------
    low, high: values at its ends, low below high; both above 0 on a logarithmic one.
    label: beside it.
    log: whether it is logarithmic.
    ticks: places and texts, or None for round values.
    shown: whether ticks have texts.
    zero: whether values of zero are drawn at the lower end of a logarithmic axis, marked 0.
    """

    low: float
    high: float
    label: str = ""
    log: bool = False
    ticks: Sequence[tuple[float, str]] | None = None
    shown: bool = True
    zero: bool = False

    def shares(self, values: ArrayLike) -> Floats:
        """Where values (n,) are along it, from 0 to 1."""
        places, low, high = np.asarray(values, dtype=np.float64), self.low, self.high
        if self.log:
            places, low, high = np.log10(places), math.log10(low), math.log10(high)
        return np.asarray((places - low) / (high - low))

    def marks(self) -> list[tuple[float, str]]:
        """Places and texts of its ticks."""
        if self.ticks is not None:
            return list(self.ticks)
        marks = _decades(self.low, self.high) if self.log else _round_values(self.low, self.high)
        return [(self.low, "0"), *marks] if self.zero else marks


def _decades(low: float, high: float) -> list[tuple[float, str]]:
    first, last = math.ceil(math.log10(low) - 1e-9), math.floor(math.log10(high) + 1e-9)
    step = -(-(last - first + 1) // _MOST_TICKS)
    powers = [power for power in range(first, last + 1) if power % step == 0]
    return [(10.0**power, "10" + str(power).translate(_RAISED)) for power in powers]


def _round_values(low: float, high: float) -> list[tuple[float, str]]:
    rough = (high - low) / _MOST_TICKS
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(step * power for step in (1.0, 2.0, 2.5, 5.0, 10.0) if step * power >= rough)
    decimals = max(0, -math.floor(math.log10(step) + 1e-9))
    decimals += round(step * 10.0**decimals, 6) % 1.0 > 0.0
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    values = [number * step for number in range(first, last + 1)]
    return [(value, f"{value:,.{decimals}f}") for value in values]


@dataclass
class Axes:
    """Two axes.

    Attributes
    ----------
    box: left, top, right and lower border of the place between them, in pixels.
    x, y: the axes.
    """

    box: tuple[float, float, float, float]
    x: Axis
    y: Axis

    def places(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """Places (n, 2) on paper of values x (n,) and y (n,)."""
        left, top, right, bottom = self.box
        columns = left + self.x.shares(x) * (right - left)
        rows = bottom - self.y.shares(y) * (bottom - top)
        return np.stack(np.broadcast_arrays(columns, rows), axis=-1)
