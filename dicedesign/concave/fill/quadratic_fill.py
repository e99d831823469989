"""Hull fill by quadratic programs: a surface grows inside a wanted hull until it spans it.

First as in appendix B.1: each corner of the hull draws on the point of the surface nearest to it,
more and more strongly. That leaves the hull rounded: no corner is met but by a corner of the
surface, and which one it is, the nearest points do not tell. So then each corner draws on a vertex
of its own, and at last those vertices are put in place exactly and the others follow.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.sparse import csc_array, csr_array, eye_array, kron
from scipy.spatial.distance import cdist

from dicedesign.concave.fill.elastic_energy import SOFT, ElasticEnergy, ElasticWeights
from dicedesign.concave.fill.quadratic_program import NO_SUMS, PointsInside
from dicedesign.concave.fill.result import FillResult, FillStatus, FillStep
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.surfaces.closest_points import closest_points
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.registry import STRICT

__all__ = ["QuadraticFillOptions", "fill_by_quadratic_programs"]

OnStep = Callable[[FillStep], None]

Terms = Callable[[Floats], dict[str, float]]

MARGIN: Final = 1e-6
"""Depth inside the hull, over the diagonal of the surface, that all points keep which are not put
onto a corner: the corners alone then span the hull, in single precision too."""

INNER: Final = 0.1
"""A vertex that the surface's own hull does not have is taken for a corner at the cost of the
square of this distance, over the diagonal, besides that of its own."""

PROXIMAL: Final = 1e-6
"""Weight of squared moves: the elastic energy leaves some free."""

SHORTEST: Final = 1e-3
"""Part of a step below which none is taken."""

RISING: Final = 3
"""Steps in which corners draw on the closest points, or on those they are known to have, more and
more strongly."""

MATCHING: Final = 100.0
"""Weight of closeness over that of the first step where corners draw on vertices of their own: so
little that the corners shift those all alike rather than each to where another should be."""

MATCHINGS: Final = 10
"""Most steps of that kind; they end where all corners keep theirs."""

SETTLED: Final = 5e-3
"""Part of the energy that a last step must be worth."""


@dataclass(frozen=True)
class QuadraticFillOptions:
    """Options of the hull fill by quadratic programs.

    Attributes
    ----------
    elastic: weights of membrane and bending energy.
    closeness: weight of the mean squared distance of the hull's corners, over the squared diagonal,
        in the first step; positive.
    growth: factor of that weight from step to step, above 1.
    steps: most steps once the corners are in place, at least 1.
    """

    __pydantic_config__ = STRICT

    elastic: ElasticWeights = SOFT
    closeness: float = 1.0
    growth: float = 10.0
    steps: int = 20

    def __post_init__(self) -> None:
        if not 0.0 < self.closeness < np.inf:
            raise InputError(
                f"closeness: expected a positive number, got {self.closeness:g}; leave it out for 1"
            )
        if not 1.0 < self.growth < np.inf:
            raise InputError(
                f"growth: expected a number above 1, got {self.growth:g}; leave it out for 10"
            )
        if self.steps < 1:
            raise InputError(
                f"steps: expected a whole number above 0, got {self.steps}; leave it out for 20"
            )


def fill_by_quadratic_programs(
    surface: Surface,
    hull: ConvexHull,
    options: QuadraticFillOptions,
    *,
    corners: Integers | None = None,
    center_of_mass: Floats | None = None,
    on_step: OnStep | None = None,
) -> FillResult:
    """Deform a surface as little as may be until its convex hull is a wanted one.

    The hull of the result has the corners of the wanted one to the last bit, and no other, unless
    the status says otherwise.

    Parameters
    ----------
    surface: the reference of the elastic energy, and the start.
    hull: wanted; it has at most as many corners as the surface has points.
    options: see `QuadraticFillOptions`.
    corners: (k,) different points of the surface that become the hull's corners, in the order of
        `hull.vertices`. None to find them, as the paper does.
    center_of_mass: (3,) of the uniform solid, to which the last steps lead: each meets it to first
        order, and `balance` does the rest. None to leave it to `balance` altogether, as the paper
        does.
    on_step: called after every accepted step.

    Raises
    ------
    InputError: more corners than points; corners of another number or not different; a triangle
        without area; Clarabel is not installed.
    """
    if len(hull.vertices) > len(surface.points):
        raise InputError(
            f"hull: expected at most {len(surface.points)} corners, as many as the surface has "
            f"points, got {len(hull.vertices)}; make the surface finer"
        )
    if corners is not None and (
        len(corners) != len(hull.vertices) or len(np.unique(corners)) != len(corners)
    ):
        raise InputError(
            f"corners: expected {len(hull.vertices)} different points of the surface, one for each "
            f"corner of the hull, got {len(np.unique(corners))}; leave them out to have them found"
        )
    return _Fill(surface, hull, options, center_of_mass, on_step).run(corners)


class _Unsolved(Exception):
    """A quadratic program has no solution that can be found, or a triangle has become flat."""


@dataclass(eq=False)
class _Fill:
    """One fill, in units of the surface's diagonal about the hull's centroid."""

    surface: Surface
    hull: ConvexHull
    options: QuadraticFillOptions
    center_of_mass: Floats | None
    on_step: OnStep | None
    history: list[FillStep] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.started = time.perf_counter()
        self.unit, self.middle = self.surface.diagonal, self.hull.centroid
        self.scaled = self.surface.moved((self.surface.points - self.middle) / self.unit)
        self.targets = (self.hull.vertices - self.middle) / self.unit
        self.heights = self.hull.heights(self.middle) / self.unit
        self.inside = PointsInside(self.hull.normals, self.heights - MARGIN)
        self.elastic = ElasticEnergy.of(self.scaled, self.options.elastic)
        self.weight = self.options.closeness
        self.centering_weight = 1.0
        self.extra_costs = np.full(len(self.scaled.points), INNER * INNER)
        self.extra_costs[convex_hull(self.surface.points).source] = 0.0
        self.points = self.inside.largest(self.scaled.points, self.scaled.centroid)

    def run(self, corners: Integers | None) -> FillResult:
        status = FillStatus.UNSOLVED
        with suppress(_Unsolved):
            self.record(self.drawn_terms(corners)(self.points))
            for _ in range(RISING):
                self.draw(corners)
                self.weight *= self.options.growth
            if corners is None:
                corners = self.found_corners()
            status = self.settle(corners)
        points = self.points * self.unit + self.middle
        if status is not FillStatus.UNSOLVED:
            points[corners] = self.hull.vertices
        return FillResult(points, self.history[-1].gap, tuple(self.history), status)

    def found_corners(self) -> Integers:
        """(k,) the points of the surface that become corners of the hull; the others are drawn
        along on the way."""
        self.weight = MATCHING * self.options.closeness
        corners = self.matching()
        for _ in range(MATCHINGS):
            self.draw(corners)
            before, corners = corners, self.matching()
            if (corners == before).all():
                break
        return corners

    def matching(self) -> Integers:
        """(k,) a point of its own for each corner of the hull, at the least sum of squares."""
        costs = cdist(self.targets, self.points, "sqeuclidean") + self.extra_costs
        return np.asarray(linear_sum_assignment(costs)[1])

    def drawn_terms(self, corners: Integers | None) -> Terms:
        """The weighted energies, by points, where the hull's corners draw on some of them, or on
        the closest of the surface."""

        def terms(points: Floats) -> dict[str, float]:
            if corners is None:
                distances = closest_points(self.scaled.moved(points), self.targets).distances
            else:
                distances = norms(points[corners] - self.targets)
            closeness = self.weight * float((distances * distances).mean())
            return {"closeness": closeness, **self.elastic.terms(points)}

        return terms

    def draw(self, corners: Integers | None) -> None:
        """One step of eq. 29 and 30."""
        points, count = self.points, len(self.targets)
        if corners is None:
            pull = closest_points(self.scaled.moved(points), self.targets).matrix(len(points))
        else:
            entries = (np.ones(count), (np.arange(count), corners))
            pull = csr_array(entries, shape=(count, len(points)))
        weighted = 2.0 * self.weight / count * pull.T
        gradient, hessian = self.elastic.model(points)
        gradient = gradient + weighted @ (pull @ points - self.targets)
        hessian = hessian + kron(weighted @ pull, np.eye(3), format="csc")
        nobody = np.empty(0, dtype=np.int64)
        move = self.move(gradient, hessian, nobody, np.empty((0, 3)))
        terms = self.descend(self.inside.mended(points + move), self.drawn_terms(corners))
        self.record(terms)

    def settle(self, corners: Integers) -> FillStatus:
        """Put the corners' points in place, and the others where the elastic energy is least."""
        gradient, hessian = self.elastic.model(self.points)
        move = self.move(gradient, hessian, corners, self.targets - self.points[corners])
        self.points = self.inside.mended(self.points + move)
        self.points[corners] = self.targets
        terms = self.settled_terms(self.points)
        self.record(terms)
        if not np.isfinite(sum(terms.values())):
            raise _Unsolved
        for _ in range(self.options.steps):
            gradient, hessian = self.elastic.model(self.points)
            sums = self.centering()
            move = self.move(gradient, hessian, corners, np.zeros_like(self.targets), sums)
            self.raise_centering(move, gradient, hessian, sums[1])
            trial = self.inside.mended(self.points + move)
            trial[corners] = self.targets
            before = sum(self.settled_terms(self.points).values())
            terms = self.descend(trial, self.settled_terms)
            self.record(terms)
            if before - sum(terms.values()) <= SETTLED * before:
                return FillStatus.FITTED
        return FillStatus.STEP_LIMIT

    def raise_centering(
        self, move: Floats, gradient: Floats, hessian: csc_array, offset: Floats
    ) -> None:
        """Let what a move brings to the center of mass outweigh what it costs in energy (Nocedal
        and Wright, Numerical Optimization, eq. 18.36)."""
        distance = float(norms(offset)) if len(offset) > 0 else 0.0
        if distance > 0.0:
            flat = move.ravel()
            cost = float(gradient.ravel() @ flat + 0.5 * flat @ (hessian @ flat))
            self.centering_weight = max(self.centering_weight, 2.0 * cost / distance)

    def settled_terms(self, points: Floats) -> dict[str, float]:
        """The elastic energies, and the penalty on the center of mass where one is wanted."""
        terms = self.elastic.terms(points)
        if self.center_of_mass is not None:
            terms["centering"] = self.centering_weight * float(norms(self.off_center(points)))
        return terms

    def off_center(self, points: Floats) -> Floats:
        """(3,) from the center of mass to the wanted one."""
        assert self.center_of_mass is not None
        wanted = (self.center_of_mass - self.middle) / self.unit
        return np.asarray(wanted - self.scaled.moved(points).centroid)

    def centering(self) -> tuple[Floats, Floats]:
        """What moves of points do to the center of mass, and what they are to do."""
        if self.center_of_mass is None:
            return NO_SUMS
        derivatives = self.scaled.moved(self.points).centroid_derivatives()
        return derivatives, self.off_center(self.points)

    def move(
        self,
        gradient: Floats,
        hessian: csc_array,
        known: Integers,
        moves: Floats,
        sums: tuple[Floats, Floats] = NO_SUMS,
    ) -> Floats:
        """(n, 3) to the minimum of a model of the energy, inside the hull."""
        hessian = csc_array(hessian + PROXIMAL * eye_array(hessian.shape[0]))
        move = self.inside.step(self.points, hessian, gradient, known, moves, sums)
        if move is None:
            raise _Unsolved
        return move

    def descend(self, trial: Floats, terms: Terms) -> dict[str, float]:
        """Go on to a trial, or as much of the way as lowers the energy; its terms there."""
        found = terms(self.points)
        before, part = sum(found.values()), 1.0
        while part >= SHORTEST:
            points = trial if part == 1.0 else self.points + part * (trial - self.points)
            there = terms(points)
            if sum(there.values()) < before:
                self.points = points
                return there
            part *= 0.5
        return found

    def record(self, terms: dict[str, float]) -> None:
        """Note where the surface is."""
        found = closest_points(self.scaled.moved(self.points), self.targets)
        gap = float(found.distances.max())
        outside = -float((self.heights - self.points @ self.hull.normals.T).min())
        seconds = time.perf_counter() - self.started
        step = FillStep(len(self.history), seconds, terms, gap, max(outside, 0.0))
        self.history.append(step)
        if self.on_step is not None:
            self.on_step(step)
