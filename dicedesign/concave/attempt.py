"""One way from a surface to a concave die: a hull is designed for it, and the surface fills it."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from dicedesign.balance.regions import is_shifted
from dicedesign.concave.correspondence import fill_by_correspondence
from dicedesign.concave.hull_design import (
    NEAREST,
    UNCROSSED,
    HullDraft,
    design_hull,
    make_designed_hull,
    nearer_draft,
    relax_hull,
    settle_draft,
)
from dicedesign.concave.hull_problem import DesignedHull, HullProblem, point_masses
from dicedesign.concave.options import ConcaveOptions, ConcavePaperOptions
from dicedesign.concave.outcome_directions import outcome_choices
from dicedesign.concave.result import (
    MOST_EASED,
    FilledHull,
    FillResult,
    FillStatus,
    doubts,
    missing,
    rank,
)
from dicedesign.concave.slopes import SlopeOptions
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.sphere import best_similarity, norms
from dicedesign.geometry.surfaces.self_intersections import intersecting_triangles
from dicedesign.geometry.triangles import Surface
from dicedesign.rest.outcomes import outcome_margins, outcome_probabilities
from dicedesign.rest.poses import analyze
from dicedesign.runtime.arrays import Floats

ROOM = 0.8
"""Part of the tolerance that the hull's design may use: the file is rounded afterwards."""

EASINGS = 6
"""Times that the hull is eased where the surface meets itself."""

WIDTH = 0.08
"""Distance from such a place within which it is eased the first time, over the circumscribed
radius."""

WIDENING = 1.3
"""Factor of that distance each further time."""

HELPED = 0.8
"""Part of the pairs of triangles that meet that may be left for easing to go on."""

SLOPES = SlopeOptions(fall=3e-3, rise=4e-3, circle=math.radians(3.0))
"""Of the first designs, where no larger circle is needed for the margin."""

CIRCLE = 0.75
"""Least circle about the outcomes over the margin: slopes rise on it and on one half as large
again."""

SHAKEN = 1.5
"""Factor by which the slopes of later attempts differ at most, once all choices were tried."""

BEYOND = math.radians(20.0)
"""Angle between outcomes beyond the least one that is wanted, at first: it shrinks on the way."""

FARTHEST = math.radians(80.0)
"""Angle that is not asked for at first if a smaller one is wanted."""


SAFE = 0.8
"""Part of the reach of cavities that is used: that of the surface as it will be bent is another."""

LESS = 0.6
"""Factor of it where that was too much."""

SHIFTS = 3
"""Times that the center of mass is shifted once more for a cavity."""


