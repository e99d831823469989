"""How far the odds of prints are from those that were designed, to first order.

A print differs from its file in the place of each facet, in its length along each axis of the
printer, in its density from bottom to top and by a bubble. With the derivatives of the odds these
give the covariance of the odds among prints; and Pearson's test says how large it may be.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Final

import numpy as np

from dicedesign.fabricate.print_odds.odds_slopes import OddsSlopes
from dicedesign.fabricate.print_odds.off_prints import OffPrints
from dicedesign.fabricate.printing.print_errors import PrintErrors
from dicedesign.results.print_odds import PrintTolerances
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.statistics.chi_square_power import LEVEL, chance_noticed

__all__ = ["NOTICED", "ROLLS", "OddsSpread", "allowed_offset", "print_tolerances"]

ROLLS: Final = 1000
"""Of the test that is not to notice."""

NOTICED: Final = 0.1
"""Part of the prints that the test may notice: twice as many as of perfect dice."""

FINENESS: Final = 1e-6
"""Part of the die's size to which the allowed offset is found."""

DOUBT: Final = 0.03
"""Part that may be noticed beyond that of the prints that are made: their own chance."""

HALVINGS: Final = 10
"""Of the range of offsets where those of the derivatives are too large."""

NEVER: Final = 1.0
"""Offset, over the die's size, beyond which nobody asks whether a test notices."""


@dataclass(frozen=True, eq=False)
class OddsSpread:
    """Covariances of a die's odds among its prints.

    Attributes
    ----------
    slopes: the derivatives of the odds.
    errors: what differs from print to print.
    has_planes: whether the places of whole facets differ; else, on a surface whose hull spans
        corners that have nothing to do with each other, those of the corners in all directions.
    axes: (3, 3) orthonormal axes of the printer in the die's coordinates, one a row, the last up.
    """

    slopes: OddsSlopes
    errors: PrintErrors
    has_planes: bool = True
    axes: Floats | None = None

    @cached_property
    def by_unit_offset(self) -> Floats:
        """(k, k) for a standard deviation of 1 of the places of facets, or of corners."""
        slopes = self.slopes
        parts = slopes.by_offsets if self.has_planes else slopes.by_corners
        rows = parts.reshape(len(parts), -1)
        return rows @ rows.T

    @cached_property
    def by_error(self) -> dict[str, Floats]:
        """(k, k) from each error, by the names of its fields."""
        axes = np.eye(3) if self.axes is None else self.axes
        stretches = self.slopes.by_stretches(axes)
        gradient = self.slopes.by_gradient(axes[2])
        unit = {
            "dimensional_mm": self.by_unit_offset,
            "shrinkage": stretches @ stretches.T,
            "density_gradient": np.outer(gradient, gradient),
            "bubble_mm3": self.slopes.of_bubble(),
        }
        return {name: deviation**2 * unit[name] for name, deviation in asdict(self.errors).items()}

    @cached_property
    def covariance(self) -> Floats:
        """(k, k) from all errors together."""
        return np.asarray(sum(self.by_error.values()))


def print_tolerances(
    spread: OddsSpread, target: Floats, bias: Floats, prints: OffPrints | None = None
) -> PrintTolerances:
    """What is known of a die's prints.

    target: (k,) wanted odds; bias: (k,) odds of the die that is printed without an error, less
        those; prints: to hold the allowed offset against, or None to trust the derivatives.
    """
    allowed = allowed_offset(spread, target, bias)
    if allowed and prints is not None:
        allowed = _let_through(prints, allowed, target, bias)
    deviations = _deviations(spread.covariance)
    return PrintTolerances(
        answer=_answer(spread, allowed),
        rolls=ROLLS,
        allowed_mm=allowed,
        noticed=chance_noticed(target, ROLLS, spread.covariance, bias),
        assumed=asdict(spread.errors),
        deviations=tuple(deviations.tolist()),
        by_error={name: tuple(_deviations(c).tolist()) for name, c in spread.by_error.items()},
        # Half the sum of the mean absolute values of normal numbers.
        total_variation=float(deviations.sum() / np.sqrt(2.0 * np.pi)),
    )


def allowed_offset(spread: OddsSpread, target: Floats, bias: Floats) -> float | None:
    """Standard deviation in mm of the places of facets, or corners, with which a test of `ROLLS`
    rolls at 5 % notices `NOTICED` of the prints, if there is no other error; 0 where it notices as
    many or more of prints without an error, None where fewer at any size of error.

    target, bias: (k,) as for `print_tolerances`.
    """

    def excess(offset: float) -> float:
        return chance_noticed(target, ROLLS, offset**2 * spread.by_unit_offset, bias) - NOTICED

    size = float(np.ptp(spread.slopes.hull.vertices, axis=0).max())
    if excess(0.0) >= 0.0:
        return 0.0
    if excess(NEVER * size) <= 0.0:
        return None
    least, most = 0.0, NEVER * size
    while most - least > FINENESS * size:
        middle = (least + most) / 2.0
        least, most = (middle, most) if excess(middle) < 0.0 else (least, middle)
    return least or most


def _let_through(prints: OffPrints, offset: float, target: Floats, bias: Floats) -> float:
    """The offset, or where more of such prints are noticed the largest with which they are not."""

    def noticed(offset: float) -> float:
        return prints.noticed(offset, target, bias, ROLLS)

    if noticed(offset) <= NOTICED + DOUBT:
        return offset
    least, most = 0.0, offset
    for _ in range(HALVINGS):
        middle = (least + most) / 2.0
        least, most = (middle, most) if noticed(middle) < NOTICED else (least, middle)
    # A die at the verge of tipping: the smallest that was tried.
    return least or most


def _deviations(covariance: Floats) -> Floats:
    return np.sqrt(np.diag(covariance))


def _answer(spread: OddsSpread, allowed: float | None) -> str:
    what = "facet's place" if spread.has_planes else "corner's place, in every direction"
    level, noticed = f"{100.0 * LEVEL:.0f} %", f"{100.0 * NOTICED:.0f} %"
    if allowed is None:
        return (
            f"{ROLLS:,} rolls show nothing, however far each {what} is off: nearly all shapes of "
            "this die have its odds."
        )
    if allowed == 0.0:
        return (
            f"{ROLLS:,} rolls notice that this die is not exact, however well it is printed: a "
            f"chi-square test at {level} finds more than {noticed} of perfect prints."
        )
    return (
        f"Printed to within ±{allowed:.2g} mm (standard deviation of each {what}), {ROLLS:,} rolls "
        f"show nothing: a chi-square test at {level} finds {noticed} of such prints, and {level} "
        "of perfect ones."
    )
