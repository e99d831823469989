"""The result of a search for a concave die, and its state, from which it goes on later."""

from __future__ import annotations

from dataclasses import dataclass

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.results.trade_off import Draft
from dicedesign.runtime.arrays import Floats

__all__ = ["ConcaveDie", "ConcaveProgress", "ConcaveStep", "FilledHull", "Hollow"]


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
    center_of_mass: (3,) for which the odds are meant: that of the uniform solid, or where cavities
        are to bring it.
    directions: (k, 3) unit directions that are down in the outcomes.
    error: largest of |p - q| over the clusters and the odds of all other rests together.
    gap: largest distance of a corner of the hull from the surface, over the diagonal.
    displacement: mean over the points, over the diagonal of the original.
    apart_deg, margin_deg, self_intersections: as in `Draft`.
    """

    attempt: int
    points: Floats
    hull_points: Floats
    center_of_mass: Floats
    directions: Floats
    error: float
    gap: float
    displacement: float
    apart_deg: float
    margin_deg: float
    self_intersections: int

    def draft(self, seconds: float) -> Draft:
        """It in numbers, after an attempt that took so long."""
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
    """What cavities are to do.

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
