"""One attempt at a concave die: a hull is designed for the surface, and the surface fills it."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from dicedesign.balance.regions import is_shifted
from dicedesign.concave.correspondence import fill_by_correspondence
from dicedesign.concave.hull_design import design_hull
from dicedesign.concave.hull_draft import (
    HullDraft,
    make_designed_hull,
    relax_hull,
    settle_draft,
)
from dicedesign.concave.hull_problem import (
    NEAREST,
    UNCROSSED,
    DesignedHull,
    HeldCorners,
    HullProblem,
    point_masses,
)
from dicedesign.concave.options import ConcaveOptions, ConcavePaperOptions
from dicedesign.concave.outcome_directions import outcome_choices
from dicedesign.concave.result import (
    MOST_EASED,
    FilledHull,
    JudgePrints,
    angle_penalty,
    is_better,
    is_right,
    judge,
    missing,
    prints_above_preferred,
    rank,
)
from dicedesign.concave.untangling import untangle
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.sphere import best_similarity, norms, unit_vectors
from dicedesign.geometry.surfaces.self_intersections import intersecting_triangles
from dicedesign.geometry.triangles import Surface
from dicedesign.rest.outcomes import outcome_margins, outcome_probabilities
from dicedesign.rest.poses import analyze
from dicedesign.results.parts import Draft
from dicedesign.runtime.arrays import Floats
from dicedesign.tolerances import FILE_ANGLE, SAME_REST_ANGLE

DESIGN_SHARE = 0.8
"""Share of the tolerance that the design of the hull may use: the file is rounded afterwards."""

MAX_EASINGS = 6
"""Maximum number of times that the hull is eased where the surface intersects itself."""

MOST_UNTANGLED = 30
"""Number of intersecting pairs of triangles above which they are not in a few places."""

EASING_WIDTH = 0.08
"""Distance from an intersection within which the hull is eased at first, over the circumscribed
radius."""

EASING_GROWTH = 1.3
"""Factor of that distance from one easing to the next."""

EASED_SHARE = 0.8
"""Share of the intersecting pairs of triangles that may remain for easing to continue."""

CLEARANCE = 0.01
"""Minimum clearance of a hull (`HullDraft.clearance`), over the circumscribed radius: 0.15 mm for a
die of 30 mm. Steps keep more at narrow facets."""

SETTLED = 0.05
"""Shortfall of a draft up to which it may become a die: the last steps to the probabilities do not
see the clearance."""

TRIES = 3
"""Maximum number of designs of an attempt: again in another metric if the surface intersects
itself, and firmer if its prints could be better."""

FIRM = 1.5
"""Firmness (see `design_hull`) of a design after one whose prints could be better."""

TURN = 0.3
"""Standard deviation of random changes of the outcomes' directions once all were tried."""

EXTRA_APART = math.radians(20.0)
"""Angle between outcomes beyond the required one at the start of a design, which may reduce it."""

MAX_APART = math.radians(80.0)
"""Angle between outcomes that is not exceeded at the start if a smaller one is required."""

SAFE_REACH = 0.8
"""Share of the reach of cavities that is used, as deforming the surface changes the reach."""

REACH_FACTOR = 0.6
"""Factor of that share after it was too large."""

MAX_SHIFTS = 3
"""Maximum number of further shifts of the center of mass by a cavity."""


