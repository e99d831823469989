"""Printed copies of a die, judged by its forward model.

Facets of a convex die move as planes. A surface of any shape rests on single points, and a facet of
its hull that is no rest in the file may be one of a print. So copies are made: with a smooth error
of facets or of points, other lengths along the axes of the printer, and a center of mass moved by
added material, by drift of the density and by a bubble. Points also have roughness and steps of
layers, which average out on a flat facet. All copies share their random numbers, so that a small
change of a body or an error is a small change of its copies. Pearson's test says which errors go
unnoticed. Lengths are in millimeters.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import cache, cached_property

import numpy as np
from scipy.optimize import brentq

from dicedesign.errors import DiceError
from dicedesign.fabricate.printers import Printer, PrintErrors
from dicedesign.geometry.hulls.hull import convex_hull, polyhedron_corners
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.triangles import (
    Surface,
    doubled_area_vectors,
    is_closed,
    second_moments,
)
from dicedesign.rest.outcomes import assign_rests
from dicedesign.rest.poses import RestPoses, analyze
from dicedesign.results.result import PrintTolerances
from dicedesign.runtime.arrays import Floats, Integers, sums_by_index
from dicedesign.throws.goodness_of_fit import LEVEL, chances_noticed
from dicedesign.throws.momentum_model import MomentumMixture
from dicedesign.throws.momentum_probabilities import thrown_probabilities
from dicedesign.tolerances import COPLANAR_TOLERANCE_FLOAT32, SAME_REST_ANGLE

COPIES = 64
"""Number of copies: their mean is known to an eighth of their spread."""

WAVES = 256
"""Number of plane waves whose sum is a smooth error of a surface."""

REACH = 6.0
"""Depth below the hull from which points may come to lie on it, in standard deviations."""

OTHERS = 7
"""Random numbers of a copy besides those of its shape: three lengths, the drift of the density, and
the place of a bubble."""


@dataclass(frozen=True, eq=False)
class Draws:
    """Places of a body that move, n of them, and the random numbers of c copies.

    Attributes
    ----------
    places: (n, 3) middles of facets, or points of a surface; outward: (n, 3) unit normals.
    shares: (n, 3) moment of material of unit thickness there, about the center of mass.
    smooth, rough: (n, c) errors along the normals, with a standard deviation of 1.
    others: (c, 7), see `OTHERS`; layers: (c,) place of the bed in a layer, from 0 to 1.
    """

    places: Floats
    outward: Floats
    shares: Floats
    smooth: Floats
    rough: Floats
    others: Floats
    layers: Floats

    @classmethod
    def of_facets(cls, poses: RestPoses, correlation_mm: float, copies: int) -> Draws:
        """Facets of the hull, which move as planes and are neither rough nor layered."""
        hull = poses.hull
        radii = hull.vertices - poses.center_of_mass
        areas = norms(doubled_area_vectors(radii, hull.triangles)) / 2.0
        moments = areas[:, None] * radii[hull.triangles].mean(axis=1)
        first = hull.facet_start[:-1] - 2 * np.arange(len(hull.normals))
        shares = np.add.reduceat(moments, first, axis=0)
        places = poses.center_of_mass + shares / hull.areas[:, None]
        apart = norms(places[:, None] - places) / correlation_mm
        # Facets that nearly coincide make the matrix of correlations nearly singular.
        alike = np.exp(-np.square(apart) / 2.0) + SINGULAR * np.eye(len(places))
        draws = _standard_draws(copies, len(places) + OTHERS)
        smooth = np.linalg.cholesky(alike) @ draws[:, OTHERS:].T
        flat, level = np.zeros_like(smooth), np.zeros(copies)
        return cls(places, hull.normals, shares, smooth, flat, draws[:, :OTHERS], level)

    @classmethod
    def of_points(
        cls, surface: Surface, poses: RestPoses, correlation_mm: float, copies: int
    ) -> Draws:
        """Points of a closed surface."""
        points, triangles = surface.points, surface.triangles
        radii = points - poses.center_of_mass
        doubled = doubled_area_vectors(points, triangles)
        # A third of the area and of the moment of each triangle belongs to each of its corners.
        moments = norms(doubled)[:, None] * radii[triangles].mean(axis=1) / 6.0
        thrice = np.repeat(np.hstack([doubled, moments]), 3, axis=0)
        normals, shares = np.hsplit(sums_by_index(triangles.ravel(), thrice, len(points)), 2)
        random = np.random.default_rng(0)
        phases = radii @ (random.normal(size=(3, WAVES)) / correlation_mm)
        waves = np.concatenate([np.cos(phases), np.sin(phases)], axis=1) / np.sqrt(WAVES)
        smooth = waves @ random.normal(size=(2 * WAVES, copies))
        by_copy = [np.random.default_rng([copy]) for copy in range(copies)]
        return cls(
            places=points,
            outward=normals / np.maximum(norms(normals), np.finfo(np.float64).tiny)[:, None],
            shares=shares,
            smooth=smooth,
            others=np.array([random.normal(size=OTHERS) for random in by_copy]),
            layers=np.array([random.uniform() for random in by_copy]),
            rough=np.stack([random.normal(size=len(points)) for random in by_copy], axis=1),
        )


SINGULAR = 1e-9
"""Variance that a facet does not share with the nearest ones, over its whole variance."""


def _standard_draws(copies: int, numbers: int) -> Floats:
    """(copies, numbers) standard normal numbers, the same for each call. If there are more copies
    than numbers, the sample mean is 0 and the sample covariance is 1, so that small errors spread
    exactly as derivatives say."""
    draws = np.random.default_rng(0).normal(size=(copies, numbers))
    if numbers >= copies:
        return draws
    return np.asarray(np.linalg.qr(draws - draws.mean(axis=0))[0] * np.sqrt(copies))


@dataclass(frozen=True, eq=False)
class PrintedCopies:
    """Copies of a body that has f labeled faces and k outcomes.

    Attributes
    ----------
    poses: its rests; directions: (f, 3) down on the faces.
    draws: places that move, and random numbers.
    is_flat: whether the places are facets.
    inside: (3, 3) mean over the body of the products of two coordinates, about the center of mass.
    volume: of the body.
    axes: (3, 3) axes of the printer in the body's coordinates, one per row, the last up.
    outcome_of: (f,) outcome of each face; None for one each.
    within: largest angle in radians from a face's own rest to others that count for its outcome.
    mixture: momentum model of the table that the die is thrown onto; None for a die set down.
    """

    poses: RestPoses
    directions: Floats
    draws: Draws
    is_flat: bool
    inside: Floats
    volume: float
    axes: Floats
    outcome_of: Integers | None = None
    within: float = SAME_REST_ANGLE
    mixture: MomentumMixture | None = None

    @classmethod
    def of(
        cls,
        body: Body,
        poses: RestPoses,
        directions: Floats,
        axes: Floats,
        correlation_mm: float,
        *,
        is_flat: bool,
        outcome_of: Integers | None = None,
        within: float = SAME_REST_ANGLE,
        mixture: MomentumMixture | None = None,
        copies: int = COPIES,
    ) -> PrintedCopies:
        """Draw the copies of a body: convex, or bounded by a closed surface.

        correlation_mm: length over which smooth errors are alike; copies: their number; others: as
        above.
        """
        surface = poses.hull.surface
        if body.triangles is not None and is_closed(body.triangles):
            surface = body.surface
        if is_flat:
            draws = Draws.of_facets(poses, correlation_mm, copies)
        else:
            draws = Draws.of_points(surface, poses, correlation_mm, copies)
        radii = surface.points - poses.center_of_mass
        squares, volume = second_moments(radii, surface.triangles, np)
        inside = np.asarray(squares / volume)
        known = poses, directions, draws, is_flat, inside, float(volume), axes
        return cls(*known, outcome_of, within, mixture)

    def probabilities(self, errors: PrintErrors, layer_mm: float) -> Floats:
        """Probabilities of the copies, (c, k + 1): of the outcomes, and elsewhere, where copies
        that are no body fall too.

        errors: standard deviations. layer_mm: height of layers; 0 for none.
        """
        draws, up = self.draws, self.axes[2]
        drift = errors.density_gradient * self.inside @ up / np.ptp(self.poses.hull.vertices @ up)
        bubble = np.linalg.cholesky(self.inside) * (errors.bubble_mm3 / self.volume)
        added = errors.dimensional_mm * (draws.smooth.T @ draws.shares) / self.volume
        if self.is_flat and self.poses.center_of_mass_source == "given":
            added[:] = 0.0
        near = self._near_places(errors, layer_mm)
        offsets = (
            errors.dimensional_mm * draws.smooth[near] + errors.roughness_mm * draws.rough[near]
        )
        results = np.zeros((len(added), len(self.exact)))
        results[:, -1] = 1.0
        for copy, result in enumerate(results):
            lengths, density, place = np.split(draws.others[copy], [3, 4])
            stretch = (self.axes.T * (1.0 + errors.shrinkage * lengths)) @ self.axes
            center = self.poses.center_of_mass + added[copy] + density * drift - bubble @ place
            with suppress(DiceError):
                points = self._move(near, offsets[:, copy])
                if layer_mm > 0.0 and not self.is_flat:
                    heights = points @ up / layer_mm + draws.layers[copy]
                    points += (layer_mm * (np.round(heights) - heights))[:, None] * up
                poses = analyze(convex_hull(points @ stretch), center @ stretch)
                result[:] = self._judge(poses.under(self.poses.prior))
        return results

    @cached_property
    def exact(self) -> Floats:
        """(k + 1,) probabilities of a copy without errors."""
        return self._judge(self.poses)

    def _judge(self, poses: RestPoses) -> Floats:
        """(k + 1,) probabilities of the outcomes of a copy, and elsewhere."""
        probabilities = poses.probabilities
        if self.mixture is not None:
            inertia = poses.hull.surface.inertia
            probabilities = thrown_probabilities(poses, inertia, self.mixture)
        faces = self.directions, self.outcome_of, self.within
        found = assign_rests(poses.normals, probabilities, *faces)
        return np.array([*found.probabilities, found.elsewhere])

    def _near_places(self, errors: PrintErrors, layer_mm: float) -> Integers:
        """Numbers of the places that can be on the hull of a copy: those of a surface not far below
        its hull."""
        if self.is_flat:
            return np.arange(len(self.draws.places))
        deviation = float(np.hypot(errors.dimensional_mm, errors.roughness_mm))
        rounding = COPLANAR_TOLERANCE_FLOAT32 * self.poses.hull.diameter
        depths = self.poses.hull.least_depths(self.draws.places)
        return np.flatnonzero(depths <= REACH * deviation + layer_mm + rounding)

    def _move(self, near: Integers, offsets: Floats) -> Floats:
        """Points (m, 3) of a copy whose near places moved outward by offsets. Raises
        DegenerateBodyError if its planes bound no body."""
        if self.is_flat:
            hull = self.poses.hull
            heights = hull.heights(hull.centroid) + offsets
            return hull.centroid + polyhedron_corners(hull.normals, heights)
        return np.asarray(self.draws.places[near] + offsets[:, None] * self.draws.outward[near])


ROLLS = 1000
"""Number of rolls of the test."""

NOTICED = 0.1
"""Largest share of prints that the test may notice: twice the share for perfect dice."""

FINEST_OFFSET = 1.0 / 512.0
"""Least offset that is tried for the allowed one, over the die's size; twice as much and so on up
to `MAX_OFFSET` are next."""

MAX_OFFSET = 1.0 / 8.0
"""Largest offset of interest, over the die's size."""

