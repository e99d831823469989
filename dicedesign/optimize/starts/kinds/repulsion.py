"""Facets tangent to a sphere, one for each outcome; see `dicedesign.optimize.starts.repulsion`."""

from __future__ import annotations

from dataclasses import dataclass

from dicedesign.errors import InputError
from dicedesign.optimize.starts.repulsion import FEWEST_FACETS, repulsion
from dicedesign.optimize.starts.start import STARTS, StartKind, check_sides
from dicedesign.runtime.registry import STRICT

__all__ = ["RepulsionOptions"]


@dataclass(frozen=True)
class RepulsionOptions:
    """`start.repulsion`: nothing to choose."""

    __pydantic_config__ = STRICT


def _check(options: RepulsionOptions, outcomes: int) -> None:
    check_sides(outcomes)
    if outcomes < FEWEST_FACETS:
        raise InputError(
            f"start.repulsion: expected a target of at least {FEWEST_FACETS} outcomes, got "
            f"{outcomes}; take a prism"
        )


STARTS.register(
    StartKind(
        name="repulsion",
        line="facets tangent to a sphere at points that repel each other, one for each outcome",
        rank=2,
        options=RepulsionOptions,
        check=_check,
        make=lambda options, task: repulsion(task.outcomes, task.seed),
    )
)
