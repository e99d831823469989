"""From a surface to a concave die: ways to a hull are tried, filled and compared."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final

import numpy as np

from dicedesign.concave.fill.correspondence import fill_by_correspondence
from dicedesign.concave.fill.paper_options import ConcavePaperOptions
from dicedesign.concave.fill.result import FillResult, FillStatus
from dicedesign.concave.fill.space_elasticity import point_masses
from dicedesign.concave.hull.design import design_hull
from dicedesign.concave.hull.draft import designed_hull
from dicedesign.concave.hull.easing import eased_hull, nearer_draft, settled_draft
from dicedesign.concave.hull.outcome_directions import outcome_choices
from dicedesign.concave.hull.problem import DesignedHull, HullProblem
from dicedesign.concave.hull.slopes import SlopeOptions
from dicedesign.concave.options import ConcaveOptions
from dicedesign.concave.result import (
    AttemptResult,
    ConcaveDie,
    ConcaveProgress,
    ConcaveStep,
    FilledHull,
)
from dicedesign.errors import NoStartError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.procrustes import best_similarity
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.surfaces.distances import distances_from_surface
from dicedesign.geometry.surfaces.self_intersections import intersecting_triangles
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.rest.outcomes import outcome_margins, outcome_odds
from dicedesign.rest.poses import analyse
from dicedesign.runtime.arrays import Floats
from dicedesign.runtime.threads import one_thread

__all__ = ["make_concave_die"]

ROOM: Final = 0.8
"""Part of the tolerance that the hull's design may use: the file is rounded afterwards."""

EASINGS: Final = 6
"""Times that the hull is eased where the surface meets itself."""

WIDTH: Final = 0.08
"""Distance from such a place within which it is eased the first time, over the circumscribed
radius."""

WIDENING: Final = 1.3
"""Factor of that distance each further time."""

MOST_EASED: Final = 400
"""Pairs of triangles that meet, beyond which that is hopeless."""

HELPED: Final = 0.8
"""Part of those pairs that may be left for easing to go on."""

SLOPES: Final = SlopeOptions(fall=3e-3, rise=4e-3, circle=math.radians(3.0))
"""Of the first designs, where no larger circle is needed for the margin."""

CIRCLE: Final = 0.75
"""Least circle about the outcomes over the margin: slopes rise on it and on one half as large
again."""

SHAKEN: Final = 1.5
"""Factor by which the slopes of later attempts differ at most, once all choices were tried."""

BEYOND: Final = math.radians(20.0)
"""Angle between outcomes beyond the least one that is wanted, at first: it shrinks on the way."""

FARTHEST: Final = math.radians(80.0)
"""Angle that is not asked for at first if a smaller one is wanted."""

PREFERRED: Final = (1.5, 2.0)
"""Angle between outcomes, and margin, in units of the least ones that are wanted, beyond which more
is worth nothing. At the least ones, a die counts as displaced by as much again."""

MEETING: Final = 0.5
"""What a die that meets itself misses, in units of what will do (`HullDraft.shortfall`), beside its
odds and angles; each pair of triangles adds its part of `MOST_EASED`."""


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
    with one_thread():
        search = _Search(surface, target, options, seed, on_step)
        progress = search.attempted(resume or ConcaveProgress(0, 0.0, None, (), ()), on_attempt)
        return search.die(progress)


