"""The least displacement of a hull's corners that meets equations and inequalities."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.linalg import solve

from dicedesign.concave.hull.slopes import SlopeConditions
from dicedesign.runtime.arrays import Floats

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
    raised = np.tensordot(jacobian, compliance, 2)
    own = np.einsum("knc,lnc->kl", jacobian, raised)
    mixed = (raised[:, corners] * tangents).sum(-1).T
    softness = SOFTNESS * float(np.einsum("ncnc", compliance)) / (3 * len(compliance))
    by_condition = np.einsum("sc,scmd->smd", tangents, compliance[corners])
    own += REGULAR * (np.trace(own) + softness) * np.eye(len(own))
    pairs = (by_condition[:, corners] * tangents).sum(-1)
    active = excess > 0.0
    for _ in range(MOST_CHANGES):
        kept = np.flatnonzero(active)
        between = pairs[np.ix_(kept, kept)] + softness * np.eye(len(kept))
        system = np.block([[between, mixed[kept]], [mixed[kept].T, own]])
        forces = solve(system, np.concatenate([bound[kept], wanted]), assume_a="pos")
        following = np.tensordot(forces[: len(kept)], by_condition[kept], 1)
        following = following + np.tensordot(forces[len(kept) :], raised, 1)
        failing = (tangents * following[corners]).sum(-1) - bound > MET
        if np.array_equal(failing, active):
            break
        active = failing
    return np.asarray(following, dtype=np.float64)
