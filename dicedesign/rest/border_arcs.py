"""Great arcs of the borders of basins, and adaptive quadrature of many integrals at once, along
arcs and over spherical triangles.

Intervals are integrated by Kronrod's rule with 15 points and halved where it differs too much from
Gauss' rule with 7 of them. A triangle is the image of a square, with one coordinate along the side
opposite to its first corner and one toward that side. It is integrated by the product of the rules
and halved along the coordinate with the larger error.

Source: Kronrod, "Nodes and weights of quadrature formulas", Consultants Bureau, 1965; Piessens et
al., "QUADPACK", Springer, 1983.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dicedesign.geometry.sphere import norms, unit_vectors
from dicedesign.rest.morse import Separatrices
from dicedesign.runtime.arrays import Booleans, Floats, Integers


@dataclass(frozen=True, eq=False)
class Arcs:
    """Great arcs, each shorter than pi and none of length zero.

    Attributes
    ----------
    start: (n, 3) unit directions where they begin; toward: (n, 3) unit tangents there.
    pole: (n, 3) unit normals of their planes, to the left of travel.
    length: (n,) in radians.
    """

    start: Floats
    toward: Floats
    pole: Floats
    length: Floats

    @classmethod
    def between(cls, a: Floats, b: Floats) -> Arcs:
        """Arcs from unit directions a (n, 3) to b (n, 3), neither equal nor opposite."""
        across = np.linalg.cross(a, b)
        sine = norms(across)
        pole = across / sine[:, None]
        toward = np.asarray(np.linalg.cross(pole, a), dtype=np.float64)
        return cls(a, toward, pole, np.asarray(np.arctan2(sine, (a * b).sum(-1))))

    def at(self, rows: Integers, distance: Floats) -> Floats:
        """(r, m, 3) unit directions on the arcs `rows` (r,) at distances (r, m) from their
        starts."""
        start, toward = self.start[rows, None, :], self.toward[rows, None, :]
        return np.cos(distance)[..., None] * start + np.sin(distance)[..., None] * toward

    def speeds(self, rows: Integers, distance: Floats) -> Floats:
        """(r, m, 2) how fast the arcs `rows` (r,) move aside at distances (r, m) from their starts
        when the start, or the end, does so at speed 1 and the other stays."""
        length = self.length[rows, None]
        ends = np.stack([np.sin(length - distance), np.sin(distance)], axis=-1)
        return np.asarray(ends / np.sin(length)[..., None])

    def nearest(self, axis: Floats) -> Floats:
        """(n,) distance, in (-pi, pi], from the start to the point of the great circle that is
        nearest to an axis (3,)."""
        return np.asarray(np.arctan2(self.toward @ axis, self.start @ axis))


@dataclass(frozen=True, eq=False)
class Borders:
    """The arcs of all separatrices of a body.

    Attributes
    ----------
    paths: the separatrices; lengths: (2 s, depth + 2) of the vectors to their points.
    moving: (2 s, depth + 1) whether a segment of a branch has a length.
    arcs: the n segments with a length, in the order of `moving`.
    """

    paths: Separatrices
    lengths: Floats
    moving: Booleans
    arcs: Arcs

    @classmethod
    def of(cls, paths: Separatrices, points: Floats) -> Borders:
        """Arcs through points (2 s, depth + 2, 3) of `separatrix_points`."""
        unit = unit_vectors(points)
        a, b = unit[:, :-1], unit[:, 1:]
        moving = norms(np.linalg.cross(a, b)) > 0.0
        return cls(paths, norms(points), moving, Arcs.between(a[moving], b[moving]))

    def sums(self, values: Floats, of_right: float = -1.0) -> Floats:
        """(k,) sums of values (n,) of the arcs over the borders of the basins, each arc with the
        basin to its left, and `of_right` times with the basin to its right."""
        filled = np.zeros(self.moving.shape)
        filled[self.moving] = values
        of_branch = filled.sum(axis=1)
        across = of_branch[::2] + of_right * of_branch[1::2]
        sums = np.zeros(len(self.paths.rests))
        np.add.at(sums, self.paths.basins[:, 0], across)
        np.add.at(sums, self.paths.basins[:, 1], of_right * across)
        return sums

    def point_slopes(self, fluxes: Floats) -> Floats:
        """(2 s, depth + 2, 3) derivatives of the integral left of each branch in the points on
        it, for fluxes (n, 2) over the arcs, see `DensityPrior`."""
        slopes = np.zeros((*self.lengths.shape, 3))
        # Moves to the right enlarge the area on the left.
        outward = -self.arcs.pole
        for column, ends in ((0, slopes[:, :-1]), (1, slopes[:, 1:])):
            moved = np.zeros(ends.shape)
            moved[self.moving] = fluxes[:, column, None] * outward
            ends += moved
        return np.asarray(slopes / self.lengths[..., None])


_POSITIVE = np.array(
    [
        0.991455371120812639206854697526329,
        0.949107912342758524526189684047851,
        0.864864423359769072789712788640926,
        0.741531185599394439863864773280788,
        0.586087235467691130294144691693219,
        0.405845151377397166906606412076961,
        0.207784955007898467600689403773245,
    ]
)
_KRONROD = np.array(
    [
        0.022935322010529224963732008058970,
        0.063092092629978553290700663189204,
        0.104790010322250183839876322541518,
        0.140653259715525918745189590510238,
        0.169004726639267902826583426598550,
        0.190350578064785409913256402421014,
        0.204432940075298892414161999234649,
        0.209482141084727828012999174891714,
    ]
)
_GAUSS = np.array(
    [
        0.129484966168869693270611432679082,
        0.279705391489276667901467771423780,
        0.381830050505118944950369775488975,
        0.417959183673469387755102040816327,
    ]
)

# On the interval from 0 to 1.
NODES = (np.concatenate([-_POSITIVE, [0.0], _POSITIVE[::-1]]) + 1.0) / 2.0
WEIGHTS = np.concatenate([_KRONROD, _KRONROD[-2::-1]]) / 2.0
COARSE = np.zeros(15)
COARSE[1::2] = np.concatenate([_GAUSS, _GAUSS[-2::-1]]) / 2.0

ROUNDED = 16.0 * float(np.finfo(np.float64).eps)
"""Least error, relative to the integral of the absolute value, that halving can reach."""

MOST_HALVINGS = 60

MOST_VALUES = 8_000_000
"""Most values of an integrand on triangles; then the error is accepted."""

CHUNK = 2_000
"""Triangles that are evaluated at once."""

Integrand = Callable[[Integers, Floats], Floats]
"""From numbers of integrals (r,) and places (r, 15) to values (r, 15, c)."""


def integrals(integrand: Integrand, edges: Floats, tolerance: float) -> tuple[Floats, Floats]:
    """Integrals of functions with c components, and estimates of the largest error of each.

    integrand: smooth between the edges; edges: (n, m) ascending ends of the intervals to begin
    with, of which some may be empty; tolerance: of each integral, above 0.
    Returns (n, c) and (n,).
    """
    rows = np.repeat(np.arange(len(edges)), edges.shape[1] - 1)
    low, high = edges[:, :-1].ravel(), edges[:, 1:].ravel()
    components = integrand(rows[:0], np.zeros((0, len(NODES)))).shape[-1]
    values, errors = np.zeros((len(edges), components)), np.zeros(len(edges))
    for halving in range(MOST_HALVINGS + 1):
        real = high > low
        rows, low, high = rows[real], low[real], high[real]
        if len(rows) == 0:
            break
        width = (high - low)[:, None]
        node_values = integrand(rows, low[:, None] + width * NODES)
        fine = width * np.einsum("j,rjc->rc", WEIGHTS, node_values)
        coarse = width * np.einsum("j,rjc->rc", COARSE, node_values)
        size = width * np.einsum("j,rjc->rc", WEIGHTS, np.abs(node_values))
        rounding = ROUNDED * size.max(axis=1)
        error = np.abs(fine - coarse).max(axis=1)
        done = (error <= np.maximum(tolerance, rounding)) | (halving == MOST_HALVINGS)
        np.add.at(values, rows[done], fine[done])
        np.add.at(errors, rows[done], np.maximum(error, rounding)[done])
        rows, low, high = np.tile(rows[~done], 2), low[~done], high[~done]
        middle = (low + high) / 2.0
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
    return values, errors


def triangle_integrals(
    density: Callable[[Floats], Floats], corners: Floats, tolerance: float
) -> tuple[Floats, Floats]:
    """Integrals over spherical triangles, and estimates of their errors.

    density: from unit directions (p, 3) to values (p,); corners: (n, 3, 3) directions, not all of
    a triangle in one plane through the center, or it counts as empty; triangles that turn clockwise
    seen from outside count as negative; tolerance: of all of them together, above 0.
    Returns (n,) and (n,).
    """
    values, errors = np.zeros(len(corners)), np.zeros(len(corners))
    rows = np.flatnonzero(np.linalg.det(corners) != 0.0)
    low, width = np.zeros((len(rows), 2)), np.ones((len(rows), 2))
    evaluated = 0
    # Each its part of the tolerance, by its part of the square.
    allowed = tolerance / max(len(rows), 1)
    while len(rows):
        fine, error, worse = _products(density, corners[rows], low, width)
        evaluated += fine.size * len(NODES) ** 2
        done = error[:, 0] <= np.maximum(allowed * width.prod(axis=1), error[:, 1])
        done |= evaluated >= MOST_VALUES
        np.add.at(values, rows[done], fine[done])
        np.add.at(errors, rows[done], error[done].max(axis=1))
        rows, low, width, worse = (part[~done] for part in (rows, low, width, worse))
        half = width.copy()
        half[np.arange(len(rows)), worse] /= 2.0
        aside = np.where(np.arange(2) == worse[:, None], half, 0.0)
        rows, width = np.tile(rows, 2), np.tile(half, (2, 1))
        low = np.concatenate([low, low + aside])
    return values, errors


def _products(
    density: Callable[[Floats], Floats], corners: Floats, low: Floats, width: Floats
) -> tuple[Floats, Floats, Integers]:
    """Integrals (r,) over parts of triangles, their errors (r, 2) by the rule and by rounding, and
    the coordinate (r,) that has more of the error."""
    fine, error = np.empty(len(corners)), np.empty((len(corners), 2))
    worse = np.empty(len(corners), dtype=np.int64)
    for first in range(0, len(corners), CHUNK):
        part = slice(first, first + CHUNK)
        own, size = corners[part], width[part]
        along = (low[part, :1] + size[:, :1] * NODES)[:, :, None, None]
        toward = (low[part, 1:] + size[:, 1:] * NODES)[:, None, :, None]
        tip, a, b = (own[:, None, None, number] for number in range(3))
        points = (1.0 - toward) * tip + toward * ((1.0 - along) * a + along * b)
        length = norms(points)
        values = density((points / length[..., None]).reshape(-1, 3)).reshape(length.shape)
        # Times the area that a part of the square has on the sphere, seen through the flat
        # triangle.
        scale = np.linalg.det(own) * size.prod(axis=1)
        slopes = values * scale[:, None, None] * toward[..., 0] / length**3
        exact = np.einsum("i,j,rij->r", WEIGHTS, WEIGHTS, slopes)
        less = [
            np.einsum("i,j,rij->r", *by, slopes) for by in ((COARSE, WEIGHTS), (WEIGHTS, COARSE))
        ]
        whole = np.einsum("i,j,rij->r", WEIGHTS, WEIGHTS, np.abs(slopes))
        misses = np.abs(np.stack([exact - one for one in less], axis=1))
        fine[part], worse[part] = exact, misses.argmax(axis=1)
        error[part, 0], error[part, 1] = misses.sum(axis=1), ROUNDED * whole
    return fine, error, worse
