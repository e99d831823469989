"""Hull fill as in the paper (appendix B).

A surface grows inside the designed hull until it spans it (B.1, by quadratic programs): the
vertices of the hull attract the closest points of the surface, with a growing weight. Then its
center of mass is moved to the required place while its hull stays exactly as it is (B.2).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import csc_array, csc_matrix, csr_array, eye_array, kron, triu

from dicedesign.concave.elastic_energy import ElasticEnergy
from dicedesign.concave.options import ConcavePaperOptions
from dicedesign.concave.result import Fill, OnEnergy
from dicedesign.errors import missing_extra
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.surfaces.grid_surface import closest_points
from dicedesign.geometry.triangles import Surface
from dicedesign.optimize.options import SobolevOptions
from dicedesign.optimize.solvers.descent import SobolevSolver, edge_laplacian
from dicedesign.runtime.arrays import Booleans, Floats

DEPTH = 1e-7
"""Depth inside the hull, over the diagonal, up to which points stay in place."""

MAX_SHARE = 0.5
"""Share of its distance from the hull by which a point moves at most in one step."""

MIN_SHARE = 1e-6
"""Share of the largest step below which a search for a step ends."""

NEAR_CENTER = 1e-3
"""Distance of the center of mass, over the diagonal, below which Newton's method is used."""

MAX_WEIGHT = 1e6
"""Maximum of lambda_CoM, over its initial value."""

STEPS = 20
"""Maximum number of steps for each weight."""

SUFFICIENT_DECREASE = 1e-4
"""Share of the predicted decrease that a step must achieve (Armijo condition)."""

EXACT = 1e-13
"""Distance of the center of mass, over the diagonal, at which Newton's method ends."""

MAX_NEWTON_STEPS = 100
"""Maximum number of steps of Newton's method."""

WORTHWHILE = 0.999
"""Share of the distance of the center of mass below which a step must reduce it for another to
follow."""


def centering_gradient(surface: Surface) -> Floats:
    """(n, 3) gradient of the squared distance E_CoM of a surface's center of mass from the origin
    (eq. 33, 34)."""
    return np.asarray(2.0 * np.tensordot(surface.centroid, surface.centroid_derivatives(), 1))


def hull_keeping_moves(
    sobolev: SobolevSolver, depths: Floats, gradients: Floats
) -> tuple[Floats, Floats]:
    """Smoothed moves `D (I + gamma L)^-p D g` of gradients g (n, 3, ...), and these over D.

    sobolev: applies `(I + gamma L)^-p`; depths: (n,) diagonal of D, distances from the hull.

    Source: eq. 35, with a second D that makes the operator symmetric, so that each move descends.
    """
    flat = gradients.reshape(len(gradients), -1)
    spread = sobolev.solve(depths[:, None] * flat)
    return (depths[:, None] * spread).reshape(gradients.shape), spread.reshape(gradients.shape)


