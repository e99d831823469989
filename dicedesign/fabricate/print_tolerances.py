"""How far the odds of prints are from those that were designed, to first order.

A print differs from its file in the place of each facet, in its length along each axis of the
printer, in its density from bottom to top and by a bubble. With the derivatives of the odds these
give the covariance of the odds among prints; and Pearson's test says how large it may be.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Final

import numpy as np
import torch
from scipy.optimize import brentq

from dicedesign.errors import DiceError
from dicedesign.fabricate.printers import PrintErrors
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull, polyhedron_corners
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.triangles import doubled_area_vectors, is_closed, second_moments
from dicedesign.gradient.facet_measures import offset_derivatives
from dicedesign.gradient.odds_model import OddsModel
from dicedesign.gradient.rest_odds import RestEvaluation, evaluate_rests
from dicedesign.rest.outcomes import OutcomeOdds, gathered
from dicedesign.rest.poses import RestPoses
from dicedesign.results.result import PrintTolerances
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.goodness_of_fit import LEVEL, chance_noticed, chances_noticed


@dataclass(frozen=True, eq=False)
class OddsSlopes:
    """Derivatives of the odds of k outcomes at a body with n corners and m facets.

    Attributes
    ----------
    hull: of the body.
    center: (3,) its center of mass.
    volume: of the body, or where its surface is open of its hull; inside: (3, 3) mean of the
        products of two coordinates over it, about the center of mass.
    by_corners: (k, n, 3) in the corners, the center of mass staying where it is.
    by_planes: (k, m) in the offsets of the facets, likewise.
    is_uniform: whether the center of mass is that of the solid, and so moves with what is added.
    """

    hull: ConvexHull
    center: Floats
    volume: float
    inside: Floats
    by_corners: Floats
    by_planes: Floats
    is_uniform: bool

    @classmethod
    def of(
        cls,
        body: Body,
        poses: RestPoses,
        outcomes: OutcomeOdds,
        model: OddsModel | None = None,
    ) -> OddsSlopes:
        """Those of a body and its rests; of a tied one the mean over the bodies beside it.

        outcomes: what its rests count for; model: of the odds, where they are not those
        without momentum and with any side down alike; is_uniform: False for a center of mass that
        was given.
        """
        place = np.full(len(poses.hull.normals), -1)
        place[poses.facets] = outcomes.outcome_of_rest
        rows, planes = [], []
        for side in poses.basins:
            center = torch.from_numpy(side.equilibria.center_of_mass)
            vertices = torch.from_numpy(side.equilibria.hull.vertices)
            rests = RestEvaluation(side.equilibria, vertices, center, side)
            jacobian = rests.jacobian if model is None else model.jacobian(rests)
            of_outcomes = np.zeros((len(outcomes.odds), jacobian.shape[1]))
            of_rests = place[side.paths.rests]
            np.add.at(of_outcomes, of_rests[of_rests >= 0], jacobian[of_rests >= 0])
            rows.append(of_outcomes)
            planes.append(offset_derivatives(rests, of_outcomes))
        points, triangles = body.points, body.triangles
        if triangles is None or not is_closed(triangles):
            points, triangles = poses.hull.vertices, poses.hull.triangles
        moments, volume = second_moments(points - poses.center_of_mass, triangles, np)
        return cls(
            hull=poses.hull,
            center=poses.center_of_mass,
            volume=float(volume),
            inside=np.asarray(moments / volume),
            by_corners=np.mean(rows, axis=0).reshape(len(outcomes.odds), -1, 3),
            by_planes=np.mean(planes, axis=0),
            is_uniform=poses.center_of_mass_source != "given",
        )

    @cached_property
    def by_center(self) -> Floats:
        """(k, 3) in the center of mass: a body that moves as a whole keeps its odds."""
        return -self.by_corners.sum(axis=1)

    @cached_property
    def by_offsets(self) -> Floats:
        """(k, m) in the offsets of the facets, with which the center of mass moves by the material
        that comes on."""
        if not self.is_uniform:
            return self.by_planes
        corners = self.hull.vertices[self.hull.triangles]
        areas = norms(doubled_area_vectors(self.hull.vertices, self.hull.triangles)) / 2.0
        first = self.hull.facet_start[:-1] - 2 * np.arange(len(self.hull.normals))
        added = areas[:, None] * (corners.mean(axis=1) - self.center) / self.volume
        return self.by_planes + self.by_center @ np.add.reduceat(added, first, axis=0).T

    def by_stretches(self, axes: Floats) -> Floats:
        """(k, 3) in the relative lengths along orthonormal axes (3, 3), one a row."""
        radii = (self.hull.vertices - self.center) @ axes.T
        along = self.by_corners @ axes.T
        return np.asarray((along * radii).sum(axis=1))

    def by_gradient(self, axis: Floats) -> Floats:
        """(k,) in the relative change of the density from one end of the body to the other along a
        unit axis (3,)."""
        heights = self.hull.vertices @ axis
        return np.asarray(self.by_center @ (self.inside @ axis) / np.ptp(heights))

    def of_bubble(self) -> Floats:
        """(k, k) covariance of the odds for a bubble of volume 1 anywhere in the body: the center
        of mass moves away from it by its part of the volume."""
        return np.asarray(self.by_center @ self.inside @ self.by_center.T / self.volume**2)


PRINTS: Final = 32
"""So many tell the part that is noticed to within some hundredths."""


@dataclass(frozen=True, eq=False)
class OffPrints:
    """Prints of a die.

    Attributes
    ----------
    poses: the rests of the file.
    directions: (k, 3) down in the outcomes.
    has_planes: whether the places of whole facets differ, or those of corners, see `OddsSpread`.
    model: of the odds under a prior, or None where any side is down alike at first.
    """

    poses: RestPoses
    directions: Floats
    has_planes: bool = True
    model: OddsModel | None = None

    def noticed(self, offset: float, target: Floats, bias: Floats, rolls: int) -> float:
        """Part of the prints with facets off by a standard deviation in mm that a test of so many
        rolls notices; target, bias: (k,) see `chance_noticed`. The same prints for all offsets;
        those that are no body are noticed."""
        random = np.random.default_rng(0)
        right = self._odds(self.poses.hull.vertices)
        biases = []
        for _ in range(PRINTS):
            with suppress(DiceError):
                biases.append(bias + self._odds(self._printed(offset, random)) - right)
        lost = PRINTS - len(biases)
        chances = chances_noticed(target, rolls, np.reshape(biases, (-1, len(target))))
        return float(chances.sum() + lost) / PRINTS

    def _printed(self, offset: float, random: np.random.Generator) -> Floats:
        hull, middle = self.poses.hull, self.poses.hull.centroid
        if not self.has_planes:
            return hull.vertices + offset * random.normal(size=hull.vertices.shape)
        heights = hull.heights(middle) + offset * random.normal(size=len(hull.normals))
        return middle + polyhedron_corners(hull.normals, heights)

    def _odds(self, corners: Floats) -> Floats:
        """(k,) of the outcomes of a body with these corners."""
        center = self.poses.center_of_mass
        if self.has_planes and self.poses.center_of_mass_source != "given":
            # What labels take away stays as it is.
            center = center + convex_hull(corners).centroid - self.poses.hull.centroid
        rests = evaluate_rests(torch.from_numpy(corners), torch.from_numpy(center))
        odds = rests.odds if self.model is None else self.model.odds(rests)
        return gathered(rests.hull.normals[rests.facets], odds, self.directions).odds


ROLLS: Final = 1000
"""Of the test that is not to notice."""

NOTICED: Final = 0.1
"""Part of the prints that the test may notice: twice as many as of perfect dice."""

FINENESS: Final = 1e-6
"""Part of the die's size to which the allowed offset is found."""

