"""Printed copies of dice, against closed forms, prints that are made one by one, displaced surfaces
and statistics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest
import trimesh
from common.made_up_die import SIDES, box
from scipy import stats

from dicedesign.fabricate.print_copies import NOTICED, ROLLS, PrintedCopies, print_tolerances
from dicedesign.fabricate.printers import FDM, PrintErrors
from dicedesign.geometry.hulls.hull import convex_hull, polyhedron_corners
from dicedesign.geometry.meshes.body import Body, body_of
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.triangles import Surface
from dicedesign.optimize.starts.shapes import repulsion
from dicedesign.rest.outcomes import outcome_probabilities
from dicedesign.rest.poses import rest_poses
from tests.reference.perturbed_dice import PrintedDie

NONE = PrintErrors(0.0, 0.0, 0.0, 0.0, 0.0)

AXES = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]


def copies_of(
    points: np.ndarray, directions: np.ndarray, axes: np.ndarray = AXES, **more: Any
) -> PrintedCopies:
    """Copies of a convex die."""
    poses = rest_poses(points, more.pop("center", None))
    body = body_of(poses.hull.surface)
    return PrintedCopies.of(body, poses, directions, axes, 3.0, is_flat=True, **more)


HALF = np.array([9.0, 10.0, 12.0])


def rectangle(depth: float, sides: tuple[float, float], others: tuple[float, float]) -> float:
    """Solid angle of a rectangle at a depth, from distances of its sides from the foot point."""
    return sum(
        float(np.arctan(x * y / (depth * np.sqrt(depth**2 + x * x + y * y))))
        for x, y in product(sides, others)
    )


def box_probabilities(low: np.ndarray, high: np.ndarray, center: np.ndarray) -> np.ndarray:
    """(6,) probabilities in closed form."""
    up, down = high - center, center - low
    angles = []
    for depths in (up, down):
        for axis in range(3):
            b, c = (axis + 1) % 3, (axis + 2) % 3
            angles.append(rectangle(depths[axis], (down[b], up[b]), (down[c], up[c])))
    return np.array(angles) / (4.0 * np.pi)


def slope(probabilities_at: Callable[[float], np.ndarray], step: float = 1e-3) -> np.ndarray:
    """Derivative at 0, by central differences."""
    return (probabilities_at(step) - probabilities_at(-step)) / (2.0 * step)


def box_slopes(given: np.ndarray | None) -> dict[str, np.ndarray]:
    """Derivatives (n, 6) of a box's probabilities in n independent errors, by their names; of a
    uniform box in all errors."""
    center = np.zeros(3) if given is None else given

    def moved(t: float, axis: np.ndarray) -> np.ndarray:
        low, high = -HALF + t * np.minimum(axis, 0.0), HALF + t * np.maximum(axis, 0.0)
        return box_probabilities(low, high, (low + high) / 2.0 if given is None else given)

    def stretched(t: float, axis: np.ndarray) -> np.ndarray:
        return box_probabilities(*((1 + t * axis) * sides for sides in (-HALF, HALF, center)))

    def heavier(t: float, shift: np.ndarray) -> np.ndarray:
        return box_probabilities(-HALF, HALF, t * shift)

    def slopes(function: Callable[..., np.ndarray], moves: np.ndarray) -> np.ndarray:
        return np.array([slope(lambda t, move=move: function(t, move)) for move in moves])

    known = {"dimensional_mm": slopes(moved, SIDES), "shrinkage": slopes(stretched, np.eye(3))}
    if given is None:
        # A bubble is uniform in the box. From 1 - g/2 at the bottom of a box 2 c high to 1 + g/2 at
        # its top the center of mass is at g c / 6; the second axis is up.
        bubbles = np.diag(HALF) / np.sqrt(3.0) / (8.0 * HALF.prod())
        known |= {"bubble_mm3": slopes(heavier, bubbles)}
        known |= {"density_gradient": slopes(heavier, HALF[1] / 6.0 * np.eye(3)[1:2])}
    return known


@pytest.mark.parametrize("given", [None, np.array([0.5, 0.2, -0.3])], ids=["uniform", "given"])
def test_small_errors_of_a_box_spread_as_its_closed_form(given: np.ndarray | None) -> None:
    copies = copies_of(box(*2.0 * HALF), SIDES, np.eye(3)[[2, 0, 1]], center=given)
    for name, slopes in box_slopes(given).items():
        small = 1.0 if name == "bubble_mm3" else 1e-3
        prints = copies.probabilities(replace(NONE, **{name: small}), 0.2)[:, :-1]
        expected = small**2 * slopes.T @ slopes
        difference = np.cov(prints.T, bias=True) - expected
        assert np.abs(difference).max() < 2e-3 * np.diag(expected).max(), name
        assert np.linalg.eigvalsh(expected).max() > 1e-12


def die(seed: int) -> np.ndarray:
    """Corners of a die of about 30 mm, about its center of mass."""
    rng = np.random.default_rng(seed)
    normals = convex_hull(repulsion(8, seed).points).normals
    points = polyhedron_corners(normals, rng.uniform(13.0, 16.0, size=8))
    return points - convex_hull(points).centroid


HOUSE = np.concatenate([box(20.0, 20.0, 20.0), [[0.0, 0.0, 21.0]]])
"""Corners of a cube with a roof whose sides are barely rests."""

TIED = 14.0 * np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1.2], [0, 0, -1.2]])
"""Corners where four facets meet, and saddles at the ends of edges: prints are on one side."""


def tolerances(points: np.ndarray, off: float = 0.0, **errors: float) -> tuple[Any, np.ndarray]:
    """Tolerances of a die, one of whose outcomes is more probable by a bias than wanted."""
    poses = rest_poses(points)
    right = poses.probabilities
    bias = off * (np.eye(len(right))[0] - np.eye(len(right))[1])
    copies = copies_of(points, poses.normals)
    return print_tolerances(copies, right, right + bias, PrintErrors(**errors), FDM), right


def chances(prints: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Probabilities (n,) that Pearson's test notices prints (n, k)."""
    noncentral = ROLLS * ((prints - right) ** 2 / right).sum(axis=1)
    degrees = len(right) - 1
    return stats.ncx2.sf(stats.chi2.isf(0.05, degrees), degrees, noncentral + 1e-12)


