"""Concave die without a search: a cube with a dent in each side."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from common.bodies import write_mesh

from dicedesign.concave.options import ConcaveOptions
from dicedesign.concave.result import (
    ConcaveDie,
    ConcaveProgress,
    FilledHull,
    Hollow,
    JudgePrints,
)
from dicedesign.errors import NoStartError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.triangles import Surface
from dicedesign.results.parts import Draft
from dicedesign.results.result import Step

CORNERS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
NORMALS = np.concatenate([np.eye(3), -np.eye(3)])


def roof(degrees: float) -> np.ndarray:
    """Corners of a cube whose lower side is bent: two rests at an angle in degrees."""
    rise = np.tan(np.radians(degrees / 2.0))
    raised = CORNERS + np.array([0.0, 0.0, rise]) * (CORNERS[:, 2:] < 0.0)
    return np.concatenate([raised, [[0.0, -1.0, -1.0], [0.0, 1.0, -1.0]]])


def dented_hull(points: np.ndarray, depth: float = 0.05) -> Surface:
    """Hull of points (n, 3) about the origin, with a pyramid cut out of each facet."""
    hull = convex_hull(points)
    order = np.argsort(hull.facet, kind="stable")
    middles = np.add.reduceat(hull.vertices[hull.tail[order]], hull.facet_start[:-1])
    middles /= np.diff(hull.facet_start)[:, None]
    triangles = np.column_stack([hull.tail, hull.head, len(hull.vertices) + hull.facet])
    return Surface(np.concatenate([hull.vertices, (1.0 - depth) * middles]), triangles)


def dented_cube(depth: float = 0.1) -> Surface:
    """Fair d6: a cube of side 2 around the origin, with a pyramid cut out of each side."""
    points = np.concatenate([CORNERS, (1.0 - depth) * NORMALS])
    triangles = []
    for side, normal in enumerate(NORMALS):
        around = np.flatnonzero(CORNERS @ normal == 1.0)
        across = np.cross(normal, CORNERS[around[0]])
        angle = np.arctan2(CORNERS[around] @ np.cross(normal, across), CORNERS[around] @ across)
        around = around[np.argsort(angle)]
        triangles += [(around[k], around[(k + 1) % 4], 8 + side) for k in range(4)]
    return Surface(points, np.array(triangles, dtype=np.int64))


def write_cube(path: Path) -> None:
    surface = dented_cube()
    write_mesh(path, surface.points, surface.triangles)


class MadeUpSearch:
    """Replacement of `make_concave_die` whose last attempt is the best, of at most three.

    Each attempt deepens the dents. The probabilities and the hull do not change.
    """

    def __init__(self) -> None:
        self.interrupt_after: int | None = None
        self.change: Callable[[np.ndarray], np.ndarray] = lambda points: points
        self.attempted: list[int] = []
        self.leads_nowhere = False
        self.hollow: Hollow | None = None

    def __call__(
        self,
        surface: Surface,
        target: np.ndarray,
        options: ConcaveOptions,
        *,
        wall: float | None = None,
        judge_prints: JudgePrints | None = None,
        seed: int = 0,
        resume: ConcaveProgress | None = None,
        on_step: Callable[[Step], None] = lambda _: None,
        on_attempt: Callable[[ConcaveProgress], None] = lambda _: None,
    ) -> ConcaveDie:
        progress = resume or ConcaveProgress()
        for attempt in range(progress.attempts + 1, min(options.attempts, 3) + 1):
            if attempt - 1 == self.interrupt_after:
                raise KeyboardInterrupt
            self.attempted.append(attempt)
            history = (
                Step(0, 0.5 * attempt, 1.0, 0.25, stage="hull", attempt=attempt),
                Step(1, 0.6 * attempt, 0.5, None, stage="fill", attempt=attempt),
            )
            for step in history:
                on_step(step)
            bent, downs = dented_cube(0.1 + 0.01 * attempt), NORMALS[: len(target)]
            places, prints = np.arange(len(downs)), None
            if judge_prints is not None and not self.leads_nowhere:
                prints = judge_prints(bent, np.zeros(3), downs, places)
            draft = Draft(attempt, 0.6, 0.0, 0.01 * attempt, 90.0, 45.0, 0, prints)
            points = self.change(bent.points)
            best = FilledHull(draft, points, CORNERS, np.zeros(3), downs, places)
            progress = ConcaveProgress(
                attempt,
                0.6 * attempt,
                None if self.leads_nowhere else best,
                () if self.leads_nowhere else (*progress.tried, draft),
                history,
            )
            on_attempt(progress)
        if progress.best is None:
            raise NoStartError("start: expected a surface that leads to the target, got a cube")
        after = surface.with_points(progress.best.points)
        hull = convex_hull(progress.best.hull_points)
        faces = progress.best.directions, progress.best.outcome_of
        return ConcaveDie(surface, after, hull, *faces, (8, 8), progress, self.hollow)