DOUBT: Final = 0.03
"""Part that may be noticed beyond that of the prints that are made: their own chance."""

HALVINGS: Final = 10
"""Of the range of offsets where those of the derivatives are too large."""

NEVER: Final = 1.0
"""Offset, over the die's size, beyond which nobody asks whether a test notices."""


@dataclass(frozen=True, eq=False)
class OddsSpread:
    """Covariances of a die's odds among its prints.

    Attributes
    ----------
    slopes: the derivatives of the odds.
    errors: what differs from print to print.
    has_planes: whether the places of whole facets differ; else, on a surface whose hull spans
        corners that have nothing to do with each other, those of the corners in all directions.
    axes: (3, 3) orthonormal axes of the printer in the die's coordinates, one a row, the last up.
    """

    slopes: OddsSlopes
    errors: PrintErrors
    has_planes: bool = True
    axes: Floats | None = None

    @cached_property
    def by_unit_offset(self) -> Floats:
        """(k, k) for a standard deviation of 1 of the places of facets, or of corners."""
        slopes = self.slopes
        parts = slopes.by_offsets if self.has_planes else slopes.by_corners
        rows = parts.reshape(len(parts), -1)
        return rows @ rows.T

    @cached_property
    def by_error(self) -> dict[str, Floats]:
        """(k, k) from each error, by the names of its fields."""
        axes = np.eye(3) if self.axes is None else self.axes
        stretches = self.slopes.by_stretches(axes)
        gradient = self.slopes.by_gradient(axes[2])
        unit = {
            "dimensional_mm": self.by_unit_offset,
            "shrinkage": stretches @ stretches.T,
            "density_gradient": np.outer(gradient, gradient),
            "bubble_mm3": self.slopes.of_bubble(),
        }
        return {name: deviation**2 * unit[name] for name, deviation in asdict(self.errors).items()}

    @cached_property
    def covariance(self) -> Floats:
        """(k, k) from all errors together."""
        return np.asarray(sum(self.by_error.values()))