@pytest.mark.parametrize("points", [die(0), HOUSE, TIED], ids=["random", "loses a rest", "tied"])
def test_the_allowed_offset_is_noticed_in_a_tenth_of_prints(points: np.ndarray) -> None:
    result, right = tolerances(points)
    assert f"within about {result.allowed_mm:.2g} mm" in result.answer
    only = PrintErrors(result.allowed_mm, 0.0, 0.0, 0.0)
    prints = PrintedDie(convex_hull(points), rest_poses(points).normals)
    probabilities = prints.probabilities(only, 400, 11)
    noticed = chances(probabilities, right)
    assert noticed.mean() == pytest.approx(NOTICED, abs=4.0 * noticed.std() / 20.0 + 0.01)
    # The assumed errors are smaller, and are most of all errors.
    assert 0.05 < result.noticed < NOTICED
    squares = sum(np.square(each) for each in result.by_error.values())
    np.testing.assert_allclose(np.square(result.deviations), squares, rtol=0.1)
    normal = np.sqrt(2.0 / np.pi) * np.sum(result.deviations) / 2.0
    assert result.total_variation == pytest.approx(normal, rel=0.2)


def test_a_biased_die_has_no_allowed_offset_and_one_outcome_any() -> None:
    biased, right = tolerances(die(0), 0.05)
    assert biased.allowed_mm == 0.0
    assert "however well" in biased.answer
    assert biased.total_variation > 0.04
    np.testing.assert_allclose(np.subtract(biased.mean, right)[:2], [0.05, -0.05], atol=2e-3)
    one = np.zeros(6, dtype=np.int64)
    copies = copies_of(box(20.0, 22.0, 25.0), SIDES, outcome_of=one)
    assert print_tolerances(copies, np.ones(1), np.ones(1), PrintErrors(), FDM).allowed_mm is None


def test_copies_that_are_no_body_are_noticed() -> None:
    plate = box(20.0, 22.0, 0.5)
    copies = copies_of(plate, SIDES)
    lost = copies.probabilities(replace(NONE, dimensional_mm=1.0), 0.0)[:, -1] == 1.0
    # Of two sides that are off by 1 mm, a third meets.
    assert 0.2 < lost.mean() < 0.5
    right = copies.exact[:-1]
    worst = print_tolerances(copies, right, right, replace(NONE, dimensional_mm=1.0), FDM)
    assert worst.noticed > lost.mean() + 0.05 * (1.0 - lost.mean())


def test_facets_move_alike_where_they_are_near() -> None:
    copies = copies_of(box(6.0, 8.0, 3.0), SIDES)
    apart = norms(copies.draws.places[:, None] - copies.draws.places)
    smooth = copies.draws.smooth
    np.testing.assert_allclose(
        smooth @ smooth.T / smooth.shape[1], np.exp(-np.square(apart / 3.0) / 2.0), atol=1e-6
    )


def fine_box(*sides: float, halvings: int = 3) -> Body:
    mesh = trimesh.creation.box(extents=sides)
    for _ in range(halvings):
        mesh = mesh.subdivide()
    return body_of(Surface(np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int64)))


