"""Result of a method of design."""

from __future__ import annotations

from dataclasses import dataclass

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.results.parts import Status
from dicedesign.runtime.arrays import Floats


@dataclass(frozen=True)
class DesignStep:
    """One accepted step: seconds since the start, weighted energy terms, largest |p - q|."""

    step: int
    seconds: float
    energy: float
    terms: dict[str, float]
    error: float


@dataclass(frozen=True)
class DesignResult:
    """End of a design.

    Attributes
    ----------
    status: why it stopped.
    hull: the designed shape.
    directions: (k, 3) where the outcomes are.
    error: its largest |p - q|, by the odds that the method is about.
    terms: the energy's terms of the hull, with their full weights.
    history: every accepted step, the first being the start.
    evaluations: dice tried, rejected ones and those after pruning included.
    hulls_built: hulls computed for them from scratch, polar hulls of facet coordinates included.
    hulls_reused: hulls that only moved the vertices of the one before, for the same result.
    starts: starting shapes that were tried.
    """

    status: Status
    hull: ConvexHull
    directions: Floats
    error: float
    terms: dict[str, float]
    history: tuple[DesignStep, ...]
    evaluations: int
    hulls_built: int
    hulls_reused: int
    starts: int = 1
