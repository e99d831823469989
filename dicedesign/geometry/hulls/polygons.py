"""The largest circle and the largest upright rectangle of a shape in a convex polygon."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import combinations

import numpy as np

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import rotation_between
from dicedesign.runtime.arrays import Floats

MOST_TRIPLED = 24
"""Most constraints for which all triples are tried; a linear program takes more."""

PARALLEL = 1e-12
"""Determinant of three unit constraints below which they meet in no point."""

ROUNDING = 1e-9
"""Relative change of a factor, well above its rounding."""

MET = 1e-12
"""Largest violation of a constraint, relative to the root of the polygon's area."""


def signed_area(polygon: Floats) -> float:
    """Area of a (m, 2) polygon in its unit squared, positive if it runs counter-clockwise."""
    x, y = (polygon - polygon.mean(axis=0)).T
    return 0.5 * float(x @ np.roll(y, -1) - np.roll(x, -1) @ y)


def centroid(polygon: Floats) -> Floats:
    """Centroid (2,) of the area of a (m, 2) polygon; the mean of the corners if it has no area."""
    middle = polygon.mean(axis=0)
    corners = polygon - middle
    following = np.roll(corners, -1, axis=0)
    doubled = corners[:, 0] * following[:, 1] - corners[:, 1] * following[:, 0]
    if doubled.sum() == 0.0:
        return middle
    return middle + doubled @ (corners + following) / (3.0 * doubled.sum())


def facet_inradius(hull: ConvexHull, facet: int) -> float:
    """Radius of the largest circle in a facet of a hull, in the hull's unit."""
    upright = rotation_between(hull.normals[facet], np.array([0.0, 0.0, 1.0]))
    return inscribed_circle((hull.polygon(facet) @ upright.T)[:, :2])[1]


def inscribed_circle(polygon: Floats) -> tuple[Floats, float]:
    """Largest circle in a convex polygon; of several, the one nearest to the polygon's centroid.

    Parameters
    ----------
    polygon: (m, 2) corners in order, either way around.

    Returns
    -------
    (2,) the center, and the radius, in the polygon's unit.

    Raises
    ------
    InputError: fewer than three corners, not finite, no area, or no circle (not convex).
    """
    sides = _Sides(polygon)
    center, radius = sides.place(np.ones(len(sides.offsets)), sides.offsets)
    if radius <= 0.0:
        raise InputError(
            f"polygon: expected {len(polygon)} corners that run around a convex one, got none that "
            "a circle fits in; pass them in order"
        )
    return center, sides.scale * radius


def inscribed_box(
    polygon: Floats,
    size: tuple[float, float],
    *,
    margin: float | Floats = 0.0,
    rim: float | Floats = 0.0,
    slack: float = 0.0,
    least: float = 0.0,
    most: float = math.inf,
) -> tuple[Floats, float]:
    """Largest upright rectangle of given proportions in a convex polygon, a margin away from its
    edges; of several, the one nearest to the polygon's centroid.

    Parameters
    ----------
    polygon: (m, 2) corners in order, either way around.
    size: width and height of the rectangle of factor 1, at least 0 and not both 0.
    margin: distance of the rectangle from the polygon's edges, at least 0; one, or (m,) for the
        edges from each corner to the next.
    rim: further distances for the rectangle of factor 1, which grow with the factor.
    slack: in [0, 1), the share of the largest factor that may be given up to come nearer to the
        centroid, as long as the factor stays at `least` or above.
    least, most: bounds of the factor, `most` at least `least`.

    Returns
    -------
    (2,) the center, and the factor, 0 where not even a point fits.

    Raises
    ------
    InputError: as `inscribed_circle`, but for the circle.
    """
    sides = _Sides(polygon)
    reach = np.abs(sides.outward) @ (0.5 * np.asarray(size) / max(size))
    reach += sides.of_edges(rim) / max(size)
    offsets = sides.offsets - sides.of_edges(margin) / sides.scale
    unit = sides.scale / max(size)

    def choose(largest: float) -> float:
        """A little more than the least, so that rounding takes nothing from it."""
        at_least = min((1.0 + ROUNDING) * least, unit * largest)
        return min(max((1.0 - slack) * unit * largest, at_least), most) / unit

    center, factor = sides.place(reach, offsets, choose)
    return center, min(unit * factor, most)


