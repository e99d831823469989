"""Priors with a density: the normal distribution of the sphere and a cap, both about an axis, and
any function."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from dicedesign.errors import InputError, is_finite_number
from dicedesign.geometry.sphere import signed_solid_angle
from dicedesign.rest.basins import Basins
from dicedesign.rest.border_arcs import Arcs, Borders, integrals, triangle_integrals
from dicedesign.rest.morse import basin_references, signed_areas, wraps
from dicedesign.rest.prior import (
    DensityPrior,
    PriorKind,
    PriorProbabilities,
    axis_of,
    unit_directions,
)
from dicedesign.runtime.arrays import Booleans, Floats, Integers

TOLERANCE = 1e-15
"""Absolute error of the integral along one arc."""

REACH = 8.0
"""Angle from the axis, over the width of the distribution, beyond which the density is
negligible."""

LARGEST = 1e12
"""Largest concentration: beyond it the distribution is narrower than the rounding of directions."""


@dataclass(frozen=True)
class _AxialPrior(DensityPrior):
    """A density that depends on the angle to an axis (3,) alone."""

    axis: Sequence[float]

    def __post_init__(self) -> None:
        object.__setattr__(self, "axis", tuple(axis_of(self.axis).tolist()))

    @cached_property
    def _axis(self) -> Floats:
        return np.array(self.axis)


@dataclass(frozen=True)
class VonMisesFisher(_AxialPrior):
    """Directions about an axis, with a density in proportion to exp(concentration * cosine).

    Attributes
    ----------
    axis: (3,) the most likely direction, of any length but zero.
    concentration: from 0, for uniform directions, to `LARGEST`; where it is large the mean square
        of the angle to the axis is 2 / concentration, in radians.

    Raises InputError for others.
    """

    concentration: float

    def __post_init__(self) -> None:
        super().__post_init__()
        concentration = self.concentration
        if not (is_finite_number(concentration) and 0.0 <= concentration <= LARGEST):
            raise InputError(
                f"prior: expected a concentration from 0 to {LARGEST:g}, got "
                f"{concentration!r}; 0 stands for uniform directions"
            )

    @classmethod
    def fitted(cls, directions: ArrayLike) -> VonMisesFisher:
        """The distribution under which directions (n, 3), none of them zero, are the most likely.

        Raises InputError for no such array.

        Source: Mardia and Jupp, "Directional Statistics", Wiley, 2000, section 10.3.
        """
        mean = unit_directions(directions).mean(axis=0)
        length = float(np.linalg.norm(mean))
        if length == 0.0:
            return cls((0.0, 0.0, 1.0), 0.0)

        def excess(k: float) -> float:
            """Difference between the mean direction's length at a concentration and the wanted
            length, over the wanted length."""
            return (k / 3.0 if k < 1e-3 else 1.0 / math.tanh(k) - 1.0 / k) - length

        # Imported late: rarely needed, and slow to load.
        from scipy.optimize import brentq

        most = LARGEST if excess(LARGEST) <= 0.0 else brentq(excess, 0.0, LARGEST, xtol=1e-300)
        return cls(mean.tolist(), float(most))

    def _drop(self, directions: Floats) -> Floats:
        """1 - cosine of the angle to the axis, exact for small ones."""
        apart = directions - self._axis
        return np.asarray((apart * apart).sum(-1) / 2.0)

    def density(self, directions: Floats) -> Floats:
        """(n,) density per steradian in unit directions (n, 3)."""
        drop = self._drop(directions)
        if self.concentration == 0.0:
            return np.full(drop.shape, 1.0 / (4.0 * math.pi))
        scale = self.concentration / -math.expm1(-2.0 * self.concentration) / (2.0 * math.pi)
        return np.asarray(scale * np.exp(-self.concentration * drop))

    def probabilities(self, basins: Basins) -> PriorProbabilities:
        """Probabilities of the rests: the uniform ones plus the flux of the density over the
        borders.

        With the axis as pole, the excess of a cap's probability over its share of the sphere,
        divided by the square of its sine, is smooth everywhere. By Stokes' theorem its integral
        along the border of a basin is the excess of the basin (docs/method.md).
        """
        borders = Borders.of(basins.paths, basins.points)
        arcs = borders.arcs
        height = arcs.pole @ self._axis

        def along(rows: Integers, distance: Floats) -> Floats:
            drop = self._drop(arcs.at(rows, distance))
            return np.asarray((height[rows, None] * self._excess(drop))[..., None])

        values, errors = integrals(along, self._edges(arcs), TOLERANCE)
        probabilities = basins.areas / (4.0 * math.pi) + borders.sums(values[:, 0])
        rounding = np.finfo(np.float64).eps
        return PriorProbabilities(
            np.maximum(probabilities, 0.0), borders.sums(errors, 1.0) + rounding
        )

    def _excess(self, drop: Floats) -> Floats:
        """Excess of the probability of the cap up to a drop over its share of the sphere, divided
        by 2 pi and the square of its sine."""
        k = self.concentration
        if k == 0.0:
            return np.zeros(drop.shape)
        whole = -math.expm1(-2.0 * k)
        rest = 2.0 - drop
        # Near the pole the probability of the cap, near the antipode that of its complement.
        with np.errstate(over="ignore"):
            held = -np.expm1(-k * drop) / whole - drop / 2.0
            left = rest / 2.0 + np.exp(-k * drop) * np.expm1(-k * rest) / whole
        beyond = np.where(drop < 1.0, held, left) / (2.0 * math.pi)
        square = drop * rest
        limit = np.where(drop < 1.0, k / whole - 0.5, 0.5 - k * math.exp(-2.0 * k) / whole)
        safe = np.where(square > 0.0, square, 1.0)
        return np.asarray(np.where(square > 0.0, beyond / safe, limit / (4.0 * math.pi)))

    def _edges(self, arcs: Arcs) -> Floats:
        """(n, 5) intervals of the arcs that begin or end where they are nearest to the axis."""
        near = arcs.nearest(self._axis)
        reach = REACH / math.sqrt(max(self.concentration, 1.0))
        inner = np.clip(near[:, None] + reach * np.arange(-1, 2), 0.0, arcs.length[:, None])
        return np.column_stack([np.zeros(len(near)), inner, arcs.length])

    def fluxes(self, arcs: Arcs) -> Floats:
        """See `DensityPrior`."""
        tolerance = TOLERANCE * max(self.concentration, 1.0)
        return _integrate_fluxes(self, arcs, self._edges(arcs), tolerance)


def _integrate_fluxes(prior: DensityPrior, arcs: Arcs, edges: Floats, tolerance: float) -> Floats:
    """Fluxes (n, 2) of `DensityPrior` over arcs; edges, tolerance: see `integrals`."""

    def along(rows: Integers, distance: Floats) -> Floats:
        directions = arcs.at(rows, distance).reshape(-1, 3)
        density = prior.density(directions).reshape(distance.shape)
        return density[..., None] * arcs.speeds(rows, distance)

    return integrals(along, edges, tolerance)[0]


def _axis_and_number(text: str) -> tuple[list[float], float]:
    """Axis (3,) and number in a text "x,y,z:NUMBER"."""
    axis, number = text.split(":")
    return [float(x) for x in axis.split(",")], float(number)


VON_MISES_FISHER = PriorKind(
    name="vmf",
    line="scattered about the axis as by the distribution of von Mises and Fisher",
    form="vmf:x,y,z:CONCENTRATION",
    read=lambda text: VonMisesFisher(*_axis_and_number(text)),
)


LEAST_DEG = 1e-4
"""Least angle of a cap, in degrees, above its rounding."""


@dataclass(frozen=True)
class SphericalCap(_AxialPrior):
    """All directions within an angle of an axis, equally likely.

    Attributes
    ----------
    axis: (3,) the middle, of any length but zero.
    angle_deg: from `LEAST_DEG` to 180; 90 is half the sphere.

    Raises InputError for others.
    """

    angle_deg: float = 90.0

    def __post_init__(self) -> None:
        super().__post_init__()
        angle = self.angle_deg
        if not (is_finite_number(angle) and LEAST_DEG <= angle <= 180.0):
            raise InputError(
                f"prior: expected an angle from {LEAST_DEG:g} to 180 degrees, got "
                f"{angle!r}; 90 is half of all directions"
            )

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

    def probabilities(self, basins: Basins) -> PriorProbabilities:
        """Probabilities of the rests, in closed form: borders are cut at the cap's border; a piece
        inside counts by its triangle with the axis, a piece outside by its triangle with the
        antipode."""
        borders = Borders.of(basins.paths, basins.points)
        arcs = borders.arcs
        ends, inside = self._pieces(arcs)
        points = arcs.at(np.arange(len(ends)), ends)
        a, b = points[:, :-1], points[:, 1:]
        near = signed_solid_angle(self._axis, a, b, np)
        far = signed_solid_angle(-self._axis, a, b, np)
        even = 1.0 / (4.0 * math.pi)
        pieces = np.where(inside, (self._inside - even) * near, -even * far)
        probabilities = basins.areas * even + borders.sums(pieces.sum(axis=1))
        rounding = np.finfo(np.float64).eps * (1.0 + borders.sums(np.abs(pieces).sum(axis=1), 1.0))
        return PriorProbabilities(np.maximum(probabilities, 0.0), rounding)

    def _pieces(self, arcs: Arcs) -> tuple[Floats, Booleans]:
        """(n, 8) ascending distances that divide arcs into pieces inside and outside the cap, and
        (n, 7) whether each is inside."""
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


HALF = PriorKind(
    name="half",
    line="uniform within 90 degrees of the axis",
    form="half:x,y,z",
    read=lambda text: SphericalCap([float(x) for x in text.split(",")]),
)
CAP = PriorKind(
    name="cap",
    line="uniform within an angle of the axis, in degrees",
    form="cap:x,y,z:ANGLE",
    read=lambda text: SphericalCap(*_axis_and_number(text)),
)


CUBATURE_TOLERANCE = 1e-13
"""Absolute error of all integrals together, relative to the integral over the sphere. Rough
densities have a larger one, which is reported."""


@dataclass(frozen=True, eq=False)
class DensityFunction(DensityPrior):
    """Any density of directions, by adaptive cubature over the basins. A peak far narrower than a
    degree may be missed.

    Attributes
    ----------
    function: from unit directions (n, 3), down in the body's frame, to densities (n,), at least 0,
        finite and not 0 everywhere, in any unit: they are divided by their integral.
    """

    function: Callable[[Floats], Floats]

    def _values(self, directions: Floats) -> Floats:
        """(n,) values of the function. Raises InputError where they are no densities."""
        values = np.asarray(self.function(directions), dtype=np.float64)
        if values.shape != (len(directions),):
            raise InputError(
                f"prior: expected a density for each of {len(directions)} directions, got an array "
                f"of shape {values.shape}; let the function take (n, 3) and return (n,)"
            )
        wrong = np.flatnonzero(~((values >= 0.0) & (values < np.inf)))
        if len(wrong):
            where = ", ".join(f"{x:.4g}" for x in directions[wrong[0]])
            raise InputError(
                f"prior: expected finite densities from 0 on, got {values[wrong[0]]:g} at "
                f"({where}); correct the function"
            )
        return values

    @cached_property
    def _whole(self) -> tuple[float, float]:
        """Integral over the sphere, and its error."""
        octants = []
        for signs in product((1.0, -1.0), repeat=3):
            corners = np.diag(signs)
            octants.append(corners if np.prod(signs) > 0.0 else corners[::-1])
        values, errors = triangle_integrals(self._values, np.stack(octants), CUBATURE_TOLERANCE)
        whole = float(values.sum())
        if not 0.0 < whole < np.inf:
            raise InputError(
                f"prior: expected a density with a finite integral above 0, got {whole:g}; correct "
                "the function"
            )
        return whole, float(errors.sum())

    def density(self, directions: Floats) -> Floats:
        """(n,) density per steradian in unit directions (n, 3)."""
        return self._values(directions) / self._whole[0]

    def probabilities(self, basins: Basins) -> PriorProbabilities:
        """Probabilities of the rests: sums over triangles with a side on the border, as areas are,
        with the density in them."""
        (whole, whole_error), paths = self._whole, basins.paths
        if len(paths.rests) == 1:
            return PriorProbabilities(np.ones(1), np.zeros(1))
        borders = Borders.of(basins.paths, basins.points)
        normals = basins.equilibria.hull.normals[paths.rests]
        references = basin_references(paths, basins.points, normals)
        masses, errors = np.zeros(len(normals)), np.zeros(len(normals))
        arcs = borders.arcs
        end = arcs.at(np.arange(len(arcs.length)), arcs.length[:, None])[:, 0]
        branch = np.nonzero(borders.moving)[0]
        for column in (0, 1):
            basin = paths.basins[branch // 2, column]
            sign = np.where(branch % 2 == column, 1.0, -1.0)
            triangles = np.stack([references[basin], arcs.start, end], axis=1)
            integrals, error = triangle_integrals(
                self._values, triangles, CUBATURE_TOLERANCE * whole
            )
            np.add.at(masses, basin, sign * integrals)
            np.add.at(errors, basin, error)
        masses += whole * wraps(signed_areas(paths, basins.points, references))
        masses = np.maximum(masses, 0.0)
        total = float(masses.sum())
        if total == 0.0:
            raise InputError(
                "prior: expected a density that is above 0 on more than a speck of the sphere, got "
                "one that is 0 on all basins; take VonMisesFisher or SphericalCap"
            )
        probabilities = masses / total
        # Error of one of the two sums.
        apart = abs(total - whole) / max(total, whole)
        errors = (errors + probabilities * whole_error) / max(total, whole) + apart
        return PriorProbabilities(probabilities, np.minimum(errors, 1.0))

    def fluxes(self, arcs: Arcs) -> Floats:
        """See `DensityPrior`."""
        edges = np.stack([np.zeros(len(arcs.length)), arcs.length], axis=1)
        return _integrate_fluxes(self, arcs, edges, CUBATURE_TOLERANCE)
