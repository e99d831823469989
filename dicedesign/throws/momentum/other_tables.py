"""Tables that dice which are made for one of them shall be right on as well."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from dicedesign.throws.momentum.table_terms import dimensionless, scaled
from dicedesign.throws.tables import Table

__all__ = ["CHANGES", "other_tables"]

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
