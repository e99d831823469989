"""Rests of a body with two centers of mass, for gradients."""

from __future__ import annotations

import numpy as np
import torch

from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.gradient.rest_probabilities import RestEvaluation
from dicedesign.rest.equilibria import classify


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
