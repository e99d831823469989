"""What is missing from a concave die as wanted, and which of two is the better one."""

from __future__ import annotations

from typing import Final

from dicedesign.concave.hull.shortfall import shortfall
from dicedesign.concave.options import ConcaveOptions
from dicedesign.concave.result import FilledHull
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.results.trade_off import Draft
from dicedesign.runtime.arrays import Floats

__all__ = ["MOST_EASED", "doubts", "is_shifted", "missing", "rank"]

MOST_EASED: Final = 400
"""Pairs of triangles that meet, beyond which there is no hope to part them."""

MEETING: Final = 0.5
"""What is missing from a die that meets itself, beside its odds and angles; each pair of triangles
adds its part of `MOST_EASED`."""

PREFERRED_APART: Final = 1.5
"""Angle between outcomes, in units of the least one that is wanted, beyond which more is worth
nothing."""

PREFERRED_MARGIN: Final = 2.0
"""The same of the angle of tipping."""

UNSHIFTED: Final = 1e-6
"""Distance of the center of mass from that of the uniform solid, over the diagonal, for which no
cavity is made: in the single precision of a file it would be none."""


def missing(die: FilledHull | Draft, options: ConcaveOptions) -> float:
    """How far odds, angles and surface are from what will do, over what will do, summed; 0 for a
    die as wanted."""
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
    """From 0, for angles in degrees at which outcomes are easily told apart and hardly left, to 1
    for each of them that is as small as will do."""
    total = 0.0
    for angle, least, preferred in (
        (apart, options.apart_deg, PREFERRED_APART),
        (margin, options.margin_deg, PREFERRED_MARGIN),
    ):
        if least > 0.0:
            total += min(max((preferred - angle / least) / (preferred - 1.0), 0.0), 1.0)
    return total


def is_shifted(surface: Surface, center_of_mass: Floats) -> bool:
    """Whether a center of mass (3,) is another than that of the uniform solid in a surface."""
    shift = float(norms(center_of_mass - surface.centroid))
    return shift > UNSHIFTED * surface.diagonal
