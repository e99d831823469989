"""Displacements of least work under bounds: linear complementarity with equations."""

from __future__ import annotations

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from dicedesign.runtime.arrays import Booleans, Floats

MAX_FAILED_PIVOTS = 10
"""Number of exchanges of all wrong bounds at once that may fail to reduce their number; then one
bound changes at a time."""

MAX_PIVOTS = 200
"""Maximum number of exchanges."""

BOUND_TOLERANCE = 1e-9
"""Allowed violation of a bound, relative to the largest one."""


def solve_complementarity(system: Floats, values: Floats, active: Booleans) -> Floats:
    """Strengths x (c + e,) with `system @ x = values` in the last e rows and in those of active
    bounds, where x < 0, and `system @ x <= values` in the others, where x = 0.

    With `system = A C A^T` for conditions A and a compliance C, `C A^T x` is the displacement of
    least work that meets all bounds and equations. If `MAX_PIVOTS` exchanges do not suffice, some
    are violated.

    system: (c + e, c + e) symmetric positive definite. active: (c,) first guess of the active
    bounds.

    Raises LinAlgError if the system is singular.

    Source: Judice and Pires, Comput. Oper. Res. 21(5), 1994 (block pivoting).
    """
    count = len(active)
    fewest, patience = count + 1, MAX_FAILED_PIVOTS
    strengths = np.zeros(len(values))
    tolerance = BOUND_TOLERANCE * float(np.abs(values).max(initial=0.0))
    for _ in range(MAX_PIVOTS):
        rows = np.flatnonzero(active)
        factor = cho_factor(system[np.ix_(rows, rows)])
        sides = np.column_stack([values[rows], system[rows, count:]])
        alone, mixed = np.split(cho_solve(factor, sides), [1], axis=1)
        across = system[count:, rows]
        rest = np.linalg.solve(
            system[count:, count:] - across @ mixed, values[count:] - across @ alone[:, 0]
        )
        strengths[:] = 0.0
        strengths[rows], strengths[count:] = alone[:, 0] - mixed @ rest, rest
        over = system[:count] @ strengths - values[:count]
        changes = np.flatnonzero(np.where(active, strengths[:count] > 0.0, over > tolerance))
        if len(changes) == 0:
            break
        if len(changes) < fewest:
            fewest, patience = len(changes), MAX_FAILED_PIVOTS
        elif patience > 0:
            patience -= 1
        else:
            changes = changes[-1:]
        active = active.copy()
        active[changes] = ~active[changes]
    return strengths
