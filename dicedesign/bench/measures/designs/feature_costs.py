"""Costs of features, each with it and without, in this process: parts of a design, hulls that are
kept, exact arithmetic."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final

import numpy as np
import torch

from dicedesign.bench.bodies.extremes import large
from dicedesign.bench.measures.processes import in_turn
from dicedesign.bench.rows import Row, column
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull, hull_precision
from dicedesign.geometry.hulls.reuse import HullMemory
from dicedesign.gradient.differentiable_rest import differentiable_rest
from dicedesign.gradient.rest_batch import differentiable_rest_batch
from dicedesign.kernels import ops as kernels
from dicedesign.optimize.coordinates.facets import FacetCoordinates
from dicedesign.optimize.coordinates.vertices import VertexCoordinates
from dicedesign.optimize.energy.objective import Evaluation, Objective
from dicedesign.optimize.energy.term import EnergyWeights
from dicedesign.optimize.options import SobolevOptions
from dicedesign.optimize.solvers.sobolev import SobolevSolver, graph_laplacian
from dicedesign.optimize.starts.kinds.hendecahedron import hendecahedron
from dicedesign.optimize.targets import sum_of_dice
from dicedesign.rest.equilibria import classify
from dicedesign.rest.exact import ExactSigns
from dicedesign.rest.morse import separatrices
from dicedesign.runtime.arrays import Floats
from dicedesign.runtime.threads import one_tensor_thread

__all__ = [
    "CostRow",
    "energy_rows",
    "exact_rows",
    "hull_rows",
    "sobolev_rows",
    "time_row",
    "torch_rows",
]


@dataclass(frozen=True)
class CostRow(Row):
    """What a feature costs.

    Attributes
    ----------
    feature: what is left out or not.
    measured: of what the cost is.
    without, included: cost where it is left out, and with it.
    unit: "s", "MB", "ms", "µs" or "calls".
    ratio: how many times as much it costs with the feature; None where nothing was without.
    """

    feature: str = column("feature", -48)
    measured: str = column("measured", -48)
    without: float = column("without", 9, ".4g")
    included: float = column("with", 9, ".4g")
    unit: str = column("", -7, lambda unit: f" {unit}")
    ratio: float | None = column("ratio", 7, ".2f", init=False)

    def __post_init__(self) -> None:
        ratio = self.included / self.without if self.without > 0.0 else None
        object.__setattr__(self, "ratio", ratio)


def time_row(feature: str, measured: str, without: float, included: float) -> CostRow:
    """A row of two times in seconds, in the unit in which the smaller one is at least 1."""
    unit, scale = ("ms", 1e3) if min(without, included) >= 1e-3 else ("µs", 1e6)
    return CostRow(feature, measured, scale * without, scale * included, unit)


def hull_rows(seconds: float) -> Iterator[CostRow]:
    """Hulls of points that move a little to and fro, as in a descent: a die's corners, of which
    more than three lie on a facet, and points of which many are near to changing neighbors."""
    start = hendecahedron("bisymmetric")
    coordinates, parameters = FacetCoordinates.of(start.points, np.zeros(3))
    rng = np.random.default_rng(0)
    parameters = parameters + 1e-2 * rng.normal(size=parameters.shape)
    die = [
        coordinates.shape(place).points
        for place in (parameters, parameters + 1e-4 * rng.normal(size=parameters.shape))
    ]
    points = large(500).points
    cloud = [points, points + 1e-6 * rng.normal(size=points.shape)]
    for name, places in (("die of 11 facets", die), ("hull of 500 points", cloud)):
        yield _hull_row(name, places, seconds / 2.0)


def _hull_row(name: str, places: Sequence[Floats], seconds: float) -> CostRow:
    memory = HullMemory()
    reused, rebuilt = in_turn(
        [
            lambda: [memory.hull(place) for place in places],
            lambda: [convex_hull(place) for place in places],
        ],
        seconds,
    )
    share = memory.reused / (memory.reused + memory.built)
    name = f"{name}, edges last in {100.0 * share:.0f} %"
    return time_row("hull rebuilt though its edges last", name, reused / 2.0, rebuilt / 2.0)


class _CountingSigns(ExactSigns):
    """Exact decisions, counted."""

    calls = 0

    def growth(self, half_edge: int) -> int:
        self.calls += 1
        return super().growth(half_edge)

    def side(self, half_edge: int) -> int:
        self.calls += 1
        return super().side(half_edge)

    def ascend(self, elements: Any, saddle: int, vertex: int) -> tuple[list[int], int]:
        self.calls += 1
        return super().ascend(elements, saddle, vertex)

    def descend(self, elements: Any, facet: int) -> int:
        self.calls += 1
        return super().descend(elements, facet)


BALANCED: Final = np.array(
    [[s * x, s * y, s - 2.0] for s in (1.0, 3.0) for x in (1.0, -1.0) for y in (1.0, -1.0)]
)
"""Corners of a square frustum about the origin (8, 3): the origin's foot on the plane of each side
lies on that side's lower edge, exactly."""


