"""Effect of print errors on the probabilities of a die, to first order, and of infill.

A print differs from its file in the place of each facet, in its length along each axis of the
printer, in its density from bottom to top, and by a bubble. With the derivatives of the
probabilities these give the covariance of the probabilities among prints. Pearson's test bounds the
covariance that goes unnoticed.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import numpy as np
import torch
from scipy.optimize import brentq

from dicedesign.errors import DiceError
from dicedesign.fabricate.die import Assessment
from dicedesign.fabricate.printers import PrintErrors
from dicedesign.geometry.hulls.hull import (
    ConvexHull,
    convex_hull,
    deepest_point,
    polyhedron_corners,
)
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.triangles import (
    doubled_area_vectors,
    is_closed,
    second_moments,
)
from dicedesign.gradient.facet_measures import offset_derivatives
from dicedesign.gradient.probability_model import RESTING, ProbabilityModel
from dicedesign.gradient.rest_probabilities import RestEvaluation, evaluate_rests
from dicedesign.rest.outcomes import OutcomeProbabilities, assign_rests, outcome_probabilities
from dicedesign.rest.poses import RestPoses, analyze
from dicedesign.results.result import InfillProbabilities, PrintTolerances
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.goodness_of_fit import LEVEL, chance_noticed, chances_noticed

if TYPE_CHECKING:
    from manifold3d import CrossSection, Manifold

    from dicedesign.fabricate.label_layout import Placement

PRINTS: Final = 32
"""Number of simulated prints: it estimates the noticed share to some hundredths."""

ROLLS: Final = 1000
"""Number of rolls of the test."""

NOTICED: Final = 0.1
"""Largest share of prints that the test may notice: twice the share for perfect dice."""

FINENESS: Final = 1e-6
"""Tolerance of the allowed offset, over the die's size."""

DOUBT: Final = 0.03
"""Tolerance of the noticed share of `PRINTS` prints: their statistical error."""

HALVINGS: Final = 10
"""Number of bisections of the allowed offset where derivatives overestimate it."""

NEVER: Final = 1.0
"""Largest offset of interest, over the die's size."""


AXES: Final = np.eye(3)
"""Axes of a printer aligned with the die."""


