"""What the fuzzing strategies do to a body: every step is a plain function of a few numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy.spatial import ConvexHull as Triangulation
from scipy.spatial import QhullError

from dicedesign.runtime.arrays import Floats
from tests.reference.extremes import hull_triangles
from tests.reference.problem import Problem
from tests.reference.solids import icosphere

ON: Final = ("facet", "edge", "corner")


def cloud(seed: int, count: int, shape: str) -> Problem:
    """Random points: "normal", on a "sphere", in a "cube" or on its faces ("walls")."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(count, 3))
    if shape == "sphere":
        points /= np.sqrt((points**2).sum(-1))[:, None]
    elif shape in ("cube", "walls"):
        points = rng.uniform(-1.0, 1.0, size=(count, 3))
        if shape == "walls":
            points[np.arange(count), rng.integers(3, size=count)] = rng.choice([-1.0, 1.0], count)
    return Problem(points)


def lattice(points: Sequence[tuple[int, int, int]], tolerance: float | None = None) -> Problem:
    """Points with small integer coordinates."""
    return Problem(np.array(points, dtype=np.float64), coplanar_tolerance=tolerance)


def globe_with_weight(subdivisions: int, seed: int, depth: float) -> Problem:
    """A sphere of triangles with its center of mass below a point of one, at a depth of parts of
    its radius."""
    points = icosphere(subdivisions).points
    return with_center_near_surface(Problem(points), seed, depth, "facet")


def with_noise(problem: Problem, seed: int, power: float) -> Problem:
    """Every coordinate moved by about 10^power of the extent; known answers are dropped."""
    points = problem.points
    noise = np.random.default_rng(seed).normal(size=points.shape)
    moved = points + 10.0**power * float(np.ptp(points, axis=0).max()) * noise
    return Problem(moved, problem.center, coplanar_tolerance=problem.coplanar_tolerance)


def squeeze(problem: Problem, powers: tuple[float, float]) -> Problem:
    """Stretched along y and z by powers of ten: needles, plates and blades."""
    factors = np.array([1.0, 10.0 ** powers[0], 10.0 ** powers[1]])
    center = None if problem.center is None else problem.center * factors
    return Problem(problem.points * factors, center, coplanar_tolerance=problem.coplanar_tolerance)


def with_random_center(problem: Problem, seed: int) -> Problem:
    """With a center of mass anywhere inside."""
    triangles = hull_triangles(problem.points)
    if triangles is None:
        return problem
    corners = problem.points[np.unique(triangles)]
    weights = np.random.default_rng(seed).dirichlet(np.full(len(corners), 0.5))
    return _with_center(problem, weights @ corners)


def with_center_near_surface(problem: Problem, seed: int, depth: float, on: str) -> Problem:
    """With a center of mass between a point on a facet, edge or corner of the hull and the hull's
    middle, at a fraction `depth` of the distance."""
    rng = np.random.default_rng(seed)
    triangles = hull_triangles(problem.points)
    if triangles is None:
        return problem
    weights = rng.dirichlet(np.ones(3))
    weights[3 - ON.index(on) :] = 0.0
    start = (weights / weights.sum()) @ problem.points[triangles[rng.integers(len(triangles))]]
    middle = problem.points[np.unique(triangles)].mean(axis=0)
    return _with_center(problem, start + depth * (middle - start))


def overhanging(problem: Problem, seed: int, distance: float, on: str) -> Problem:
    """With a center of mass above a point that is `distance` extents from an edge or a corner of a
    facet, inside or outside: the body nearly balances there."""
    rng = np.random.default_rng(seed)
    triangles = hull_triangles(problem.points)
    if triangles is None:
        return problem
    points = problem.points
    middle = points[np.unique(triangles)].mean(axis=0)
    for triangle in rng.permutation(triangles):
        a, b, c = points[rng.permutation(triangle)]
        along, normal = b - a, np.cross(b - a, c - a)
        if not normal.any():
            continue
        inward = np.cross(normal, along)
        inward *= np.sign(inward @ (c - a)) / np.sqrt(inward @ inward)
        normal *= np.sign(normal @ (middle - a)) / np.sqrt(normal @ normal)
        foot = a + (0.0 if on == "corner" else rng.uniform(0.1, 0.9)) * along
        foot = foot + distance * float(np.ptp(points, axis=0).max()) * inward
        height = rng.uniform(0.2, 0.8) * ((points - a) @ normal).max()
        moved = _with_center(problem, foot + height * normal)
        if moved is not problem:
            return moved
    return problem


def glancing_edge(problem: Problem, seed: int, growth: float) -> Problem:
    """With a center of mass for which a corner p and a hull edge v from it have r_p . v = growth
    |r_p| |v|: a path crosses the edge at a grazing angle, or the corner is about to be a
    maximum."""
    rng = np.random.default_rng(seed)
    triangles = hull_triangles(problem.points)
    if triangles is None:
        return problem
    points = problem.points
    center = points[np.unique(triangles)].mean(axis=0)
    for triangle in rng.permutation(triangles):
        p, q, _ = points[rng.permutation(triangle)]
        v = (q - p) / np.sqrt((q - p) @ (q - p))
        rise = (p - center) @ v
        moved = _with_center(
            problem, center + v * (rise - growth * np.sqrt(((p - center) ** 2).sum()))
        )
        if moved is not problem:
            return moved
    return problem


def _with_center(problem: Problem, center: Floats) -> Problem:
    """With another center of mass, or the unchanged problem if that is not inside."""
    local = problem.points - center
    try:
        planes = Triangulation(local / np.abs(local).max()).equations
    except (QhullError, ValueError):
        return problem
    if planes[:, 3].max() >= 0.0:
        return problem
    return Problem(problem.points, center, coplanar_tolerance=problem.coplanar_tolerance)