@dataclass(frozen=True, eq=False)
class Attempts:
    """Attempts at one die. Coordinates are those of the surface about its center of mass, over its
    circumscribed radius.

    Attributes
    ----------
    surface, target, options, seed, wall: see `make_concave_die`.
    on_step: called with the number of the attempt, the stage, the energy and the largest |p - q|,
        or without it where the stage does not know.
    """

    surface: Surface
    target: Floats
    options: ConcaveOptions
    seed: int
    on_step: Callable[..., None]
    wall: float | None = None

    @cached_property
    def center(self) -> Floats:
        """(3,) the surface's center of mass."""
        return self.surface.centroid

    @cached_property
    def radius(self) -> float:
        """The circumscribed one about it."""
        return float(norms(self.surface.points - self.center).max())

    @cached_property
    def problem(self) -> HullProblem:
        """Problem of the hull's design."""
        options = self.options
        return HullProblem(
            self.surface.with_points((self.surface.points - self.center) / self.radius),
            self.target,
            tolerance=ROOM * options.tolerance,
            apart=math.radians(options.apart_deg),
            margin=math.radians(options.margin_deg),
            coarse=options.hull == "gauss_newton",
        )

    @cached_property
    def choices(self) -> list[Floats]:
        """(k, 3) directions of the outcomes, for one attempt after the other."""
        wanted = self.problem.apart
        apart = max(wanted, min(wanted + BEYOND, FARTHEST))
        return outcome_choices(self.problem.hull, self.target, apart, self.seed)

    def attempt(self, number: int, best: FilledHull | None) -> FilledHull | None:
        """Design and fill a hull; None where none comes about, or the best is as good."""
        problem, choices = self.problem, self.choices
        random = np.random.default_rng([self.seed, number])
        on_step = partial(self.on_step, number, "hull")
        if self.options.hull == "paper":
            # Imported late: the usual way does without.
            from dicedesign.concave.paper_hull import search_hull

            paper = self.options.paper or ConcavePaperOptions()
            design = search_hull(problem, choices, paper, random, on_step, plain=number == 1)
            return self._fill(number, problem, design, best)
        circle = max(SLOPES.circle, CIRCLE * problem.margin)
        factors = np.ones(3)
        if number > len(choices):
            factors = np.exp(random.uniform(-np.log(SHAKEN), np.log(SHAKEN), 3))
        slopes = SlopeOptions(*(factors * [SLOPES.fall, SLOPES.rise, circle]).tolist())
        draft = design_hull(problem, choices[(number - 1) % len(choices)], slopes, on_step)
        if draft is None or not self._is_promising(problem, draft, best):
            return None
        return self.fill_near(number, draft, slopes, best)

    def fill_near(
        self, number: int, draft: HullDraft, slopes: SlopeOptions, best: FilledHull | None
    ) -> FilledHull | None:
        """A hull as it was designed, brought nearer to the original and filled; None where none
        comes about, or the best is as good."""
        if self.wall is not None:
            return self._fill_about_cavity(number, draft, slopes, best, self.wall)
        best_fill = None
        for metric in (NEAREST, UNCROSSED):
            nearer = nearer_draft(self.problem, draft, slopes, metric)
            filled = self.finish(number, self.problem, nearer, best)
            if filled is None:
                break
            if self.is_better(filled, best_fill):
                best_fill = filled
            if filled.self_intersections == 0:
                break
        return best_fill

    def _fill_about_cavity(
        self,
        number: int,
        draft: HullDraft,
        slopes: SlopeOptions,
        best: FilledHull | None,
        wall: float,
    ) -> FilledHull | None:
        """Fill a hull whose center of mass is shifted by a cavity, as far as that reduces the
        bending."""
        # Imported late, with manifold3d: solid dice do without.
        from dicedesign.balance.cavity import balancing_cavity, reach

        def thickness(surface: Surface) -> float:
            return wall * convex_hull(surface.points).diameter

        def with_room(surface: Surface, part: float) -> HullProblem:
            """The problem with part of the reach of cavities in a surface, in its unit."""
            return self.problem.with_room(reach(surface, thickness(surface), part))

        def has_room(filled: FilledHull) -> bool:
            """Whether a cavity brings the center of mass to where it is wanted."""
            surface, center = self.surface.with_points(filled.points), filled.center_of_mass
            with suppress(InputError):
                if is_shifted(surface, center):
                    balancing_cavity(surface, thickness(surface), center)
                return True
            return False

        problem = with_room(self.problem.surface, SAFE)
        nearer = nearer_draft(problem, draft, slopes)
        filled = self.finish(number, problem, nearer, best)
        if filled is None or not self.is_better(filled, best):
            return None
        if not has_room(filled):
            # A solid one to begin with, which has more room when it is bent less.
            nearer = nearer_draft(self.problem, draft, slopes)
            filled = self.finish(number, self.problem, nearer, None)
        part = SAFE
        for _ in range(SHIFTS):
            if filled is None:
                break
            bent = self.problem.surface.with_points((filled.points - self.center) / self.radius)
            try:
                problem = with_room(bent, part)
            except InputError:
                break
            further = nearer_draft(problem, nearer, slopes)
            following = self.finish(number, problem, further, filled)
            if following is None or not self.is_better(following, filled):
                break
            if has_room(following):
                nearer, filled = further, following
            else:
                part *= LESS
        return filled

    def is_better(self, filled: FilledHull, best: FilledHull | None) -> bool:
        """Whether a filled hull is better than the best, or the first."""
        return best is None or rank(filled, self.options) < rank(best, self.options)

    def finish(
        self, number: int, problem: HullProblem, draft: HullDraft, best: FilledHull | None
    ) -> FilledHull | None:
        """A draft as a filled hull; None where none comes about, or the best is as good."""
        draft = settle_draft(problem, draft)
        if not self._is_promising(problem, draft, best):
            return None
        if best is not None and missing(best, self.options) == 0.0:
            # It has to be better by its angles and the displacement by its corners, to which the
            # fill adds as a rule.
            apart, margin = math.degrees(draft.apart), math.degrees(draft.margin)
            moved = problem.displacement(draft.corners - problem.hull.vertices)
            cost = (1.0 + doubts(apart, margin, self.options)) * moved
            if cost >= rank(best, self.options)[1]:
                return None
        return self._fill(number, problem, make_designed_hull(problem, draft), best)

    def _is_promising(
        self, problem: HullProblem, draft: HullDraft, best: FilledHull | None
    ) -> bool:
        """Whether a die may come of a draft, as wanted or with less missing than from the best."""
        if best is None:
            return True
        lacking = draft.shortfall(problem)
        return lacking == 0.0 or lacking < missing(best, self.options)

    def _fill(
        self, number: int, problem: HullProblem, design: DesignedHull, best: FilledHull | None
    ) -> FilledHull | None:
        """A designed hull filled in the way that the options say."""
        if self.options.fill == "correspondence":
            return self._ease(number, problem, design)
        if best is not None and design.error > max(self.options.tolerance, best.error):
            return None
        # Imported late: the usual way does without.
        from dicedesign.concave.paper_fill import fill_as_paper

        filled = fill_as_paper(
            problem.surface,
            design.hull,
            design.center_of_mass,
            self.options.paper or ConcavePaperOptions(),
            partial(self.on_step, number),
        )
        # As near as it comes.
        if filled.status is FillStatus.UNSOLVED:
            return None
        return self._measure(number, design, filled)

    def _ease(self, number: int, problem: HullProblem, design: DesignedHull) -> FilledHull | None:
        """A designed hull filled by correspondence, and eased as long as that helps; None where it
        cannot be filled."""
        points, triangles = problem.surface.points, self.surface.triangles
        best: FilledHull | None = None
        for easing in range(EASINGS + 1):
            filled = fill_by_correspondence(
                self.problem.elasticity,
                design.hull,
                design.corners,
                design.center_of_mass,
                partial(self.on_step, number, "fill"),
            )
            if filled.status is not FillStatus.FITTED:
                break
            eased = self._measure(number, design, filled)
            if best and eased.self_intersections > HELPED * best.self_intersections:
                break
            best = eased
            if easing == EASINGS or not 0 < best.self_intersections <= MOST_EASED:
                break
            crossing = np.unique(intersecting_triangles(best.points, triangles))
            places = points[np.unique(triangles[crossing])]
            following = relax_hull(problem, design, places, WIDTH * WIDENING**easing)
            if following is None:
                break
            design = following
        return best

    def _measure(self, number: int, design: DesignedHull, filled: FillResult) -> FilledHull:
        """A designed hull after it was filled."""
        unit = self.problem.surface
        back = best_similarity(filled.points, unit.points, point_masses(unit))
        solid = unit.with_points(back(filled.points))
        # As they come out of a file of single precision.
        rounded = unit.with_points(solid.points.astype(np.float32).astype(np.float64))
        reached = convex_hull(rounded.points, single_precision=True)
        shift = back(design.center_of_mass + design.shift) - back(design.center_of_mass)
        poses = analyze(reached, rounded.centroid + shift)
        directions = design.directions @ back.rotation.T
        outcomes = outcome_probabilities(poses, directions)
        error = outcomes.error(self.target)
        self.on_step(number, "fill", filled.energy, error)
        return FilledHull(
            attempt=number,
            points=self.center + self.radius * solid.points,
            hull_points=self.center + self.radius * back(design.hull.vertices),
            center_of_mass=self.center + self.radius * (solid.centroid + shift),
            directions=directions,
            error=error,
            displacement=float(norms(solid.points - unit.points).mean() / unit.diagonal),
            apart_deg=float(np.degrees(outcomes.least_angle)),
            margin_deg=float(np.degrees(outcome_margins(poses, outcomes).min())),
            self_intersections=len(intersecting_triangles(solid.points, unit.triangles)),
        )
