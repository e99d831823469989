"""What the parts of a design cost, each with and without."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dicedesign.bench.cost import Row, time_row
from dicedesign.bench.extremes import large
from dicedesign.bench.stopwatch import in_turn
from dicedesign.design.coordinates import FacetCoordinates, VertexCoordinates
from dicedesign.design.energy_weights import EnergyWeights
from dicedesign.design.objective import Evaluation, Objective
from dicedesign.design.sobolev import SobolevOptions, SobolevSolver, graph_laplacian
from dicedesign.design.starts import hendecahedron
from dicedesign.design.targets import sum_of_dice
from dicedesign.geometry.hull import convex_hull

__all__ = ["energy_rows", "sobolev_rows"]

Floats = NDArray[np.float64]

TERMS: Final = ("coplanar", "barycenter", "neighbor", "stability")


def energy_rows(seconds: float) -> Iterator[Row]:
    """An evaluation of the objective for 11 facets whose rests add up to the total of two dice."""
    start = hendecahedron("bisymmetric")
    center = convex_hull(start.points).centroid
    coordinates, parameters = FacetCoordinates.of(start.points, center)
    parameters = parameters + 1e-3 * np.random.default_rng(0).normal(size=parameters.shape)
    full = Objective(coordinates, sum_of_dice([6, 6]).probabilities, EnergyWeights(), None)
    evaluation = full.evaluate(parameters, start.directions)

    def terms(objective: Objective) -> Evaluation:
        """The energies of the shape, whose rests are known; a new object, as each keeps its own."""
        fresh = evaluation.under(objective)
        assert np.isfinite(fresh.value)
        return fresh

    def slope_of_terms(objective: Objective) -> Floats:
        return terms(objective).gradient

    chosen = [full, *(replace(full, weights=replace(full.weights, **{t: 0.0})) for t in TERMS)]
    works = [partial(work, objective) for work in (terms, slope_of_terms) for objective in chosen]
    times = np.reshape(in_turn(works, 2.0 * seconds), (2, -1))
    for index, term in enumerate(TERMS, start=1):
        for quantity, found in zip(("energies", "energies and gradient"), times, strict=True):
            yield time_row(f"{term} term", f"{quantity}, rests known", found[index], found[0])

    def whole(objective: Objective) -> Evaluation:
        fresh = objective.evaluate(parameters, start.directions)
        assert np.isfinite(fresh.value)
        return fresh

    fixed = replace(full, center_of_mass=center)
    fixed_value, value, fixed_slope, slope = in_turn(
        [
            lambda: whole(fixed),
            lambda: whole(full),
            lambda: whole(fixed).gradient,
            lambda: whole(full).gradient,
        ],
        seconds,
    )
    yield time_row("center of mass of the uniform solid", "trial of a step", fixed_value, value)
    yield time_row("center of mass of the uniform solid", "and its gradient", fixed_slope, slope)
    yield time_row("gradient, for accepted steps only", "trial of a step", value, slope)


def sobolev_rows(seconds: float) -> Iterator[Row]:
    """A step's direction on a hull of 500 vertices."""
    points = large(500).points
    hull = convex_hull(points)
    coordinates, parameters = VertexCoordinates.of(points, hull.centroid)
    directions = np.concatenate([np.eye(3), -np.eye(3)])
    objective = Objective(coordinates, np.full(6, 1.0 / 6.0), EnergyWeights(stability=0.0), None)
    options = SobolevOptions()
    kept = SobolevSolver(graph_laplacian(hull), options)

    def slope() -> Floats:
        return objective.evaluate(parameters, directions).gradient.reshape(-1, 3)

    right = slope()
    bare, smooth, solve, anew = in_turn(
        [
            slope,
            lambda: kept.solve(slope()),
            lambda: kept.solve(right),
            lambda: SobolevSolver(graph_laplacian(hull), options).solve(right),
        ],
        seconds,
    )
    yield time_row(
        "Sobolev step, its factor kept", "energy and gradient, 500 vertices", bare, smooth
    )
    yield time_row("Sobolev factor made anew", "smoothing a gradient, 500 vertices", solve, anew)