def balance(
    reference: Surface,
    filled: Surface,
    hull: ConvexHull,
    center_of_mass: Floats,
    options: ConcavePaperOptions,
    on_step: OnEnergy,
) -> Fill:
    """Move the center of mass of a surface to its required place without changing its hull.

    Gradient steps on the energy with a growing weight (eq. 31, 35), then Newton's method for the
    center of mass alone, both by moves of `hull_keeping_moves`. They end where the place is reached
    or no step helps.

    Parameters
    ----------
    reference: reference of the elastic energy.
    filled: the triangles of the reference inside the hull, as from
        `fill_by_quadratic_programs`.
    hull: hull of `filled`.
    center_of_mass: (3,) required center of mass of the uniform solid, strictly inside the hull.
    options: lambda_CoM, lambda_m, lambda_b, growth of lambda_CoM, gamma and p.
    on_step: see `OnEnergy`.

    Raises
    ------
    InputError: a triangle of the reference has no area.
    """
    # In units of the reference's diagonal, with the required center of mass at the origin.
    unit, weight, part = reference.diagonal, options.center_of_mass, 1.0
    scaled = reference.with_points(reference.points / unit)
    surface = filled.with_points((filled.points - center_of_mass) / unit)
    heights = hull.heights(center_of_mass) / unit
    elastic = ElasticEnergy.of(scaled, options.membrane, options.bending)
    # The triangles of a closed oriented surface pass each edge once in each direction.
    starts, ends = scaled.triangles.ravel(), np.roll(scaled.triangles, -1, axis=1).ravel()
    laplacian = edge_laplacian(starts, ends, len(scaled.points))
    sobolev = SobolevSolver(laplacian, SobolevOptions(options.gamma, options.power))

    def error() -> float:
        """Distance of the center of mass from its required place."""
        return float(norms(surface.centroid))

    def depths() -> Floats:
        """(n,) distances of the points from the hull, 0 for points that stay in place."""
        slacks = (heights - surface.points @ hull.normals.T).min(axis=1)
        return np.maximum(slacks - DEPTH, 0.0)

    def energy(surface: Surface) -> float:
        """Energy of a surface with the current weight."""
        centroid = surface.centroid
        return elastic.value(surface.points) + weight * float(centroid @ centroid)

    def descend() -> bool:
        """Take a step of eq. 35; returns False if none decreases the energy."""
        nonlocal surface, part
        gradient = weight * centering_gradient(surface) + elastic.gradient(surface.points)
        move, reach = hull_keeping_moves(sobolev, depths(), gradient)
        slope, before = float((gradient * move).sum()), energy(surface)
        longest = MAX_SHARE / max(float(norms(reach).max()), np.finfo(np.float64).tiny)
        part = min(1.0, 4.0 * part)
        while part >= MIN_SHARE:
            step = part * longest
            trial = surface.with_points(surface.points - step * move)
            lower = energy(trial)
            if lower <= before - SUFFICIENT_DECREASE * step * slope:
                surface = trial
                on_step(lower)
                return True
            part *= 0.5
        part = 1.0
        return False

    on_step(energy(surface))
    while error() > NEAR_CENTER and weight <= MAX_WEIGHT * options.center_of_mass:
        for _ in range(STEPS):
            if error() <= NEAR_CENTER or not descend():
                break
        weight *= options.growth
    for _ in range(MAX_NEWTON_STEPS):
        before = error()
        if before <= EXACT:
            break
        derivatives = surface.centroid_derivatives()
        moves, reaches = hull_keeping_moves(sobolev, depths(), np.moveaxis(derivatives, 0, -1))
        system = np.einsum("kni,nij->kj", derivatives, moves)
        multipliers = np.linalg.lstsq(system, -surface.centroid, rcond=None)[0]
        longest = float(norms(reaches @ multipliers).max())
        if longest == 0.0:
            break
        step = min(1.0, MAX_SHARE / longest) * (moves @ multipliers)
        surface = surface.with_points(surface.points + step)
        on_step(energy(surface))
        if error() > WORTHWHILE * before:
            break
    points = surface.points * unit + center_of_mass
    still = depths() == 0.0
    points[still] = filled.points[still]
    return points, energy(surface)


@dataclass(frozen=True, eq=False)
class ClosestPointEnergy:
    """`E_CP = sum_p |p - CP(p)|^2` over the vertices p of a hull (eq. 28).

    CP(p), the closest point of the surface, stays in its triangle when the surface moves, so that
    the energy is quadratic.

    Attributes
    ----------
    corners: (v, 3) vertices of the hull.
    blend: (v, n) sparse weights of the surface's points in CP(p).
    """

    corners: Floats
    blend: csr_array

    @classmethod
    def of(cls, surface: Surface, corners: Floats) -> ClosestPointEnergy:
        """Energy with the closest points of a surface."""
        chosen, feet = closest_points(surface, corners)
        triangles = surface.triangles[chosen]
        starts, ends = surface.points[triangles[:, :1]], surface.points[triangles[:, 1:]]
        # The least ones where a triangle has no area.
        shares = (
            np.linalg.pinv((ends - starts).transpose(0, 2, 1)) @ (feet - starts[:, 0])[..., None]
        )
        weights = np.concatenate([1.0 - shares.sum(axis=1), shares[..., 0]], axis=1)
        rows = np.repeat(np.arange(len(corners)), 3)
        columns = triangles.ravel()
        shape = (len(corners), len(surface.points))
        return cls(corners, csr_array((weights.ravel(), (rows, columns)), shape=shape))

    def offsets(self, points: Floats) -> Floats:
        """(v, 3) from p to CP(p), for points (n, 3) of the surface."""
        return np.asarray(self.blend @ points - self.corners)

    def value(self, points: Floats) -> float:
        """E_CP."""
        offsets = self.offsets(points)
        return float((offsets * offsets).sum())

    def gradient(self, points: Floats) -> Floats:
        """(n, 3) of E_CP."""
        return np.asarray(2.0 * (self.blend.T @ self.offsets(points)))

    @property
    def hessian(self) -> csc_array:
        """(3 n, 3 n) constant Hessian of E_CP."""
        return csc_array(2.0 * kron(self.blend.T @ self.blend, eye_array(3)))


