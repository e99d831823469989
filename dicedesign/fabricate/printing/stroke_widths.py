"""How wide the strokes of a label are, and what stands between them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["narrowest_gap", "narrowest_stroke"]

PARALLEL_COSINE: Final = math.cos(math.radians(15.0))
"""Sides that run together at more than 15 degrees are a corner, and no stroke."""

SAMPLES: Final = 24
"""Samples along the extent of a label, at least; every edge of its outline has one."""

AT_A_TIME: Final = 1 << 17
"""Pairs of a ray and an edge that are looked at at a time: they stay in the processor's memory."""

NEAR: Final = 1e-9
"""Over the extent: nearer than this along a ray is where the ray begins."""


def narrowest_stroke(contours: Sequence[Floats]) -> float | None:
    """Least width of the strokes within closed contours.

    From points of the outline a ray goes straight inward to the other side. Its length is a width
    where that side runs along the first to 15 degrees, which leaves out corners and ends; and where
    both sides, as far as they are no farther apart, are as long as that, which leaves out joints.

    contours: (n, 2) each, without a repeated last point, outer ones counter-clockwise, holes
    clockwise, and none that meet. Returns None where there is no such ray.
    Source: the stroke width transform of Epshtein, Ofek and Wexler, CVPR 2010, on outlines.
    """
    return _narrowest(contours, 1.0)


def narrowest_gap(contours: Sequence[Floats]) -> float | None:
    """Least width of what lies between strokes, or None where nothing does; as
    `narrowest_stroke`, outward."""
    return _narrowest(contours, -1.0)


def _narrowest(contours: Sequence[Floats], side: float) -> float | None:
    if not contours:
        return None
    starts = np.concatenate(contours)
    edges = np.concatenate([np.roll(contour, -1, axis=0) - contour for contour in contours])
    lengths = np.linalg.norm(edges, axis=1)
    starts, edges, lengths = starts[lengths > 0], edges[lengths > 0], lengths[lengths > 0]
    normals = side * np.column_stack([-edges[:, 1], edges[:, 0]]) / lengths[:, None]
    extent = float(np.ptp(starts, axis=0).max())
    counts = np.ceil(lengths * SAMPLES / extent).astype(np.int64)
    edge = np.arange(len(edges)).repeat(counts)
    number = np.arange(len(edge)) - (np.cumsum(counts) - counts).repeat(counts)
    points = starts[edge] + ((number + 0.5) / counts[edge])[:, None] * edges[edge]
    rays = np.array_split(np.arange(len(points)), len(points) * len(edges) // AT_A_TIME + 1)
    found = [
        _first_met(points[ray], normals[edge[ray]], starts, edges, NEAR * extent) for ray in rays
    ]
    widths, first = (np.concatenate(parts) for parts in zip(*found, strict=True))
    opposite = (normals[edge] * normals[first]).sum(axis=1) < -PARALLEL_COSINE
    sides = np.flatnonzero(opposite & np.isfinite(widths))
    sides = sides[np.argsort(widths[sides], kind="stable")]
    long = np.cumsum((lengths / counts)[edge[sides]]) >= 2.0 * widths[sides]
    return float(widths[sides[long.argmax()]]) if long.any() else None


def _first_met(
    points: Floats, ways: Floats, starts: Floats, edges: Floats, least: float
) -> tuple[Floats, Integers]:
    """(r,) how far rays from points (r, 2) in unit ways (r, 2) go to the first edge farther than
    `least`, infinite where there is none, and (r,) the number of that edge.

    starts, edges: (m, 2) where edges begin, and how far they go.
    """
    # Ray p + t d meets edge a + s e where t = (a - p) x e / (d x e), s = (a - p) x d / (d x e).
    d_x, d_y = (column[:, None] for column in ways.T)
    e_x, e_y = edges.T
    a_x, a_y = (starts[:, k] - points[:, k, None] for k in range(2))
    turn = d_x * e_y - d_y * e_x
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (a_x * e_y - a_y * e_x) / turn
        across = (a_x * d_y - a_y * d_x) / turn
        met = (along > least) & (across >= 0.0) & (across <= 1.0)
    along = np.where(met, along, np.inf)
    first = along.argmin(axis=1)
    return along[np.arange(len(points)), first], first
