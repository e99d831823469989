"""Printed copies of dice, against closed forms, prints that are made one by one, displaced surfaces
and statistics."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import trimesh
from common.bumpy import ball, surface_of
from common.made_up_die import SIDES, box
from scipy import stats

from dicedesign.fabricate.print_copies import (
    NOTICED,
    ROLLS,
    PrintedCopies,
    print_tolerances,
    total_variations,
)
from dicedesign.fabricate.printers import FDM, PrintErrors
from dicedesign.geometry.hulls.hull import convex_hull, polyhedron_corners
from dicedesign.geometry.meshes.body import Body, body_of
from dicedesign.geometry.sphere import norms
from dicedesign.optimize.starts.shapes import repulsion
from dicedesign.rest.outcomes import outcome_probabilities
from dicedesign.rest.poses import rest_poses
from tests.reference.perturbed_dice import PrintedDie, only

NONE = PrintErrors(0.0, 0.0, 0.0, 0.0, 0.0)

AXES = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]


def copies_of(
    points: np.ndarray, directions: np.ndarray, axes: np.ndarray = AXES, **more: Any
) -> PrintedCopies:
    """Copies of a convex die."""
    poses = rest_poses(points, more.pop("center", None))
    body = body_of(poses.hull.surface)
    return PrintedCopies.of(body, poses, directions, axes, 3.0, is_flat=True, **more)


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


@pytest.mark.parametrize("name", ["dimensional_mm", "shrinkage", "density_gradient", "bubble_mm3"])
@pytest.mark.parametrize("center", [None, np.array([0.5, 0.2, -0.3])], ids=["uniform", "given"])
def test_small_errors_spread_like_those_of_prints_one_by_one(
    name: str, center: np.ndarray | None
) -> None:
    points, errors = die(0), only(PrintErrors(), name)
    poses = rest_poses(points, center)
    copies = copies_of(points, poses.normals, np.eye(3), center=center).probabilities(errors, 0.0)
    prints = PrintedDie(poses.hull, poses.normals, center).probabilities(errors, 400, 7)
    # Of 400 prints a standard deviation is known to 4 %.
    np.testing.assert_allclose(copies[:, :-1].std(axis=0), prints.std(axis=0), rtol=0.15)


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
    only = PrintErrors(result.allowed_mm, 0.0, 0.0, 0.0)
    prints = PrintedDie(convex_hull(points), rest_poses(points).normals)
    probabilities = prints.probabilities(only, 400, 11)
    noticed = chances(probabilities, right)
    assert noticed.mean() == pytest.approx(NOTICED, abs=4.0 * noticed.std() / 20.0 + 0.01)
    # The assumed errors are smaller, and are most of all errors.
    assert 0.05 < result.noticed < NOTICED
    squares = sum(np.square(each) for each in result.by_error.values())
    np.testing.assert_allclose(np.square(result.deviations), squares, rtol=0.1)


def test_a_biased_die_has_no_allowed_offset_and_one_outcome_any() -> None:
    biased, right = tolerances(die(0), 0.05)
    assert biased.allowed_mm == 0.0
    assert biased.total_variation > 0.04
    np.testing.assert_allclose(np.subtract(biased.mean, right)[:2], [0.05, -0.05], atol=2e-3)
    copies = copies_of(box(20.0, 22.0, 25.0), SIDES, outcome_of=np.zeros(6, dtype=np.int64))
    assert print_tolerances(copies, np.ones(1), np.ones(1), PrintErrors(), FDM).allowed_mm is None


def test_copies_that_are_no_body_are_noticed() -> None:
    copies, off = copies_of(box(20.0, 22.0, 0.5), SIDES), replace(NONE, dimensional_mm=1.0)
    lost = copies.probabilities(off, 0.0)[:, -1] == 1.0
    # Of two sides that are off by 1 mm, a third meets.
    assert 0.2 < lost.mean() < 0.5
    right = copies.exact[:-1]
    worst = print_tolerances(copies, right, right, off, FDM)
    assert worst.noticed > lost.mean() + 0.05 * (1.0 - lost.mean())


def test_the_variation_of_prints_is_the_largest_difference_of_any_event() -> None:
    """Among the events are falls elsewhere, which the target excludes."""
    target = np.array([0.5, 0.3, 0.2])
    prints = np.array([[0.4, 0.3, 0.2], [0.5, 0.3, 0.2], [0.25, 0.35, 0.25]])
    events = np.array(list(itertools.product([0.0, 1.0], repeat=4)))
    whole = np.column_stack([prints, 1.0 - prints.sum(axis=1)])
    expected = ((whole - np.append(target, 0.0)) @ events.T).max(axis=1)
    np.testing.assert_allclose(total_variations(target, prints), expected, atol=1e-15)


def test_nine_in_ten_copies_are_nearer_than_the_tolerance() -> None:
    points, errors = die(0), PrintErrors()
    result, right = tolerances(points)
    copies = copies_of(points, rest_poses(points).normals)
    every = copies.probabilities(errors, FDM.layer_mm)
    off = np.sort(np.abs(np.column_stack([every[:, :-1] - right, every[:, -1]])).sum(axis=1) / 2)
    # Of 64, between the 57th and the 58th.
    assert off[56] <= result.nine_in_ten <= off[57]
    assert result.total_variation == pytest.approx(off.mean())
    assert result.elsewhere == pytest.approx(every[:, -1].mean())
    np.testing.assert_allclose(result.mean, every[:, :-1].mean(axis=0))
    np.testing.assert_allclose(result.deviations, every[:, :-1].std(axis=0))


def fine_box(*sides: float, halvings: int = 3) -> Body:
    mesh = trimesh.creation.box(extents=sides)
    for _ in range(halvings):
        mesh = mesh.subdivide()
    return body_of(surface_of(mesh))


def fine_ball(*sides: float) -> Body:
    return body_of(ball(2).with_points(15.0 * ball(2).points * sides))


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


def test_smooth_errors_are_normal_and_alike_nearby(many: PrintedCopies) -> None:
    """Of points of a surface, and of the facets of a convex die."""
    facets = copies_of(box(6.0, 8.0, 3.0), SIDES).draws
    for draws, within in ((many.draws, 0.05), (facets, 1e-6)):
        smooth = draws.smooth
        apart = norms(draws.places[:, None] - draws.places)
        products = smooth @ smooth.T / smooth.shape[1]
        expected = np.exp(-np.square(apart / 3.0) / 2.0)
        for low, high in ((0.0, 0.1), (2.4, 3.0), (4.5, 6.0), (10.0, 12.0)):
            pairs = (low <= apart) & (apart < high)
            off = (products - expected)[pairs]
            assert abs(off.sum()) <= within * max(len(off), 1)


def test_smooth_errors_move_the_center() -> None:
    """At the edges of a box the normals of points are not those of its sides."""
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
    assert result.total_variation < min(0.02, result.nine_in_ten)
    assert sum(result.mean) + result.elsewhere == pytest.approx(1.0)
    prints = copies.probabilities(replace(NONE, dimensional_mm=result.allowed_mm), 0.0)
    assert chances(prints[:, :6], sixths).mean() == pytest.approx(NOTICED, abs=2e-3)
