"""What one may care about among dice of the same odds, as residuals with weights."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from types import ModuleType
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dicedesign.design.circles import soft_circle_radii
from dicedesign.design.differentiable import RestEvaluation
from dicedesign.design.energy import SMALLEST_MEAN
from dicedesign.design.robustness import Swing
from dicedesign.errors import InputError
from dicedesign.geometry.sphere import foot_on_line
from dicedesign.options import STRICT
from dicedesign.rest.momentum import basin_moments
from dicedesign.rest.morse import separatrix_points

__all__ = ["Preferences", "preference_residuals"]

Integers = NDArray[np.int64]

LARGEST_WEIGHT: Final = 1e6
"""Beyond it the other terms are lost in rounding."""

CIRCLE_POWER: Final = 4.0
"""Power of a circle's residual in the inverse of its radius: the larger, the more it is the
smallest circle alone that counts."""

USUAL_CIRCLE: Final = 0.5
"""Radius of an ordinary circle, in units of the diameter over the root of the number of outcomes:
that of the caps that as many equal parts of a sphere are."""

USUAL_OFFSET: Final = 0.1
"""Root of the mean square distance of ordinary normals from the barycenters of their basins."""

USUAL_INEQUALITY: Final = 0.4
"""Root of the weighted sum of the squares of ordinary saddles' relative differences of angles."""

USUAL_SPREAD: Final = 0.2
"""Relative standard deviation of ordinary distances from the center of mass."""

USUAL_RATIO: Final = 0.7
"""Standard deviation of the logarithms of ordinary areas."""

USUAL_HELPERS: Final = 0.2
"""Part of an ordinary die's surface that bears no outcome."""

_TORCH: ModuleType = torch


@dataclass(frozen=True)
class Preferences:
    """Weights of what is made better while the odds are kept; 0 leaves one out. Only their ratios
    matter.

    Each multiplies a sum of squares that is about 1 for an ordinary die.

    Attributes
    ----------
    circles: large circles in the facets of the outcomes, for large labels; the smallest counts
        most.
    margin: normals of the outcomes' facets near the barycenters of their basins (eq. 14).
    asymmetry: both rests beside a saddle equally far from it (eq. 20, 21).
    roundness: all facets equally far from the center of mass, and all vertices.
    areas: equal areas of the outcomes' facets.
    small_helpers: little area on facets without an outcome.
    robustness: thrown odds that are the same on a table that is a little livelier or duller; those
        without momentum always are.
    nearness: parameters near those of the die that is made better.
    """

    __pydantic_config__ = STRICT

    circles: float = 0.0
    margin: float = 0.0
    asymmetry: float = 0.0
    roundness: float = 0.0
    areas: float = 0.0
    small_helpers: float = 0.0
    robustness: float = 0.0
    nearness: float = 0.0

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if not 0.0 <= value <= LARGEST_WEIGHT:
                raise InputError(
                    f"{item.name}: expected a number from 0 to {LARGEST_WEIGHT:g}, got "
                    f"{value:g}; 0 leaves it out"
                )

    @property
    def largest(self) -> float:
        """The largest weight."""
        return max(getattr(self, item.name) for item in fields(self))

    @property
    def any(self) -> bool:
        """Whether anything is preferred."""
        return self.largest > 0.0


def preference_residuals(
    rests: RestEvaluation,
    facets: Integers,
    preferences: Preferences,
    swing: Swing | None = None,
) -> list[Tensor]:
    """Residuals of each term, whose sum of squares is the weighted sum of all but `nearness`.

    They do not depend on the die's size. Derivatives of the odds themselves are left out: they are
    meant for directions that change no odds.

    rests: the die; facets: (k,) facet of each outcome; preferences: the weights; swing: of its odds
    when thrown, or None for odds without momentum.
    """
    terms = dict(_TERMS)
    if swing is not None:
        terms["robustness"] = swing.residuals
    weights = {name: getattr(preferences, name) for name in terms}
    return [
        np.sqrt(weight) * terms[name](rests, facets)
        for name, weight in weights.items()
        if weight > 0.0
    ]


