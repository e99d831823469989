"""Why a design stopped."""

from __future__ import annotations

from enum import Enum

__all__ = ["Status"]


class Status(Enum):
    """Why a design stopped; the value is the message."""

    CONVERGED = "reached the tolerance"
    OFF_TARGET = (
        "reached the tolerance counting all rests near an outcome, but the die also rests "
        "elsewhere; raise weights.stability or weights.coplanar"
    )
    OFF_TABLE = (
        "reached the tolerance by the momentum model, but not in simulated throws; allow more with "
        "method.exact.refine.rounds or .drops"
    )
    NO_START = (
        "none of the starting shapes led there; try another seed, or allow more with "
        "method.exact.starts"
    )
    NO_PROGRESS = "no step lowers the energy any further; try another start, assignment or seed"
    NO_GRADIENT = (
        "the energy has no finite gradient at this shape, which balances exactly; raise "
        "method.descent.perturbation, or try another start or seed"
    )
    TOO_SMALL = (
        "reached the odds, but with a facet that has no room for a circle of min_inradius_mm; "
        "raise size_mm, lower min_inradius_mm, or try another seed"
    )
    STEP_LIMIT = "reached the number of steps; allow more steps"
    TIME_LIMIT = "ran out of time"
