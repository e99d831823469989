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
from dicedesign.runtime.arrays import Floats, Integers

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
    """Six qualities of a die, each from 0 for bad to 1 for good, and three numbers behind them.

    Attributes
    ----------
    compact: isoperimetric quotient 36 pi V^2 / A^3 over `ROUND`.
    thick: thickness over the largest diameter, over `THICK`.
    legible: circle in the smallest labeled face, over `LARGE_CIRCLE`.
    plain: 1 without blank facets, 1/2 if the largest has `BLANK` times the area of the smallest
        labeled face.
    firm: least angle to tip a labeled face, over `FIRM`.
    printable: 1 if facets that are off change no probability, 1/2 at `PRINTED`.
    quotient: isoperimetric quotient 36 pi V^2 / A^3.
    circle: diameter of the circle in the smallest labeled face over the largest diameter.
    print_variation: mean total variation by which facets that are off change the outcomes.
    """

    compact: float
    thick: float
    legible: float
    plain: float
    firm: float
    printable: float
    quotient: float
    circle: float
    print_variation: float

    @property
    def measure(self) -> float:
        """Product of the qualities, 0 to 1."""
        good = self.compact, self.thick, self.legible, self.plain, self.firm, self.printable
        return math.prod(good)


def rate_looks(hull: ConvexHull, directions: Floats, outcome_of: Integers | None = None) -> Looks:
    """Looks of a uniform convex die with rests on its labeled faces and no others.

    directions: (f, 3) normals of the labeled faces. outcome_of: (f,) outcome that each shows; None
    for one outcome each.
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
    # Rows of the faces' outcomes.
    places = np.argmax(hull.normals[rests.facets] @ directions.T, axis=1)
    outcome = places if outcome_of is None else outcome_of[places]
    sums = (np.arange(outcome.max() + 1)[:, None] == outcome).astype(np.float64)
    changes = OFF * hull.diameter * offset_derivatives(rests, sums @ rests.jacobian)
    variances = (changes**2).sum(axis=1)
    chi_square = float((variances / (sums @ rests.probability_values)).sum())
    quotient = 36.0 * math.pi * surface.volume**2 / float(hull.areas.sum()) ** 3
    return Looks(
        compact=min(quotient / ROUND, 1.0),
        thick=min(thickness / hull.diameter / THICK, 1.0),
        legible=min(circle * len(facets) ** 0.5 / hull.diameter / LARGE_CIRCLE, 1.0),
        plain=1.0 / (1.0 + blank / BLANK),
        firm=min(float(poses.margins.min()) / FIRM, 1.0),
        printable=1.0 / (1.0 + chi_square**0.5 / PRINTED),
        quotient=quotient,
        circle=2.0 * circle / hull.diameter,
        # Half of the mean absolute values of Gaussians.
        print_variation=float(np.sqrt(variances / (2.0 * np.pi)).sum()),
    )
