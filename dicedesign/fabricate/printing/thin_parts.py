"""Parts of a surface that are thinner than a printer makes walls.

Lengths are in millimetres.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.spatial import cKDTree

from dicedesign.geometry.sphere import norms
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.geometry.triangles import doubled_area_vectors
from dicedesign.results.printability import ThinParts

__all__ = ["thin_parts"]

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
    from dicedesign.geometry.manifold import solid

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
