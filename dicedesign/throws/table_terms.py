"""What of a table the momentum model depends on: five dimensionless numbers, and the range of them
in which a model holds.

A die of any size thrown by a table is the same as one of another size whose heights, speeds and
spins are as large compared with its size and gravity.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement, compress
from typing import Any, Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.engines import GRAVITY
from dicedesign.throws.tables import Table, least_of, mean_of
from dicedesign.throws.tables import scaled as spread_by

TABLE_NUMBERS: Final = ("restitution", "friction", "height", "speed", "spin")
"""Parameters of a table that throws depend on, besides the size."""

PAIRS: Final = tuple(combinations_with_replacement(range(len(TABLE_NUMBERS)), 2))

TABLE_TERMS: Final = 1 + len(TABLE_NUMBERS) + len(PAIRS)
"""Terms of a quadratic polynomial in the table's numbers."""

CENTERS: Final = np.array([0.4, -1.0, 1.6, 0.8, 0.9])
"""About which the scaled numbers are taken,"""

EXTENTS: Final = np.array([0.4, 1.3, 1.4, 0.8, 0.9])
"""and over what, so that those of usual tables are within -1 and 1."""

ROUNDED: Final = 1e-5

UNITS: Final = {"height": " m", "speed": " m/s", "spin": " rad/s"}


def dimensionless(table: Table) -> Floats:
    """(5,) restitution, friction, height over size, speed over the root of gravity times size, spin
    times the root of size over gravity; of a range its mean."""
    middles = [mean_of(getattr(table, name)) for name in TABLE_NUMBERS]
    return np.array(middles) / _units(table.size)


def table_terms(table: Table) -> Floats:
    """(`TABLE_TERMS`,) what a model's numbers are linear in: 1, the `scaled` numbers of a table and
    their products by twos. Its friction and height are above 0."""
    numbers = scaled(dimensionless(table))
    return np.array([1.0, *numbers, *(numbers[i] * numbers[j] for i, j in PAIRS)])


def scaled(numbers: Floats) -> Floats:
    """(..., 5) of the numbers of `dimensionless`: frictions and heights count by their logarithms,
    speeds and spins by that of 1 more."""
    restitution, friction, height, speed, spin = np.moveaxis(numbers, -1, 0)
    free = restitution, np.log(friction), np.log(height), np.log1p(speed), np.log1p(spin)
    scaled: Floats = (np.stack(free, axis=-1) - CENTERS) / EXTENTS
    return scaled


def _units(size: float) -> Floats:
    """(5,) of the numbers, for dice of a size in m."""
    return np.array([1.0, 1.0, size, math.sqrt(GRAVITY * size), math.sqrt(GRAVITY / size)])


@dataclass(frozen=True)
class TableRange:
    """Tables, those within a box of the numbers of `dimensionless`.

    Attributes
    ----------
    least, most: (5,) of each number; friction and height are above 0.
    """

    least: Floats
    most: Floats

    def nearest(self, table: Table) -> Table:
        """The table, or one with the numbers that are beyond the range at its end."""
        return moved(table, np.clip(dimensionless(table), self.least, self.most))

    def require(self, table: Table, remedy: str) -> None:
        """Raise InputError, which names the parameter, for a table beyond the range."""
        units, numbers = _units(table.size), dimensionless(table)
        for place, name in enumerate(TABLE_NUMBERS):
            least, most = self.least[place], self.most[place]
            # What files have is rounded.
            slack = ROUNDED * most
            if not least - slack <= numbers[place] <= most + slack:
                low, high = least * units[place], most * units[place]
                raise InputError(
                    f"table {table.name}: expected a {name} of {low:.3g} to {high:.3g}"
                    f"{UNITS.get(name, '')} for dice of {1e3 * table.size:g} mm, as its momentum "
                    f"model knows, got {numbers[place] * units[place]:.3g}; {remedy}"
                )


def moved(table: Table, numbers: Floats) -> Table:
    """A table with those numbers that differ from its own; ranges stay as wide as they are
    compared with their mean."""
    values = dict(zip(TABLE_NUMBERS, (numbers * _units(table.size)).tolist(), strict=True))
    differs = numbers != dimensionless(table)
    changed: dict[str, Any] = {}
    for name in compress(TABLE_NUMBERS, differs):
        spread, value = getattr(table, name), values[name]
        mean = mean_of(spread)
        is_wide = isinstance(spread, tuple) and mean > 0.0
        changed[name] = spread_by(spread, value / mean) if is_wide else value
    if least_of(changed.get("height", table.height)) < table.size:
        # A die falls from no less than its size.
        changed["height"] = max(values["height"], table.size)
    return replace(table, **changed)


CHANGES: Final = (0.2, -0.2)
"""Parts by which the restitution of a livelier and of a duller table is higher. Of all that makes a
throw it is what changes the odds most."""

MOST_OTHERS: Final = 4
"""Tables that stand for a posterior."""


def other_tables(table: Table, posterior: Sequence[Table] = ()) -> tuple[Table, ...]:
    """Few tables that stand for what the table may be instead: of a posterior those that its others
    are nearest to, without one a livelier and a duller table. None where nothing bounces."""
    if not posterior:
        livelier = (table.livelier(change) for change in CHANGES)
        return tuple(other for other in livelier if other != table)
    numbers = np.array([scaled(dimensionless(one)) for one in posterior])
    spread = numbers.std(axis=0)
    numbers = numbers / np.where(spread > 0.0, spread, 1.0)
    apart = np.linalg.norm(numbers[:, None] - numbers, axis=2)
    nearest = np.full(len(posterior), np.inf)
    chosen: list[int] = []
    while len(chosen) < min(MOST_OTHERS, len(posterior)):
        left = np.minimum(nearest, apart).sum(axis=1)
        left[chosen] = np.inf
        chosen.append(int(left.argmin()))
        nearest = np.minimum(nearest, apart[chosen[-1]])
    return tuple(posterior[place] for place in chosen)


def table_measures(table: Table, others: Sequence[Table]) -> Floats:
    """(n, d) of other tables, 0 for the table itself: differences in what the momentum model knows
    of them (`scaled`), each over the root of its mean square; those in which none differs are
    left out."""
    if not others:
        return np.zeros((0, 0))
    own = scaled(dimensionless(table))
    gaps = np.array([scaled(dimensionless(other)) for other in others]) - own
    spread = np.sqrt((gaps**2).mean(axis=0))
    differing = spread > 0.0
    measures: Floats = gaps[:, differing] / spread[differing]
    return measures
