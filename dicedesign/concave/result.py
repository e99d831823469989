"""Results of a hull fill, of an attempt and of a search for a concave die, and what is missing from
them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import TypeAlias

from dicedesign.concave.options import ConcaveOptions
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.triangles import Surface
from dicedesign.results.parts import Draft
from dicedesign.runtime.arrays import Floats

OnEnergy: TypeAlias = Callable[[float], None]
"""Called with the energy at the start and after every accepted step."""


class FillStatus(Enum):
    """Reasons why a fill stopped; the value is the message."""

    FITTED = "reached what was wanted"
    NO_PROGRESS = "no step comes any nearer; design the hull nearer to that of the surface"
    STEP_LIMIT = "reached the number of steps; allow more steps"
    UNSOLVED = (
        "a quadratic program was not solved; remesh the surface without slivers, or design the "
        "hull nearer to that of the surface"
    )


@dataclass(frozen=True, eq=False)
class FillResult:
    """The end of a fill.

    Attributes
    ----------
    points: (n, 3) of the surface, in the order of those it was made from.
    energy: there; those of different ways to fill do not compare.
    status: why it stopped.
    """

    points: Floats
    energy: float
    status: FillStatus


@dataclass(frozen=True)
class ConcaveStep:
    """One step of one attempt.

    Attributes
    ----------
    attempt: its number, from 1 on.
    stage: "hull", "fill" or "balance".
    seconds: since the start, over all sessions.
    energy: of the stage; those of different stages do not compare.
    error: largest |p - q| of the hull, or None where the stage does not know.
    """

    attempt: int
    stage: str
    seconds: float
    energy: float
    error: float | None


@dataclass(frozen=True, eq=False)
class FilledHull:
    """A surface that fills a designed hull.

    Attributes
    ----------
    attempt: the one that led there.
    points: (n, 3) of the surface, laid onto the original as well as a similarity can.
    hull_points: (v, 3) corners of the designed hull, the same way.
    center_of_mass: (3,) for which the probabilities are meant: that of the uniform solid, or where
        cavities are to bring it.
    directions: (k, 3) unit directions that are down in the outcomes.
    error: largest of |p - q| over the clusters and the probabilities of all other rests together.
    displacement: mean over the points, over the diagonal of the original.
    apart_deg, margin_deg, self_intersections: as in `Draft`.
    """

    attempt: int
    points: Floats
    hull_points: Floats
    center_of_mass: Floats
    directions: Floats
    error: float
    displacement: float
    apart_deg: float
    margin_deg: float
    self_intersections: int

    def draft(self, seconds: float) -> Draft:
        """Figures of this hull after an attempt, with the seconds it took."""
        return Draft(
            self.attempt,
            seconds,
            self.error,
            self.displacement,
            self.apart_deg,
            self.margin_deg,
            self.self_intersections,
        )


@dataclass(frozen=True)
class ConcaveProgress:
    """Enough to go on from.

    Attributes
    ----------
    attempts: how many are done.
    seconds: spent on them.
    best: the best so far, or None.
    tried: what each attempt led to that led anywhere.
    history: steps of the best attempt, or of the last where none led anywhere.
    """

    attempts: int
    seconds: float
    best: FilledHull | None
    tried: tuple[Draft, ...]
    history: tuple[ConcaveStep, ...]


@dataclass(frozen=True, eq=False)
class Hollow:
    """Wanted walls of cavities.

    Attributes
    ----------
    wall: least thickness around them, over the largest distance of two points of the surface.
    center_of_mass: (3,) that the die has with them.
    """

    wall: float
    center_of_mass: Floats


@dataclass(frozen=True, eq=False)
class ConcaveDie:
    """A finished search.

    Attributes
    ----------
    before: the surface as it came, after remeshing if that was asked for.
    after: the die, in the same place and of the same triangles.
    hull: the designed one.
    directions: (k, 3) that are down in the outcomes, in the order of the target.
    hull_corners: numbers of corners of the hulls before and after.
    progress: how it went.
    hollow: what its cavities are to do; None of a solid die.
    """

    before: Surface
    after: Surface
    hull: ConvexHull
    directions: Floats
    hull_corners: tuple[int, int]
    progress: ConcaveProgress
    hollow: Hollow | None = None


def shortfall(error: float, tolerance: float, *angles: tuple[float, float]) -> float:
    """Sum of what is missing over its limits; 0 if nothing is missing.

    error: largest |p - q|, which may be as large as the tolerance; angles: each with the least that
    will do, in one unit.
    """
    missing = max(error / tolerance - 1.0, 0.0)
    return missing + sum(1.0 - angle / least for angle, least in angles if angle < least)


MOST_EASED = 400
"""Pairs of triangles that meet, beyond which there is no hope to part them."""

MEETING = 0.5
"""What is missing from a die that meets itself, beside its probabilities and angles; each pair of
triangles adds its part of `MOST_EASED`."""

PREFERRED_APART = 1.5
"""Angle between outcomes, in units of the least one that is wanted, beyond which more is worth
nothing."""

PREFERRED_MARGIN = 2.0
"""The same of the angle of tipping."""


def missing(die: FilledHull | Draft, options: ConcaveOptions) -> float:
    """Sum of the relative distances of probabilities, angles and surface from their limits; 0 for
    a converged die."""
    apart = die.apart_deg, options.apart_deg
    margin = die.margin_deg, options.margin_deg
    missing = shortfall(die.error, options.tolerance, apart, margin)
    if die.self_intersections > 0:
        missing += MEETING + die.self_intersections / MOST_EASED
    return missing


def rank(die: FilledHull, options: ConcaveOptions) -> tuple[float, float]:
    """Sort key, best first: what is missing, then the displacement, which counts for more in a die
    that is hard to read (`doubts`)."""
    dearer = 1.0 + doubts(die.apart_deg, die.margin_deg, options)
    return missing(die, options), dearer * die.displacement


def doubts(apart: float, margin: float, options: ConcaveOptions) -> float:
    """Penalty of small angles in degrees: 0 for outcomes that are easy to tell apart and hard to
    leave, up to 1 for each angle at its limit."""
    total = 0.0
    for angle, least, preferred in (
        (apart, options.apart_deg, PREFERRED_APART),
        (margin, options.margin_deg, PREFERRED_MARGIN),
    ):
        if least > 0.0:
            total += min(max((preferred - angle / least) / (preferred - 1.0), 0.0), 1.0)
    return total
