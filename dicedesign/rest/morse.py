"""The Morse-Smale complex of the support function: which separatrices divide which basins.

Separatrices are stored as integers (`Separatrices`); `separatrix_points` turns them into points,
and `border_areas` points into areas, with formulas that NumPy and torch share.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dicedesign.geometry.sphere import (
    foot_on_line,
    oblique_projection,
    signed_solid_angle,
    unit_vectors,
)
from dicedesign.kernels import ops as kernels
from dicedesign.rest.equilibria import Equilibria
from dicedesign.rest.tracing import ascend, trace_to_rests
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import NEAR_ANTIPODE


@dataclass(frozen=True)
class Separatrices(kernels.Handled):
    """The ascending separatrices of the saddles that divide two basins, as integers.

    Branch 2 s runs from saddle s into the cell of its half-edge's head, branch 2 s + 1 into the
    cell of its tail.

    Attributes
    ----------
    rests: (k,) stable facets.
    saddles: (s,) one half-edge for each dividing saddle.
    basins: (s, 2) index into `rests` of the basin left and right of the half-edge.
    saddle_ends: (s, 2) tail and head vertex of each saddle's half-edge.
    crossings: (c, 2) vertices p, q of the edges whose arcs the branches cross, in order, branch
        after branch.
    branch_start: (2 s + 1,) branch b has `crossings[branch_start[b] : branch_start[b + 1]]`.
    maxima: (2 s,) vertex at which a branch ends.
    """

    rests: Integers
    saddles: Integers
    basins: Integers
    saddle_ends: Integers
    crossings: Integers
    branch_start: Integers
    maxima: Integers

    @cached_property
    def handle(self) -> Any:
        """C++ handle of these separatrices for kernels."""
        return kernels.new_handle(
            "Paths",
            self.rests,
            self.basins,
            self.saddle_ends,
            self.crossings,
            self.branch_start,
            self.maxima,
        )

    @cached_property
    def lengths(self) -> Integers:
        """(2 s,) number of edges that each branch crosses."""
        return np.diff(self.branch_start)

    @cached_property
    def padded_crossings(self) -> Integers:
        """(2 s, depth, 2) crossings of each branch, padded with arbitrary ones."""
        steps = np.arange(int(self.lengths.max(initial=0)))
        places = np.minimum(self.branch_start[:-1, None] + steps, len(self.crossings) - 1)
        return self.crossings[places]


def separatrices(equilibria: Equilibria) -> Separatrices:
    """Find the separatrices that divide basins (algorithm 3, lines 2 to 27).

    Saddles whose two sides roll to one facet are not traced. Raises `Tie` if the tie distance is
    above 0 and the body is tied.
    """
    body = equilibria.hull, equilibria.center_of_mass, equilibria.tie_distance
    answer = kernels.separatrices(*body)
    if answer is not kernels.UNDECIDED:
        *arrays, handle, growth_sign, side_sign = answer
        equilibria.remember(growth_sign, side_sign)
        paths = Separatrices(*arrays)
        paths.__dict__["handle"] = handle
        return paths
    # As in the kernels, with exact arithmetic where rounding leaves a decision open.
    hull = equilibria.hull
    rests = np.flatnonzero(equilibria.stable)
    saddles = np.flatnonzero(equilibria.saddle & (np.arange(len(hull.tail)) < hull.twin))
    if len(rests) == 1:
        saddles = saddles[:0]
    sides = np.stack([hull.facet[saddles], hull.facet[hull.twin[saddles]]], axis=1)
    needed, inverse = np.unique(sides, return_inverse=True)
    destined = trace_to_rests(equilibria, needed)[inverse].reshape(sides.shape)
    dividing = destined[:, 0] != destined[:, 1]
    saddles = saddles[dividing]
    basins = np.searchsorted(rests, destined[dividing])
    starts = np.stack([hull.head[saddles], hull.tail[saddles]], axis=1).ravel()
    crossed, start, maxima = ascend(equilibria, np.repeat(saddles, 2), starts)
    return Separatrices(
        rests,
        saddles,
        basins,
        np.stack([hull.tail[saddles], hull.head[saddles]], axis=1),
        np.stack([hull.tail[crossed], hull.head[crossed]], axis=1),
        start,
        maxima,
    )


def separatrix_points(paths: Separatrices, vertices: Any, center: Any, xp: ModuleType) -> Any:
    """Directions along every branch: the saddle, the crossings, the maximum.

    paths: the separatrices of a hull.
    vertices: (n, 3) and center: (3,), NumPy or torch.
    Returns (2 s, depth + 2, 3), all but the maxima normalized. A branch that has crossed its last
    edge waits there, so that superfluous segments have length zero.
    """
    radii = vertices - center
    tail, head = paths.saddle_ends[:, 0], paths.saddle_ends[:, 1]
    v = vertices[head] - vertices[tail]
    saddle = foot_on_line(radii[tail], radii[head], v, xp)
    # Without this the products along a branch would overflow for bodies of extreme sizes.
    saddle = saddle / xp.sqrt((saddle * saddle).sum(-1))[:, None]
    point = xp.stack([saddle, saddle], 1).reshape(-1, 3)
    points = [point]
    for step in range(paths.padded_crossings.shape[1]):
        p, q = paths.padded_crossings[:, step, 0], paths.padded_crossings[:, step, 1]
        moved = oblique_projection(point, radii[p], vertices[q] - vertices[p])
        squared = (moved * moved).sum(-1)
        moving = xp.asarray(paths.lengths > step) & (squared > 0.0)
        unit = moved / xp.sqrt(xp.where(moving, squared, 1.0))[:, None]
        point = xp.where(moving[:, None], unit, point)
        points.append(point)
    points.append(radii[paths.maxima])
    return xp.stack(points, 1)


def basin_references(paths: Separatrices, points: Floats, normals: Floats) -> Floats:
    """A direction for each basin from which its area can be measured without cancellation.

    It is the rest's normal, unless the antipode is near the basin's border: the area of a triangle
    between nearly opposite directions is ill-conditioned. Then it is the coordinate direction whose
    antipode is farthest from the border.

    points: (2 s, depth + 2, 3) from `separatrix_points`; normals: (k, 3). Returns (k, 3).
    """
    unit = unit_vectors(points)
    middle = unit_vectors(unit[:, 1:] + unit[:, :-1])
    border = np.concatenate([unit, middle], axis=1)
    basins = np.repeat(paths.basins, 2, axis=0)

    def distance(references: Floats) -> Floats:
        """(k,) of the border from the references' antipodes: 1 + cosine."""
        nearest = np.full(len(normals), np.inf)
        for basin in basins.T:
            along = (references[basin][:, None, :] * border).sum(-1)
            np.minimum.at(nearest, basin, 1.0 + along.min(axis=1))
        return nearest

    references, nearest = normals.copy(), distance(normals)
    poor = nearest < NEAR_ANTIPODE
    if poor.any():
        for axis in (*np.eye(3), *-np.eye(3)):
            gap = distance(np.tile(axis, (len(normals), 1)))
            better = poor & (gap > nearest)
            references[better] = axis
            nearest = np.where(better, gap, nearest)
    return references


