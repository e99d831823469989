"""Printed copies of bodies, against derivatives, displaced surfaces and statistics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from common.made_up_die import SIDES

from dicedesign.fabricate.print_copies import CopiedBody, copied_tolerances
from dicedesign.fabricate.print_tolerances import ProbabilitySpread
from dicedesign.fabricate.printers import FDM, PrintErrors
from dicedesign.geometry.meshes.body import Body, body_of
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.triangles import Surface
from dicedesign.rest.outcomes import outcome_probabilities
from dicedesign.rest.poses import rest_poses

NONE = PrintErrors(0.0, 0.0, 0.0, 0.0, 0.0)

AXES = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]


def fine_box(*sides: float) -> Body:
    mesh = trimesh.creation.box(extents=sides)
    for _ in range(3):
        mesh = mesh.subdivide()
    return body_of(Surface(np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int64)))


def fine_ball(*sides: float) -> Body:
    sphere = trimesh.creation.icosphere(subdivisions=3, radius=15.0)
    points = np.asarray(sphere.vertices) * sides
    return body_of(Surface(points, np.asarray(sphere.faces, dtype=np.int64)))


@pytest.fixture(scope="module")
def copied() -> CopiedBody:
    body = fine_box(20.0, 22.0, 25.0)
    return CopiedBody.of(body, rest_poses(body), AXES, 3.0, copies=400)


def test_copies_without_errors_are_the_body(copied: CopiedBody) -> None:
    expected = outcome_probabilities(copied.poses, SIDES[:5])
    assert expected.elsewhere > 0.1
    every = copied.probabilities(NONE, 0.0, SIDES[:5])
    assert np.abs(every[:, :-1] - expected.probabilities).max() < 1e-12
    assert np.abs(every[:, -1] - expected.elsewhere).max() < 1e-12


def test_corners_below_the_hull_by_rounding_remain(copied: CopiedBody) -> None:
    expected = outcome_probabilities(copied.poses, SIDES).probabilities
    below = replace(copied, depths=copied.depths + 1e-7)
    assert np.abs(below.probabilities(NONE, 0.0, SIDES)[:, :-1] - expected).max() < 1e-12


@pytest.mark.parametrize("name", ["shrinkage", "density_gradient", "bubble_mm3"])
def test_small_errors_spread_as_derivatives_say(copied: CopiedBody, name: str) -> None:
    errors = replace(NONE, **{name: 0.1 if name == "bubble_mm3" else 1e-4})
    body = fine_box(20.0, 22.0, 25.0)
    spread = ProbabilitySpread.of(body, copied.poses, SIDES, errors, axes=AXES)
    every = copied.probabilities(errors, 0.0, SIDES)[:, :-1]
    expected = np.sqrt(np.diag(spread.covariance))
    # Of 400 copies a standard deviation is known to 4 %.
    np.testing.assert_allclose(every.std(axis=0), expected, rtol=0.15)


def test_smooth_errors_are_normal_alike_nearby_and_move_the_center(copied: CopiedBody) -> None:
    assert copied.smooth.std() == pytest.approx(1.0, abs=0.02)
    apart = norms(copied.points[:, None] - copied.points[None])
    products = copied.smooth @ copied.smooth.T / copied.smooth.shape[1]
    for low, high in ((2.4, 3.0), (4.5, 6.0), (10.0, 12.0)):
        pairs = (low < apart) & (apart < high)
        expected = np.exp(-np.square(apart[pairs] / 3.0) / 2.0).mean()
        assert products[pairs].mean() == pytest.approx(expected, abs=0.05)
    # At the edges of a box the normals of points are not those of its sides.
    body, small = fine_ball(1.0, 0.9, 0.7), 1e-4
    round_copies = CopiedBody.of(body, rest_poses(body), AXES, 3.0, copies=5)
    for smooth, expected in zip(round_copies.smooth.T, round_copies.moved, strict=True):
        moved = body.points + small * smooth[:, None] * round_copies.outward
        shift = body.surface.with_points(moved).centroid - body.surface.centroid
        np.testing.assert_allclose(shift / small, expected, atol=0.01)


def test_layers_change_a_box_in_proportion_to_their_height(copied: CopiedBody) -> None:
    """Upright, its ends move by up to half a layer; tilted, its sides remain flat."""
    upright = replace(copied, axes=np.eye(3))
    coarse, fine = (
        upright.probabilities(NONE, layer, SIDES)[:, :-1].std(axis=0) for layer in (0.4, 0.1)
    )
    tilted = copied.probabilities(NONE, 0.4, SIDES)[:, :-1].std(axis=0)
    assert 0.1 < fine.max() / coarse.max() < 0.5
    assert tilted.max() < coarse.max()


def test_tolerances_tell_rests_of_copies_elsewhere() -> None:
    """A ball of many facets rests anywhere once its surface is rough; a box hardly changes."""
    downs, target = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]), np.full(2, 0.5)
    errors = PrintErrors()
    found = [
        copied_tolerances(
            CopiedBody.of(body, rest_poses(body), np.eye(3), 3.0),
            wanted,
            errors,
            FDM,
            (to, None, None),
        )
        for body, wanted, to in (
            (fine_ball(1.0, 1.0, 0.7), target, downs),
            (fine_box(20.0, 20.0, 20.0), np.full(6, 1.0 / 6.0), SIDES),
        )
    ]
    rough, box = found
    assert rough.elsewhere > 0.1
    assert box.elsewhere < 0.001
    assert box.total_variation < 0.02 < 0.1 < rough.total_variation <= rough.nine_in_ten
    assert sum(rough.mean) + rough.elsewhere == pytest.approx(1.0)
    for each in found:
        assert each.method == "copies"
        assert set(each.by_error) == {*each.assumed, "layers"} - {"correlation_mm"}
