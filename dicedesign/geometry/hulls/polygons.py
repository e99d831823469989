"""The largest circle in a convex polygon."""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import linprog

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import rotation_between
from dicedesign.runtime.arrays import Floats

__all__ = ["facet_inradius", "inscribed_circle", "signed_area"]


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

    widest = linprog(
        (0, 0, -1),
        A_ub=np.column_stack([outward, np.ones(len(outward))]),
        b_ub=offsets,
        bounds=[(None, None), (None, None), (0, None)],
    )
    if not widest.success or widest.x[2] <= 0:
        raise InputError(
            f"polygon: expected {len(polygon)} corners that run around a convex one, got none that "
            "a circle fits in; pass them in order"
        )
    # Between parallel edges the center is free to slide, and in a long facet nearly so.
    reach = np.array([(1, 0, -1), (-1, 0, -1), (0, 1, -1), (0, -1, -1)])
    nearest = linprog(
        (0, 0, 1),
        A_ub=np.vstack([np.column_stack([outward, np.zeros(len(outward))]), reach]),
        b_ub=np.concatenate([offsets - (1.0 - slack) * widest.x[2], np.zeros(4)]),
        bounds=[(None, None), (None, None), (0, None)],
    )
    center = nearest.x[:2] if nearest.success else widest.x[:2]
    radius = float((offsets - outward @ center).min())
    return middle + scale * center, scale * radius