@dataclass(frozen=True, eq=False)
class ProbabilitySpread:
    """Covariance of the probabilities of k outcomes among prints of a body with n corners and m
    facets, from their derivatives.

    Attributes
    ----------
    poses: the rests of the body; directions: (f, 3) down on the faces.
    errors: standard deviations of print errors.
    model: of the probabilities.
    axes: (3, 3) orthonormal axes of the printer in the die's coordinates, one per row, the last up.
    volume: of the body, or of its hull if its surface is open; inside: (3, 3) mean over it of the
        products of two coordinates, about the center of mass.
    by_corners: (k, n, 3) derivatives in the corners at a fixed center of mass.
    by_planes: (k, m) derivatives in the offsets of the facets at a fixed center of mass.
    outcome_of: (f,) outcome that each face shows; None for one outcome each.
    """

    poses: RestPoses
    directions: Floats
    errors: PrintErrors
    model: ProbabilityModel
    axes: Floats
    volume: float
    inside: Floats
    by_corners: Floats
    by_planes: Floats
    outcome_of: Integers | None = None

    @classmethod
    def of(
        cls,
        body: Body,
        poses: RestPoses,
        directions: Floats,
        errors: PrintErrors,
        model: ProbabilityModel = RESTING,
        *,
        axes: Floats = AXES,
        outcome_of: Integers | None = None,
    ) -> ProbabilitySpread:
        """Spread of a body's probabilities; for a tied body the mean over its two perturbations."""
        place = np.full(len(poses.hull.normals), -1)
        outcomes = outcome_probabilities(poses, directions, outcome_of)
        place[poses.facets], count = outcomes.outcome_of_rest, len(outcomes.probabilities)
        rows, planes = [], []
        for side in poses.basins:
            center = torch.from_numpy(side.equilibria.center_of_mass)
            vertices = torch.from_numpy(side.equilibria.hull.vertices)
            rests = RestEvaluation(side.equilibria, vertices, center, side)
            jacobian = model.jacobian(rests)
            of_outcomes = np.zeros((count, jacobian.shape[1]))
            of_rests = place[side.paths.rests]
            np.add.at(of_outcomes, of_rests[of_rests >= 0], jacobian[of_rests >= 0])
            rows.append(of_outcomes)
            planes.append(offset_derivatives(rests, of_outcomes))
        points, triangles = body.points, body.triangles
        if triangles is None or not is_closed(triangles):
            points, triangles = poses.hull.vertices, poses.hull.triangles
        moments, volume = second_moments(points - poses.center_of_mass, triangles, np)
        return cls(
            poses=poses,
            directions=directions,
            errors=errors,
            model=model,
            axes=axes,
            volume=float(volume),
            inside=np.asarray(moments / volume),
            by_corners=np.mean(rows, axis=0).reshape(count, -1, 3),
            by_planes=np.mean(planes, axis=0),
            outcome_of=outcome_of,
        )

    @property
    def is_uniform(self) -> bool:
        """Whether the body is a uniform solid, whose center of mass moves with added material."""
        return self.poses.center_of_mass_source != "given"

    @cached_property
    def by_center(self) -> Floats:
        """(k, 3) derivatives in the center of mass: a body that moves as a whole keeps its
        probabilities."""
        return -self.by_corners.sum(axis=1)

    @cached_property
    def by_offsets(self) -> Floats:
        """(k, m) derivatives in the offsets of the facets, with the center of mass moved by the
        added material."""
        if not self.is_uniform:
            return self.by_planes
        hull = self.poses.hull
        middles = hull.vertices[hull.triangles].mean(axis=1) - self.poses.center_of_mass
        areas = norms(doubled_area_vectors(hull.vertices, hull.triangles)) / 2.0
        first = hull.facet_start[:-1] - 2 * np.arange(len(hull.normals))
        added = areas[:, None] * middles / self.volume
        return self.by_planes + self.by_center @ np.add.reduceat(added, first, axis=0).T

    @cached_property
    def by_stretches(self) -> Floats:
        """(k, 3) derivatives in the relative lengths along the axes."""
        radii = (self.poses.hull.vertices - self.poses.center_of_mass) @ self.axes.T
        return np.asarray((self.by_corners @ self.axes.T * radii).sum(axis=1))

    @cached_property
    def by_gradient(self) -> Floats:
        """(k,) derivatives in the relative change of the density from the bottom of the body to its
        top."""
        up = self.axes[2]
        tall = np.ptp(self.poses.hull.vertices @ up)
        return np.asarray(self.by_center @ (self.inside @ up) / tall)

    @cached_property
    def by_unit_offset(self) -> Floats:
        """(k, k) covariance for a standard deviation of 1 of the places of facets."""
        return self.by_offsets @ self.by_offsets.T

    @cached_property
    def by_error(self) -> dict[str, Floats]:
        """(k, k) covariance from each error, by the names of `PrintErrors`."""
        unit = {
            "dimensional_mm": self.by_unit_offset,
            "shrinkage": self.by_stretches @ self.by_stretches.T,
            "density_gradient": np.outer(self.by_gradient, self.by_gradient),
            # A bubble shifts the center of mass away from it in proportion to its volume.
            "bubble_mm3": self.by_center @ self.inside @ self.by_center.T / self.volume**2,
        }
        return {name: getattr(self.errors, name) ** 2 * each for name, each in unit.items()}

    @cached_property
    def covariance(self) -> Floats:
        """(k, k) covariance from all errors."""
        return np.asarray(sum(self.by_error.values()))

    def allowed_offset(self, target: Floats, bias: Floats) -> float | None:
        """Standard deviation in mm of the places of facets at which a test of `ROLLS` rolls at 5 %
        notices a share `NOTICED` of prints without other errors; 0 if it notices as many exact
        prints, None if it notices fewer at any size of error.

        target, bias: (k,) as for `print_tolerances`.
        """

        def excess(offset: float) -> float:
            return chance_noticed(target, ROLLS, offset**2 * self.by_unit_offset, bias) - NOTICED

        size = float(np.ptp(self.poses.hull.vertices, axis=0).max())
        if excess(0.0) >= 0.0:
            return 0.0
        if excess(NEVER * size) <= 0.0:
            return None
        return float(brentq(excess, 0.0, NEVER * size, xtol=FINENESS * size))

    def share_noticed(self, offset: float, target: Floats, bias: Floats) -> float:
        """Share of simulated prints, with facets off by a standard deviation in mm, that a test of
        `ROLLS` rolls notices; target, bias: (k,) as for `print_tolerances`. All offsets share their
        random numbers; prints that are no body count as noticed."""
        hull, random = self.poses.hull, np.random.default_rng(0)
        middle, designed = hull.centroid, self._probabilities(hull.vertices)
        biases = []
        for _ in range(PRINTS):
            with suppress(DiceError):
                depths = hull.heights(middle) + offset * random.normal(size=len(hull.normals))
                corners = middle + polyhedron_corners(hull.normals, depths)
                biases.append(bias + self._probabilities(corners) - designed)
        chances = chances_noticed(target, ROLLS, np.reshape(biases, (-1, len(target))))
        return float(chances.sum() + (PRINTS - len(biases))) / PRINTS

    def _probabilities(self, corners: Floats) -> Floats:
        """(k,) probabilities of the outcomes of a body with other corners."""
        center = self.poses.center_of_mass
        if self.is_uniform:
            # The offset that labels cause stays.
            center = center + convex_hull(corners).centroid - self.poses.hull.centroid
        rests = evaluate_rests(torch.from_numpy(corners), torch.from_numpy(center))
        normals, probabilities = rests.hull.normals[rests.facets], self.model.probabilities(rests)
        faces = self.directions, self.outcome_of
        return assign_rests(normals, probabilities, *faces).probabilities


