"""Prisms with pointed ends."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from dicedesign.errors import InputError
from dicedesign.optimize.starts.start import (
    STARTS,
    Start,
    StartKind,
    Task,
    check_sides,
    normalised_start,
)
from dicedesign.runtime.registry import STRICT

__all__ = ["PrismOptions", "prism"]


@dataclass(frozen=True)
class PrismOptions:
    """`start.prism`; see `prism`.

    Attributes
    ----------
    sides: 3 to 12; the number of outcomes unless given.
    height: of the side faces, over the base's circumscribed radius, positive.
    cap: height of each pointed cap over the same, not negative; steep caps are unstable.
    """

    __pydantic_config__: ClassVar = {**STRICT, "allow_inf_nan": False}

    sides: int | None = None
    height: float = 1.5
    cap: float = 1.3


def prism(sides: int, height: float = 1.5, cap: float = 1.3) -> Start:
    """A prism with pointed caps, whose side faces carry the outcomes in order around the axis.

    Own coordinates: the center at the origin, the axis along z, the base's circumscribed radius 1,
    a corner of the base in direction x.

    Parameters
    ----------
    sides: 3 to 12.
    height: height of the side faces in units of the base's circumscribed radius, positive and
        finite.
    cap: height of each pointed cap in the same unit, not negative and finite; steep caps are
        unstable.

    Raises
    ------
    InputError: a parameter out of range.
    """
    _check_proportions(sides, height, cap)
    corner = 2.0 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(corner), np.sin(corner)], axis=1)
    level = np.full((sides, 1), height / 2.0)
    apex = np.array([[0.0, 0.0, height / 2.0 + cap]])
    points = np.concatenate([np.hstack([ring, level]), np.hstack([ring, -level])])
    if cap > 0.0:
        points = np.concatenate([points, apex, -apex])
    middle = corner + np.pi / sides
    directions = np.stack([np.cos(middle), np.sin(middle), np.zeros(sides)], axis=1)
    return normalised_start(points, directions)


def _check_proportions(sides: int, height: float, cap: float) -> None:
    if not 3 <= sides <= 12:
        raise InputError(
            f"start.prism.sides: expected 3 to 12, got {sides}; start from repulsion or a mesh"
        )
    if not 0.0 < height < np.inf:
        raise InputError(
            f"start.prism.height: expected a positive number, got {height:g}; leave it out for 1.5"
        )
    if not 0.0 <= cap < np.inf:
        raise InputError(
            f"start.prism.cap: expected a number not below 0, got {cap:g}; leave it out for 1.3"
        )


def _check(options: PrismOptions, outcomes: int) -> None:
    check_sides(outcomes)
    sides = outcomes if options.sides is None else options.sides
    _check_proportions(sides, options.height, options.cap)
    if sides != outcomes:
        raise InputError(
            f"start.prism.sides: expected {outcomes}, one side for each outcome of the target, got "
            f"{sides}; leave it out"
        )


def _made(options: PrismOptions, task: Task) -> Start:
    sides = task.outcomes if options.sides is None else options.sides
    return prism(sides, options.height, options.cap)


STARTS.register(
    StartKind(
        name="prism",
        line="a prism with pointed caps, one side for each outcome in order around the axis",
        rank=0,
        options=PrismOptions,
        check=_check,
        make=_made,
    )
)
