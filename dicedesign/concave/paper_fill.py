"""Hull fill as in the paper (appendix B): a surface grows inside a wanted hull until it spans it
(B.1, by quadratic programs), and then its center of mass is brought to its place while its hull
stays as it is (B.2).

The corners of the hull draw on the points of the surface that are closest to them, more and more
strongly."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import csc_array, csc_matrix, csr_array, eye_array, kron, triu

from dicedesign.concave.elastic_energy import ElasticEnergy
from dicedesign.concave.options import ConcavePaperOptions
from dicedesign.concave.result import FillResult, FillStatus, OnEnergy
from dicedesign.errors import missing_extra
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.surfaces.grid_surface import closest_points
from dicedesign.geometry.triangles import Surface
from dicedesign.optimize.options import SobolevOptions
from dicedesign.optimize.solvers.descent import SobolevSolver, edge_laplacian
from dicedesign.runtime.arrays import Booleans, Floats

DEPTH = 1e-7
"""Depth inside the hull, over the diagonal, at which points do not move any more. The corners do
not move at all."""

BOLDEST = 0.5
"""Part of its distance from the hull that no point moves farther than in one step."""

SHORTEST_MOVE = 1e-6
"""Part of the boldest step below which none is taken."""

NEAR_CENTER = 1e-3
"""Distance of the center of mass, over the diagonal, from which on Newton's method takes over."""

HEAVIEST = 1e6
"""lambda_CoM, in units of that of the first steps, beyond which it does not grow."""

STEPS = 20
"""Most steps at each weight."""

DECREASE = 1e-4
"""Part of the decrease that the slope promises which a step must achieve."""

EXACT = 1e-13
"""Distance of the center of mass, over the diagonal, at which Newton's method ends."""

CONTENT = 1e-9
"""The same with which the balance is content."""

REFINED = 100
"""Most steps of Newton's method."""

USEFUL = 0.999
"""Part of the distance of the center of mass that may be left by a step with another after it."""


def centering_gradient(surface: Surface, center_of_mass: Floats) -> Floats:
    """(n, 3) of the squared distance E_CoM of a surface's center of mass from a place (3,) (eq. 33,
    34)."""
    offset = surface.centroid - center_of_mass
    return np.asarray(2.0 * np.tensordot(offset, surface.centroid_derivatives(), 1))


