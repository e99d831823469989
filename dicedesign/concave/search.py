"""From a surface to a concave die: ways to a hull are tried, filled and compared."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from scipy.spatial import cKDTree

from dicedesign.concave.fill.correspondence import fill_by_correspondence
from dicedesign.concave.fill.result import FillResult, FillStep
from dicedesign.concave.fill.space_elasticity import point_masses
from dicedesign.concave.hull.design import design_hull
from dicedesign.concave.hull.easing import eased_hull
from dicedesign.concave.hull.outcome_directions import outcome_choices
from dicedesign.concave.hull.problem import DesignedHull, HullProblem
from dicedesign.concave.hull.slopes import SlopeOptions
from dicedesign.concave.options import ConcaveOptions
from dicedesign.concave.result import ConcaveDie, ConcaveProgress, ConcaveStep, FilledHull
from dicedesign.errors import NoStartError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.procrustes import best_similarity
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.surfaces.self_intersections import intersecting_triangles
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.rest.outcomes import outcome_odds
from dicedesign.rest.poses import analyse
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["make_concave_die"]

ROOM: Final = 0.8
"""Part of the tolerance that the hull's design may use: the file is rounded afterwards."""

CHOICE_SCALE: Final = 1.0
"""Mean place, among the choices of outcomes, of the one that an attempt takes."""

EASINGS: Final = 6
"""Times that the hull is eased where the surface meets itself."""

WIDTH: Final = 0.08

WIDENING: Final = 1.3
"""How far about such a place at first, over the circumscribed radius, and how much farther each
further time."""

MOST_EASED: Final = 400
"""Pairs of triangles that meet, beyond which that is hopeless."""

HELPED: Final = 0.8
"""Part of those pairs that may be left for easing to go on."""

FALLS: Final = (1e-3, 1e-2)

RISES: Final = (2e-3, 5e-3)

CIRCLES: Final = (2.0, 4.5)
"""Ranges that an attempt's slopes are drawn from, circles in degrees; see `SlopeOptions`."""


def make_concave_die(
    surface: Surface,
    target: Floats,
    options: ConcaveOptions,
    *,
    seed: int = 0,
    resume: ConcaveProgress | None = None,
    on_step: Callable[[ConcaveStep], None] | None = None,
    on_attempt: Callable[[ConcaveProgress], None] | None = None,
) -> ConcaveDie:
    """Deform a surface until its convex hull and its center of mass have the wanted odds.

    Each attempt designs the hull with the center of mass held, for one choice of outcomes, and lets
    the surface follow. The best is one without self-intersections, of least mean displacement.

    Parameters
    ----------
    surface: closed, of one component, without self-intersections (see `make_surface`).
    target: (k,) the odds.
    options: see `ConcaveOptions`.
    seed: of the attempts' slopes and choices; attempt n is the same in any session.
    resume: how far a former session came.
    on_step: called after every step.
    on_attempt: called after every attempt, with what it takes to go on from there.

    Raises
    ------
    NoStartError: no attempt led to a filled hull.
    InputError: more outcomes than the hull can carry; a fill needs a package that is missing.
    """
    return _Making(surface, target, options, seed, on_step, on_attempt).run(resume)


