"""How handsome a die is: a measure that chooses between dice with the same probabilities."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.hulls.polygons import facet_inradius
from dicedesign.gradient.facet_measures import offset_derivatives
from dicedesign.gradient.rest_probabilities import evaluate_rests
from dicedesign.optimize.preferences import OFF
from dicedesign.rest.poses import analyze
from dicedesign.runtime.arrays import Floats

ROUND = 0.75
"""Isoperimetric quotient from which a die is compact; a regular dodecahedron's."""

THICK = 0.75
"""Thickness over the largest diameter from which a die is no needle or plate."""

LARGE_CIRCLE = 0.4
"""Radius of the circle in the smallest face over the largest diameter, times the root of the number
of faces, from which labels are large. Circles that divided a sphere equally would have 0.5."""

BLANK = 2.0
"""Area of the largest blank facet over the smallest labeled face at which a die counts half."""

FIRM = math.radians(20.0)
"""Angle to tip a face from which a die is firm."""

PRINTED = 0.02
"""Root of the chi-square per roll that such prints show, at which a die counts half."""


@dataclass(frozen=True)
class Looks:
    """Six qualities of a die, each from 0 for bad to 1 for good.

    Attributes
    ----------
    compact: isoperimetric quotient 36 pi V^2 / A^3 over `ROUND`.
    thick: thickness over the largest diameter, over `THICK`.
    legible: circle in the smallest labeled face, over `LARGE_CIRCLE`.
    plain: 1 without blank facets, 1/2 if the largest has `BLANK` times the area of the smallest
        labeled face.
    firm: least angle to tip a labeled face, over `FIRM`.
    printable: 1 if facets that are off change no probability, 1/2 at `PRINTED`.
    """

    compact: float
    thick: float
    legible: float
    plain: float
    firm: float
    printable: float

    @property
    def measure(self) -> float:
        """Product of the qualities, 0 to 1."""
        return math.prod(vars(self).values())


def rate_looks(hull: ConvexHull, directions: Floats) -> Looks:
    """Looks of a uniform convex die with rests on its labeled faces and no others.

    directions: (f, 3) normals of the labeled faces.
    """
    poses, surface = analyze(hull, hull.centroid), hull.surface
    facets = np.argmax(directions @ hull.normals.T, axis=1)
    is_blank = np.ones(len(hull.normals), dtype=bool)
    is_blank[facets] = False
    heights = hull.vertices @ hull.normals.T
    thickness = float(np.ptp(heights, axis=0).min())
    circle = min(facet_inradius(hull, facet) for facet in facets.tolist())
    blank = float(hull.areas[is_blank].max(initial=0.0) / hull.areas[facets].min())
    rests = evaluate_rests(torch.from_numpy(hull.vertices))
    changes = OFF * hull.diameter * offset_derivatives(rests, rests.jacobian)
    chi_square = float(((changes**2).sum(axis=1) / rests.probability_values).sum())
    quotient = 36.0 * math.pi * surface.volume**2 / float(hull.areas.sum()) ** 3
    return Looks(
        compact=min(quotient / ROUND, 1.0),
        thick=min(thickness / hull.diameter / THICK, 1.0),
        legible=min(circle * len(facets) ** 0.5 / hull.diameter / LARGE_CIRCLE, 1.0),
        plain=1.0 / (1.0 + blank / BLANK),
        firm=min(float(poses.margins.min()) / FIRM, 1.0),
        printable=1.0 / (1.0 + chi_square**0.5 / PRINTED),
    )