@dataclass(frozen=True, eq=False)
class Attempts:
    """Attempts at one die. The design has its origin at the center of mass of the surface, and the
    circumscribed radius as its unit.

    Attributes
    ----------
    surface, target, options, seed, wall: see `make_concave_die`.
    on_step: receives the stage, the energy, and the largest |p - q| if the stage knows it.
    judge_prints: see `JudgePrints`; None if no prints are judged.
    """

    surface: Surface
    target: Floats
    options: ConcaveOptions
    seed: int
    on_step: Callable[..., None]
    wall: float | None = None
    judge_prints: JudgePrints | None = None

    @cached_property
    def center(self) -> Floats:
        """(3,) center of mass of the surface."""
        return self.surface.centroid

    @cached_property
    def radius(self) -> float:
        """Circumscribed radius of the surface about its center of mass."""
        return float(norms(self.surface.points - self.center).max())

    @cached_property
    def problem(self) -> HullProblem:
        """Problem of the hull's design."""
        options = self.options
        return HullProblem(
            self.surface.with_points((self.surface.points - self.center) / self.radius),
            self.target,
            tolerance=DESIGN_SHARE * options.tolerance,
            apart=math.radians(options.apart_deg),
            margin=math.radians(options.margin_deg),
            clearance=CLEARANCE if options.hull == "gauss_newton" else 0.0,
            coarse=options.hull == "gauss_newton",
        )

    @cached_property
    def drafts(self) -> list[HullDraft]:
        """The original hull with directions of the outcomes, for one attempt after the other; no
        two begin on the same facets."""
        wanted, different = self.problem.apart, dict[object, HullDraft]()
        apart = max(wanted, min(wanted + EXTRA_APART, MAX_APART))
        choices = outcome_choices(self.problem.hull, self.target, apart, self.seed)
        original = HullDraft.of(self.problem.hull.vertices, choices[0])
        assert original is not None
        for directions in choices:
            draft = replace(original, directions=directions)
            facets = sorted(zip(draft.facets.tolist(), self.target.tolist(), strict=True))
            different.setdefault(tuple(facets), draft)
        return list(different.values())

    def attempt(self, number: int, best: FilledHull | None) -> FilledHull | None:
        """Design and fill a hull; None if that fails or cannot improve on the best die.

        number: number of the attempt, from 1 on.
        """
        problem, drafts = self.problem, self.drafts
        random = np.random.default_rng([self.seed, number])
        on_step = partial(self.on_step, "hull")
        if self.options.hull == "paper":
            # The default method does not need this import.
            from dicedesign.concave.paper_hull import search_hull

            paper = self.options.paper or ConcavePaperOptions()
            choices = [draft.directions for draft in drafts]
            design = search_hull(problem, choices, paper, random, on_step, plain=number == 1)
            return self._fill(problem, design, best)
        draft = drafts[(number - 1) % len(drafts)]
        if number > len(drafts):
            turned = draft.directions + TURN * random.normal(size=draft.directions.shape)
            draft = replace(draft, directions=unit_vectors(turned))
        best_fill, metric, firmness = None, NEAREST, 1.0
        for _ in range(TRIES):
            move = partial(design_hull, on_step=on_step, metric=metric, firmness=firmness)
            if self.wall is None:
                filled = self._finish(problem, move(problem, draft), best)
            else:
                filled = self._fill_about_cavity(draft, best, self.wall, move)
            if filled is None:
                break
            if is_better(filled, best_fill, self.options):
                best_fill = filled
            if filled.draft.self_intersections > 0 and metric is NEAREST:
                metric = UNCROSSED
            elif prints_above_preferred(filled.draft, self.options) > 0.0 and firmness < FIRM:
                firmness = FIRM
            else:
                break
        return best_fill

    def _fill_about_cavity(
        self,
        draft: HullDraft,
        best: FilledHull | None,
        wall: float,
        move: Callable[[HullProblem, HullDraft], HullDraft],
    ) -> FilledHull | None:
        """Fill a hull whose center of mass is moved by a cavity, as far as that reduces the
        bending; None as in `_finish`. move: designs a hull from a draft, see `design_hull`."""
        # It imports manifold3d, which no solid die needs.
        from dicedesign.balance.cavity import balancing_cavity, reach

        def thickness(surface: Surface) -> float:
            return wall * convex_hull(surface.points).diameter

        def with_room(surface: Surface, share: float) -> HullProblem:
            """Problem with a share of the reach of cavities in a surface, in its unit."""
            return self.problem.with_room(reach(surface, thickness(surface), share))

        def has_room(filled: FilledHull) -> bool:
            """Whether a cavity can move the center of mass to its required place."""
            surface, center = self.surface.with_points(filled.points), filled.center_of_mass
            with suppress(InputError):
                if is_shifted(surface, center):
                    balancing_cavity(surface, thickness(surface), center)
                return True
            return False

        problem = with_room(self.problem.surface, SAFE_REACH)
        nearer = move(problem, draft)
        filled = self._finish(problem, nearer, best)
        if filled is None or not is_better(filled, best, self.options):
            return filled
        if not has_room(filled):
            # Begin with a solid die, which has more room when it is bent less.
            nearer = move(self.problem, draft)
            filled = self._finish(self.problem, nearer, None)
        share = SAFE_REACH
        for _ in range(MAX_SHIFTS):
            if filled is None:
                break
            bent = self.problem.surface.with_points((filled.points - self.center) / self.radius)
            try:
                problem = with_room(bent, share)
            except InputError:
                break
            further = move(problem, nearer)
            following = self._finish(problem, further, filled)
            if following is None or not is_better(following, filled, self.options):
                break
            if has_room(following):
                nearer, filled = further, following
            else:
                share *= REACH_FACTOR
        return filled

    def _finish(
        self, problem: HullProblem, draft: HullDraft, best: FilledHull | None
    ) -> FilledHull | None:
        """Fill the hull of a draft; None if that fails or cannot improve on the best die."""
        draft = settle_draft(problem, draft)
        if not self._is_promising(problem, draft, best):
            return None
        if best is not None and is_right(best.draft, self.options):
            # The displacement of the hull's vertices alone must be better: the fill usually adds
            # to it.
            apart, margin = math.degrees(draft.apart), math.degrees(draft.margin)
            moved = problem.mean_displacement(draft.corners - problem.hull.vertices)
            cost = (1.0 + angle_penalty(apart, margin, self.options)) * moved
            if cost >= rank(best.draft, self.options)[-1]:
                return None
        return self._fill(problem, make_designed_hull(problem, draft), best)

    def _is_promising(
        self, problem: HullProblem, draft: HullDraft, best: FilledHull | None
    ) -> bool:
        """Whether a draft meets all limits, or nearly, or violates them less than the best die."""
        if best is None:
            return True
        violation = draft.shortfall(problem)
        return violation <= SETTLED or violation < missing(best.draft, self.options)

    def _fill(
        self, problem: HullProblem, design: DesignedHull, best: FilledHull | None
    ) -> FilledHull | None:
        """Fill a designed hull by the method of the options; None if that fails."""
        if self.options.fill == "correspondence":
            return self._fill_and_ease(problem, design)
        if best is not None and design.error > max(self.options.tolerance, best.draft.error):
            return None
        # The default method does not need this import.
        from dicedesign.concave.paper_fill import fill_as_paper

        paper = self.options.paper or ConcavePaperOptions()
        center = design.center_of_mass
        fill = fill_as_paper(problem.surface, design.hull, center, paper, self.on_step)
        return None if fill is None else self._measure(design, *fill)

    def _fill_and_ease(self, problem: HullProblem, design: DesignedHull) -> FilledHull | None:
        """Fill a hull by correspondence, and ease it as long as that reduces self-intersections;
        None if it cannot be filled."""
        points, triangles = problem.surface.points, self.surface.triangles
        best: FilledHull | None = None
        for easing in range(MAX_EASINGS + 1):
            held = HeldCorners(self.problem.elasticity, design.corners)
            on_step = partial(self.on_step, "fill")
            fill = fill_by_correspondence(held, design.hull, design.center_of_mass, on_step)
            if fill is None:
                break
            eased = self._measure(design, *fill)
            crossings = eased.draft.self_intersections
            if 0 < crossings <= MOST_UNTANGLED:
                parted = untangle(held, design.hull, design.center_of_mass, fill[0])
                apart = None if parted is None else self._measure(design, *parted)
                if apart is not None and apart.draft.self_intersections == 0:
                    return apart
            if best and crossings > EASED_SHARE * best.draft.self_intersections:
                break
            best = eased
            if easing == MAX_EASINGS or not 0 < crossings <= MOST_EASED:
                break
            crossing = np.unique(intersecting_triangles(best.points, triangles))
            places = points[np.unique(triangles[crossing])]
            following = relax_hull(problem, design, places, EASING_WIDTH * EASING_GROWTH**easing)
            if following is None:
                break
            design = following
        return best

    def _measure(self, design: DesignedHull, points: Floats, energy: float) -> FilledHull:
        """Measure a fill of a hull."""
        unit = self.problem.surface
        back = best_similarity(points, unit.points, point_masses(unit))
        solid = unit.with_points(back(points))
        # As read from a file in single precision.
        rounded = unit.with_points(solid.points.astype(np.float32).astype(np.float64))
        reached = convex_hull(rounded.points, single_precision=True)
        shift = back(design.center_of_mass + design.shift) - back(design.center_of_mass)
        poses = analyze(reached, rounded.centroid + shift)
        directions = design.directions @ back.rotation.T
        # In a file, rounding decides whether rests at nearly this angle count as one outcome, so
        # that the die must be right either way.
        either = [
            outcome_probabilities(poses, directions, within=SAME_REST_ANGLE + change)
            for change in (-FILE_ANGLE, FILE_ANGLE)
        ]
        error = max(outcomes.error(self.target) for outcomes in either)
        self.on_step("fill", energy, error)
        filled = FilledHull(
            Draft(
                attempt=0,
                seconds=None,
                error=error,
                displacement=float(norms(solid.points - unit.points).mean() / unit.diagonal),
                apart_deg=math.degrees(min(outcomes.least_angle for outcomes in either)),
                margin_deg=math.degrees(
                    min(outcome_margins(poses, outcomes).min() for outcomes in either)
                ),
                self_intersections=len(intersecting_triangles(solid.points, unit.triangles)),
            ),
            points=self.center + self.radius * solid.points,
            hull_points=self.center + self.radius * back(design.hull.vertices),
            center_of_mass=self.center + self.radius * (solid.centroid + shift),
            directions=directions,
            outcome_of=np.arange(len(directions)),
        )
        return judge(filled, self.surface, self.options, self.judge_prints)