@dataclass(eq=False)
class _Making:
    """One search. Coordinates are those of the surface about its center of mass, over its
    circumscribed radius."""

    surface: Surface
    target: Floats
    options: ConcaveOptions
    seed: int
    on_step: Callable[[ConcaveStep], None] | None
    on_attempt: Callable[[ConcaveProgress], None] | None
    steps: list[ConcaveStep] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.started = time.perf_counter()
        self.center = self.surface.centroid
        self.radius = float(norms(self.surface.points - self.center).max())
        unit = self.surface.moved((self.surface.points - self.center) / self.radius)
        self.problem = HullProblem(unit, self.target, ROOM * self.options.tolerance)
        self.masses = point_masses(unit)

    def run(self, resume: ConcaveProgress | None) -> ConcaveDie:
        progress = resume or ConcaveProgress(0, 0.0, None, ())
        self.started -= progress.seconds
        choices = outcome_choices(self.problem.hull, self.target)
        while progress.attempts < self.options.attempts and not self._good_enough(progress.best):
            number = progress.attempts + 1
            self.steps = []
            best, found = progress.best, self._attempt(number, choices)
            history = tuple(self.steps) if best is None else progress.history
            if found is not None and (best is None or self._rank(found) < self._rank(best)):
                best, history = found, tuple(self.steps)
            progress = ConcaveProgress(number, self.seconds, best, history)
            if self.on_attempt is not None:
                self.on_attempt(progress)
        if self.options.fill == "quadratic" and progress.best is not None:
            progress = self._refilled(progress, progress.best)
        return self._result(progress)

    @property
    def seconds(self) -> float:
        """Wall-clock time, over all sessions."""
        return time.perf_counter() - self.started

    def _good_enough(self, best: FilledHull | None) -> bool:
        """Whether a die is as wanted, and near the original or all that the time allows."""
        return (
            best is not None
            and best.error <= self.options.tolerance
            and best.intersections == 0
            and (
                best.displacement <= self.options.displacement
                or self.seconds >= self.options.seconds
            )
        )

    def _rank(self, found: FilledHull) -> tuple[float, int, float]:
        """What counts, first to last: the odds, fewer self-intersections, less displacement."""
        missed = found.error if found.error > self.options.tolerance else 0.0
        return missed, found.intersections, found.displacement

    def _attempt(self, number: int, choices: list[Floats]) -> FilledHull | None:
        random = np.random.default_rng([self.seed, number])
        place = 0 if number == 1 else int(random.exponential(CHOICE_SCALE))
        directions = choices[place % len(choices)]
        design = self._designed(number, directions, random)
        found = None if design is None else self._filled(number, design)
        for easing in range(EASINGS):
            if design is None or found is None or not 0 < found.intersections <= MOST_EASED:
                break
            crossing = np.unique(self._crossing(found.points))
            places = self.problem.surface.points[np.unique(self.surface.triangles[crossing])]
            design = eased_hull(self.problem, design, places, WIDTH * WIDENING**easing)
            eased = None if design is None else self._filled(number, design)
            if eased is None or eased.intersections > HELPED * found.intersections:
                break
            found = eased
        return found

    def _crossing(self, points: Floats) -> Integers:
        """(m, 2) pairs of triangles that meet and should not."""
        return intersecting_triangles(points, self.surface.triangles)

    def _designed(
        self, number: int, directions: Floats, random: np.random.Generator
    ) -> DesignedHull | None:
        def told(energy: float, error: float) -> None:
            self._record(number, "hull", energy, error)

        if self.options.hull == "descent":
            # Imported late: the usual way does without.
            from dicedesign.concave.hull.descent import descend_hull

            return descend_hull(self.problem, directions, told)
        low, high = np.log(FALLS)
        slopes = SlopeOptions(
            fall=float(np.exp(random.uniform(low, high))),
            rise=float(random.uniform(*RISES)),
            circle=float(np.radians(random.uniform(*CIRCLES))),
        )
        return design_hull(self.problem, directions, slopes, told)

    def _filled(self, number: int, design: DesignedHull) -> FilledHull | None:
        def told(step: FillStep) -> None:
            self._record(number, "fill", sum(step.terms.values()), None)

        filled = fill_by_correspondence(
            self.problem.elasticity, design.hull, design.corners, design.center_of_mass, told
        )
        if not filled.converged:
            return None
        return self._measured(number, design.hull, design.corners, design.directions, filled)

    def _refilled(self, progress: ConcaveProgress, best: FilledHull) -> ConcaveProgress:
        """The best hull, filled by quadratic programs and balanced."""
        # Imported late: the usual way does without.
        from dicedesign.concave.fill.paper_fill import refill

        def told(stage: str, step: FillStep) -> None:
            self._record(best.attempt, stage, sum(step.terms.values()), None)

        self.steps = list(progress.history)
        unit = self.problem.surface
        points = (best.points - self.center) / self.radius
        hull = convex_hull((best.hull_points - self.center) / self.radius)
        corners = cKDTree(points).query(hull.vertices)[1]
        center = unit.moved(points).centroid
        filled = refill(unit, hull, corners, center, told)
        if not filled.converged:
            raise NoStartError(
                f"fill: expected quadratic programs to fill the hull of attempt {best.attempt}, "
                f"but they ended early ({filled.message}); leave fill out for correspondence"
            )
        found = self._measured(best.attempt, hull, corners, best.directions, filled)
        return ConcaveProgress(progress.attempts, self.seconds, found, tuple(self.steps))

    def _measured(
        self,
        number: int,
        hull: ConvexHull,
        corners: Integers,
        directions: Floats,
        filled: FillResult,
    ) -> FilledHull:
        """What came of a designed hull with outcomes in some directions (k, 3), of whose corners
        (v,) points of the surface are to be."""
        unit = self.problem.surface
        back = best_similarity(filled.points, unit.points, self.masses)
        solid = unit.moved(back(filled.points))
        # As they come out of a file of single precision.
        rounded = unit.moved(solid.points.astype(np.float32).astype(np.float64))
        reached = convex_hull(rounded.points, single_precision=True)
        poses = analyse(reached, rounded.centroid, "uniform solid")
        directions = directions @ back.rotation.T
        wanted = back(hull.vertices)
        error = outcome_odds(poses, directions).error(self.target)
        self._record(number, "fill", sum(filled.history[-1].terms.values()), error)
        displacement = norms(solid.points - unit.points).mean() / unit.diagonal
        return FilledHull(
            number,
            self._own(solid.points),
            self._own(wanted),
            directions,
            error,
            float(norms(solid.points[corners] - wanted).max()) / unit.diagonal,
            float(displacement),
            len(self._crossing(solid.points)),
        )

    def _own(self, points: Floats) -> Floats:
        """Points (n, 3) in the surface's own unit and place."""
        return self.center + self.radius * points

    def _record(self, number: int, stage: str, energy: float, error: float | None) -> None:
        self.steps.append(ConcaveStep(number, stage, self.seconds, energy, error))
        if self.on_step is not None:
            self.on_step(self.steps[-1])

    def _result(self, progress: ConcaveProgress) -> ConcaveDie:
        best = progress.best
        if best is None:
            raise NoStartError(
                f"start: expected a surface whose hull leads to the target, but none of "
                f"{progress.attempts} attempts did; allow more with method.concave.attempts, "
                "or take another target or surface"
            )
        after = self.surface.moved(best.points)
        return ConcaveDie(
            self.surface,
            after,
            convex_hull(best.hull_points),
            best.directions,
            (len(self.problem.hull.vertices), len(best.hull_points)),
            progress,
        )
