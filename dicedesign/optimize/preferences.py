"""Preferences among dice with equal probabilities, as weighted residuals."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dicedesign.optimize.terms import SMALLEST_MEAN
from dicedesign.runtime.registry import Extension, Number, Numbers, Registry

if TYPE_CHECKING:
    from torch import Tensor

    from dicedesign.gradient.probability_model import ProbabilityModel
    from dicedesign.gradient.rest_probabilities import RestEvaluation
    from dicedesign.runtime.arrays import Integers


@dataclass(frozen=True)
class OutcomeFacets:
    """A die with one rest for each outcome, as preferences see it.

    Attributes
    ----------
    rests: hull and rests; tensors are functions of its `vertices` (n, 3).
    facets: (k,) facet of each outcome.
    model: of the probabilities; None for `RESTING`.
    """

    rests: RestEvaluation
    facets: Integers
    model: ProbabilityModel | None = None


@dataclass(frozen=True, kw_only=True)
class Preference(Extension):
    """A secondary objective.

    Attributes
    ----------
    residuals: vector whose sum of squares is minimized, differentiable in the vertices. The sum is
        about 1 for an ordinary die of any size. Derivatives of the probabilities without momentum
        are not needed, as steps keep these.
    """

    residuals: Callable[[OutcomeFacets], Tensor]


CIRCLE_POWER = 4.0
"""Power of the inverse radius in a circle's residual: the larger, the more the smallest circle
counts."""

USUAL_CIRCLE = 0.5
"""Radius of an ordinary circle, over the diameter, times the root of the number of outcomes: the
radius of caps that divide a sphere equally."""


def circle_residuals(die: OutcomeFacets) -> Tensor:
    """Residuals (k,) whose sum of squares is the squared high-power mean of the inverse radii."""
    from dicedesign.gradient.facet_measures import soft_circle_radii

    count = len(die.facets)
    inverse = USUAL_CIRCLE / (np.sqrt(count) * soft_circle_radii(die.rests, die.facets))
    mean = (inverse ** (2.0 * CIRCLE_POWER)).mean()
    return inverse**CIRCLE_POWER * mean ** (0.5 / CIRCLE_POWER - 0.5) / np.sqrt(count)


USUAL_OFFSET = 0.1
"""Root mean square distance of ordinary normals from the barycenters of their basins."""


def margin_residuals(die: OutcomeFacets) -> Tensor:
    """Offsets (3 k,) of the normals from the barycenters of the basins. These barycenters are
    exact, as the mean of the maxima on the border (eq. 14) jumps where a maximum joins or
    leaves."""
    import torch

    from dicedesign.rest.morse import basin_moments, separatrix_points

    rests = die.rests
    points = separatrix_points(rests.paths, rests.vertices, rests.center_of_mass, torch)
    moments = basin_moments(rests.paths, points, torch)
    lengths = torch.linalg.vector_norm(moments, dim=1, keepdim=True)
    offsets = rests.rest_normals - moments / lengths.clamp_min(SMALLEST_MEAN)
    return offsets.reshape(-1) / (USUAL_OFFSET * np.sqrt(len(die.facets)))


USUAL_INEQUALITY = 0.4
"""Root of the weighted sum of squared relative differences of angles of ordinary saddles."""


def asymmetry_residuals(die: OutcomeFacets) -> Tensor:
    """Relative differences (s,) of the angles from each saddle to its two rests, 2 phi - 1 with a
    sign that makes it smooth, times the root of the saddle's weight in rho (eq. 20, 21)."""
    import torch

    rests, basins = die.rests, die.rests.paths.basins
    normals = rests.rest_normals[torch.as_tensor(basins)]
    saddles = rests.saddle_directions[:, None]
    cross = torch.linalg.cross(normals, saddles.expand_as(normals))
    angles = torch.atan2(torch.linalg.vector_norm(cross, dim=-1), (normals * saddles).sum(-1))
    weights = torch.as_tensor(rests.probability_values[basins].min(axis=1))
    unequal = (angles[:, 0] - angles[:, 1]) / angles.sum(dim=1)
    return torch.sqrt(weights) * unequal / USUAL_INEQUALITY


USUAL_SPREAD = 0.2
"""Relative standard deviation of ordinary distances from the center of mass."""