def print_tolerances(
    spread: ProbabilitySpread, target: Floats, bias: Floats, *, is_checked: bool = True
) -> PrintTolerances:
    """Effect of print errors on a die's probabilities.

    target: (k,) wanted probabilities; bias: (k,) probabilities of an exact print less the target;
    is_checked: whether to check the allowed offset by simulated prints.
    """
    allowed = spread.allowed_offset(target, bias)
    if allowed and is_checked and spread.share_noticed(allowed, target, bias) > NOTICED + DOUBT:
        # The largest offset that goes unnoticed.
        least, most = 0.0, allowed
        for _ in range(HALVINGS):
            middle = (least + most) / 2.0
            if spread.share_noticed(middle, target, bias) < NOTICED:
                least = middle
            else:
                most = middle
        # A die at the verge of tipping gets the smallest one.
        allowed = least or most
    level, noticed = f"{100.0 * LEVEL:.0f} %", f"{100.0 * NOTICED:.0f} %"
    if allowed is None:
        answer = (
            f"{ROLLS:,} rolls rarely reveal how far each face is off: nearly all shapes of this "
            "die have its probabilities."
        )
    elif allowed == 0.0:
        answer = (
            f"{ROLLS:,} rolls reveal that this die is not exact, however well it is printed: a "
            f"chi-square test at {level} rejects more than {noticed} of perfect prints."
        )
    else:
        answer = (
            f"If your printer places each face within about {allowed:.2g} mm, {ROLLS:,} rolls "
            f"rarely reveal an error. Yours is assumed to place it within "
            f"{spread.errors.dimensional_mm:.2g} mm; both are standard deviations. A chi-square "
            f"test at {level} rejects {noticed} of prints that are off by {allowed:.2g} mm, and "
            f"{level} of perfect dice."
        )
    values, vectors = np.linalg.eigh(spread.covariance)
    normal = np.random.default_rng(0).normal(size=(DRAWS, len(target)))
    prints = target + bias + normal @ (np.sqrt(np.maximum(values, 0.0)) * vectors).T
    return PrintTolerances(
        answer=answer,
        method="derivatives",
        rolls=ROLLS,
        allowed_mm=allowed,
        noticed=chance_noticed(target, ROLLS, spread.covariance, bias),
        assumed=asdict(spread.errors),
        deviations=_roots(spread.covariance),
        by_error={name: _roots(each) for name, each in spread.by_error.items()},
        **variation_of_prints(target, prints, 0.0),
    )


DRAWS: Final = 4096
"""Number of prints drawn from the covariance."""


def _roots(covariance: Floats) -> tuple[float, ...]:
    return tuple(np.sqrt(np.diag(covariance)).tolist())


def total_variations(target: Floats, prints: Floats) -> Floats:
    """(n,) total variations from a target (k,) of prints with probabilities (n, k); what is missing
    from 1 falls elsewhere."""
    missing = 1.0 - prints.sum(axis=1)
    return np.asarray((np.abs(prints - target).sum(axis=1) + np.abs(missing)) / 2.0)


def variation_of_prints(target: Floats, prints: Floats, elsewhere: float) -> dict[str, Any]:
    """Facts on prints with probabilities (n, k) and a mean probability elsewhere."""
    off = total_variations(target, prints)
    return {
        "mean": tuple(prints.mean(axis=0).tolist()),
        "elsewhere": elsewhere,
        "total_variation": float(off.mean()),
        "nine_in_ten": float(np.quantile(off, 0.9)),
    }


STEPS: Final = 20
"""Number of infills up to 100 % among which the least one is searched."""

LEAST_MASS: Final = 1e-3
"""Least mass of a print in that search, over the solid's: the center of mass of hardly any material
is uncertain."""

Inside: TypeAlias = tuple[float, Floats]
"""Volume in mm3 and centroid (3,) of the part of a print that is infill. Where walls leave none the
volume is 0 and the centroid arbitrary."""