def hull_keeping_moves(
    sobolev: SobolevSolver, depths: Floats, gradients: Floats
) -> tuple[Floats, Floats]:
    """Moves `D (I + gamma L)^-p D g` of gradients g (n, 3, ...) smoothed over a surface, and their
    lengths over the depths.

    sobolev: applies `(I + gamma L)^-p`; depths: (n,) diagonal of D, distances from the hull.

    Source: eq. 35, but for the second D: with it the operator is symmetric, and each move goes
    downhill.
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
) -> FillResult:
    """Move a surface's center of mass to its wanted place without changing the hull by a bit.

    First-order steps on the energy with a weight that grows (eq. 31, 35), and Newton's method for
    the center of mass alone, with moves of the same kind, for the rest; see `hull_keeping_moves`.

    Parameters
    ----------
    reference: of the elastic energy.
    filled: the same triangles in the hull, as `fill_by_quadratic_programs` leaves them.
    hull: of `filled`.
    center_of_mass: (3,) wanted for the uniform solid, strictly inside the hull.
    options: lambda_CoM, lambda_m, lambda_b, the growth of the first, gamma and p.
    on_step: see `OnEnergy`.

    Raises
    ------
    InputError: a triangle of the reference has no area.
    """
    # In units of the reference's diagonal about the wanted center of mass.
    unit, weight, part = reference.diagonal, options.center_of_mass, 1.0
    scaled = reference.with_points(reference.points / unit)
    surface = filled.with_points((filled.points - center_of_mass) / unit)
    heights = hull.heights(center_of_mass) / unit
    elastic = ElasticEnergy.of(scaled, options.membrane, options.bending)
    # A closed oriented surface passes each edge once in each direction.
    starts, ends = scaled.triangles.ravel(), np.roll(scaled.triangles, -1, axis=1).ravel()
    laplacian = edge_laplacian(starts, ends, len(scaled.points))
    sobolev = SobolevSolver(laplacian, SobolevOptions(options.gamma, options.power))

    def error() -> float:
        """Distance of the center of mass from where it is wanted."""
        return float(norms(surface.centroid))

    def depths() -> Floats:
        """(n,) distances of the points from the hull, 0 for those that may not move."""
        slacks = (heights - surface.points @ hull.normals.T).min(axis=1)
        return np.maximum(slacks - DEPTH, 0.0)

    def energy(surface: Surface) -> float:
        """Energy of a surface with the present weight of centering."""
        centroid = surface.centroid
        return elastic.value(surface.points) + weight * float(centroid @ centroid)

    def descend() -> bool:
        """One step of eq. 35; whether there was any."""
        nonlocal surface, part
        gradient = weight * centering_gradient(surface, np.zeros(3))
        gradient = gradient + elastic.gradient(surface.points)
        move, reach = hull_keeping_moves(sobolev, depths(), gradient)
        slope, before = float((gradient * move).sum()), energy(surface)
        longest = BOLDEST / max(float(norms(reach).max()), np.finfo(np.float64).tiny)
        part = min(1.0, 4.0 * part)
        while part >= SHORTEST_MOVE:
            step = part * longest
            trial = surface.with_points(surface.points - step * move)
            lower = energy(trial)
            if lower <= before - DECREASE * step * slope:
                surface = trial
                on_step(lower)
                return True
            part *= 0.5
        part = 1.0
        return False

    def refine() -> bool:
        """One step of Newton's method for the center of mass, as far as the hull allows; whether
        any point may move."""
        nonlocal surface
        derivatives = surface.centroid_derivatives()
        moves, reaches = hull_keeping_moves(sobolev, depths(), np.moveaxis(derivatives, 0, -1))
        system = np.einsum("kni,nij->kj", derivatives, moves)
        multipliers = np.linalg.lstsq(system, -surface.centroid, rcond=None)[0]
        longest = float(norms(reaches @ multipliers).max())
        if longest == 0.0:
            return False
        step = min(1.0, BOLDEST / longest) * (moves @ multipliers)
        surface = surface.with_points(surface.points + step)
        on_step(energy(surface))
        return True

    on_step(energy(surface))
    while error() > NEAR_CENTER and weight <= HEAVIEST * options.center_of_mass:
        for _ in range(STEPS):
            if error() <= NEAR_CENTER or not descend():
                break
        weight *= options.growth
    for _ in range(REFINED):
        before = error()
        if before <= EXACT or not refine() or error() > USEFUL * before:
            break
    points = surface.points * unit + center_of_mass
    still = depths() == 0.0
    points[still] = filled.points[still]
    status = FillStatus.FITTED if error() <= CONTENT else FillStatus.NO_PROGRESS
    return FillResult(points, energy(surface), status)


@dataclass(frozen=True, eq=False)
class ClosestPointEnergy:
    """`E_CP = sum_p |p - CP(p)|^2` over the corners p of a hull (eq. 28).

    CP(p) lies on a face, an edge or a corner of the surface, where it was closest; there it stays
    as the points move, so that the energy is quadratic in them.

    Attributes
    ----------
    corners: (v, 3) of the hull.
    blend: (v, n) sparse weights of the surface's points, of which CP(p) is the mean.
    """

    corners: Floats
    blend: csr_array

    @classmethod
    def of(cls, surface: Surface, corners: Floats) -> ClosestPointEnergy:
        """Energy with the closest points of the present surface."""
        triangles, weights = closest_points(surface, corners)
        rows = np.repeat(np.arange(len(corners)), 3)
        columns = surface.triangles[triangles].ravel()
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
        """(3n, 3n) constant Hessian of E_CP."""
        return csc_array(2.0 * kron(self.blend.T @ self.blend, eye_array(3)))


ALMOST = 0.999
"""Part of the largest size inside that points get which are put there."""

NEAR = 0.05
"""Half-spaces nearer to a point than this, in units of length of the program, are among the first
that it is kept in."""

NEAREST = 4
"""Most half-spaces of each point among the first."""

WORST = 2
"""Most half-spaces of each point that are added at a time."""

ROUNDS = 6
"""Most programs for one step."""

OUTSIDE = 5e-4
"""Distance beyond a half-space, in the same units, from which on it is added. What is less is
mended when the step is done, and kept to from the next one on."""


def solve_quadratic_program(
    hessian: csc_array, gradient: Floats, rows: csc_array, bounds: Floats
) -> Floats | None:
    """The x that minimizes `x . H x / 2 + g . x` where `A x <= b`, or None where none was found.

    Parameters
    ----------
    hessian: (n, n) H, symmetric positive semidefinite.
    gradient: (n,) g.
    rows: (m, n) A.
    bounds: (m,) b.

    Raises
    ------
    InputError: Clarabel is not installed.
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


