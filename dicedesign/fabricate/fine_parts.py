"""Parts of a surface that are thinner than a printer makes walls.

Lengths are in millimetres.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.spatial import cKDTree

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.triangles import Surface, doubled_area_vectors
from dicedesign.results.parts import ThinParts
from dicedesign.runtime.arrays import Floats, Integers

if TYPE_CHECKING:
    from dicedesign.fabricate.label_layout import Placement

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


BENEATH: Final = -1e-2
"""Cosine between the normals of two facets below which one is beneath the other."""


def walls_under(
    placements: Sequence[Placement], depth: float, hull: ConvexHull
) -> tuple[float, ...]:
    """Thickness of a convex die under each of its labels: the least distance of the floor of the
    label's pocket from a facet beneath, i.e. one that looks the other way, or of the pocket from
    another.

    Both are exact: in a convex solid the distance from its facets is a concave function, least at a
    corner of the floor; that of two pockets is that of their triangles.

    placements: k labels on facets of the die; depth: of their pockets, above 0; hull: the die, in
    mm. Returns k numbers; 0 where a pocket meets another, or comes out beneath.
    """
    pockets, walls = [], []
    for placement in placements:
        section, frame = placement.section(), placement.frame
        cut = section.extrude(depth).translate((0.0, 0.0, -depth))
        pockets.append(cut.transform(frame[:3]))
        rim = np.concatenate(section.to_polygons()) @ frame[:3, :2].T + frame[:3, 3]
        beneath = hull.normals @ frame[:3, 2] < BENEATH
        room = hull.depths(rim - depth * frame[:3, 2])[:, beneath]
        walls.append(max(float(room.min(initial=hull.diameter)), 0.0))
    for one, other in combinations(range(len(pockets)), 2):
        gap = float(pockets[one].min_gap(pockets[other], max(walls[one], walls[other])))
        walls[one], walls[other] = min(walls[one], gap), min(walls[other], gap)
    return tuple(walls)


OPPOSITE: Final = np.cos(np.radians(45.0))
"""Two sides are those of one wall where their outward normals are opposite to within the angle of
this cosine: what is between others is an edge, which is not weak."""

FINENESS: Final = 0.25
"""Distance between samples, over the least thickness of a wall."""

MOST_SAMPLES: Final = 200_000

SPOT: Final = 8
"""Samples, half a wall's square, whose median is the thickness of a place: every edge is thin where
it ends. Thin parts of fewer samples are not told."""

SEED: Final = 20


def thin_parts(surface: Surface, wall: float) -> ThinParts | None:
    """What is thinner than a wall, measured by rays straight inward from points spread at random
    over a surface, with even odds for each bit of area.

    surface: closed, of positive volume; wall: least thickness, above 0. Returns None where nothing
    is thinner.

    Raises InputError: the surface bounds no solid.
    """
    # Imported late: convex dice do without.
    from dicedesign.geometry.meshes.manifold import solid

    body = solid(surface.points, surface.triangles)
    doubled = doubled_area_vectors(surface.points, surface.triangles)
    lengths = norms(doubled)
    area = float(lengths.sum()) / 2.0
    count = min(int(area / (FINENESS * wall) ** 2) + 1, MOST_SAMPLES)
    random = np.random.default_rng(SEED)
    chosen = random.choice(len(lengths), count, p=lengths / lengths.sum())
    weights = random.dirichlet(np.ones(3), count)
    starts = np.einsum("nkx,nk->nx", surface.points[surface.triangles[chosen]], weights)
    normals = doubled[chosen] / lengths[chosen, None]
    # A ray begins a little inside, so that it does not meet the triangle that it starts from.
    begins, ends = starts - 1e-6 * wall * normals, starts - wall * normals
    thicknesses, places = [], []
    for start, normal, begin, end in zip(starts, normals, begins, ends, strict=True):
        hits = body.ray_cast(begin, end)
        if hits and np.dot(hits[0].normal, normal) < -OPPOSITE:
            exit_point = np.array(hits[0].position)
            thicknesses.append(float(np.linalg.norm(exit_point - start)))
            places.append((start + exit_point) / 2.0)
    if len(thicknesses) < SPOT:
        return None
    _, near = cKDTree(places).query(places, SPOT)
    medians = np.median(np.array(thicknesses)[near], axis=1)
    thinnest = int(medians.argmin())
    return ThinParts(
        wall_mm=wall,
        share=len(thicknesses) / count,
        least_mm=float(medians[thinnest]),
        place=tuple(places[thinnest].tolist()),
    )
