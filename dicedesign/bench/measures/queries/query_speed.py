"""Seconds of a query and of a gradient, beside those of scipy's convex hull."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, Final

import numpy as np
from scipy.spatial import ConvexHull

from dicedesign.bench.measures.processes import in_turn
from dicedesign.bench.measures.queries.other_methods import TrimeshRequest
from dicedesign.bench.reference.speed_cases import DIE_CORNERS, Case, goals
from dicedesign.bench.rows import Row, column, milliseconds
from dicedesign.optimize.coordinates.vertices import VertexCoordinates
from dicedesign.optimize.energy.objective import Objective
from dicedesign.optimize.energy.term import EnergyWeights
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.runtime.arrays import Floats

__all__ = ["Effort", "GrowthRow", "SpeedRow", "energy_gradient", "speed_row"]

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


TimeTrimesh = Callable[[TrimeshRequest], tuple[float | None, str]]
"""Seconds that trimesh takes, or None and why; see `TrimeshTimer`."""

MANY: Final = 20_000
"""Points of which a gradient is still measured."""

ROW: Final = 2e-3
"""Seconds that a work is repeated in a row when it has its turn (`in_turn`)."""


@dataclass(frozen=True)
class SpeedRow(Row):
    """What was measured with one case, in seconds and as multiples of scipy's hull; None where
    something was left out or is not known.

    Attributes
    ----------
    case: its name.
    points, hull_vertices, rests: how many points there are, how many of them are vertices of the
        hull, and on how many facets it rests.
    scipy_hull_seconds: `scipy.spatial.ConvexHull(points)`.
    query_*: from the points to the probabilities, hull included.
    gradient_*: the energy of a design and its gradient in the points, hull included.
    trimesh_*: trimesh's stable poses of the hull, hull included.
    *_goal, *_ratio_of_cpp: see `dicedesign.bench.reference.speed_cases`.
    note: why something is missing.
    """

    case: str = column("case", -28)
    points: int = column("points", 9)
    hull_vertices: int = column("corners", 9)
    rests: int = column("rests", 7)
    scipy_hull_seconds: float = column("hull ms", 10, milliseconds)
    query_seconds: float = column("query ms", 10, milliseconds)
    query_ratio: float = column("ratio", 7, ".2f")
    query_goal: float | None = column("goal", 6, "g")
    query_ratio_of_cpp: float | None = column("C++", 6, "g")
    gradient_seconds: float | None = column("grad. ms", 10, milliseconds)
    gradient_ratio: float | None = column("ratio", 7, ".2f")
    gradient_goal: float | None = column("goal", 6, "g")
    gradient_ratio_of_cpp: float | None = column("C++", 6, "g")
    trimesh_seconds: float | None = column("trimesh", 10, milliseconds)
    trimesh_ratio: float | None = column("ratio", 7, ".2f")
    note: str = column("", 0, default="")


@dataclass(frozen=True)
class GrowthRow(SpeedRow):
    """One with points on a sphere, for the figure."""

    table: ClassVar[str | None] = "growth"
    printed: ClassVar[bool] = False


def energy_gradient(points: Floats, directions: Floats, target: Floats) -> Floats:
    """Gradient (n, 3) of the paper's energy in points (n, 3), for directions (k, 3) of outcomes
    and their wanted probabilities (k,)."""
    objective = Objective(VertexCoordinates(np.zeros(3), 1.0), target, PAPER, None)
    return objective.evaluate(points.ravel(), directions).gradient.reshape(-1, 3)


def speed_row(
    case: Case,
    effort: Effort,
    time_trimesh: TimeTrimesh | None,
    most_points: int = MANY,
    row: type[SpeedRow] = SpeedRow,
) -> SpeedRow:
    """Measure one case, in seconds of the processor, all threads together.

    time_trimesh: None leaves trimesh out. most_points: with more, gradients are left out, and no
    work is repeated in a row. row: kind of the row. Raises as `rest_poses`.
    """
    points = case.points
    poses = rest_poses(points)
    works: list[Callable[[], Any]] = [
        partial(ConvexHull, points),
        lambda: rest_poses(points).probabilities,
    ]
    goal, notes = goals(len(points), len(poses.hull.vertices)), []
    many = len(points) > most_points
    if many:
        notes.append(f"no gradient for more than {most_points:,} points")
    else:
        works.append(partial(energy_gradient, points, *_outcomes(poses)))
    hull_seconds, query_seconds, *others = in_turn(
        works, effort.seconds, rounds=effort.rounds, row=0.0 if many else ROW
    )
    gradient = others[0] if others else None
    trimesh = None
    if time_trimesh is not None:
        hull = poses.hull
        trimesh, why = time_trimesh(
            TrimeshRequest(hull.vertices, hull.triangles, poses.center_of_mass)
        )
        notes += [why] if why else []
    return row(
        case=case.name,
        points=len(points),
        hull_vertices=len(poses.hull.vertices),
        rests=len(poses.normals),
        scipy_hull_seconds=hull_seconds,
        query_seconds=query_seconds,
        query_ratio=query_seconds / hull_seconds,
        query_goal=goal.query,
        query_ratio_of_cpp=case.cpp.query,
        gradient_seconds=gradient,
        gradient_ratio=None if gradient is None else gradient / hull_seconds,
        gradient_goal=None if many else goal.gradient,
        gradient_ratio_of_cpp=case.cpp.gradient,
        trimesh_seconds=trimesh,
        trimesh_ratio=None if trimesh is None else trimesh / hull_seconds,
        note="; ".join(notes),
    )


def _outcomes(poses: RestPoses) -> tuple[Floats, Floats]:
    """Directions (k, 3) and wanted probabilities (k,): a fair die on its own rests, or of three
    outcomes where the hull is no die's."""
    own = len(poses.hull.vertices) <= DIE_CORNERS
    directions = poses.normals if own else np.eye(3)
    return directions, np.full(len(directions), 1.0 / len(directions))
