"""Spread of the odds of prints: the linear prediction against prints made one by one."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
import pytest
from common.made_up_die import SIDES, box

from dicedesign.fabricate.print_options import PrintErrors
from dicedesign.fabricate.print_tolerances import (
    NOTICED,
    ROLLS,
    OddsSlopes,
    OddsSpread,
    allowed_offset,
    print_tolerances,
)
from dicedesign.geometry.hulls.halfspaces import polyhedron_corners
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.meshes.body import make_body
from dicedesign.optimize.starts.repulsion import repulsion
from dicedesign.rest.outcomes import outcome_odds
from dicedesign.rest.poses import rest_poses
from dicedesign.throws.goodness_of_fit import chance_noticed
from tests.reference.perturbed_dice import PrintedDie, only

PRINTS = 600
ERRORS = PrintErrors(0.05, 0.01, 0.1, 200.0)


def die(seed: int) -> tuple[ConvexHull, np.ndarray]:
    """A body of about 30 mm, about its center of mass, and the normals of its rests."""
    rng = np.random.default_rng(seed)
    normals = convex_hull(repulsion(8, seed).points).normals
    points = polyhedron_corners(normals, rng.uniform(13.0, 16.0, size=8))
    hull = convex_hull(points - convex_hull(points).centroid)
    return hull, rest_poses(hull.vertices).normals


def spread(
    hull: ConvexHull, directions: np.ndarray, errors: PrintErrors = ERRORS, **options: bool
) -> OddsSpread:
    poses = rest_poses(hull.vertices)
    body = make_body(hull.vertices)
    slopes = OddsSlopes.of(body, poses, outcome_odds(poses, directions))
    return OddsSpread(slopes, errors, **options)


@pytest.mark.parametrize("name", [*asdict(ERRORS), "all"])
@pytest.mark.parametrize("seed", range(2))
def test_prints_spread_as_predicted(seed: int, name: str) -> None:
    hull, directions = die(seed)
    found = spread(hull, directions)
    covariance = found.covariance if name == "all" else found.by_error[name]
    errors = ERRORS if name == "all" else only(ERRORS, name)
    odds = PrintedDie(hull, directions).odds(errors, PRINTS, seed)
    printed = np.cov(odds.T)
    scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    # Of a sample covariance over the standard deviations: at most the root of 2 over the prints.
    noise = 4.5 * np.sqrt(2.0 / PRINTS)
    np.testing.assert_allclose(printed / scale, covariance / scale, atol=noise + 0.05)


def test_errors_add_up() -> None:
    hull, directions = die(3)
    found = spread(hull, directions)
    np.testing.assert_allclose(found.covariance, sum(found.by_error.values()), atol=1e-18)
    twice = spread(hull, directions, PrintErrors(*(2.0 * v for v in asdict(ERRORS).values())))
    np.testing.assert_allclose(twice.covariance, 4.0 * found.covariance, rtol=1e-12)
    assert not spread(hull, directions, PrintErrors(0.0, 0.0, 0.0, 0.0)).covariance.any()


def test_the_printer_s_axes_turn_with_the_print() -> None:
    """A die that lies on another side is the same die in turned coordinates."""
    hull, directions = die(1)
    turn = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    turned = spread(convex_hull(hull.vertices @ turn.T), directions @ turn.T).by_error
    slopes = spread(hull, directions).slopes
    lying = OddsSpread(slopes, ERRORS, axes=turn).by_error
    for name, covariance in lying.items():
        np.testing.assert_allclose(covariance, turned[name], atol=1e-12)
    name = "density_gradient"
    assert np.abs(lying[name] - spread(hull, directions).by_error[name]).max() > 1e-7


def test_corners_that_are_off_one_by_one() -> None:
    """Of a surface: its center of mass stays where it is."""
    hull, directions = die(2)
    found = spread(hull, directions, only(ERRORS, "dimensional_mm"), has_planes=False)
    rng = np.random.default_rng(2)
    odds = []
    for _ in range(PRINTS):
        moved = hull.vertices + ERRORS.dimensional_mm * rng.normal(size=hull.vertices.shape)
        odds.append(outcome_odds(rest_poses(moved, hull.centroid), directions).odds)
    printed = np.std(odds, axis=0)
    # Facets of more than three corners break, and come to rest on either part: one outcome.
    np.testing.assert_allclose(printed / np.sqrt(np.diag(found.covariance)), 1.0, atol=0.2)


def test_what_is_allowed_is_what_the_test_just_lets_through() -> None:
    hull, directions = die(0)
    found = spread(hull, directions)
    target = outcome_odds(rest_poses(hull.vertices), directions).odds
    still = np.zeros(len(target))
    told = print_tolerances(found, target, still)
    assert told.allowed_mm is not None
    covariance = told.allowed_mm**2 * found.by_unit_offset
    assert chance_noticed(target, ROLLS, covariance, still) == pytest.approx(NOTICED, abs=1e-4)
    assert told.noticed == chance_noticed(target, ROLLS, found.covariance, still)
    assert f"±{told.allowed_mm:.2g} mm" in told.answer
    np.testing.assert_allclose(told.deviations, np.sqrt(np.diag(found.covariance)))
    drawn = np.random.default_rng(5).multivariate_normal(still, found.covariance, size=100_000)
    expected = np.abs(drawn).sum(axis=1).mean() / 2.0
    assert told.total_variation == pytest.approx(expected, rel=0.02)


def test_a_die_twice_as_large_may_be_twice_as_far_off() -> None:
    hull, directions = die(0)
    target = outcome_odds(rest_poses(hull.vertices), directions).odds
    still = np.zeros(len(target))
    small = allowed_offset(spread(hull, directions), target, still)
    large = allowed_offset(spread(convex_hull(2.0 * hull.vertices), directions), target, still)
    assert large == pytest.approx(2.0 * small, rel=1e-4)


def test_a_die_that_is_off_already_can_not_be_printed_well_enough() -> None:
    hull, directions = die(0)
    target = outcome_odds(rest_poses(hull.vertices), directions).odds
    bias = np.zeros(len(target))
    bias[:2] = 0.05, -0.05
    told = print_tolerances(spread(hull, directions), target, bias)
    assert told.allowed_mm == 0.0
    assert "however well" in told.answer


def test_one_outcome_is_never_off() -> None:
    hull = convex_hull(box(20.0, 20.0, 20.0))
    found = spread(hull, SIDES[:1])
    told = print_tolerances(found, np.ones(1), np.zeros(1))
    assert told.allowed_mm is None
    assert told.noticed == 0.0
    assert "however far" in told.answer