def _circles(rests: RestEvaluation, facets: Integers) -> Tensor:
    """Shares of the squared high-power mean of the inverse radii."""
    count = len(facets)
    inverse = USUAL_CIRCLE / (np.sqrt(count) * soft_circle_radii(rests, facets))
    mean = (inverse ** (2.0 * CIRCLE_POWER)).mean()
    return inverse**CIRCLE_POWER * mean ** (0.5 / CIRCLE_POWER - 0.5) / np.sqrt(count)


def _margin(rests: RestEvaluation, facets: Integers) -> Tensor:
    """Offsets of the normals from the barycenters. These are the true ones: the mean of the maxima
    on the border, which eq. 14 takes for them, jumps where a maximum joins or leaves."""
    points = separatrix_points(rests.paths, rests.vertices, rests.center, _TORCH)
    moments = basin_moments(rests.paths, points, _TORCH)
    lengths = torch.linalg.vector_norm(moments, dim=1, keepdim=True)
    offsets = rests.rest_normals - moments / lengths.clamp_min(SMALLEST_MEAN)
    return offsets.reshape(-1) / (USUAL_OFFSET * np.sqrt(len(facets)))


def _asymmetry(rests: RestEvaluation, facets: Integers) -> Tensor:
    """2 phi - 1 of each saddle, with the sign that makes it smooth, by the root of its weight in
    rho."""
    paths = rests.paths
    tail, head = rests.vertices[paths.saddle_ends[:, 0]], rests.vertices[paths.saddle_ends[:, 1]]
    saddles = foot_on_line(tail - rests.center, head - rests.center, head - tail, _TORCH)[:, None]
    normals = rests.rest_normals[torch.as_tensor(paths.basins)]
    cross = torch.linalg.cross(normals, saddles.expand_as(normals))
    angles = torch.atan2(torch.linalg.vector_norm(cross, dim=-1), (normals * saddles).sum(-1))
    weights = torch.as_tensor(rests.odds[paths.basins].min(axis=1))
    unequal = (angles[:, 0] - angles[:, 1]) / angles.sum(dim=1)
    return torch.sqrt(weights) * unequal / USUAL_INEQUALITY


def _roundness(rests: RestEvaluation, facets: Integers) -> Tensor:
    """Distances of vertices and of planes from the center of mass, as parts of their means."""
    hull = rests.hull
    radii = rests.vertices - rests.center
    normals = rests.facet_normals(np.arange(len(hull.normals)))
    heights = (radii[hull.tail[hull.facet_start[:-1]]] * normals).sum(-1)
    return torch.cat(
        [
            (distances / distances.mean() - 1.0) / (USUAL_SPREAD * np.sqrt(len(distances)))
            for distances in (torch.linalg.vector_norm(radii, dim=1), heights)
        ]
    )


def _areas(rests: RestEvaluation, facets: Integers) -> Tensor:
    """Logarithms of the areas less their mean."""
    logarithms = torch.log(_all_areas(rests)[facets])
    return (logarithms - logarithms.mean()) / (USUAL_RATIO * np.sqrt(len(facets)))


def _small_helpers(rests: RestEvaluation, facets: Integers) -> Tensor:
    """The part of the surface that bears no outcome."""
    areas = _all_areas(rests)
    return (1.0 - areas[facets].sum() / areas.sum())[None] / USUAL_HELPERS


def _all_areas(rests: RestEvaluation) -> Tensor:
    """(m,) areas of the facets, by the triangles they are cut into."""
    hull = rests.hull
    a, b, c = (rests.vertices[corner] for corner in hull.triangles.T)
    owner = np.repeat(np.arange(len(hull.normals)), np.diff(hull.facet_start) - 2)
    vectors = torch.zeros((len(hull.normals), 3), dtype=torch.float64)
    vectors = vectors.index_add(0, torch.as_tensor(owner), torch.linalg.cross(b - a, c - a))
    return torch.linalg.vector_norm(vectors, dim=1) / 2.0


_TERMS: Final[dict[str, Callable[[RestEvaluation, Integers], Tensor]]] = {
    "circles": _circles,
    "margin": _margin,
    "asymmetry": _asymmetry,
    "roundness": _roundness,
    "areas": _areas,
    "small_helpers": _small_helpers,
}