INNER_SHARE = 0.999
"""Share of the largest size that fits inside, to which points are scaled."""

NEAR = 0.05
"""Distance below which the half-spaces at a point are constraints from the start."""

MAX_NEAR = 4
"""Maximum number of half-spaces of each point from the start."""

MAX_ADDED = 2
"""Maximum number of half-spaces of each point that are added at a time."""

MAX_PROGRAMS = 6
"""Maximum number of programs for one step."""

MAX_VIOLATION = 5e-4
"""Distance outside a half-space above which it becomes a constraint. Smaller violations are removed
after the step, and the half-spaces are constraints of the next one."""


def solve_quadratic_program(
    hessian: csc_array, gradient: Floats, rows: csc_array, bounds: Floats
) -> Floats | None:
    """The x that minimizes `x . H x / 2 + g . x` with `A x <= b`; None if that fails.

    hessian: (n, n) H, symmetric positive semidefinite; gradient: (n,) g; rows: (m, n) A; bounds:
    (m,) b.

    Raises InputError if Clarabel is not installed.
    """
    try:
        import clarabel
    except ImportError as error:
        raise missing_extra("concave", "hull fill by quadratic programs", error) from error
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    cones = [clarabel.NonnegativeConeT(len(bounds))]
    solution = clarabel.DefaultSolver(
        csc_matrix(triu(hessian, format="csc")), gradient, csc_matrix(rows), bounds, cones, settings
    ).solve()
    minimum = np.array(solution.x)
    solved = (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved)
    return minimum if solution.status in solved and bool(np.isfinite(minimum).all()) else None


@dataclass
class PointsInside:
    """Points that move inside a polyhedron around the origin, `normals . x <= heights`.

    A program begins with constraints for half-spaces near each point, and adds those that its
    solution violates. Constraints that were active at the end of a step are kept for the next one.

    Attributes
    ----------
    normals: (m, 3) unit; heights: (m,) positive.
    held: (n, m) half-spaces that held a point back in the last step.
    """

    normals: Floats
    heights: Floats
    held: Booleans | bool = False

    def slacks(self, points: Floats) -> Floats:
        """(n, m) distances of points (n, 3) from the facets, positive inside."""
        return self.heights - points @ self.normals.T

    def largest(self, points: Floats) -> Floats:
        """Points (n, 3) moved and, if necessary, scaled down to the largest size that is inside."""
        reaches = (points @ self.normals.T).max(axis=0)
        # The size s and the shift t with the largest s such that s * reach + normal . t <= height.
        best = linprog(
            [-1.0, 0.0, 0.0, 0.0],
            np.column_stack([reaches, self.normals]),
            self.heights,
            bounds=[(0.0, 1.0), *[(None, None)] * 3],
        ).x
        return INNER_SHARE * (best[0] * points + best[1:])

    def pull_inside(self, points: Floats) -> Floats:
        """Points (n, 3), with those outside moved toward the origin onto the boundary."""
        excess = (points @ self.normals.T / self.heights).max(axis=1)
        return points / np.maximum(excess, 1.0)[:, None]

    def step(self, points: Floats, hessian: csc_array, gradient: Floats) -> Floats | None:
        """Moves d (n, 3) that minimize `d . H d / 2 + g . d` with all points inside; None if that
        fails.

        points: (n, 3), inside; hessian: (3 n, 3 n) H, symmetric positive semidefinite; gradient:
        (n, 3) g.
        """
        slacks = self.slacks(points)
        pairs = np.full(slacks.shape, self.held)
        _add_least(pairs, slacks, MAX_NEAR, NEAR)
        for _ in range(MAX_PROGRAMS):
            point, plane = np.nonzero(pairs)
            entries = (3 * point[:, None] + np.arange(3)).ravel()
            rows = csc_array(
                (self.normals[plane].ravel(), (np.repeat(np.arange(len(point)), 3), entries)),
                shape=(len(point), points.size),
            )
            minimum = solve_quadratic_program(hessian, gradient.ravel(), rows, slacks[point, plane])
            if minimum is None:
                return None
            moves = minimum.reshape(-1, 3)
            left = slacks - moves @ self.normals.T
            if not _add_least(pairs, left, MAX_ADDED, -MAX_VIOLATION):
                break
        self.held = pairs & (left < MAX_VIOLATION)
        return moves


