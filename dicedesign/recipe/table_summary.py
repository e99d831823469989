"""What result.json says of a die's throws."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from dicedesign.design.targets import Target
from dicedesign.recipe.on_table import TableVerdict
from dicedesign.recipe.schema.recipe import Recipe
from dicedesign.results.status import Status
from dicedesign.throws.statistics.intervals import exact_intervals
from dicedesign.throws.statistics.total_variation import MeasuredVariation, measure_variation

__all__ = ["CONFIDENCE", "measured", "table_outcome", "table_summary"]

CONFIDENCE: Final = 0.95
"""Of every interval."""


def measured(verdict: TableVerdict, target: Target) -> MeasuredVariation | None:
    """Total variation of the simulated throws from the target; None without throws."""
    if verdict.throws is None:
        return None
    # None of the target is elsewhere.
    wanted = np.append(target.probabilities, 0.0)
    return measure_variation(verdict.counts, wanted, CONFIDENCE)


def table_summary(verdict: TableVerdict, target: Target) -> dict[str, Any]:
    """The table, the momentum model's odds, the rounds of the design, and the simulated throws with
    their total variation from the target."""
    summary: dict[str, Any] = {
        "table": verdict.table.as_dict(),
        "momentum": verdict.momentum.tolist(),
        "rounds": [
            {
                "drops": thrown.drops,
                "deviation": thrown.deviation,
                "noise_floor": thrown.noise_floor,
                "changed": list(thrown.changed),
                "asked": thrown.asked.tolist(),
                "frequencies": thrown.frequencies.tolist(),
            }
            for thrown in verdict.rounds
        ],
    }
    variation, throws = measured(verdict, target), verdict.throws
    if variation is None or throws is None:
        return summary
    resolved, counts = throws.drops - throws.unresolved, verdict.counts[:-1]
    intervals = exact_intervals(counts, resolved, CONFIDENCE)
    summary["simulated"] = {
        "engine": throws.engine,
        "seed": throws.seed,
        "drops": throws.drops,
        "unresolved": throws.unresolved,
        "counts": counts.tolist(),
        "frequencies": (counts / resolved).tolist(),
        "intervals": intervals.tolist(),
        "total_variation": variation.value,
        "interval": list(variation.interval),
        "noise_floor": variation.noise_floor,
    }
    return summary


def table_outcome(
    status: Status, message: str, verdict: TableVerdict, target: Target, recipe: Recipe
) -> tuple[Status, str]:
    """Status and message of a die, once it has been thrown."""
    variation, exact = measured(verdict, target), recipe.method.exact
    if variation is None or exact is None or exact.refine is None:
        return status, message
    if status is Status.CONVERGED and variation.value > exact.refine.within:
        status = Status.OFF_TABLE
    told = (
        f"thrown {exact.refine.verdict} times, its total variation from the target is "
        f"{variation.value:.2g}, where a perfect die shows {variation.noise_floor:.2g}"
    )
    if status is Status.OFF_TABLE:
        return status, f"{status.value}; {told}"
    return status, f"{told}; {message}"