CLOSENESS = 0.01
"""Relative error of the allowed offset, less than that of the copies."""

ALONE = ("dimensional_mm", "shrinkage", "density_gradient", "bubble_mm3")
"""Errors of copies, each also without the others."""


def total_variations(target: Floats, prints: Floats) -> Floats:
    """(n,) total variations from a target (k,) of prints with probabilities (n, k); what is missing
    from 1 falls elsewhere."""
    missing = 1.0 - prints.sum(axis=1)
    return np.asarray((np.abs(prints - target).sum(axis=1) + np.abs(missing)) / 2.0)


def print_tolerances(
    copies: PrintedCopies,
    target: Floats,
    expected: Floats,
    errors: PrintErrors,
    printer: Printer,
) -> PrintTolerances:
    """Effect of print errors on the probabilities of a die, by copies of it.

    target: (k,) wanted probabilities. expected: (k,) probabilities of an exact print. errors: their
    standard deviations. printer: its name and layers.
    """
    shift = np.append(expected - copies.exact[:-1], 0.0)

    def prints(layer_mm: float = 0.0, **some: float) -> Floats:
        none = dict.fromkeys(asdict(errors).keys() - {"correlation_mm"}, 0.0)
        return copies.probabilities(replace(errors, **none | some), layer_mm) + shift

    @cache
    def excess(offset: float) -> float:
        placed = prints(dimensional_mm=offset) if offset > 0.0 else (copies.exact + shift)[None]
        return _share_noticed(target, placed) - NOTICED

    every = copies.probabilities(errors, printer.layer_mm) + shift
    names = ALONE if copies.is_flat else (*ALONE, "roughness_mm")
    alone = {name: prints(**{name: getattr(errors, name)}) for name in names}
    if not copies.is_flat:
        alone["layers"] = prints(printer.layer_mm)
    size = float(np.ptp(copies.poses.hull.vertices, axis=0).max())
    allowed = _allowed_offset(excess, size)
    off = total_variations(target, every[:, :-1])
    nine_in_ten = float(np.quantile(off, 0.9))
    if copies.is_flat:
        answer = _describe_accuracy(
            allowed,
            errors.dimensional_mm,
            copies.poses.hull.diameter,
            printer.name,
            "set down" if copies.mixture is None else "thrown",
        )
    else:
        *shares, other = (f"{100.0 * share:.2g}" for share in every.mean(axis=0))
        answer = (
            f"Printed on an ordinary printer ({printer.name}), the outcomes come up "
            f"{', '.join(shares)} % of the time, and {other} % of throws end on other sides. Nine "
            f"in ten prints are off by at most {100.0 * nine_in_ten:.2g} % in total."
        )
    return PrintTolerances(
        answer=answer,
        rolls=ROLLS,
        allowed_mm=allowed,
        noticed=_share_noticed(target, every),
        assumed=asdict(errors),
        deviations=tuple(every[:, :-1].std(axis=0).tolist()),
        by_error={name: tuple(each[:, :-1].std(axis=0).tolist()) for name, each in alone.items()},
        mean=tuple(every[:, :-1].mean(axis=0).tolist()),
        elsewhere=float(every[:, -1].mean()),
        total_variation=float(off.mean()),
        nine_in_ten=nine_in_ten,
    )


