"""Designs by the paper's method: what they end with, and what leaving a term out does."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from dicedesign.bench.measures.recipes import begun
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.optimize.energy.clusters import cluster
from dicedesign.optimize.paper_options import PaperOptions
from dicedesign.optimize.preferences.preference import Preferences
from dicedesign.optimize.result import DesignResult
from dicedesign.optimize.solvers.finish import finished
from dicedesign.optimize.solvers.paper import descend_as_paper
from dicedesign.optimize.starts.start import Start
from dicedesign.recipe.methods.convex import normalised_center, wanted_odds
from dicedesign.recipe.schema.recipe import Recipe
from dicedesign.rest.poses import analyse
from dicedesign.runtime.arrays import Floats

__all__ = ["Ending", "PaperProblem", "Seeded"]

NEARBY: Final = 15.0
"""Angle, in degrees, from an outcome's main rest within which facets count as folds of its."""


@dataclass(frozen=True)
class Ending:
    """A shape, by the forward model.

    Attributes
    ----------
    error: largest |p - q|, each rest counted for the nearest outcome.
    rests: how many there are; empty: outcomes without one.
    least_angle: between the main rests of two outcomes.
    stray: largest angle from a rest to the main rest of its outcome.
    fold: largest angle of a facet to an outcome's main rest among those within `NEARBY` of it.
    least_facet: smallest part of the surface that an outcome's rests have.

    Angles are in degrees; the main rest is the most probable one.
    """

    error: float
    rests: int
    empty: int
    least_angle: float
    stray: float
    fold: float
    least_facet: float

    @classmethod
    def of(cls, result: DesignResult, target: Floats, center: Floats | None) -> Ending:
        """Of a design whose target is (k,), with a center of mass (3,) or that of the solid."""
        hull = result.hull
        poses = analyse(hull, hull.centroid if center is None else center)
        of_rest = cluster(poses.normals, result.directions).of_rest
        sums = np.bincount(of_rest, poses.probabilities, len(target))
        # Rests come the most probable first.
        filled, first = np.unique(of_rest, return_index=True)
        mains = np.zeros((len(target), 3))
        mains[filled] = poses.normals[first]
        between = _degrees(mains[filled] @ mains[filled].T)[np.triu_indices(len(filled), 1)]
        around = _degrees(hull.normals @ mains[filled].T)
        areas = np.bincount(of_rest, hull.areas[poses.facets], len(target))
        return cls(
            error=float(np.abs(sums - target).max()),
            rests=len(of_rest),
            empty=len(target) - len(filled),
            least_angle=float(between.min(initial=180.0)),
            stray=float(_degrees((poses.normals * mains[of_rest]).sum(1)).max()),
            fold=float(around[around < NEARBY].max(initial=0.0)),
            least_facet=float(areas.min() / hull.areas.sum()),
        )


@dataclass(frozen=True)
class Seeded:
    """One seed of a problem.

    Attributes
    ----------
    plain, finished: ends of the descent and of its exact finish, which is without preferences;
        seconds, finish_seconds: wall-clock time of each.
    converged: whether the finish is exact to 1e-12.
    moved: largest change of the width in any direction by the finish, over the diameter.
    """

    seed: int
    plain: Ending
    seconds: float
    finished: Ending
    finish_seconds: float
    converged: bool
    moved: float


@dataclass(frozen=True)
class PaperProblem:
    """A recipe of method paper, ready for many seeds.

    Attributes
    ----------
    recipe: its start is not searched; options: of its method; start: made once.
    """

    recipe: Recipe
    options: PaperOptions
    start: Start

    @classmethod
    def of(cls, recipe: Recipe) -> PaperProblem:
        """Raises InputError for a recipe of another method."""
        if recipe.method.paper is None:
            raise InputError(
                f"{recipe.name}: expected a recipe of method paper, got {recipe.method.name}; "
                "leave it out, or change its method"
            )
        start = begun(recipe).start
        assert start is not None
        return cls(recipe, recipe.method.paper, start)

    @property
    def target(self) -> Floats:
        """(k,) wanted probabilities of the start's directions."""
        return wanted_odds(self.recipe)

    @property
    def center(self) -> Floats | None:
        """(3,) the center of mass, if one is given."""
        return normalised_center(self.recipe, self.start)

    def ended(self, seed: int, options: PaperOptions) -> tuple[DesignResult, Ending, float]:
        """A design, what it ends with, and its seconds."""
        started = time.perf_counter()
        result = descend_as_paper(
            self.start, self.target, options, center_of_mass=self.center, seed=seed
        )
        seconds = time.perf_counter() - started
        return result, Ending.of(result, self.target, self.center), seconds

    def seeded(self, seed: int) -> Seeded:
        """The recipe with another seed, without preferences."""
        options = replace(self.options, prefer=Preferences(), tolerance=None)
        plain, ending, seconds = self.ended(seed, replace(options, finish="none"))
        started = time.perf_counter()
        end = finished(plain, self.target, options, center_of_mass=self.center)
        finish_seconds = time.perf_counter() - started
        exact = Ending.of(end, self.target, self.center)
        return Seeded(
            seed=seed,
            plain=ending,
            seconds=seconds,
            finished=exact,
            finish_seconds=finish_seconds,
            converged=exact.error <= 1e-12 and exact.rests == len(self.target),
            moved=_largest_change(plain.hull, end.hull),
        )

    def without(self, seed: int, *terms: str) -> tuple[DesignResult, Ending]:
        """The descent without finish, and without some terms."""
        weights = self.options.weights.changed(**dict.fromkeys(terms, 0.0))
        options = replace(self.options, finish="none", tolerance=None, weights=weights)
        return self.ended(seed, options)[:2]


def _degrees(cosines: Floats) -> Floats:
    return np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0)))


def _largest_change(before: ConvexHull, after: ConvexHull) -> float:
    """Largest difference of support functions about the centroids, over the diameter."""
    outward = np.random.default_rng(0).normal(size=(2000, 3))
    outward /= np.sqrt((outward * outward).sum(1))[:, None]
    heights = [
        ((hull.vertices - hull.centroid) @ outward.T).max(axis=0) for hull in (before, after)
    ]
    return float(np.abs(heights[0] - heights[1]).max() / before.diameter)