@dataclass(eq=False)
class _Search:
    """One search. Coordinates are those of the surface about its center of mass, over its
    circumscribed radius."""

    surface: Surface
    target: Floats
    options: ConcaveOptions
    seed: int
    on_step: Callable[[ConcaveStep], None] | None
    steps: list[ConcaveStep] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.started = time.perf_counter()
        self.center = self.surface.centroid
        self.radius = float(norms(self.surface.points - self.center).max())
        self.unit = self.surface.moved((self.surface.points - self.center) / self.radius)
        options = self.options
        self.problem = HullProblem(
            self.unit,
            self.target,
            tolerance=ROOM * options.tolerance,
            apart=math.radians(options.apart_deg),
            margin=math.radians(options.margin_deg),
            coarse=options.hull == "gauss_newton",
        )
        self.masses = point_masses(self.unit)

    @cached_property
    def choices(self) -> list[Floats]:
        """(k, 3) directions of the outcomes, for one attempt after the other."""
        wanted = self.problem.apart
        apart = max(wanted, min(wanted + BEYOND, FARTHEST))
        return outcome_choices(self.problem.hull, self.target, apart, self.seed)

    def attempted(
        self, progress: ConcaveProgress, on_attempt: Callable[[ConcaveProgress], None] | None
    ) -> ConcaveProgress:
        """The progress once all attempts are made."""
        self.started -= progress.seconds
        while progress.attempts < self.options.attempts and not self.ended(progress):
            number, begun = progress.attempts + 1, self.seconds
            self.steps = []
            best, history, tried = progress.best, progress.history, progress.tried
            filled = self.attempt(number, best)
            if filled is not None:
                tried += (_told(filled, self.seconds - begun),)
            if best is None:
                history = tuple(self.steps)
            if filled is not None and (best is None or self.rank(filled) < self.rank(best)):
                best, history = filled, tuple(self.steps)
            progress = ConcaveProgress(number, self.seconds, best, tried, history)
            if on_attempt is not None:
                on_attempt(progress)
        return progress

    @property
    def seconds(self) -> float:
        """Wall-clock time, over all sessions."""
        return time.perf_counter() - self.started

    def ended(self, progress: ConcaveProgress) -> bool:
        """True if time is out, or enough dice are as wanted, or one of them is near enough."""
        best, options = progress.best, self.options
        if options.seconds is not None and self.seconds >= options.seconds:
            return progress.attempts > 0
        if best is None or self.missing(best) > 0.0:
            return False
        good = sum(self.missing(attempt) == 0.0 for attempt in progress.tried)
        return best.displacement <= options.displacement or good >= options.enough

    def missing(self, die: FilledHull | AttemptResult) -> float:
        """What is missing from a die as wanted, as `HullDraft.shortfall`."""
        options = self.options
        missing = max(die.error / options.tolerance - 1.0, 0.0)
        if die.apart < options.apart_deg:
            missing += 1.0 - die.apart / options.apart_deg
        if die.margin < options.margin_deg:
            missing += 1.0 - die.margin / options.margin_deg
        if die.intersections > 0:
            missing += MEETING + die.intersections / MOST_EASED
        return missing

    def rank(self, filled: FilledHull) -> tuple[float, float]:
        """Sort key, best first: what is missing, then the displacement, which counts for more in
        one whose outcomes are near each other or easily left."""
        options, doubts = self.options, 0.0
        for angle, least, factor in zip(
            (filled.apart, filled.margin),
            (options.apart_deg, options.margin_deg),
            PREFERRED,
            strict=True,
        ):
            enough = factor * least
            doubts += max(enough - angle, 0.0) / max(enough - least, np.finfo(float).tiny)
        return self.missing(filled), (1.0 + doubts) * filled.displacement

    def attempt(self, number: int, best: FilledHull | None) -> FilledHull | None:
        """A hull designed and filled; None where none comes about, or what is missing from it is no
        less than from the best."""
        if self.options.hull == "paper":
            return self.attempt_as_paper(number, best)
        choices, draft = self.choices, None
        slopes = self.slopes(number)
        draft = design_hull(
            self.problem,
            choices[(number - 1) % len(choices)],
            slopes,
            lambda energy, error: self.record(number, "hull", energy, error),
        )
        if draft is None:
            return None
        missing = draft.shortfall(self.problem)
        if missing > 0.0 and best is not None and missing >= self.missing(best):
            return None
        nearer = settled_draft(self.problem, nearer_draft(self.problem, draft, slopes))
        design = designed_hull(self.problem, nearer)
        return self.filled_design(number, design, best)

    def filled_design(
        self, number: int, design: DesignedHull, best: FilledHull | None
    ) -> FilledHull | None:
        """A designed hull filled in the way that the options say."""
        if self.options.fill == "correspondence":
            return self.eased(number, design)
        if best is not None and design.error > max(self.options.tolerance, best.error):
            return None
        return self.filled_as_paper(number, design)

    def slopes(self, number: int) -> SlopeOptions:
        """Slopes to ask for in an attempt."""
        circle = max(SLOPES.circle, CIRCLE * self.problem.margin)
        factors = np.ones(3)
        if number > len(self.choices):
            random = np.random.default_rng([self.seed, number])
            factors = np.exp(random.uniform(-np.log(SHAKEN), np.log(SHAKEN), 3))
        return SlopeOptions(*(factors * [SLOPES.fall, SLOPES.rise, circle]).tolist())

    def eased(self, number: int, design: DesignedHull) -> FilledHull | None:
        """A designed hull filled by correspondence, and eased as long as that helps."""
        best = self.filled(number, design)
        for easing in range(EASINGS):
            if best is None or not 0 < best.intersections <= MOST_EASED:
                break
            crossing = np.unique(intersecting_triangles(best.points, self.surface.triangles))
            places = self.unit.points[np.unique(self.surface.triangles[crossing])]
            following = eased_hull(self.problem, design, places, WIDTH * WIDENING**easing)
            eased = None if following is None else self.filled(number, following)
            if following is None or eased is None:
                break
            if eased.intersections > HELPED * best.intersections:
                break
            best, design = eased, following
        return best

    def attempt_as_paper(self, number: int, best: FilledHull | None) -> FilledHull | None:
        """The same with a hull as in the paper."""
        # Imported late: the usual way does without.
        from dicedesign.concave.hull.paper_hull import searched_hull

        design = searched_hull(
            self.problem,
            self.choices,
            self.paper,
            np.random.default_rng([self.seed, number]),
            lambda energy, error: self.record(number, "hull", energy, error),
            plain=number == 1,
        )
        return self.filled_design(number, design, best)

    @property
    def paper(self) -> ConcavePaperOptions:
        """Of the paper's method, where it is used."""
        return self.options.paper or ConcavePaperOptions()

    def filled(self, number: int, design: DesignedHull) -> FilledHull | None:
        """A designed hull filled by correspondence, if it can be."""
        filled = fill_by_correspondence(
            self.problem.elasticity,
            design.hull,
            design.corners,
            design.center_of_mass,
            lambda energy: self.record(number, "fill", energy),
        )
        if not filled.converged:
            return None
        return self.measured(number, design, filled)

    def filled_as_paper(self, number: int, design: DesignedHull) -> FilledHull | None:
        """The same by quadratic programs and a balance, as near as these come."""
        # Imported late: the usual way does without.
        from dicedesign.concave.fill.paper_fill import fill_as_paper

        filled = fill_as_paper(
            self.unit,
            design.hull,
            design.center_of_mass,
            self.paper,
            lambda stage, energy: self.record(number, stage, energy),
        )
        if filled.status is FillStatus.UNSOLVED:
            return None
        return self.measured(number, design, filled)

    def measured(self, number: int, design: DesignedHull, filled: FillResult) -> FilledHull:
        """A designed hull after it was filled."""
        unit = self.unit
        back = best_similarity(filled.points, unit.points, self.masses)
        solid = unit.moved(back(filled.points))
        # As they come out of a file of single precision.
        rounded = unit.moved(solid.points.astype(np.float32).astype(np.float64))
        reached = convex_hull(rounded.points, single_precision=True)
        poses = analyse(reached, rounded.centroid, "uniform solid")
        directions = design.directions @ back.rotation.T
        wanted = back(design.hull.vertices)
        outcomes = outcome_odds(poses, directions)
        error = outcomes.error(self.target)
        self.record(number, "fill", filled.energy, error)
        return FilledHull(
            attempt=number,
            points=self.center + self.radius * solid.points,
            hull_points=self.center + self.radius * wanted,
            directions=directions,
            error=error,
            gap=float(distances_from_surface(solid, wanted).max()) / unit.diagonal,
            displacement=float(norms(solid.points - unit.points).mean() / unit.diagonal),
            apart=float(np.degrees(outcomes.least_angle)),
            margin=float(np.degrees(outcome_margins(poses, outcomes).min())),
            intersections=len(intersecting_triangles(solid.points, unit.triangles)),
        )

    def record(self, number: int, stage: str, energy: float, error: float | None = None) -> None:
        """Note a step."""
        self.steps.append(ConcaveStep(number, stage, self.seconds, energy, error))
        if self.on_step is not None:
            self.on_step(self.steps[-1])

    def die(self, progress: ConcaveProgress) -> ConcaveDie:
        """The best of all attempts."""
        best = progress.best
        if best is None:
            raise NoStartError(
                f"start: expected a surface whose hull leads to the target, but none of "
                f"{progress.attempts} attempts did; allow more with method.concave.attempts, "
                "or take another target or surface"
            )
        return ConcaveDie(
            self.surface,
            self.surface.moved(best.points),
            convex_hull(best.hull_points),
            best.directions,
            (len(self.problem.hull.vertices), len(best.hull_points)),
            progress,
        )


def _told(filled: FilledHull, seconds: float) -> AttemptResult:
    """A filled hull in numbers."""
    return AttemptResult(
        filled.attempt,
        seconds,
        filled.error,
        filled.displacement,
        filled.apart,
        filled.margin,
        filled.intersections,
    )
