"""Results of a hull fill, an attempt and a search for a concave die, and their ranking."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

from dicedesign.concave.options import ConcaveOptions
from dicedesign.concave.rest_groups import PREFERRED_GAP
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.triangles import Surface
from dicedesign.results.parts import Draft
from dicedesign.results.result import Step
from dicedesign.runtime.arrays import Floats, Integers

OnEnergy: TypeAlias = Callable[[float], None]
"""Callback that receives the energy at the start and after every accepted step."""

JudgePrints: TypeAlias = Callable[[Surface, Floats, Floats, Integers], float]
"""Mean total variation of prints of a surface with a center of mass (3,) from the target, for down
directions (f, 3) and the outcome (f,) of each."""

Fill: TypeAlias = tuple[Floats, float]
"""Points (n, 3) of a surface that fills a hull, in their original order, and the final energy; each
fill method has its own energy."""


@dataclass(frozen=True, eq=False)
class FilledHull:
    """Surface that fills a designed hull.

    Attributes
    ----------
    draft: error, displacement and angles; the search sets its number and time.
    points: (n, 3) points of the surface, aligned with the original by a similarity.
    hull_points: (v, 3) vertices of the designed hull, aligned by this similarity.
    center_of_mass: (3,) center of mass to which the probabilities belong: of the uniform solid, or
        where cavities are to move it.
    directions: (f, 3) unit down directions of the outcomes; outcome_of: (f,) outcome of each.
    """

    draft: Draft
    points: Floats
    hull_points: Floats
    center_of_mass: Floats
    directions: Floats
    outcome_of: Integers


@dataclass(frozen=True)
class ConcaveProgress:
    """State of a search, from which it can be resumed.

    Attributes
    ----------
    attempts: number of finished attempts; seconds: their wall-clock time.
    best: best filled hull so far, or None.
    tried: results of all attempts that led to a filled hull.
    history: steps of the best attempt, or of the last one if all failed.
    """

    attempts: int = 0
    seconds: float = 0.0
    best: FilledHull | None = None
    tried: tuple[Draft, ...] = ()
    history: tuple[Step, ...] = ()


@dataclass(frozen=True, eq=False)
class Hollow:
    """Required cavities of a die.

    Attributes
    ----------
    wall: minimum thickness of their walls, over the largest distance of two points of the surface.
    center_of_mass: (3,) center of mass of the die with its cavities.
    """

    wall: float
    center_of_mass: Floats


@dataclass(frozen=True, eq=False)
class ConcaveDie:
    """Result of a search.

    Attributes
    ----------
    before: original surface, remeshed if the options say so.
    after: surface of the die, with the triangles of `before` and about its place and size.
    hull: designed hull.
    directions: (f, 3) down directions of the outcomes, in the order of the target.
    outcome_of: (f,) outcome of each.
    hull_corners: numbers of vertices of the hulls before and after.
    progress: final state of the search.
    hollow: required cavities; None for a solid die.
    """

    before: Surface
    after: Surface
    hull: ConvexHull
    directions: Floats
    outcome_of: Integers
    hull_corners: tuple[int, int]
    progress: ConcaveProgress
    hollow: Hollow | None = None


def shortfall(error: float, tolerance: float, *angles: tuple[float, float]) -> float:
    """Sum of the relative violations of all limits; 0 if all are met.

    error: largest |p - q|, at most the tolerance; angles: or lengths, each with its minimum.
    """
    excess = max(error / tolerance - 1.0, 0.0)
    return excess + sum(1.0 - angle / least for angle, least in angles if angle < least)


MOST_EASED = 400
"""Number of intersecting pairs of triangles above which easing the hull is hopeless."""

INTERSECTION_SHORTFALL = 0.5
"""Shortfall of any self-intersection; each pair of triangles adds 1 / `MOST_EASED`."""

PREFERRED_APART = 1.5
"""Angle between outcomes, over its minimum, above which a larger one is not preferred."""

PREFERRED_MARGIN = 2.0
"""Tipping margin, over its minimum, above which a larger one is not preferred."""

PREFERRED_PRINTS = 0.5
"""Mean total variation of prints, over its limit, below which a smaller one is not preferred."""

PRINT_PENALTY = 4.0
"""Penalty of prints at their limit."""


def missing(die: Draft, options: ConcaveOptions) -> float:
    """Sum of the relative violations by probabilities, angles and self-intersections of the file; 0
    for a die that is right in it."""
    apart, margin = options.least_angles
    angles = (die.apart_deg, apart), (die.margin_deg, margin)
    violation = shortfall(die.error, options.tolerance, *angles)
    if die.self_intersections > 0:
        violation += INTERSECTION_SHORTFALL + die.self_intersections / MOST_EASED
    return violation


def is_right(die: Draft, options: ConcaveOptions) -> bool:
    """Whether a die is right in its file and its prints."""
    return missing(die, options) == 0.0 and not die.is_fragile(options.prints_within)


def rank(die: Draft, options: ConcaveOptions) -> tuple[float, float, float]:
    """Sort key, best first: violations of the file, prints beyond their limit, then the
    displacement times 1 + `angle_penalty`, and more for prints that are off by more than the
    preferred share of their limit. With several rests for an outcome the last is `eye_cost`."""
    beyond = (die.prints or 0.0) if die.is_fragile(options.prints_within) else 0.0
    if options.rests == "several":
        return missing(die, options), beyond, eye_cost(die)
    penalty = angle_penalty(die.apart_deg, die.margin_deg, options)
    penalty += PRINT_PENALTY * prints_above_preferred(die, options)
    return missing(die, options), beyond, (1.0 + penalty) * die.displacement


COST_DISPLACEMENT = 0.005
"""Mean displacement over the diagonal that costs 1."""

COST_PRINTS = 0.01
"""Mean total variation of prints that costs 1."""

COST_GAP_DEG = 10.0
"""Angle that costs 1 if two outcomes are nearer to each other than `PREFERRED_GAP` by it."""


def eye_cost(die: Draft) -> float:
    """What a die with several rests for an outcome costs: displacement, prints that are off, and
    outcomes that are hard to tell apart, each 1 where it begins to matter."""
    near = max(math.degrees(PREFERRED_GAP) - die.apart_deg, 0.0)
    off = die.displacement / COST_DISPLACEMENT + (die.prints or 0.0) / COST_PRINTS
    return off + near / COST_GAP_DEG


def prints_above_preferred(die: Draft, options: ConcaveOptions) -> float:
    """How far prints of a die are off: 0 up to the preferred share of their limit, 1 from
    the limit on; 0 if they were not judged."""
    if die.prints is None:
        return 0.0
    off = die.prints / options.prints_within
    return min(max((off - PREFERRED_PRINTS) / (1.0 - PREFERRED_PRINTS), 0.0), 1.0)


def angle_penalty(apart: float, margin: float, options: ConcaveOptions) -> float:
    """Sum of the penalties of two angles in degrees: each 1 at its minimum, and 0 above the
    preferred value."""
    total = 0.0
    for angle, least, preferred in (
        (apart, options.apart_deg, PREFERRED_APART),
        (margin, options.margin_deg, PREFERRED_MARGIN),
    ):
        if least > 0.0:
            total += min(max((preferred - angle / least) / (preferred - 1.0), 0.0), 1.0)
    return total


def is_better(filled: FilledHull, best: FilledHull | None, options: ConcaveOptions) -> bool:
    """Whether a filled hull is better than the best, or the first."""
    return best is None or rank(filled.draft, options) < rank(best.draft, options)


def judge(
    filled: FilledHull,
    surface: Surface,
    options: ConcaveOptions,
    judge_prints: JudgePrints | None,
) -> FilledHull:
    """Judge the prints of a filled hull that is right otherwise. surface: has its triangles."""
    prints = None
    if judge_prints is not None and missing(filled.draft, options) == 0.0:
        bent = surface.with_points(filled.points)
        faces = filled.directions, filled.outcome_of
        prints = judge_prints(bent, filled.center_of_mass, *faces)
    return replace(filled, draft=replace(filled.draft, prints=prints))