def _share_noticed(target: Floats, prints: Floats) -> float:
    """Share of prints (c, k + 1) that a test of `ROLLS` rolls notices, all that are no body among
    them."""
    chances = chances_noticed(target, ROLLS, prints[:, :-1] - target)
    return float(np.where(prints[:, -1] < 1.0, chances, 1.0).mean())


def _allowed_offset(excess: Callable[[float], float], size: float) -> float | None:
    """Offset in mm at which the excess of prints that are noticed is 0: 0 if it is above that for
    exact prints, None if it is below at any offset up to `MAX_OFFSET`.

    size: of the die in mm.
    """
    if excess(0.0) >= 0.0:
        return 0.0
    least, most = 0.0, FINEST_OFFSET * size
    while excess(most) <= 0.0:
        if most >= MAX_OFFSET * size:
            return None
        least, most = most, 2.0 * most
    return float(brentq(excess, least, most, xtol=CLOSENESS * most))


def _describe_accuracy(
    allowed: float | None, assumed: float, size: float, printer: str, way: str
) -> str:
    """Whether prints are right within chance, in a sentence. allowed, assumed: standard deviations
    of the place of each facet; size: of the die; all in mm. way: how it is rolled."""
    level, noticed = f"{100.0 * LEVEL:.0f} %", f"{100.0 * NOTICED:.0f} %"
    if allowed is None:
        return (
            f"{way.capitalize()}, your print will be right within chance for {ROLLS:,} rolls, "
            "however far each face is off: nearly all shapes of this die have its probabilities."
        )
    if allowed == 0.0:
        return (
            f"{ROLLS:,} rolls reveal that this die is not exact, however well it is printed: a "
            f"chi-square test at {level} rejects more than {noticed} of perfect prints."
        )
    limits = (
        f"(a chi-square test at {level} rejects {noticed} of prints whose faces are off by "
        f"{allowed:.2g} mm; {printer} is assumed to place them within {assumed:.2g} mm, both as "
        "standard deviations)"
    )
    if allowed >= assumed:
        return (
            f"{way.capitalize()}, your print will be right within chance for {ROLLS:,} rolls "
            f"{limits}."
        )
    return (
        f"{way.capitalize()}, your print will not be right within chance for {ROLLS:,} rolls at "
        "this size, but from "
        f"{math.ceil(size * assumed / allowed)} mm on, or on a finer printer {limits}."
    )
