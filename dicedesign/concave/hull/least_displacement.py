"""The least displacement of a hull's corners that meets equations and inequalities."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.linalg import solve
from scipy.sparse import csr_array

from dicedesign.concave.hull.slopes import SlopeConditions
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["least_displacement"]

SOFTNESS: Final = 2e-3
"""Compliance by which an inequality gives way, over the mean compliance of a corner: conditions may
contradict each other, and none is worth every price."""

REGULAR: Final = 1e-9
"""Part of the trace, and of that softness, that is added where equations may depend on each other
or say nothing."""

MOST_CHANGES: Final = 4
"""Changes of the set of inequalities that count; what is left is for the next step."""

MET: Final = 1e-9
"""An inequality that fails by no more than this is met."""


def least_displacement(
    compliance: Floats,
    displacement: Floats,
    conditions: SlopeConditions,
    excess: Floats,
    jacobian: Floats,
    misses: Floats,
) -> Floats:
    """(n, 3) the displacement from the original that takes least work, among those that meet the
    linearised equations and, softly, the inequalities.

    Parameters
    ----------
    compliance: (n, 3, n, 3) symmetric positive definite: displacement for force.
    displacement: (n, 3) the present one.
    conditions, excess: (s,) inequalities and how much they fail at present.
    jacobian: (k, n, 3) of the equations; misses: (k,) what their values are to gain.

    Solved for the forces: k of the equations, and one for each inequality that would else fail.
    """
    tangents, corners = conditions.tangents, conditions.corners
    bound = (tangents * displacement[corners]).sum(-1) - excess
    wanted = misses + np.einsum("knc,nc->k", jacobian, displacement)
    size = displacement.size
    flat = compliance.reshape(size, size)
    along = _rows(tangents, corners, size)
    raised = jacobian.reshape(len(jacobian), size) @ flat
    own = raised @ jacobian.reshape(len(jacobian), size).T
    softness = SOFTNESS * float(np.trace(flat)) / size
    own += REGULAR * (np.trace(own) + softness) * np.eye(len(own))
    mixed = along @ raised.T
    by_condition = along @ flat
    pairs = along @ by_condition.T
    active = excess > 0.0
    for _ in range(MOST_CHANGES):
        kept = np.flatnonzero(active)
        between = pairs[np.ix_(kept, kept)] + softness * np.eye(len(kept))
        system = np.block([[between, mixed[kept]], [mixed[kept].T, own]])
        forces = solve(system, np.concatenate([bound[kept], wanted]), assume_a="pos")
        moved = forces[: len(kept)] @ by_condition[kept] + forces[len(kept) :] @ raised
        failing = along @ moved - bound > MET
        if np.array_equal(failing, active):
            break
        active = failing
    return np.asarray(moved.reshape(displacement.shape), dtype=np.float64)


def _rows(tangents: Floats, corners: Integers, size: int) -> csr_array:
    """(s, 3 n) of the inequalities, for displacements as one vector."""
    columns = 3 * corners[:, None] + np.arange(3)
    starts = np.arange(0, columns.size + 1, 3)
    return csr_array((tangents.ravel(), columns.ravel(), starts), shape=(len(corners), size))
