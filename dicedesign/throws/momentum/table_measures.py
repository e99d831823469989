"""How tables differ, in what thrown odds change with."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dicedesign.runtime.arrays import Floats
from dicedesign.throws.momentum.table_terms import dimensionless, scaled
from dicedesign.throws.tables import Table

__all__ = ["table_measures"]


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
