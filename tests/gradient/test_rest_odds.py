"""The differentiable model: values against the forward model, gradients against differences."""

from __future__ import annotations

import re

import numpy as np
import pytest
import torch
from common.kernels import without_kernels

from dicedesign import rest_poses
from dicedesign.errors import DegenerateBodyError, InputError, OutsideHullError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.solid import solid_properties
from dicedesign.gradient import rest_odds
from dicedesign.gradient.differentiable_rest import differentiable_rest
from dicedesign.gradient.rest_odds import RestEvaluation, evaluate_rests
from dicedesign.gradient.solid_moments import hull_centroid
from dicedesign.optimize.starts.kinds.prism import prism
from dicedesign.optimize.starts.repulsion import repulsion

SIZES = [4, 5, 6, 8, 10, 12, 16, 20]
CUBE = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


def leaf(values: np.ndarray) -> torch.Tensor:
    return torch.tensor(values, dtype=torch.float64, requires_grad=True)


def inside(points: np.ndarray, seed: int) -> np.ndarray:
    """A point of the hull's middle, away from its centroid."""
    weights = np.random.default_rng(seed).dirichlet(np.full(len(points), 3.0))
    return 0.6 * rest_poses(points).center_of_mass + 0.4 * weights @ points


def structure(rests: RestEvaluation) -> tuple[object, ...]:
    """All integers that the probabilities depend on, by vertex number and free of order."""
    hull, paths = rests.hull, rests.paths
    name = hull.source
    facets = [
        frozenset(name[hull.tail[start:end]].tolist())
        for start, end in zip(hull.facet_start[:-1], hull.facet_start[1:], strict=True)
    ]
    stable = [facets[facet] for facet in paths.rests]
    branches = set()
    for branch in range(len(paths.maxima)):
        ends = paths.saddle_ends[branch // 2]
        start = name[ends[1 - branch % 2]]
        crossed = tuple(map(tuple, name[paths.crossed[branch, : paths.lengths[branch]]].tolist()))
        sides = frozenset(stable[basin] for basin in paths.basins[branch // 2])
        branches.add((int(start), crossed, int(name[paths.maxima[branch]]), sides))
    return frozenset(facets), frozenset(stable), frozenset(branches)


def by_facet(rests: RestEvaluation) -> dict[frozenset[int], torch.Tensor]:
    hull = rests.hull
    corners = [
        frozenset(hull.source[hull.tail[hull.facet_start[f] : hull.facet_start[f + 1]]].tolist())
        for f in rests.paths.rests
    ]
    return dict(zip(corners, rests.probabilities, strict=True))


@pytest.mark.parametrize("count", [4, 6, 9, 14, 20])
def test_gradcheck_in_vertices_and_center(random_points, count: int) -> None:
    points = random_points(count, count)
    center = leaf(inside(points, count))
    assert torch.autograd.gradcheck(
        differentiable_rest, (leaf(points), center), eps=1e-6, atol=1e-7, rtol=1e-5
    )


@pytest.mark.parametrize("count", [4, 7, 12, 20])
def test_gradcheck_of_the_uniform_solid(random_points, count: int) -> None:
    points = random_points(100 + count, count)
    assert torch.autograd.gradcheck(
        differentiable_rest, (leaf(points),), eps=1e-6, atol=1e-7, rtol=1e-5
    )


def test_gradients_are_differences_within_a_cell(random_points) -> None:
    """Directional derivatives of 30 hulls, where both displaced hulls have the same structure."""
    errors = []
    for seed in range(30):
        points = random_points(seed, SIZES[seed % len(SIZES)])
        center = inside(points, seed) if seed % 2 else None
        rng = np.random.default_rng(1000 + seed)
        step = 1e-5
        along, along_center = rng.normal(size=points.shape), rng.normal(size=3)
        vertices = leaf(points)
        middle = leaf(center) if center is not None else None
        here = evaluate_rests(vertices, middle)
        cell = structure(here)
        while True:
            sides = []
            for sign in (1.0, -1.0):
                moved = torch.tensor(points + sign * step * along)
                c = None if center is None else torch.tensor(center + sign * step * along_center)
                sides.append(evaluate_rests(moved, c))
            if all(structure(side) == cell for side in sides):
                break
            step *= 0.5
            assert step > 1e-7, f"hull {seed} lies on the border of its cell"
        above, below = (by_facet(side) for side in sides)
        difference, exact = [], []
        for facet, probability in by_facet(here).items():
            inputs = [vertices] if middle is None else [vertices, middle]
            gradient = torch.autograd.grad(probability, inputs, retain_graph=True)
            slope = float((gradient[0].numpy() * along).sum())
            if middle is not None:
                slope += float(gradient[1].numpy() @ along_center)
            exact.append(slope)
            difference.append(float((above[facet] - below[facet]) / (2.0 * step)))
        largest = np.abs(exact).max()
        errors.append(np.abs(np.subtract(difference, exact)).max() / largest)
    assert np.median(errors) < 1e-8
    assert max(errors) < 1e-6


@pytest.mark.parametrize("seed", range(12))
def test_values_are_those_of_the_forward_model(random_points, seed: int) -> None:
    points = random_points(seed, SIZES[seed % len(SIZES)]) * 3.0 + np.array([10.0, -4.0, 2.0])
    for center in (None, inside(points, seed)):
        poses = rest_poses(points, center)
        given = None if center is None else torch.tensor(center)
        normals, probabilities = differentiable_rest(torch.tensor(points), given)
        np.testing.assert_allclose(probabilities.numpy(), poses.probabilities, atol=1e-14)
        np.testing.assert_allclose(normals.numpy(), poses.normals, atol=1e-14)


def test_flat_polygons_count_as_one_rest() -> None:
    normals, probabilities = differentiable_rest(leaf(CUBE))
    assert normals.shape == (6, 3)
    np.testing.assert_allclose(probabilities.detach().numpy(), 1 / 6, atol=1e-15)


@pytest.mark.parametrize("count", [4, 8, 13, 20])
@pytest.mark.parametrize("uniform", [True, False])
def test_gradients_have_the_symmetries_of_probabilities(
    random_points, count: int, uniform: bool
) -> None:
    """Sum 1, translation, scaling and rotation: each gives a linear relation of the gradients."""
    points = random_points(30 + count, count)
    vertices = leaf(points)
    center = leaf(inside(points, count)) if not uniform else None
    _, probabilities = differentiable_rest(vertices, center)
    inputs = [vertices] if center is None else [vertices, center]
    positions = [points] if center is None else [points, center.detach().numpy()[None]]
    total = np.zeros(1)
    for probability in probabilities:
        parts = torch.autograd.grad(probability, inputs, retain_graph=True)
        x = np.concatenate(positions)
        g = np.concatenate([part.numpy().reshape(-1, 3) for part in parts])
        size = np.abs(g).max()
        assert size > 1e-3
        np.testing.assert_allclose(g.sum(axis=0), 0.0, atol=1e-12 * size)
        assert abs((x * g).sum()) < 1e-12 * size
        np.testing.assert_allclose(np.linalg.cross(x, g).sum(axis=0), 0.0, atol=1e-12 * size)
        total = total + g
    assert np.abs(total).max() < 1e-12


def test_points_inside_the_hull_have_no_gradient(random_points) -> None:
    corners = random_points(2, 12)
    hull = convex_hull(corners)
    points = np.concatenate([0.3 * corners, corners, np.zeros((1, 3))])
    vertices = leaf(points)
    _, probabilities = differentiable_rest(vertices)
    gradient = torch.autograd.grad(probabilities[0], vertices)[0].numpy()
    is_corner = np.zeros(len(points), dtype=bool)
    is_corner[12 + hull.source] = True
    assert (gradient[~is_corner] == 0.0).all()
    assert (np.abs(gradient[is_corner]).max(axis=1) > 0.0).any()


def test_a_body_with_one_rest_has_probability_one_and_no_gradient() -> None:
    rng = np.random.default_rng(0)
    for _ in range(3000):
        points = rng.normal(size=(6, 3))
        center = rng.dirichlet(np.full(6, 0.3)) @ points
        try:
            alone = len(rest_poses(points, center).normals) == 1
        except (DegenerateBodyError, OutsideHullError):
            continue
        if alone:
            break
    assert alone
    vertices, middle = leaf(points), leaf(center)
    normals, probabilities = differentiable_rest(vertices, middle)
    assert normals.shape == (1, 3)
    assert probabilities.tolist() == [1.0]
    by_vertices, by_center = torch.autograd.grad(probabilities.sum(), [vertices, middle])
    assert (by_vertices == 0.0).all()
    assert (by_center == 0.0).all()


def test_the_centroid_is_that_of_the_solid_and_so_is_its_gradient(random_points) -> None:
    points = random_points(5, 15) + np.array([4.0, 5.0, 6.0])
    hull = convex_hull(points)
    vertices = leaf(hull.vertices)
    centroid = hull_centroid(vertices, hull)
    np.testing.assert_allclose(centroid.detach().numpy(), hull.centroid, atol=1e-14)
    for axis in range(3):
        gradient = torch.autograd.grad(centroid[axis], vertices, retain_graph=True)[0].numpy()
        expected = np.empty_like(gradient)
        for i, k in np.ndindex(*hull.vertices.shape):
            step = np.zeros_like(hull.vertices)
            step[i, k] = 1e-5
            above = solid_properties(hull.vertices + step, hull.triangles)[1]
            below = solid_properties(hull.vertices - step, hull.triangles)[1]
            expected[i, k] = (above[axis] - below[axis]) / 2e-5
        np.testing.assert_allclose(gradient, expected, atol=1e-9)


@pytest.mark.parametrize("factors", [[1.0, 1.0, 1e6], [1.0, 1.0, 1e-6]])
def test_the_centroid_of_a_thin_body_in_any_direction(random_points, factors) -> None:
    hull = convex_hull(random_points(5, 15))
    direction = np.array([0.3, -0.7, 0.5])
    vertices = leaf(hull.vertices)
    plain = hull_centroid(vertices, hull)
    expected = torch.autograd.grad(plain, vertices, torch.tensor(direction))[0].numpy()
    # An affine map of the vertices maps the centroid too, and gradients by its inverse transposed.
    matrix = np.array(factors)[:, None] * np.linalg.qr(random_points(6, 3))[0]
    turned = leaf(hull.vertices @ matrix)
    centroid = hull_centroid(turned, convex_hull(hull.vertices @ matrix))
    back = np.linalg.inv(matrix)
    gradient = torch.autograd.grad(centroid, turned, torch.tensor(back @ direction))[0].numpy()
    found, wanted = centroid.detach().numpy() @ back, plain.detach().numpy()
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-9)
    np.testing.assert_allclose(gradient @ matrix.T, expected, rtol=0, atol=1e-9)


def test_the_gradient_of_a_fixed_center_is_part_of_the_uniform_one(random_points) -> None:
    points = random_points(6, 10)
    hull = convex_hull(points)
    vertices = leaf(hull.vertices)
    whole = torch.autograd.grad(differentiable_rest(vertices)[1][0], vertices)[0]
    middle = leaf(hull.centroid)
    part, by_center = torch.autograd.grad(
        differentiable_rest(vertices, middle)[1][0], [vertices, middle]
    )
    moved = torch.autograd.grad(hull_centroid(vertices, hull), vertices, by_center)[0]
    np.testing.assert_allclose(whole.numpy(), (part + moved).numpy(), atol=1e-13)


def test_facet_normals_and_vertex_directions(random_points) -> None:
    points = random_points(9, 14)
    rests = evaluate_rests(torch.tensor(points))
    facets = np.arange(len(rests.hull.normals))[::-1].copy()
    np.testing.assert_allclose(
        rests.facet_normals(facets).numpy(), rests.hull.normals[facets], atol=1e-15
    )
    radii = rests.hull.vertices - rests.hull.centroid
    directions = rests.vertex_directions(np.arange(len(radii))).numpy()
    np.testing.assert_allclose(directions * np.linalg.norm(radii, axis=1)[:, None], radii)


@pytest.mark.parametrize("sides", range(3, 13))
def test_ties_of_a_symmetric_body_are_decided_as_in_the_forward_model(sides: int) -> None:
    """Separatrices of these prisms run along edges into corners."""
    points = prism(sides, height=1.0, cap=2.0).points
    vertices = leaf(points)
    _, probabilities = differentiable_rest(vertices)
    np.testing.assert_allclose(probabilities.detach().numpy(), 1.0 / sides, atol=1e-12)
    np.testing.assert_allclose(rest_poses(points).probabilities, 1.0 / sides, atol=1e-12)
    gradient = torch.autograd.grad(probabilities[0], vertices)[0]
    assert torch.isfinite(gradient).all()


@without_kernels()
def test_basins_that_do_not_close_are_an_error(monkeypatch) -> None:
    original = rest_odds.border_areas

    def torn(*arguments):
        return original(*arguments) * (1.0 + 1e-6)

    monkeypatch.setattr(rest_odds, "border_areas", torn)
    text = "body: expected basins that cover the sphere once, got a difference of "
    vertices = leaf(CUBE)
    with pytest.raises(DegenerateBodyError, match=text):
        differentiable_rest(vertices)[1][0].backward()


def test_a_polished_start_has_finite_gradients() -> None:
    for outcomes in (4, 6, 12, 20):
        vertices = leaf(repulsion(outcomes, 0).points)
        normals, probabilities = differentiable_rest(vertices)
        total = (probabilities**2).sum() + normals[:, 0].sum()
        assert torch.isfinite(torch.autograd.grad(total, vertices)[0]).all()


@pytest.mark.parametrize(
    ("vertices", "center", "error", "text"),
    [
        (
            CUBE,
            None,
            InputError,
            "vertices: expected a float32 or float64 tensor of shape (n, 3), got ndarray; make a "
            "tensor with torch.tensor",
        ),
        (torch.tensor(CUBE).half(), None, InputError, "got torch.float16; convert it with .double"),
        (torch.tensor(CUBE).to(torch.complex128), None, InputError, "got torch.complex128"),
        (torch.tensor(CUBE).long(), None, InputError, "got torch.int64"),
        (torch.tensor(CUBE, device="meta"), None, InputError, "got a meta tensor; pass one with"),
        (torch.tensor(CUBE).to_sparse(), None, InputError, "got one of layout torch.sparse_coo"),
        (torch.ones(8, 2).double(), None, InputError, "got shape (8, 2)"),
        (torch.ones(24).double(), None, InputError, "got shape (24,)"),
        (
            torch.tensor(CUBE),
            torch.zeros(3, 1).double(),
            InputError,
            "center of mass: expected a float32 or float64 tensor of shape (3,), got shape (3, 1)",
        ),
        (torch.tensor(CUBE), (0.0, 0.0, 0.0), InputError, "center of mass: expected a float32 or"),
        (
            torch.tensor(CUBE),
            torch.tensor([2.0, 0.0, 0.0]).double(),
            OutsideHullError,
            "center of mass: expected a point strictly inside the hull, got [2.0, 0.0, 0.0]",
        ),
        (torch.tensor(CUBE[:3]), None, DegenerateBodyError, "expected at least 4"),
        (torch.tensor(CUBE * [1, 1, 0]), None, DegenerateBodyError, "on one plane"),
        (
            torch.tensor(CUBE),
            torch.tensor([float("nan"), 0.0, 0.0]).double(),
            InputError,
            "center of mass: expected three finite numbers",
        ),
    ],
)
def test_bad_tensors_are_refused_in_words(vertices, center, error, text: str) -> None:
    for function in (differentiable_rest, evaluate_rests):
        with pytest.raises(error, match=re.escape(text)):
            function(vertices, center)


def test_single_precision_is_carried_there_and_back() -> None:
    """Facets that rounding made uneven are one facet, as for `rest_poses`."""
    turned = CUBE * [1.0, 1.1, 1.2] @ np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    rounded = torch.tensor(turned, dtype=torch.float32, requires_grad=True)
    center = torch.zeros(3, requires_grad=True)
    normals, probabilities = differentiable_rest(rounded, center)
    assert normals.dtype == probabilities.dtype == torch.float32
    expected = rest_poses(rounded.detach().numpy(), [0.0, 0.0, 0.0])
    assert len(expected.probabilities) == 6
    np.testing.assert_array_equal(probabilities.detach(), expected.probabilities.astype("f4"))
    np.testing.assert_array_equal(normals.detach(), expected.normals.astype("f4"))
    slopes = torch.autograd.grad(probabilities[0], (rounded, center))
    double = (torch.tensor(turned, requires_grad=True), torch.zeros(3).double().requires_grad_())
    exact = torch.autograd.grad(differentiable_rest(*double)[1][0], double)
    for slope, wanted in zip(slopes, exact, strict=True):
        assert slope.dtype == torch.float32
        torch.testing.assert_close(slope.double(), wanted, rtol=0, atol=1e-5)
    assert len(evaluate_rests(rounded, center).hull.normals) == 6


def test_rests_of_moved_and_sliced_tensors(random_points) -> None:
    """Whatever strides they have."""
    points = torch.tensor(random_points(2, 8))
    sliced = torch.zeros(3, 16).double()
    sliced[:, ::2] = points.T
    for found, wanted in zip(
        differentiable_rest(sliced[:, ::2].T), differentiable_rest(points), strict=True
    ):
        assert torch.equal(found, wanted)


def test_saddles_and_maxima_are_those_of_the_forward_model(random_points) -> None:
    points = random_points(4, 11)
    poses, rests = rest_poses(points), evaluate_rests(leaf(points))
    assert rests.facets.tolist() == sorted(poses.facets.tolist())
    np.testing.assert_allclose(rests.saddles.detach(), poses.morse.saddles, atol=1e-14)
    found = np.unique(np.round(rests.maxima.detach().numpy(), 12), axis=0)
    known = np.unique(np.round(poses.morse.maxima, 12), axis=0)
    assert {tuple(row) for row in found + 0.0} <= {tuple(row) for row in known + 0.0}
    # The saddle is the point of an edge's line that is nearest to the center of mass.
    vertices, center = rests.hull.vertices, poses.center_of_mass
    for saddle, ends in zip(rests.saddles.detach().numpy(), rests.paths.saddle_ends, strict=True):
        assert abs(saddle @ (vertices[ends[1]] - vertices[ends[0]])) < 1e-13
        assert abs(np.linalg.det(np.array([saddle, *(vertices[ends] - center)]))) < 1e-13
    for part in (rests.saddles, rests.maxima):
        assert part.requires_grad
