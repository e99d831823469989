"""How gradients grow where a flow line hardly climbs.

A flow line in the cell of p comes from u and crosses the arc of an edge vector v at
u' = u (r_p . v) - r_p (u . v). Take u, r_p, v as unit vectors, rho = r_p . v >= 0,
alpha = -u . v >= 0, and theta < 90 degrees between u and r_p. Then u' = rho u + alpha r_p lies at
an angle phi from r_p with tan phi = rho sin theta / (alpha + rho cos theta), so that

    d phi = sin theta (alpha d rho - rho d alpha) / |u'|^2,
    |u'|^2 = rho^2 + alpha^2 + 2 rho alpha cos theta >= rho^2 + alpha^2,

and |d phi| <= |d (rho, alpha)| / sqrt(rho^2 + alpha^2): about one over the slant, the sine of the
angle between line and arc, which is rho / sin phi = |u'| / sin theta. So rho -> 0 alone is
harmless: the crossing tends to r_p itself and d phi / d rho to sin theta / alpha. The gradient
grows like 1 / rho only where alpha vanishes too: where a line enters the cell next to the arc's
end, a facet's normal. `grazing_body` is such a body. In the next cell the line turns towards r_q by
an angle that stays away from 0 (r_q . v >= |v|^2), so the area inherits the growth; where several
crossings graze at once, their factors multiply.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from dicedesign.bench.gradients import GradientRow, gradient_row
from dicedesign.bench.problem import Problem, turned
from dicedesign.bench.stiff import glancing

__all__ = ["GROWTHS", "exponent", "glancing_rows", "grazing_body", "grazing_rows"]

GROWTHS: Final = tuple(10.0**-power for power in range(1, 15))

OFFSETS: Final = (0.01, 0.1, 1.0, 10.0)
"""Tried for the offset over rho."""

LARGEST_OFFSET: Final = 0.1
"""With a larger one the center of mass leaves `grazing_body`."""

SMALL: Final = 1e-3
"""Growths up to which the exponent is fitted."""

HEIGHT: Final = 0.14
"""Of the center of mass over the bottom of `grazing_body`."""

TOP: Final = np.array([[-0.48, 0.41, 1.33], [-0.37, -0.57, 1.41], [-0.92, 1.58, 2.59]])
"""Its upper corners: with the height and the length of the legs about those with the largest
gradient of 4,000 bodies drawn at random."""


def glancing_rows() -> Iterator[GradientRow]:
    """Bodies in which only rho vanishes: crossed, and just not crossed (rho < 0)."""
    for sign in (1.0, -1.0):
        for growth in GROWTHS:
            row = gradient_row("glancing", glancing(sign * growth))
            yield row if sign > 0.0 else replace(row, growth=-growth)


def grazing_rows() -> Iterator[GradientRow]:
    """For each rho the body of `grazing_body` with the largest gradient of all offsets, turned, so
    that its coordinates are rounded as those of any other body."""
    for number, growth in enumerate(GROWTHS[:-1]):
        rows = [
            gradient_row(
                f"grazing, offset {ratio:.3g} rho",
                turned(grazing_body(growth, ratio * growth), number),
            )
            for ratio in OFFSETS
            if ratio * growth <= LARGEST_OFFSET
        ]
        yield max(rows, key=lambda row: row.size)


def grazing_body(growth: float, offset: float) -> Problem:
    """A body in which rho is a given growth and the saddle lies at a distance from the bottom's
    normal that is the offset times its height: alpha is about that distance.

    The bottom is a triangle with a nearly right angle at p, and the foot of the center of mass is
    at `offset` from the middle of one leg: the saddle's line enters the cell of p and leaves it
    across the other leg's arc.
    """
    center = np.array([0.5, offset, HEIGHT])
    reach = np.hypot(0.5, offset)
    tilt = np.arctan2(offset, 0.5) + np.arcsin(growth * np.hypot(reach, HEIGHT) / reach)
    leg = 1.3 * np.array([-np.sin(tilt), np.cos(tilt), 0.0])
    bottom = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], leg])
    return Problem(np.concatenate([bottom, TOP]), center)


def exponent(rows: list[GradientRow]) -> float:
    """Slope of the gradient's size over the growth, in logarithms, for small positive growths."""
    chosen = [row for row in rows if 0.0 < row.growth <= SMALL * 1.01]
    growths, sizes = (np.log([getattr(row, key) for row in chosen]) for key in ("growth", "size"))
    return float(np.polyfit(growths, sizes, 1)[0])
