"""All directions within an angle of an axis alike, and no others; at 90 degrees half the sphere."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dicedesign.errors import InputError
from dicedesign.geometry.sphere import signed_solid_angle
from dicedesign.rest.basins import Basins
from dicedesign.rest.border_arcs import Arcs, Borders
from dicedesign.rest.prior import (
    PRIORS,
    DensityPrior,
    PriorKind,
    PriorOdds,
    axis_of,
)
from dicedesign.runtime.arrays import Booleans, Floats
from dicedesign.runtime.checks import is_finite_number

__all__ = ["SphericalCap"]

LEAST_DEG = 1e-4
"""Below it a cap is no wider than rounding lets it be measured."""


@dataclass(frozen=True)
class SphericalCap(DensityPrior):
    """All directions within an angle of an axis, equally likely.

    Attributes
    ----------
    axis: (3,) the middle, of any length but zero.
    angle_deg: from `LEAST_DEG` to 180; 90 is half the sphere.

    Raises InputError for others.
    """

    axis: Sequence[float]
    angle_deg: float = 90.0

    def __post_init__(self) -> None:
        axis = axis_of(self.axis)
        object.__setattr__(self, "axis", tuple(axis.tolist()))
        angle = self.angle_deg
        if not (is_finite_number(angle) and LEAST_DEG <= angle <= 180.0):
            raise InputError(
                f"prior: expected an angle from {LEAST_DEG:g} to 180 degrees, got "
                f"{angle!r}; 90 is half of all directions"
            )

    @cached_property
    def _axis(self) -> Floats:
        return np.array(self.axis)

    @property
    def _angle(self) -> float:
        return math.radians(self.angle_deg)

    @property
    def _inside(self) -> float:
        """Density in the cap."""
        return 1.0 / (4.0 * math.pi * math.sin(self._angle / 2.0) ** 2)

    def density(self, directions: Floats) -> Floats:
        """(n,) density per steradian in unit directions (n, 3)."""
        apart = np.linalg.norm(directions - self._axis, axis=-1)
        return np.where(apart <= 2.0 * math.sin(self._angle / 2.0), self._inside, 0.0)

    def odds(self, basins: Basins) -> PriorOdds:
        """Odds of the rests, in closed form: borders are clipped at the cap's, and of each piece
        the triangle with the axis counts inside, and that with its antipode outside."""
        borders = Borders.of_basins(basins)
        arcs = borders.arcs
        ends, inside = self._pieces(arcs)
        points = arcs.at(np.arange(len(ends)), ends)
        a, b = points[:, :-1], points[:, 1:]
        near = signed_solid_angle(self._axis, a, b, np)
        far = signed_solid_angle(-self._axis, a, b, np)
        even = 1.0 / (4.0 * math.pi)
        pieces = np.where(inside, (self._inside - even) * near, -even * far)
        odds = basins.areas * even + borders.sums(pieces.sum(axis=1))
        rounding = np.finfo(np.float64).eps * (1.0 + borders.totals(np.abs(pieces).sum(axis=1)))
        return PriorOdds(np.maximum(odds, 0.0), rounding)

    def _pieces(self, arcs: Arcs) -> tuple[Floats, Booleans]:
        """(n, 8) ascending distances between which arcs are in the cap or out of it, and (n, 7)
        whether they are."""
        near = arcs.nearest(self._axis)
        height = arcs.pole @ self._axis
        # Angle of the axis from the plane of each arc, and from there to the cap's border.
        off = np.arctan2(
            np.abs(height), np.hypot(arcs.start @ self._axis, arcs.toward @ self._axis)
        )
        square = np.sin((self._angle + off) / 2.0) * np.sin((self._angle - off) / 2.0)
        # Of a plane through the border's own middle the cosine is zero.
        cosine = np.maximum(np.cos(off), np.finfo(np.float64).tiny)
        half = 2.0 * np.arcsin(np.sqrt(np.clip(square / cosine, 0.0, 1.0)))
        turns = near[:, None] + 2.0 * math.pi * np.arange(-1, 2)
        crossings = np.concatenate([turns - half[:, None], turns + half[:, None]], axis=1)
        clipped = np.clip(crossings, 0.0, arcs.length[:, None])
        ends = np.sort(np.column_stack([np.zeros(len(near)), clipped, arcs.length]), axis=1)
        middle = (ends[:, 1:] + ends[:, :-1]) / 2.0
        inside = (np.abs(middle[..., None] - turns[:, None, :]) < half[:, None, None]).any(axis=-1)
        return ends, inside

    def fluxes(self, arcs: Arcs) -> Floats:
        """See `DensityPrior`."""
        ends, inside = self._pieces(arcs)
        width = np.where(inside, 2.0 * np.sin((ends[:, 1:] - ends[:, :-1]) / 2.0), 0.0)
        middle, length = (ends[:, 1:] + ends[:, :-1]) / 2.0, arcs.length[:, None]
        moments = [(np.sin(place) * width).sum(axis=1) for place in (length - middle, middle)]
        return self._inside * np.column_stack(moments) / np.sin(length)


def _read_half(text: str) -> SphericalCap:
    return SphericalCap([float(x) for x in text.split(",")])


def _read_cap(text: str) -> SphericalCap:
    axis, angle = text.split(":")
    return SphericalCap([float(x) for x in axis.split(",")], float(angle))


PRIORS.register(
    PriorKind(
        name="half",
        line="all directions within 90 degrees of the axis alike, and no others",
        rank=2,
        form="half:x,y,z",
        read=_read_half,
    )
)
PRIORS.register(
    PriorKind(
        name="cap",
        line="the same within another angle, in degrees",
        rank=3,
        form="cap:x,y,z:ANGLE",
        read=_read_cap,
    )
)