def exact_rows(seconds: float) -> Iterator[CostRow]:
    """The same shape with its balances and, a little deformed, without."""
    noise = 1e-3 * np.random.default_rng(0).normal(size=BALANCED.shape)
    hulls = [convex_hull(BALANCED + noise), convex_hull(BALANCED)]

    def trace(hull: ConvexHull) -> int:
        signs = _CountingSigns(hull, np.zeros(3))
        equilibria = classify(hull, np.zeros(3))
        equilibria.__dict__["exact"] = signs
        separatrices(equilibria)
        return signs.calls

    counts = [trace(hull) for hull in hulls]
    times = in_turn([partial(trace, hull) for hull in hulls], seconds / 2.0)
    feature = "exact arithmetic, for what rounding leaves open"
    yield CostRow(feature, "square frustum: decisions", counts[0], counts[1], "calls")
    yield time_row(feature, "square frustum: tracing", *times)


TERMS: Final = ("coplanar", "barycenter", "neighbor", "stability")


def energy_rows(seconds: float) -> Iterator[CostRow]:
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

    chosen = [full, *(replace(full, weights=full.weights.changed(**{t: 0.0})) for t in TERMS)]
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


def sobolev_rows(seconds: float) -> Iterator[CostRow]:
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


def torch_rows(seconds: float) -> Iterator[CostRow]:
    """Odds and their gradients for torch, of dice one by one and all at once, beside what the
    kernels take of that; none without kernels. Torch has one thread."""
    dice, corners = 500, 14
    points = np.random.default_rng(0).normal(size=(dice, corners, 3))
    points /= np.linalg.norm(points, axis=2)[:, :, None]
    start, counts, which = corners * np.arange(dice), np.full(dice, corners), np.arange(dice)

    def by_kernels() -> None:
        usual = hull_precision(False)
        bodies = kernels.bodies(points.reshape(-1, 3), start, counts, None, *usual, 1)
        assert bodies is not None
        _, _, normals, odds = bodies.rests()
        bodies.pull_back(which, normals, odds, corners, 1)

    together = torch.tensor(points, requires_grad=True)
    one_by_one = [torch.tensor(die, requires_grad=True) for die in points]

    def at_once() -> None:
        rests = differentiable_rest_batch(together)
        torch.autograd.backward(rests, [value.detach() for value in rests])

    def from_list() -> None:
        rests = differentiable_rest_batch(one_by_one)
        torch.autograd.backward(rests, [value.detach() for value in rests])

    def each() -> None:
        for die in one_by_one:
            rests = differentiable_rest(die)
            torch.autograd.backward(rests, [value.detach() for value in rests])

    if kernels.available():
        with one_tensor_thread():
            least, *others = in_turn([by_kernels, at_once, from_list, each], seconds)
        for how, time in zip(("one tensor", "list of tensors", "one by one"), others, strict=True):
            measured = f"die of {corners} corners, {how}"
            yield time_row("torch around kernels", measured, least / dice, time / dice)
