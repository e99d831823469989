"""Attempts at a die whose outcomes have several rests: the surface is bent smoothly, or not at all
if a cavity moves its center of mass far enough."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import chain, zip_longest

import numpy as np

from dicedesign.balance.regions import is_shifted
from dicedesign.concave.attempt import REACH_FACTOR, SAFE_REACH
from dicedesign.concave.options import ConcaveOptions
from dicedesign.concave.rest_groups import group_rests, share_groups
from dicedesign.concave.result import FilledHull, JudgePrints, is_better, judge
from dicedesign.concave.smooth_bending import BentSurface, SmoothBending
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.surfaces.self_intersections import intersecting_triangles
from dicedesign.geometry.triangles import Surface
from dicedesign.rest.outcomes import outcome_margins, outcome_probabilities
from dicedesign.rest.poses import analyze
from dicedesign.results.parts import Draft
from dicedesign.runtime.arrays import Floats, Integers

BARRIERS = (0.003, 0.001, 0.0003, 0.01)
"""Barriers of `group_rests`, over the diagonal, in the order in which they take turns."""

WAYS = 10
"""Maximum number of ways to share out the groups of each barrier."""

SIMILAR_ANGLE = math.radians(8.0)
"""Angle between two rests below which they are one outcome at first: nobody tells apart what is
nearer than `SAME_REST_ANGLE`, and bending turns rests. Later attempts may part them."""

BENT_TOLERANCE = 1e-8
"""Largest |p - q| of a bent surface."""

MAX_SHARES = 3
"""Maximum number of shares of the reach of cavities that are tried."""


@dataclass(frozen=True, eq=False)
class BentAttempts:
    """Attempts at one die, each with another way to share the rests out among the outcomes.

    Attributes
    ----------
    surface, target, options, wall: see `make_concave_die`.
    on_step: receives the stage, the energy and the largest |p - q|.
    judge_prints: see `JudgePrints`; None if no prints are judged.
    """

    surface: Surface
    target: Floats
    options: ConcaveOptions
    on_step: Callable[..., None]
    wall: float | None = None
    judge_prints: JudgePrints | None = None

    @property
    def _center(self) -> Floats:
        """(3,) center of mass of the surface."""
        return self.surface.centroid

    @cached_property
    def _bending(self) -> SmoothBending:
        """Bending of the surface with its center of mass at the origin and a diagonal of 1."""
        surface = self.surface
        return SmoothBending(
            surface.with_points((surface.points - self._center) / surface.diagonal)
        )

    @cached_property
    def _rooms(self) -> dict[float, ConvexHull]:
        """Regions of the shifts of the center of mass that cavities reach, by the share of it."""
        return {}

    @cached_property
    def ways(self) -> list[Integers]:
        """Outcomes (r,) of the rests of the surface, in several ways."""
        poses = self._bending.poses
        different = dict[bytes, Integers]()
        for similar in (SIMILAR_ANGLE, 0.0):
            by_barrier = [
                share_groups(poses, group_rests(poses, barrier, similar), self.target, WAYS)
                for barrier in BARRIERS
            ]
            for way in chain.from_iterable(zip_longest(*by_barrier)):
                if way is not None:
                    different.setdefault(way.tobytes(), way)
        return list(different.values())

    def attempt(self, number: int, best: FilledHull | None) -> FilledHull | None:
        """Bend the surface for the rests of one way to share them out; None if that fails or cannot
        improve on the best die.

        number: of the way, from 1 on.
        """
        from dicedesign.balance.cavity import balancing_cavity, reach

        unit, share = self._bending.surface, SAFE_REACH
        wall = None if self.wall is None else self.wall * self._bending.poses.hull.diameter
        for _ in range(1 if wall is None else MAX_SHARES):
            room = None
            if wall is not None:
                if share not in self._rooms:
                    self._rooms[share] = reach(unit, wall, share)
                room = self._rooms[share]
            bent = self._bending.bend(
                self.ways[number - 1],
                self.target,
                BENT_TOLERANCE,
                room,
                partial(self.on_step, "bend"),
            )
            if bent is None:
                return None
            surface = unit.with_points(bent.points)
            try:
                if wall is not None and is_shifted(surface, bent.center_of_mass):
                    balancing_cavity(surface, wall, bent.center_of_mass)
            except InputError:
                share *= REACH_FACTOR
                continue
            filled = self._measure(bent)
            # Prints only add to the cost, and take longest to judge.
            if not is_better(filled, best, self.options):
                return None
            return judge(filled, self.surface, self.options, self.judge_prints)
        return None

    def _measure(self, bent: BentSurface) -> FilledHull:
        """Measure a bent surface, as read from a file in single precision."""
        unit = self._bending.surface
        surface = unit.with_points(bent.points)
        rounded = unit.with_points(bent.points.astype(np.float32).astype(np.float64))
        shift = bent.center_of_mass - surface.centroid
        hull = convex_hull(rounded.points, single_precision=True)
        poses = analyze(hull, rounded.centroid + shift)
        order = np.lexsort((-bent.poses.probabilities, bent.outcomes))
        directions, outcome_of = bent.poses.normals[order], bent.outcomes[order]
        outcomes = outcome_probabilities(poses, directions, outcome_of, np.pi)
        return FilledHull(
            Draft(
                attempt=0,
                seconds=None,
                error=outcomes.error(self.target),
                displacement=float(norms(bent.points - unit.points).mean()),
                apart_deg=math.degrees(outcomes.least_angle),
                margin_deg=math.degrees(outcome_margins(poses, outcomes).min()),
                self_intersections=len(intersecting_triangles(bent.points, unit.triangles)),
            ),
            points=self._center + self.surface.diagonal * bent.points,
            hull_points=self._center + self.surface.diagonal * hull.vertices,
            center_of_mass=self._center + self.surface.diagonal * bent.center_of_mass,
            directions=directions,
            outcome_of=outcome_of,
        )