def print_tolerances(
    spread: OddsSpread, target: Floats, bias: Floats, prints: OffPrints | None = None
) -> PrintTolerances:
    """What is known of a die's prints.

    target: (k,) wanted odds; bias: (k,) odds of the die that is printed without an error, less
        those; prints: to hold the allowed offset against, or None to trust the derivatives.
    """
    allowed = allowed_offset(spread, target, bias)
    if allowed and prints is not None:
        allowed = _let_through(prints, allowed, target, bias)
    deviations = _deviations(spread.covariance)
    return PrintTolerances(
        answer=_answer(spread, allowed),
        rolls=ROLLS,
        allowed_mm=allowed,
        noticed=chance_noticed(target, ROLLS, spread.covariance, bias),
        assumed=asdict(spread.errors),
        deviations=tuple(deviations.tolist()),
        by_error={name: tuple(_deviations(c).tolist()) for name, c in spread.by_error.items()},
        # Half the sum of the mean absolute values of normal numbers.
        total_variation=float(deviations.sum() / np.sqrt(2.0 * np.pi)),
    )


def allowed_offset(spread: OddsSpread, target: Floats, bias: Floats) -> float | None:
    """Standard deviation in mm of the places of facets, or corners, with which a test of `ROLLS`
    rolls at 5 % notices `NOTICED` of the prints, if there is no other error; 0 where it notices as
    many or more of prints without an error, None where fewer at any size of error.

    target, bias: (k,) as for `print_tolerances`.
    """

    def excess(offset: float) -> float:
        return chance_noticed(target, ROLLS, offset**2 * spread.by_unit_offset, bias) - NOTICED

    size = float(np.ptp(spread.slopes.hull.vertices, axis=0).max())
    if excess(0.0) >= 0.0:
        return 0.0
    if excess(NEVER * size) <= 0.0:
        return None
    return float(brentq(excess, 0.0, NEVER * size, xtol=FINENESS * size))


def _let_through(prints: OffPrints, offset: float, target: Floats, bias: Floats) -> float:
    """The offset, or where more of such prints are noticed the largest with which they are not."""

    def noticed(offset: float) -> float:
        return prints.noticed(offset, target, bias, ROLLS)

    if noticed(offset) <= NOTICED + DOUBT:
        return offset
    least, most = 0.0, offset
    for _ in range(HALVINGS):
        middle = (least + most) / 2.0
        least, most = (middle, most) if noticed(middle) < NOTICED else (least, middle)
    # A die at the verge of tipping: the smallest that was tried.
    return least or most


def _deviations(covariance: Floats) -> Floats:
    return np.sqrt(np.diag(covariance))


def _answer(spread: OddsSpread, allowed: float | None) -> str:
    what = "facet's place" if spread.has_planes else "corner's place, in every direction"
    level, noticed = f"{100.0 * LEVEL:.0f} %", f"{100.0 * NOTICED:.0f} %"
    if allowed is None:
        return (
            f"{ROLLS:,} rolls show nothing, however far each {what} is off: nearly all shapes of "
            "this die have its odds."
        )
    if allowed == 0.0:
        return (
            f"{ROLLS:,} rolls notice that this die is not exact, however well it is printed: a "
            f"chi-square test at {level} finds more than {noticed} of perfect prints."
        )
    return (
        f"Printed to within ±{allowed:.2g} mm (standard deviation of each {what}), {ROLLS:,} rolls "
        f"show nothing: a chi-square test at {level} finds {noticed} of such prints, and {level} "
        "of perfect ones."
    )
