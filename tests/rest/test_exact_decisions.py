"""What rounding could change, on bodies at the brink: held against 60 digits."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from functools import cache
from itertools import pairwise

import mpmath
import numpy as np
import pytest
from common.kernels import without_kernels

from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.kernels.ops import Tie
from dicedesign.rest import equilibria as equilibria_module
from dicedesign.rest import tracing as tracing_module
from dicedesign.rest.equilibria import Equilibria, classify, surroundings
from dicedesign.rest.morse import separatrices
from dicedesign.rest.tracing import trace_to_rests
from dicedesign.runtime.arrays import Floats
from tests.reference.oracle import DIGITS, Balanced, Oracle, facet_polygons
from tests.reference.random_hulls import extreme_hulls

Body = tuple[ConvexHull, Floats]


def long_bodies(count: int) -> Iterator[ConvexHull]:
    """On which paths cross up to four edges, and some facets tip onto a corner."""
    for seed in range(count):
        points = np.random.default_rng(seed).normal(size=(12 + seed % 12, 3))
        points /= np.linalg.norm(points, axis=1)[:, None]
        yield convex_hull(points * [1.0, 2.0, 3.0 + seed % 3], 0.0)


def elements(body: Equilibria) -> Floats:
    """All signs about edges."""
    return np.concatenate([body.growth_sign, body.side_sign])


def lines(body: Equilibria) -> Floats:
    """All uphill lines from saddles that divide basins. If one crosses the normal of a facet,
    bodies released on that facet end on another rest."""
    paths = separatrices(body)
    return np.concatenate([paths.crossings.ravel(), paths.branch_start])


def same_elements(hull: ConvexHull, start: Floats, direction: Floats) -> float:
    """How far the center of mass may be moved from a start before a sign about an edge changes:
    all of them are linear in the center."""
    body = classify(hull, start)
    r, v = body.radii[hull.tail], body.edge_vectors
    reach = float(surroundings(hull, start).height)
    for normal in (v, np.cross(v, hull.normals[hull.facet])):
        way = (direction * normal).sum(-1) / (r * normal).sum(-1)
        reach = min(reach, 1.0 / float(way.max()))
    return reach


def brink(
    hull: ConvexHull,
    start: Floats,
    direction: Floats,
    most: float,
    decisions: Callable[[Equilibria], Floats],
) -> list[Floats]:
    """Two adjacent float64 centers of mass on a line of at most a length whose decisions differ;
    none if no decision changes."""

    def at(reach: float) -> Floats:
        return decisions(classify(hull, start + reach * direction))

    low, high, before = 0.0, most, at(0.0)
    if np.array_equal(before, at(high)):
        return []
    while low < (middle := (low + high) / 2.0) < high:
        same = np.array_equal(before, at(middle))
        low, high = (middle, high) if same else (low, middle)
    return [start + low * direction, start + high * direction]


@cache
def bodies_at_the_brink() -> dict[str, list[Body]]:
    """Bodies with centers of mass on both sides of a change, at adjacent float64 positions, by the
    kind of change."""
    at_brink: dict[str, list[Body]] = {"elements": [], "lines": []}
    rng = np.random.default_rng(1)
    for hull in extreme_hulls(22, tolerance=0.0):
        for direction in rng.normal(size=(2, 3)):
            reach = 0.5 * float(surroundings(hull, hull.centroid).height)
            way = direction / np.linalg.norm(direction)
            ends = brink(hull, hull.centroid, way, reach, elements)
            at_brink["elements"] += [(hull, end) for end in ends]
    for hull in long_bodies(90):
        for direction in rng.normal(size=(3, 3)):
            way = direction / np.linalg.norm(direction)
            reach = 0.999 * same_elements(hull, hull.centroid, way)
            at_brink["lines"] += [
                (hull, end) for end in brink(hull, hull.centroid, way, reach, lines)
            ]
    return at_brink


def agrees_with_the_oracle(equilibria: Equilibria) -> bool:
    """Whether the oracle decides about the body, and then as is asserted."""
    hull, paths = equilibria.hull, separatrices(equilibria)
    try:
        with mpmath.workdps(DIGITS):
            flow = Oracle(hull.vertices, facet_polygons(hull), equilibria.center_of_mass)
            edges = list(flow.left)
            grows = [flow.grows(*edge) for edge in edges]
            inside = [flow.is_inside(*edge) for edge in edges]
            rests = flow.rests()
            borders = list(flow.borders()) if len(rests) > 1 else []
            ways = [flow.ascend(*ends)[1] for p, q, *_ in borders for ends in ((q, p), (p, q))]
            destined = [flow.destined(facet) for facet in range(len(hull.normals))]
    except Balanced:
        return False
    assert edges == list(zip(hull.tail.tolist(), hull.head.tolist(), strict=True))
    assert grows == (equilibria.growth_sign > 0).tolist()
    assert inside == (equilibria.side_sign > 0).tolist()
    assert paths.rests.tolist() == rests
    assert paths.saddles.tolist() == [edges.index((p, q)) for p, q, *_ in borders]
    assert paths.rests[paths.basins].tolist() == [sides for _, _, *sides in borders]
    assert paths.saddle_ends.tolist() == [[p, q] for p, q, *_ in borders]
    branches = np.split(paths.crossings, paths.branch_start[1:-1])[: len(ways)]
    crossed = [[tuple(edge) for edge in branch.tolist()] for branch in branches]
    assert crossed == [list(pairwise(cells)) for cells in ways]
    assert paths.maxima.tolist() == [cells[-1] for cells in ways]
    facets = np.arange(len(equilibria.stable))
    assert trace_to_rests(equilibria, facets).tolist() == destined
    return True


@pytest.mark.parametrize("kind", ["elements", "lines"])
def test_at_the_brink_decisions_are_those_of_the_oracle(kind: str) -> None:
    decided = 0
    for number, (shape, center) in enumerate(bodies_at_the_brink()[kind]):
        size = SIZES[number // 2 % 3]
        body = classify(convex_hull(size * shape.vertices, 0.0), size * center)
        with without_kernels():
            decided += agrees_with_the_oracle(body)
    assert decided > 50


@without_kernels()
def test_exact_arithmetic_decides_as_the_oracle(monkeypatch: pytest.MonkeyPatch) -> None:
    """With error bounds blown up, every decision is taken in exact arithmetic."""
    monkeypatch.setattr(equilibria_module, "ROUNDING", 1e6)
    monkeypatch.setattr(tracing_module, "ROUNDING", 1e6)
    for kind in bodies_at_the_brink().values():
        assert sum([agrees_with_the_oracle(classify(*body)) for body in kind[::4]]) > 10
    for hull in extreme_hulls(25, tolerance=0.0):
        agrees_with_the_oracle(classify(hull, hull.centroid))


def nearest_change(equilibria: Equilibria) -> float:
    """How far the center of mass is from where a sign about an edge changes."""
    hull, r, v = equilibria.hull, equilibria.radii, equilibria.edge_vectors
    across = np.cross(v, hull.normals[hull.facet])
    values = [(r[hull.tail] * normal).sum(-1) for normal in (v, across)]
    return float((np.abs(values) / np.linalg.norm(v, axis=1)).min())


SIZES = (2.0**-30, 1.0, 2.0**30)
"""Powers of two change no rounding."""


@pytest.mark.parametrize("way", [nullcontext, without_kernels])
def test_a_move_within_the_tie_distance_that_changes_an_element_is_a_tie(
    way: Callable[[], AbstractContextManager[None]],
) -> None:
    for number, shape in enumerate(extreme_hulls(40, tolerance=0.0)):
        hull = convex_hull(SIZES[number % 3] * shape.vertices, 0.0)
        least = nearest_change(classify(hull, hull.centroid))
        if least < 1e-9 * hull.diameter:
            continue
        with way(), pytest.raises(Tie):
            separatrices(classify(hull, hull.centroid, 1.001 * least))
        elements(classify(hull, hull.centroid, 0.999 * least))


@pytest.mark.parametrize("way", [nullcontext, without_kernels])
def test_a_move_within_the_tie_distance_that_changes_a_path_is_a_tie(
    way: Callable[[], AbstractContextManager[None]],
) -> None:
    """And bodies whose paths change nowhere near are not tied."""
    tied, decided = 0, 0
    rng = np.random.default_rng(2)
    for number, (shape, brink_of_shape) in enumerate(bodies_at_the_brink()["lines"][::2]):
        size = SIZES[number % 3]
        hull, center = convex_hull(size * shape.vertices, 0.0), size * brink_of_shape
        moved = rng.normal(size=3)
        distance = 1e-4 * hull.diameter
        elsewhere = center + distance * moved / np.linalg.norm(moved)
        with way():
            with pytest.raises(Tie):
                separatrices(classify(hull, elsewhere, 1.001 * distance))
            decided += 1
            try:
                separatrices(classify(hull, elsewhere, 1e-5 * distance))
            except Tie:
                tied += 1
    assert decided > 25
    assert tied < 0.1 * decided