class _Sides:
    """A polygon as sides `outward @ x <= offsets`, about its centroid and of area 1.

    middle: (2,) the centroid; scale: the root of the area. Raises InputError for fewer than three
    corners, or corners that are not finite or have no area.
    """

    def __init__(self, polygon: Floats) -> None:
        polygon = np.asarray(polygon, dtype=np.float64)
        if polygon.ndim != 2 or polygon.shape[1] != 2 or len(polygon) < 3:
            raise InputError(
                f"polygon: expected corners of shape (m, 2) with m >= 3, got shape "
                f"{polygon.shape}; pass one row x, y for each corner"
            )
        area = signed_area(polygon) if np.isfinite(polygon).all() else math.nan
        if math.isnan(area) or area == 0.0:
            raise InputError(
                f"polygon: expected finite corners around an area, got area {area}; pass them in "
                "order"
            )
        self.middle = centroid(polygon)
        self.scale = math.sqrt(abs(area))
        corners = (polygon - self.middle) / self.scale
        edges = np.roll(corners, -1, axis=0) - corners
        lengths = np.linalg.norm(edges, axis=1)
        self.edges = lengths > 0
        corners, edges, lengths = corners[self.edges], edges[self.edges], lengths[self.edges]
        self.outward = np.sign(area) * np.column_stack([edges[:, 1], -edges[:, 0]])
        self.outward /= lengths[:, None]
        self.offsets = np.einsum("ij,ij->i", self.outward, corners)

    def of_edges(self, values: float | Floats) -> Floats:
        """(k,) values, one for all edges or one for each, of the edges that have a length."""
        return np.broadcast_to(values, self.edges.shape)[self.edges]

    def place(
        self,
        reach: Floats,
        offsets: Floats,
        choose: Callable[[float], float] = float,
    ) -> tuple[Floats, float]:
        """Center (2,) and factor of a shape within `outward @ x <= offsets` (m,) that reaches
        `factor * reach` (m,) beyond its center toward each side; factor 0 where none fits.

        choose: the factor that has to be left, from the largest one. The center is the nearest to
        the centroid that leaves it: between parallel edges a center is free to slide, and in a long
        facet nearly so.
        """
        widest = _least_third(-1.0, np.column_stack([self.outward, reach]), offsets)
        if widest is None or widest[2] <= 0.0:
            return self.middle, 0.0
        along = np.array([(1, 0, -1), (-1, 0, -1), (0, 1, -1), (0, -1, -1)])
        rows = np.vstack([np.column_stack([self.outward, np.zeros(len(reach))]), along])
        inner = offsets - choose(float(widest[2])) * reach
        nearest = _least_third(1.0, rows, np.concatenate([inner, np.zeros(4)]))
        center = (widest if nearest is None else nearest)[:2]
        factor = float(((offsets - self.outward @ center) / reach).min())
        return self.middle + self.scale * center, factor


def _least_third(sign: float, rows: Floats, bounds: Floats) -> Floats | None:
    """Point (3,) of a polyhedron `rows @ x <= bounds` whose third coordinate times a sign is least,
    or None: a corner, in which three constraints are active."""
    if len(rows) > MOST_TRIPLED:
        # Imported late: loading it takes longer than most dice.
        from scipy.optimize import linprog

        free = [(None, None), (None, None), (0, None)]
        answer = linprog((0, 0, sign), A_ub=rows, b_ub=bounds, bounds=free)
        return answer.x if answer.success else None
    triples = np.array(list(combinations(range(len(rows)), 3)))
    regular = np.abs(np.linalg.det(rows[triples])) > PARALLEL
    triples = triples[regular]
    corners = np.linalg.solve(rows[triples], bounds[triples][..., None])[..., 0]
    corners = corners[(corners @ rows.T <= bounds + MET).all(axis=1)]
    if len(corners) == 0:
        return None
    values = sign * corners[:, 2]
    # Of several, the one in the middle.
    tied = corners[values <= values.min() + MET]
    least: Floats = tied[np.argmin((tied[:, :2] ** 2).sum(axis=1))]
    return least