class PointsInside:
    """Points that move inside a polyhedron about the origin, `normals . x <= heights`.

    A program has constraints only for half-spaces near each point; those that its solution violates
    are added until there are none. The ones that held a point back at the end of a step are among
    the first of the next.
    """

    def __init__(self, normals: Floats, heights: Floats) -> None:
        """normals: (m, 3) unit; heights: (m,) above 0."""
        self.normals = normals
        self.heights = heights
        self.held: Booleans | bool = False

    def slacks(self, points: Floats) -> Floats:
        """(n, m) distances of points (n, 3) from the planes, positive inside."""
        return self.heights - points @ self.normals.T

    def largest(self, points: Floats) -> Floats:
        """Points (n, 3) moved, and scaled down where they have to be, to the largest size that is
        inside."""
        reaches = (points @ self.normals.T).max(axis=0)
        # Of the size s and the shift t, the largest s with s * reach + normal . t <= height.
        best = linprog(
            [-1.0, 0.0, 0.0, 0.0],
            np.column_stack([reaches, self.normals]),
            self.heights,
            bounds=[(0.0, 1.0), *[(None, None)] * 3],
        ).x
        return ALMOST * (best[0] * points + best[1:])

    def pull_inside(self, points: Floats) -> Floats:
        """Points (n, 3), those outside drawn toward the origin until they are not."""
        excess = (points @ self.normals.T / self.heights).max(axis=1)
        return points / np.maximum(excess, 1.0)[:, None]

    def step(self, points: Floats, hessian: csc_array, gradient: Floats) -> Floats | None:
        """Moves d (n, 3) that minimize `d . H d / 2 + g . d` with all points inside; None where the
        program cannot be solved.

        points: (n, 3), inside; hessian: (3n, 3n) H, symmetric positive semidefinite; gradient:
        (n, 3) g.
        """
        slacks = self.slacks(points)
        pairs = np.full(slacks.shape, self.held)
        _add_least(pairs, slacks, NEAREST, NEAR)
        for _ in range(ROUNDS):
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
            if not _add_least(pairs, left, WORST, -OUTSIDE):
                break
        self.held = pairs & (left < OUTSIDE)
        return moves


def _add_least(pairs: Booleans, slacks: Floats, count: int, limit: float) -> bool:
    """Mark the least of each row of slacks (n, m), at most `count` and only those below a limit, in
    pairs (n, m); whether there were any."""
    count = min(count, slacks.shape[1] - 1)
    least = np.argpartition(slacks, count, axis=1)[:, :count]
    rows, columns = np.nonzero(np.take_along_axis(slacks, least, axis=1) < limit)
    pairs[rows, least[rows, columns]] = True
    return len(rows) > 0


MARGIN = 1e-6
"""Depth inside the hull, over the diagonal of the surface, that all points keep."""

