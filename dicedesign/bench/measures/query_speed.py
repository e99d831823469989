"""Seconds of a query and of a gradient, beside those of scipy's convex hull."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np
from scipy.spatial import ConvexHull

from dicedesign.bench.measures.other_methods import Request
from dicedesign.bench.measures.processes import in_turn
from dicedesign.bench.reference.speed_cases import DIE_CORNERS, Case, Ratios, goals
from dicedesign.design.coordinates.vertices import VertexCoordinates
from dicedesign.design.energy.objective import Objective
from dicedesign.design.energy.term import EnergyWeights
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.runtime.arrays import Floats

__all__ = ["Effort", "SpeedRow", "energy_gradient", "speed_row"]

PAPER: Final = EnergyWeights(stability=0.0)
"""The dice energy with the paper's three regularizers (eq. 16)."""


@dataclass(frozen=True)
class Effort:
    """How long to measure.

    Attributes
    ----------
    rounds: how often each work has its turn, at least.
    seconds: how long the turns of a case go on, at least.
    """

    rounds: int
    seconds: float


TimeTrimesh = Callable[[Request], tuple[float | None, str]]
"""Seconds that trimesh takes, or None and why; see `TrimeshTimer`."""

MANY: Final = 20_000
"""With more points gradients are left out, and no work is repeated in a row."""

ROW: Final = 2e-3
"""Seconds that a work is repeated in a row when it has its turn (`in_turn`)."""


@dataclass(frozen=True)
class SpeedRow:
    """What was measured with one case.

    Attributes
    ----------
    name: of the case.
    points, corners, rests: how many points there are, how many of them are vertices of the hull,
        and on how many facets it rests.
    hull_seconds: `scipy.spatial.ConvexHull(points)`.
    query_seconds: from the points to the probabilities, hull included.
    gradient_seconds: the energy of a design and its gradient in the points, hull included.
    trimesh_seconds: trimesh's stable poses of the hull, hull included.
    goal, cpp: see `dicedesign.bench.reference.speed_cases`.
    note: why something is missing.
    """

    name: str
    points: int
    corners: int
    rests: int
    hull_seconds: float
    query_seconds: float
    gradient_seconds: float | None
    trimesh_seconds: float | None
    goal: Ratios
    cpp: Ratios
    note: str = ""

    @property
    def ratios(self) -> Ratios:
        """Query and gradient as multiples of scipy's hull."""
        return Ratios(self.query_seconds / self.hull_seconds, self._ratio(self.gradient_seconds))

    @property
    def trimesh_ratio(self) -> float | None:
        """trimesh as a multiple of scipy's hull."""
        return self._ratio(self.trimesh_seconds)

    def _ratio(self, seconds: float | None) -> float | None:
        return None if seconds is None else seconds / self.hull_seconds

    def plain(self) -> dict[str, Any]:
        """The row as plain data."""
        ratios, goal, cpp = self.ratios, self.goal, self.cpp
        return {
            "case": self.name,
            "points": self.points,
            "hull_vertices": self.corners,
            "rests": self.rests,
            "scipy_hull_seconds": self.hull_seconds,
            "query_seconds": self.query_seconds,
            "query_ratio": ratios.query,
            "query_goal": goal.query,
            "query_ratio_of_cpp": cpp.query,
            "gradient_seconds": self.gradient_seconds,
            "gradient_ratio": ratios.gradient,
            "gradient_goal": goal.gradient,
            "gradient_ratio_of_cpp": cpp.gradient,
            "trimesh_seconds": self.trimesh_seconds,
            "trimesh_ratio": self.trimesh_ratio,
            "note": self.note,
        }


def energy_gradient(points: Floats, directions: Floats, target: Floats) -> Floats:
    """Gradient (n, 3) of the paper's energy in points (n, 3), for directions (k, 3) of outcomes
    and their wanted probabilities (k,)."""
    objective = Objective(VertexCoordinates(np.zeros(3), 1.0), target, PAPER, None)
    return objective.evaluate(points.ravel(), directions).gradient.reshape(-1, 3)


def speed_row(case: Case, effort: Effort, time_trimesh: TimeTrimesh | None) -> SpeedRow:
    """Measure one case, in seconds of the processor, all threads together.

    time_trimesh: None leaves trimesh out. Raises as `rest_poses`.
    """
    points = case.points
    poses = rest_poses(points)
    works: list[Callable[[], Any]] = [
        partial(ConvexHull, points),
        lambda: rest_poses(points).probabilities,
    ]
    goal, notes = goals(len(points), len(poses.hull.vertices)), []
    many = len(points) > MANY
    if not many:
        works.append(partial(energy_gradient, points, *_outcomes(poses)))
    else:
        goal = Ratios(goal.query, None)
        notes.append(f"no gradient for more than {MANY:,} points")
    row = 0.0 if many else ROW
    seconds = in_turn(works, effort.seconds, rounds=effort.rounds, row=row)
    trimesh = None
    if time_trimesh is not None:
        hull = poses.hull
        trimesh, why = time_trimesh(Request(hull.vertices, hull.triangles, poses.center_of_mass))
        notes += [why] if why else []
    return SpeedRow(
        name=case.name,
        points=len(points),
        corners=len(poses.hull.vertices),
        rests=len(poses.normals),
        hull_seconds=seconds[0],
        query_seconds=seconds[1],
        gradient_seconds=seconds[2] if len(seconds) > 2 else None,
        trimesh_seconds=trimesh,
        goal=goal,
        cpp=case.cpp,
        note="; ".join(notes),
    )


def _outcomes(poses: RestPoses) -> tuple[Floats, Floats]:
    """Directions (k, 3) and wanted probabilities (k,): a fair die on its own rests, or of three
    outcomes where the hull is no die's."""
    own = len(poses.hull.vertices) <= DIE_CORNERS
    directions = poses.normals if own else np.eye(3)
    return directions, np.full(len(directions), 1.0 / len(directions))
