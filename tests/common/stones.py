"""Bodies without symmetry, and their rests with two centers of mass, for gradients."""

from __future__ import annotations

import numpy as np
import torch

from dicedesign.geometry.hulls.hull import convex_hull, polyhedron_corners
from dicedesign.geometry.sphere import unit_vectors
from dicedesign.gradient.rest_probabilities import RestEvaluation
from dicedesign.optimize.starts.shapes import repulsion
from dicedesign.rest.equilibria import classify


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


def both_ways(points: np.ndarray) -> list[RestEvaluation]:
    """Rests of the uniform solid, and with a given center of mass near its centroid."""
    hull = convex_hull(points)
    vertices = torch.tensor(hull.vertices, requires_grad=True)
    aside = 0.95 * hull.centroid + 0.05 * hull.vertices[:3].mean(axis=0)
    center = torch.tensor(aside, requires_grad=True)
    return [
        RestEvaluation(classify(hull, hull.centroid), vertices),
        RestEvaluation(classify(hull, aside), vertices, center),
    ]