PROXIMAL = 1e-6
"""Weight of squared moves: the elastic energy leaves some free."""

SHORTEST = 1e-3
"""Part of a step below which none is taken."""

CLOSE = 1e-3
"""Mean distance of the hull's corners from the surface, over its diagonal, that will do: nearer
corners than the surface has points for share one, and are never all met."""

MOST_STEPS = 40
"""Most programs."""


def fill_by_quadratic_programs(
    surface: Surface, hull: ConvexHull, options: ConcavePaperOptions, on_step: OnEnergy
) -> FillResult:
    """Deform a surface as little as may be until its convex hull is a wanted one (eq. 26, 27).

    Parameters
    ----------
    surface: the reference of the elastic energy, and the start.
    hull: wanted.
    options: lambda_CP, lambda_m, lambda_b and the growth of the first.
    on_step: see `OnEnergy`.

    Returns
    -------
    FITTED with the corners of the hull close to the surface, on the mean; STEP_LIMIT with a surface
    that is not as close, UNSOLVED with the one of which no program was solved.

    Raises
    ------
    InputError: a triangle without area; Clarabel is not installed.
    """
    # In units of the surface's diagonal about the hull's centroid.
    unit, middle = surface.diagonal, hull.centroid
    scaled = surface.with_points((surface.points - middle) / unit)
    targets = (hull.vertices - middle) / unit
    inside = PointsInside(hull.normals, hull.heights(middle) / unit - MARGIN)
    elastic = ElasticEnergy.of(scaled, options.membrane, options.bending)
    points, weight = inside.largest(scaled.points), options.closest_point
    closest = ClosestPointEnergy.of(scaled.with_points(points), targets)

    def energy_at(points: Floats) -> float:
        return elastic.value(points) + weight * closest.value(points)

    energy, status = energy_at(points), FillStatus.STEP_LIMIT
    on_step(energy)
    # Steps of eq. 29 and 30, with a weight that grows.
    for number in range(MOST_STEPS + 1):
        if norms(closest.offsets(points)).mean() <= CLOSE:
            status = FillStatus.FITTED
            break
        if number == MOST_STEPS:
            break
        gradient = elastic.gradient(points) + weight * closest.gradient(points)
        hessian = elastic.hessian(points) + weight * closest.hessian
        hessian = hessian + PROXIMAL * eye_array(gradient.size)
        move = inside.step(points, csc_array(hessian), gradient)
        if move is None:
            status = FillStatus.UNSOLVED
            break
        trial = inside.pull_inside(points + move)
        before, energy, part = points, energy_at(points), 1.0
        while part >= SHORTEST:
            nearer = trial if part == 1.0 else before + part * (trial - before)
            lower = energy_at(nearer)
            if lower < energy:
                points, energy = nearer, lower
                break
            part *= 0.5
        on_step(energy)
        if part == 1.0 or part < SHORTEST:
            weight *= options.growth
        closest = ClosestPointEnergy.of(scaled.with_points(points), targets)
    return FillResult(points * unit + middle, energy, status)


def fill_as_paper(
    surface: Surface,
    hull: ConvexHull,
    center_of_mass: Floats,
    options: ConcavePaperOptions,
    on_step: Callable[[str, float], None],
) -> FillResult:
    """The surface grown in a wanted hull, and its center of mass brought to where it is wanted (3,)
    while the hull that it has then stays.

    on_step: called with "fill" or "balance" and the energy of every step. The status is that of the
    balance, or UNSOLVED where there is nothing to balance.

    Raises InputError where Clarabel is not installed or a triangle has no area.
    """
    filled = fill_by_quadratic_programs(
        surface, hull, options, lambda energy: on_step("fill", energy)
    )
    if filled.status is FillStatus.UNSOLVED:
        return filled
    return balance(
        surface,
        surface.with_points(filled.points),
        convex_hull(filled.points),
        center_of_mass,
        options,
        lambda energy: on_step("balance", energy),
    )