def fine_ball(*sides: float) -> Body:
    sphere = trimesh.creation.icosphere(subdivisions=2, radius=15.0)
    points = np.asarray(sphere.vertices) * sides
    return body_of(Surface(points, np.asarray(sphere.faces, dtype=np.int64)))


def copies_of_surface(
    body: Body, directions: np.ndarray = SIDES, axes: np.ndarray = AXES, copies: int = 64
) -> PrintedCopies:
    poses = rest_poses(body)
    return PrintedCopies.of(body, poses, directions, axes, 3.0, is_flat=False, copies=copies)


@pytest.fixture(scope="module")
def many() -> PrintedCopies:
    return copies_of_surface(fine_box(20.0, 22.0, 25.0), copies=400)


def test_copies_without_errors_are_the_body(many: PrintedCopies) -> None:
    expected = outcome_probabilities(many.poses, SIDES[:5])
    assert expected.elsewhere > 0.1
    flat = copies_of(many.poses.hull.vertices, SIDES[:5])
    lower = replace(many.draws, places=(1.0 - 1e-8) * many.draws.places)
    # Corners below the hull by rounding remain.
    for copies in (flat, replace(many, directions=SIDES[:5], draws=lower)):
        every = copies.probabilities(NONE, 0.0)
        assert np.abs(every - [*expected.probabilities, expected.elsewhere]).max() < 1e-12


@pytest.mark.parametrize("name", ["shrinkage", "density_gradient", "bubble_mm3"])
def test_small_errors_of_points_spread_like_those_of_facets(many: PrintedCopies, name: str) -> None:
    errors = replace(NONE, **{name: 0.1 if name == "bubble_mm3" else 1e-4})
    flat = copies_of(many.poses.hull.vertices, SIDES).probabilities(errors, 0.0)
    every = many.probabilities(errors, 0.0)
    # Of 400 copies a standard deviation is known to 4 %.
    np.testing.assert_allclose(every[:, :6].std(axis=0), flat[:, :6].std(axis=0), rtol=0.15)


def test_smooth_errors_are_normal_alike_nearby_and_move_the_center(many: PrintedCopies) -> None:
    points, smooth = many.draws.places, many.draws.smooth
    assert smooth.std() == pytest.approx(1.0, abs=0.02)
    apart = norms(points[:, None] - points[None])
    products = smooth @ smooth.T / smooth.shape[1]
    for low, high in ((2.4, 3.0), (4.5, 6.0), (10.0, 12.0)):
        pairs = (low < apart) & (apart < high)
        expected = np.exp(-np.square(apart[pairs] / 3.0) / 2.0).mean()
        assert products[pairs].mean() == pytest.approx(expected, abs=0.05)
    # At the edges of a box the normals of points are not those of its sides.
    body, small = fine_ball(1.0, 0.9, 0.7), 1e-4
    draws = copies_of_surface(body, copies=5).draws
    for smooth in draws.smooth.T:
        moved = body.points + small * smooth[:, None] * draws.outward
        shift = body.surface.with_points(moved).centroid - body.surface.centroid
        expected = smooth @ draws.shares / body.surface.volume
        np.testing.assert_allclose(shift / small, expected, atol=0.01)


def test_layers_change_a_box_in_proportion_to_their_height(many: PrintedCopies) -> None:
    """Upright, its ends move by up to half a layer; tilted, its sides remain flat."""
    upright = replace(many, axes=np.eye(3))
    coarse, fine = (upright.probabilities(NONE, layer)[:, :-1].std(axis=0) for layer in (0.4, 0.1))
    tilted = many.probabilities(NONE, 0.4)[:, :-1].std(axis=0)
    assert 0.1 < fine.max() / coarse.max() < 0.5
    assert tilted.max() < coarse.max()


def test_tolerances_tell_rests_of_copies_elsewhere() -> None:
    """A ball of many facets rests anywhere once its surface is rough; a box hardly changes."""
    downs = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    ball = copies_of_surface(fine_ball(1.0, 1.0, 0.7), downs, np.eye(3), copies=16)
    assert ball.probabilities(PrintErrors(), FDM.layer_mm)[:, -1].mean() > 0.1
    copies, sixths = copies_of_surface(fine_box(20.0, 20.0, 20.0, halvings=2)), np.full(6, 1 / 6)
    result = print_tolerances(copies, sixths, copies.exact[:-1], PrintErrors(), FDM)
    assert result.elsewhere < 0.001
    assert result.total_variation < 0.02
    assert result.total_variation <= result.nine_in_ten
    assert sum(result.mean) + result.elsewhere == pytest.approx(1.0)
    assert set(result.by_error) == {*result.assumed, "layers"} - {"correlation_mm"}
    prints = copies.probabilities(replace(NONE, dimensional_mm=result.allowed_mm), 0.0)
    assert chances(prints[:, :6], sixths).mean() == pytest.approx(NOTICED, abs=2e-3)