def roundness_residuals(die: OutcomeFacets) -> Tensor:
    """Relative deviations (n + m,) of the distances of vertices and of planes from the center of
    mass."""
    import torch

    rests, hull = die.rests, die.rests.hull
    radii = rests.vertices - rests.center_of_mass
    normals = rests.facet_normals(np.arange(len(hull.normals)))
    heights = (radii[hull.tail[hull.facet_start[:-1]]] * normals).sum(-1)
    return torch.cat(
        [
            (distances / distances.mean() - 1.0) / (USUAL_SPREAD * np.sqrt(len(distances)))
            for distances in (torch.linalg.vector_norm(radii, dim=1), heights)
        ]
    )


USUAL_RATIO = 0.7
"""Standard deviation of the logarithms of ordinary areas."""


def area_residuals(die: OutcomeFacets) -> Tensor:
    """Deviations (k,) of the logarithms of the areas from their mean."""
    logarithms = die.rests.facet_areas[die.facets].log()
    return (logarithms - logarithms.mean()) / (USUAL_RATIO * np.sqrt(len(die.facets)))


USUAL_HELPERS = 0.2
"""Part of the surface of an ordinary die without outcomes."""


def helper_residuals(die: OutcomeFacets) -> Tensor:
    """Part (1,) of the surface without outcomes."""
    areas = die.rests.facet_areas
    return (1.0 - areas[die.facets].sum() / areas.sum())[None] / USUAL_HELPERS


OFF = 1.0 / 300.0
"""Offset of facets over the diameter: 0.1 mm of an ordinary die."""

USUAL_SLOPE = 2.0
"""Root of the summed squared derivatives of an ordinary die's probabilities in the offsets of its
facets, times the diameter."""


def tolerance_residuals(die: OutcomeFacets) -> Tensor:
    """Root (m,) of the summed squared slopes of all probabilities in the offset of each facet. For
    independent offsets of equal variance, the sum of squares is proportional to the summed variance
    of the probabilities."""
    from dicedesign.gradient.facet_measures import offset_secants, soft_diameter
    from dicedesign.gradient.probability_model import RESTING

    diameter = soft_diameter(die.rests)
    secants = offset_secants(die.rests, OFF * diameter, die.model or RESTING)
    return secants.norm(dim=0) * diameter / USUAL_SLOPE


PREFERENCES = Registry(
    "preference",
    Preference,
    builtin=(
        Preference(
            name="circles",
            line="large circles in the facets of the outcomes, for large labels; the smallest "
            "counts most",
            residuals=circle_residuals,
        ),
        Preference(
            name="margin",
            line="normals of the outcomes' facets near their basins' barycenters (eq. 14)",
            residuals=margin_residuals,
        ),
        Preference(
            name="asymmetry",
            line="both rests beside a saddle equally far from it (eq. 20, 21)",
            residuals=asymmetry_residuals,
        ),
        Preference(
            name="roundness",
            line="all facets equally far from the center of mass, and all vertices",
            residuals=roundness_residuals,
        ),
        Preference(
            name="areas",
            line="equal areas of the outcomes' facets",
            residuals=area_residuals,
        ),
        Preference(
            name="small_helpers",
            line="little area on facets without an outcome",
            residuals=helper_residuals,
        ),
        Preference(
            name="tolerance",
            line="probabilities that change little under print errors of the facets",
            residuals=tolerance_residuals,
        ),
    ),
    group="dicedesign.preferences",
)

LARGEST_WEIGHT = 1e6
"""Limit on weights, beyond which the other terms are lost in rounding."""


class Preferences(Numbers):
    """Weights of preferences; see `PREFERENCES`. The default 0 omits one. Only ratios matter. Each
    weight multiplies a sum of squares that is about 1 for an ordinary die.

    Raises InputError for a weight out of range.
    """

    __slots__ = ()

    @classmethod
    def list_numbers(cls) -> Mapping[str, Number]:
        """The weight of each preference."""
        return {
            preference.name: Number(
                name=preference.name,
                default=0.0,
                line=preference.line,
                expected=f"a number from 0 to {LARGEST_WEIGHT:g}",
                remedy="0 leaves it out",
                allows=lambda weight: 0.0 <= weight <= LARGEST_WEIGHT,
            )
            for preference in PREFERENCES
        }

    @property
    def largest(self) -> float:
        """The largest weight."""
        return max(getattr(self, name) for name in PREFERENCES.names)


def preference_residuals(die: OutcomeFacets, preferences: Preferences) -> list[Tensor]:
    """Residuals of the preferences with a weight; the sum of all squares is the weighted sum of the
    preferences."""
    weights = {one: getattr(preferences, one.name) for one in PREFERENCES}
    return [np.sqrt(w) * one.residuals(die) for one, w in weights.items() if w > 0.0]
