"""Convex bodies without symmetry whose facets have many edges."""

from __future__ import annotations

import numpy as np

from dicedesign.geometry.hulls.hull import convex_hull, polyhedron_corners
from dicedesign.geometry.sphere import unit_vectors
from dicedesign.optimize.starts.shapes import repulsion


def stone(
    seed: int, facets: int = 9, noise: float = 0.2, least: float = 0.8, longest: float = 2.2
) -> np.ndarray:
    """Corners of a polyhedron with random facets. noise: of the normals; least: distance of a
    facet from the origin; longest: stretch along the z axis, for a body with unstable facets."""
    rng = np.random.default_rng(seed)
    normals = convex_hull(repulsion(facets, seed).points).normals
    normals = unit_vectors(normals + noise * rng.normal(size=normals.shape))
    corners = polyhedron_corners(normals, rng.uniform(least, 1.3, size=facets))
    return corners * [1.0, 1.0 + 0.25 * (longest - 1.0), longest]
