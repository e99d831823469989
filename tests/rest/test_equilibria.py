"""Classification of facets, edges and vertices, on bodies where it is known."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from itertools import pairwise, permutations, product

import numpy as np
import pytest

from dicedesign.errors import InputError, OutsideHullError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.rest.equilibria import FacetKind, classify
from dicedesign.runtime.arrays import Floats

CUBE = np.array(list(product([-1.0, 1.0], repeat=3)))


def test_a_cube_rests_on_facets_balances_on_corners_and_tips_over_edges() -> None:
    cube = classify(convex_hull(CUBE), [0, 0, 0])
    assert (cube.facet_kind == FacetKind.STABLE).all()
    assert cube.maximum.all()
    assert cube.saddle.sum() == 2 * 12
    assert cube.hinge.all()
    lengths = np.linalg.norm(cube.saddle_directions, axis=1)
    unit = np.abs(cube.saddle_directions / lengths[:, None])
    np.testing.assert_allclose(np.sort(unit, axis=1), [[0, 0.5**0.5, 0.5**0.5]] * 24, atol=1e-15)


@pytest.mark.parametrize(
    "center", [[0.0, 0.0], [0.0, np.nan, 0.0], [0.0, 0.0, np.inf], [[0.0] * 3]]
)
def test_a_center_is_three_finite_numbers(center: list[float]) -> None:
    with pytest.raises(InputError, match="center of mass"):
        classify(convex_hull(CUBE), center)


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_a_center_has_to_be_inside_whatever_the_size(size: float) -> None:
    hull = convex_hull(size * CUBE)
    for x, where in ((1.0 - 1e-14, "on the boundary"), (1.0 + 1e-14, "boundary"), (1.1, "outside")):
        with pytest.raises(OutsideHullError, match=where):
            classify(hull, [0.0, size * x, 0.0])
    classify(hull, [0.0, size * (1.0 - 1e-12), 0.0])


def test_of_several_edges_a_facet_rolls_over_the_one_that_its_foot_is_farthest_beyond() -> None:
    """Facets that are flat only within a wide tolerance can have several."""
    several = 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        points = rng.normal(size=(25, 3))
        points *= [1.0, 2.0, 3.0] / np.linalg.norm(points, axis=1)[:, None]
        hull = convex_hull(points, 0.1)
        center = hull.centroid + 0.05 * rng.normal(size=3)
        body = classify(hull, center)
        for facet in np.flatnonzero(body.facet_kind == FacetKind.ROLLS_OVER_EDGE):
            edges = np.flatnonzero((hull.facet == facet) & body.hinge & (body.side_sign < 0))
            beyond = []
            for edge in edges:
                a, b = hull.vertices[[hull.tail[edge], hull.head[edge]]]
                out = np.cross(b - a, hull.normals[facet])
                beyond.append((center - a) @ out / np.linalg.norm(b - a))
            assert body.roll_edge[facet] == edges[np.argmax(beyond)]
            several += len(edges) > 1
    assert several > 3


def test_steep_caps_roll_over_their_base() -> None:
    ring = [[np.cos(a), np.sin(a)] for a in np.arange(5) * 2 * np.pi / 5]
    walls = [[x, y, z] for x, y in ring for z in (-0.75, 0.75)]
    body = classify(convex_hull([*walls, [0, 0, 2.05], [0, 0, -2.05]]), [0, 0, 0])
    steep = np.abs(body.hull.normals[:, 2]) > 0.1
    assert steep.sum() == 10
    assert (body.facet_kind[steep] == FacetKind.ROLLS_OVER_EDGE).all()
    assert (body.facet_kind[~steep] == FacetKind.STABLE).all()
    assert len(set(FacetKind)) == 3
    np.testing.assert_array_equal(body.roll_edge == -1, ~steep)
    assert (body.roll_vertex == -1).all()
    beyond = body.hull.facet[body.hull.twin[body.roll_edge[steep]]]
    assert not steep[beyond].any()


def test_a_slanting_spike_tips_onto_the_vertex_nearest_to_its_foot() -> None:
    """The foot of c lies in the cone of a corner exactly where F1 says so."""
    rng = np.random.default_rng(5)
    tipping = 0
    for _ in range(200):
        hull = convex_hull(rng.normal(size=(6, 3)) * [1, 1, 4])
        body = classify(hull, hull.centroid)
        for facet in np.flatnonzero(body.facet_kind == FacetKind.ROLLS_TO_VERTEX):
            tipping += 1
            polygon = hull.polygon(facet)
            n = hull.normals[facet]
            foot = hull.centroid + n * ((polygon[0] - hull.centroid) @ n)
            corner = hull.vertices[body.roll_vertex[facet]]
            beside = [(foot - corner) @ (x - corner) for x in polygon]
            assert max(beside) <= 1e-12
    assert tipping > 20


@pytest.mark.parametrize("shift", [0.0, 0.3])
def test_edges_are_hinges_where_the_foot_is_between_their_ends(shift: float) -> None:
    hull = convex_hull(CUBE * [1.0, 2.0, 3.0])
    center = np.array([0.0, shift, -shift])
    body = classify(hull, center)
    a, b = hull.vertices[hull.tail], hull.vertices[hull.head]
    t = ((center - a) * (b - a)).sum(1) / ((b - a) ** 2).sum(1)
    np.testing.assert_array_equal(body.hinge, (t > 0) & (t < 1))


def exact_cross(a: list[Fraction], b: list[Fraction]) -> list[Fraction]:
    return [a[i - 2] * b[i - 1] - a[i - 1] * b[i - 2] for i in range(3)]


def exact_area_vector(polygon: Floats) -> list[Fraction]:
    """Of corners (m, 3), times a factor."""
    corners = [[Fraction(x) for x in corner] for corner in polygon.tolist()]
    fan = [[x - y for x, y in zip(corner, corners[0], strict=True)] for corner in corners]
    crosses = [exact_cross(a, b) for a, b in pairwise(fan)]
    total = [sum(parts) for parts in zip(*crosses, strict=True)]
    largest = max(map(abs, total))
    return [x / largest for x in total]


LUCKLESS = np.array(
    [
        [0.09801455455289887, 0.09885052856593858, 0.0007441152934791626],
        [-1.0835595631277988, -1.0829793163094326, -0.002241014093653108],
        [1.1601496313260369, 1.1599836006540545, -0.0014022629124345765],
    ]
)
"""A triangle whose normal is turned by rounding as few are, one of millions: large terms cancel."""


def random_bodies() -> list[Floats]:
    return [np.random.default_rng(seed).normal(size=(40, 3)) for seed in range(10)]


def luckless_bodies() -> list[Floats]:
    """With an apex; which corner rounding begins at depends on their order."""
    normal = np.cross(LUCKLESS[1] - LUCKLESS[0], LUCKLESS[2] - LUCKLESS[0])
    apex = LUCKLESS.mean(axis=0) - normal / np.linalg.norm(normal)
    return [np.vstack([LUCKLESS[list(order)], apex]) for order in permutations(range(3))]


@pytest.mark.parametrize("bodies", [random_bodies, luckless_bodies])
def test_normals_are_as_exact_as_is_said(bodies: Callable[[], list[Floats]]) -> None:
    """Against rational arithmetic; and not said to be far less exact than they are."""
    worst = 0.0
    for points in bodies():
        hull = convex_hull(points, 0.0)
        bounds = classify(hull, hull.centroid).normal_error
        for facet, bound in enumerate(bounds.tolist()):
            area = exact_area_vector(hull.polygon(facet))
            normal = [Fraction(x) for x in hull.normals[facet].tolist()]
            across = np.array([float(x) for x in exact_cross(normal, area)])
            angle = np.linalg.norm(across) / np.linalg.norm([float(x) for x in area])
            worst = max(worst, angle / bound)
    assert 1e-3 < worst <= 1.0