def border_areas(paths: Separatrices, points: Any, normals: Any, xp: ModuleType) -> Any:
    """Area that each dividing saddle's border adds to the basins beside it.

    points: (2 s, depth + 2, 3) from `separatrix_points`; normals: (k, 3) a reference direction for
    each basin. A basin's area is the sum over its borders, up to a multiple of 4 pi, and as a sum
    over closed loops does not depend on the reference.
    Returns (s, 2) for `paths.basins`. Source: eq. 10.
    """
    a, b = points[:, :-1], points[:, 1:]
    contributions = []
    for column, sign in ((0, 1.0), (1, -1.0)):
        reference = normals[np.repeat(paths.basins[:, column], 2)][:, None, :]
        angles = signed_solid_angle(reference, a, b, xp).sum(-1).reshape(-1, 2)
        # The branch into the head's cell runs along the left basin's border, the other against it.
        contributions.append(sign * (angles[:, 0] - angles[:, 1]))
    return xp.stack(contributions, 1)


def signed_areas(paths: Separatrices, points: NDArray[Any], references: Floats) -> NDArray[Any]:
    """Areas (k,) of the basins, up to multiples of 4 pi and in the type of the points; see
    `border_areas`."""
    areas = np.zeros(len(paths.rests), dtype=points.dtype)
    np.add.at(areas, paths.basins.ravel(), border_areas(paths, points, references, np).ravel())
    return areas


def wraps(areas: Floats) -> Integers:
    """Multiples of 4 pi (k,) to add to signed areas (k,) so that they become the basins' areas.

    The area of a basin that contains the antipode of its own normal is too small by 4 pi. The sum
    of areas gives the number of these basins, and they are the most negative ones.
    """
    missing = round(1.0 - float(areas.sum()) / (4.0 * np.pi))
    added = np.zeros(len(areas), dtype=np.int64)
    added[np.argsort(areas, kind="stable")[: max(missing, 0)]] = 1
    return added


SHORT_ARC = 1e-24
"""Squared sine below which an arc is replaced by its chord."""


def basin_moments(paths: Separatrices, points: Any, xp: ModuleType) -> Any:
    """(k, 3) integrals of the direction over each basin, which point to the basins' barycenters.

    An arc of angle t in a plane with unit normal m, counter-clockwise about the basin, contributes
    m t / 2, by Stokes' theorem.

    paths: the separatrices; points: (2 s, depth + 2, 3) on them, from `separatrix_points`, NumPy or
    torch as `xp` says.
    """
    unit = points / xp.sqrt((points * points).sum(-1))[..., None]
    a, b = unit[:, :-1], unit[:, 1:]
    cross = xp.linalg.cross(a, b)
    squared = (cross * cross).sum(-1)
    curved = squared > SHORT_ARC
    sine = xp.sqrt(xp.where(curved, squared, 1.0))
    ratio = xp.where(curved, xp.atan2(sine, (a * b).sum(-1)) / sine, 1.0)
    halves = (ratio[..., None] * cross).sum(1).reshape(-1, 2, 3) / 2.0
    # The branch into the head's cell runs along the left basin's border, the other against it.
    left = halves[:, 0] - halves[:, 1]
    borders = paths.basins[None] == np.arange(len(paths.rests))[:, None, None]
    signs = borders[..., 0].astype(np.float64) - borders[..., 1]
    return xp.asarray(signs) @ left