def inside_walls(hull: ConvexHull, walls_mm: float, pockets: Sequence[Manifold] = ()) -> Inside:
    """Inside of the walls of a convex body: its half-spaces, moved inward.

    walls_mm: above 0; pockets: solids without infill, from `pocket_walls`.
    """
    middle = hull.centroid
    depths = hull.heights(middle)
    if depths.min() <= walls_mm:
        move, _ = deepest_point(hull.normals, depths)
        depths, middle = depths - hull.normals @ move, middle + move
    if depths.min() <= walls_mm:
        return 0.0, middle
    inner = convex_hull(middle + polyhedron_corners(hull.normals, depths - walls_mm))
    core = inner.surface
    if pockets:
        from manifold3d import Manifold, OpType

        from dicedesign.geometry.meshes.manifold import mesh_of, solid

        left = Manifold.batch_boolean([solid(core), *pockets], OpType.Subtract)
        if not left.volume() > 0.0:
            return 0.0, middle
        core = mesh_of(left)
    return core.volume, core.centroid


def pocket_walls(
    sections: Sequence[tuple[Placement, CrossSection]], depth_mm: float, walls_mm: float
) -> list[Manifold]:
    """Walls around pockets, as solids that reach from outside of the facet to below the pocket's
    floor. Their lower rims are square; slicers may round them.

    sections: of the pockets, from `cut_sections`; depth_mm: of those with a share of 1.
    """
    from manifold3d import JoinType

    walls = []
    for placement, section in sections:
        deep = depth_mm * placement.depth_share + walls_mm
        around = section.offset(walls_mm, JoinType.Round).extrude(2.0 * deep)
        walls.append(around.translate((0.0, 0.0, -deep)).transform(placement.frame[:3]))
    return walls


def weigh_print(
    volume: float, centroid: Floats, inside: Inside, infill: float
) -> tuple[float, Floats]:
    """Mass of a print over the mass of a solid print, and its center of mass (3,).

    volume, centroid: of the solid, with its labels cut in; infill: 0 to 1.
    """
    missing = (1.0 - infill) * inside[0]
    mass = volume - missing
    return mass / volume, (volume * centroid - missing * inside[1]) / mass


def infill_probabilities(
    verdict: Assessment,
    directions: Floats,
    volume: float,
    inside: Inside,
    infill: float,
    walls_mm: float,
) -> InfillProbabilities:
    """Probabilities of a die printed with infill.

    Parameters
    ----------
    verdict: assessment of the file of the uniform solid.
    directions: (f, 3) down on the labeled faces.
    volume: of the solid in mm3.
    inside: of its walls.
    infill: share of the inside that is material, 0 to 1; walls_mm: thickness of the walls.
    """
    poses, solid = verdict.poses, verdict.outcomes.probabilities
    shown = solid > 0.0

    def assess(share: float) -> tuple[float, Floats, OutcomeProbabilities, bool]:
        """Mass, center of mass, probabilities, and whether the test notices them."""
        mass, center = weigh_print(volume, poses.center_of_mass, inside, share)
        at_center = analyze(poses.hull, center).under(poses.prior)
        of_face = verdict.target.outcome_of_face
        outcomes = outcome_probabilities(at_center, directions, of_face)
        change = outcomes.probabilities[shown] - solid[shown]
        chances = chances_noticed(solid[shown] / solid[shown].sum(), ROLLS, change[None])
        return mass, center, outcomes, bool(chances[0] > NOTICED)

    least = STEPS
    while least > 0:
        share = (least - 1) / STEPS
        if volume - (1.0 - share) * inside[0] < LEAST_MASS * volume or assess(share)[3]:
            break
        least -= 1
    mass, center, outcomes, is_noticed = assess(infill)
    shift = center - poses.center_of_mass
    changes = np.abs(outcomes.probabilities - solid)
    advice = (
        f"At {100.0 * infill:.0f} % infill with walls of {walls_mm:g} mm the die has "
        f"{100.0 * mass:.0f} % of its mass, its center of mass moves by {norms(shift):.2g} mm, and "
        f"the probabilities of {verdict.target.labels[int(changes.argmax())]} change most, by "
        f"{changes.max():.2g}: a chi-square test at {100.0 * LEVEL:.0f} % of {ROLLS:,} rolls "
    )
    if is_noticed:
        enough = "" if least == STEPS else f", or with {100.0 * least / STEPS:.0f} % or more"
        advice += f"notices. Print it solid, at 100 % infill{enough}."
    else:
        advice += "does not notice. Print it so, or solid."
    return InfillProbabilities(
        infill=infill,
        walls_mm=walls_mm,
        advice=advice,
        probabilities=tuple(outcomes.probabilities.tolist()),
        elsewhere=outcomes.elsewhere,
        max_abs_error=outcomes.max_abs_error(verdict.target.probabilities),
        mass=mass,
        shift_mm=tuple(shift.tolist()),
        least_infill=least / STEPS,
    )
