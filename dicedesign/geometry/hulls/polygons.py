"""The largest circle in a convex polygon."""

from __future__ import annotations

import math
from itertools import combinations
from typing import Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import rotation_between
from dicedesign.runtime.arrays import Floats

__all__ = ["facet_inradius", "inscribed_circle", "signed_area"]

MOST_TRIPLED: Final = 24
"""Constraints up to which all triples of them are tried."""

PARALLEL: Final = 1e-12
"""Determinant of three unit constraints below which they meet in no point."""

MET: Final = 1e-12
"""By how much a constraint may be missed, relative to the root of the polygon's area."""


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


def inscribed_circle(polygon: Floats, slack: float = 0.0) -> tuple[Floats, float]:
    """Largest circle in a convex polygon; of several, the one nearest to the polygon's centroid.

    Parameters
    ----------
    polygon: (m, 2) corners in order, either way around.
    slack: in [0, 1), the part of the largest radius that may be given up to come nearer to the
        centroid.

    Returns
    -------
    (2,) the center, and the radius, in the polygon's unit.

    Raises
    ------
    InputError: fewer than three corners, not finite, no area, or no circle (not convex).
    """
    polygon = np.asarray(polygon, dtype=np.float64)
    if polygon.ndim != 2 or polygon.shape[1] != 2 or len(polygon) < 3:
        raise InputError(
            f"polygon: expected corners of shape (m, 2) with m >= 3, got shape {polygon.shape}; "
            "pass one row x, y for each corner"
        )
    area = signed_area(polygon) if np.isfinite(polygon).all() else math.nan
    if math.isnan(area) or area == 0.0:
        raise InputError(
            f"polygon: expected finite corners around an area, got area {area}; pass them in order"
        )
    middle = centroid(polygon)
    scale = math.sqrt(abs(area))
    corners = (polygon - middle) / scale
    edges = np.roll(corners, -1, axis=0) - corners
    lengths = np.linalg.norm(edges, axis=1)
    corners, edges, lengths = corners[lengths > 0], edges[lengths > 0], lengths[lengths > 0]
    outward = np.sign(area) * np.column_stack([edges[:, 1], -edges[:, 0]]) / lengths[:, None]
    offsets = np.einsum("ij,ij->i", outward, corners)

    widest = _least_third(-1.0, np.column_stack([outward, np.ones(len(outward))]), offsets)
    if widest is None or widest[2] <= 0:
        raise InputError(
            f"polygon: expected {len(polygon)} corners that run around a convex one, got none that "
            "a circle fits in; pass them in order"
        )
    # Between parallel edges the center is free to slide, and in a long facet nearly so.
    reach = np.array([(1, 0, -1), (-1, 0, -1), (0, 1, -1), (0, -1, -1)])
    nearest = _least_third(
        1.0,
        np.vstack([np.column_stack([outward, np.zeros(len(outward))]), reach]),
        np.concatenate([offsets - (1.0 - slack) * widest[2], np.zeros(4)]),
    )
    center = widest[:2] if nearest is None else nearest[:2]
    radius = float((offsets - outward @ center).min())
    return middle + scale * center, scale * radius


def _least_third(sign: float, rows: Floats, bounds: Floats) -> Floats | None:
    """The point (3,) of a polyhedron `rows @ x <= bounds` whose third coordinate times a sign is
    least, where there is one: it is a corner, in which three constraints are met exactly."""
    if len(rows) > MOST_TRIPLED:
        return _by_linear_program(sign, rows, bounds)
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


def _by_linear_program(sign: float, rows: Floats, bounds: Floats) -> Floats | None:
    """The same where there are too many constraints to try all triples."""
    # Imported where it is needed: it takes longer than most dice.
    from scipy.optimize import linprog

    free = [(None, None), (None, None), (0, None)]
    answer = linprog((0, 0, sign), A_ub=rows, b_ub=bounds, bounds=free)
    return answer.x if answer.success else None
