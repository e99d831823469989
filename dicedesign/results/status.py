"""How a design ended, and what a finished die is like."""

from __future__ import annotations

from enum import Enum

__all__ = ["Status"]


class Status(Enum):
    """Why a design stopped, or what is wrong with the finished die; the value is the message."""

    CONVERGED = "reached the tolerance"
    OFF_TARGET = "the odds of the outcomes are off by more than the tolerance"
    STRAY = "the die also rests elsewhere, more often than the tolerance"
    CROWDED = "two outcomes are nearer than 5 degrees to each other, which is one to the eye"
    UNSTEADY = "an outcome is left at a nudge"
    TOO_NEAR = "two outcomes are nearer to each other than method.concave.apart_deg"
    TIPPY = "an outcome is left when the die is tipped by less than method.concave.margin_deg"
    LOOSE = "the surface does not fill the designed hull"
    SELF_INTERSECTING = "the surface meets itself"
    OPEN = "the surface is not closed, as rounded to the single precision of its file"
    UNPRINTABLE = "the surface cannot be cleaned for printing"
    UNBALANCED = (
        "the plain die reached the tolerance, but no shape nearby does with its labels and edges; "
        "try a smaller depth_mm or radius_mm, or another seed"
    )
    OFF_TABLE = (
        "reached the tolerance by the momentum model, but not in simulated throws; allow more with "
        "method.exact.refine.rounds or .drops"
    )
    FILE_LEFT_OUT = "a file in another format has not the odds of the die, and was left out"
    NO_START = (
        "none of the starting shapes led there; try another seed, or allow more with "
        "method.exact.starts"
    )
    UNCHANGED = "no attempt led to a die: this is the surface as it came"
    NO_PROGRESS = "no step lowers the energy any further; try another start, assignment or seed"
    NO_GRADIENT = (
        "the energy has no finite gradient at this shape, which balances exactly; raise the "
        "method's perturbation, or try another start or seed"
    )
    TOO_SMALL = (
        "reached the odds, but with a facet that has no room for a circle of min_inradius_mm; "
        "raise size_mm, lower min_inradius_mm, or try another seed"
    )
    STEP_LIMIT = "reached the number of steps; allow more steps"
    TIME_LIMIT = "ran out of time"