def _add_least(pairs: Booleans, slacks: Floats, count: int, limit: float) -> bool:
    """Mark in pairs (n, m) the smallest slacks (n, m) of each row below a limit, at most `count`;
    returns whether there are any."""
    count = min(count, slacks.shape[1] - 1)
    least = np.argpartition(slacks, count, axis=1)[:, :count]
    rows, columns = np.nonzero(np.take_along_axis(slacks, least, axis=1) < limit)
    pairs[rows, least[rows, columns]] = True
    return len(rows) > 0


MARGIN = 1e-6
"""Depth inside the hull, over the diagonal, that all points keep."""

PROXIMAL = 1e-6
"""Weight of squared moves, which the elastic energy does not all resist."""

MIN_STEP = 1e-3
"""Share of a step below which a search for a step ends."""

CLOSE = 1e-3
"""Mean distance of the hull's vertices from the surface, over its diagonal, that counts as fitted.
Vertices that are closer together than the points of the surface are never all met."""

MAX_STEPS = 40
"""Maximum number of steps."""


def fill_by_quadratic_programs(
    surface: Surface, hull: ConvexHull, options: ConcavePaperOptions, on_step: OnEnergy
) -> Fill | None:
    """Deform a surface as little as possible until its convex hull is a given one (eq. 26, 27), or
    the steps are used up; None if a program cannot be solved.

    Parameters
    ----------
    surface: start, and reference of the elastic energy.
    hull: required hull.
    options: lambda_CP, lambda_m, lambda_b and the growth of lambda_CP.
    on_step: see `OnEnergy`.

    Raises
    ------
    InputError: a triangle has no area, or Clarabel is not installed.
    """
    # In units of the surface's diagonal, with the centroid of the hull at the origin.
    unit, middle = surface.diagonal, hull.centroid
    scaled = surface.with_points((surface.points - middle) / unit)
    targets = (hull.vertices - middle) / unit
    inside = PointsInside(hull.normals, hull.heights(middle) / unit - MARGIN)
    elastic = ElasticEnergy.of(scaled, options.membrane, options.bending)
    points, weight = inside.largest(scaled.points), options.closest_point
    closest = ClosestPointEnergy.of(scaled.with_points(points), targets)

    def energy_at(points: Floats) -> float:
        return elastic.value(points) + weight * closest.value(points)

    energy = energy_at(points)
    on_step(energy)
    # Steps of eq. 29 and 30 with a growing weight.
    for _ in range(MAX_STEPS):
        if norms(closest.offsets(points)).mean() <= CLOSE:
            break
        gradient = elastic.gradient(points) + weight * closest.gradient(points)
        hessian = elastic.hessian(points) + weight * closest.hessian
        hessian = hessian + PROXIMAL * eye_array(gradient.size)
        move = inside.step(points, csc_array(hessian), gradient)
        if move is None:
            return None
        trial = inside.pull_inside(points + move)
        before, energy, part = points, energy_at(points), 1.0
        while part >= MIN_STEP:
            nearer = trial if part == 1.0 else before + part * (trial - before)
            lower = energy_at(nearer)
            if lower < energy:
                points, energy = nearer, lower
                break
            part *= 0.5
        on_step(energy)
        if part == 1.0 or part < MIN_STEP:
            weight *= options.growth
        closest = ClosestPointEnergy.of(scaled.with_points(points), targets)
    return points * unit + middle, energy


def fill_as_paper(
    surface: Surface,
    hull: ConvexHull,
    center_of_mass: Floats,
    options: ConcavePaperOptions,
    on_step: Callable[[str, float], None],
) -> Fill | None:
    """Grow a surface inside a hull, and move its center of mass to its required place (3,) or as
    near as possible; None if a program cannot be solved.

    on_step: receives "fill" or "balance" and the energy of every step.

    Raises InputError if a triangle has no area or Clarabel is not installed.
    """
    fill = fill_by_quadratic_programs(surface, hull, options, partial(on_step, "fill"))
    if fill is None:
        return None
    filled, on_balance = surface.with_points(fill[0]), partial(on_step, "balance")
    return balance(surface, filled, convex_hull(filled.points), center_of_mass, options, on_balance)
