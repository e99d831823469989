"""Spread of the probabilities of prints: linear prediction against simulated prints."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
import pytest
from common.made_up_die import box
from scipy import stats

from dicedesign.fabricate.print_tolerances import (
    AXES,
    NOTICED,
    ROLLS,
    ProbabilitySpread,
    print_tolerances,
)
from dicedesign.fabricate.printers import PrintErrors
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull, polyhedron_corners
from dicedesign.geometry.meshes.body import make_body
from dicedesign.optimize.starts.shapes import repulsion
from dicedesign.rest.outcomes import outcome_probabilities
from dicedesign.rest.poses import rest_poses
from dicedesign.throws.goodness_of_fit import chance_noticed
from tests.reference.perturbed_dice import PrintedDie

FACES = np.concatenate([np.eye(3), -np.eye(3)])
HALF = np.array([9.0, 10.0, 12.0])


def spread(given: np.ndarray | None = None, axes: np.ndarray = AXES) -> ProbabilitySpread:
    """Spread of a box with one outcome for each face."""
    body = make_body(np.array(list(product(*np.stack([-HALF, HALF], axis=1)))))
    return ProbabilitySpread.of(body, rest_poses(body, given), FACES, PrintErrors(), axes=axes)


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


def difference(probabilities_at: Callable[[float], np.ndarray], step: float = 1e-3) -> np.ndarray:
    """Derivative at 0 of a function of one number, by central differences of fourth order."""
    near, far = (
        probabilities_at(step) - probabilities_at(-step),
        probabilities_at(2 * step) - probabilities_at(-2 * step),
    )
    return (8.0 * near - far) / (12.0 * step)


@pytest.mark.parametrize("given", [None, np.array([0.5, 0.2, -0.3])], ids=["uniform", "given"])
def test_derivatives_in_the_offsets_of_faces(given: np.ndarray | None) -> None:
    box_spread = spread(given)
    columns = np.argmax(box_spread.poses.hull.normals @ FACES.T, axis=1)
    for facet, face in enumerate(columns):
        axis = FACES[face]

        def moved(t: float, axis: np.ndarray = axis) -> np.ndarray:
            low = -HALF + t * np.minimum(axis, 0.0)
            high = HALF + t * np.maximum(axis, 0.0)
            center = (low + high) / 2.0 if given is None else given
            return box_probabilities(low, high, center)

        np.testing.assert_allclose(box_spread.by_offsets[:, facet], difference(moved), atol=1e-10)


def test_derivatives_in_stretches() -> None:
    expected = [
        difference(
            lambda t, e=e: box_probabilities(-HALF * (1 + t * e), HALF * (1 + t * e), np.zeros(3))
        )
        for e in np.eye(3)
    ]
    stretches = spread().by_stretches
    np.testing.assert_allclose(stretches, np.stack(expected, axis=1), atol=1e-10)
    # A die that shrinks as a whole keeps its probabilities.
    np.testing.assert_allclose(stretches.sum(axis=1), 0.0, atol=1e-12)
    # Axes in another order, the printer's own.
    other = spread(axes=np.eye(3)[[2, 0, 1]])
    np.testing.assert_allclose(other.by_stretches, stretches[:, [2, 0, 1]])


def test_derivatives_in_a_density_gradient() -> None:
    """From 1 - g/2 at the bottom of a box 2 c high to 1 + g/2 at its top the center of mass is at
    g c / 6."""
    slopes, up = spread().by_gradient, np.array([0.0, 0.0, 1.0])
    expected = difference(lambda g: box_probabilities(-HALF, HALF, g * HALF[2] / 6.0 * up))
    np.testing.assert_allclose(slopes, expected, atol=1e-10)
    assert slopes[2] > 0.0 > slopes[5]


HOUSE = np.concatenate([box(20.0, 20.0, 20.0), [[0.0, 0.0, 21.0]]])
"""Corners of a cube with a roof whose sides are barely rests."""


def chance(points: np.ndarray, directions: np.ndarray, offset: float, prints: int) -> float:
    """Share of prints that the test notices, by the noncentral chi-square of each."""
    right = outcome_probabilities(rest_poses(points), directions).probabilities
    die = PrintedDie(convex_hull(points), directions)
    probabilities = die.probabilities(PrintErrors(offset, 0.0, 0.0, 0.0), prints, 11)
    noncentral = ROLLS * ((probabilities - right) ** 2 / right).sum(axis=1)
    critical = stats.chi2.isf(0.05, len(right) - 1)
    return float(stats.ncx2.sf(critical, len(right) - 1, noncentral + 1e-12).mean())


def test_a_die_about_to_lose_a_rest_gets_a_checked_offset() -> None:
    poses = rest_poses(HOUSE)
    sides = poses.normals
    probabilities, still = outcome_probabilities(poses, sides).probabilities, np.zeros(len(sides))
    house = ProbabilitySpread.of(make_body(HOUSE), poses, sides, PrintErrors())
    trusting = print_tolerances(house, probabilities, still, is_checked=False)
    careful = print_tolerances(house, probabilities, still)
    assert trusting.allowed_mm is not None
    assert careful.allowed_mm is not None
    assert chance(HOUSE, sides, trusting.allowed_mm, 200) > 0.2
    assert careful.allowed_mm < 0.8 * trusting.allowed_mm
    assert chance(HOUSE, sides, careful.allowed_mm, 200) < 0.16
    assert careful.deviations == trusting.deviations


PRINTS = 600
ERRORS = PrintErrors(0.05, 0.01, 0.1, 200.0)


def die(seed: int) -> tuple[ConvexHull, np.ndarray]:
    """A body of about 30 mm, about its center of mass, and the normals of its rests."""
    rng = np.random.default_rng(seed)
    normals = convex_hull(repulsion(8, seed).points).normals
    points = polyhedron_corners(normals, rng.uniform(13.0, 16.0, size=8))
    hull = convex_hull(points - convex_hull(points).centroid)
    return hull, rest_poses(hull.vertices).normals


@pytest.fixture(scope="module")
def spread_of_design() -> tuple[ProbabilitySpread, np.ndarray]:
    """Spread of a die's probabilities, and the probabilities."""
    hull, directions = die(0)
    poses = rest_poses(hull.vertices)
    prints = ProbabilitySpread.of(make_body(hull.vertices), poses, directions, ERRORS)
    return prints, outcome_probabilities(poses, directions).probabilities


def test_prints_spread_as_predicted(spread_of_design: tuple[ProbabilitySpread, np.ndarray]) -> None:
    covariance = spread_of_design[0].covariance
    probabilities = PrintedDie(*die(0)).probabilities(ERRORS, PRINTS, 0)
    scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    # The standard error of a sample correlation is at most the root of 2 over the prints.
    noise = 4.5 * np.sqrt(2.0 / PRINTS)
    np.testing.assert_allclose(
        np.cov(probabilities.T) / scale, covariance / scale, atol=noise + 0.05
    )


def test_the_allowed_offset_is_noticed_in_a_tenth_of_prints(
    spread_of_design: tuple[ProbabilitySpread, np.ndarray],
) -> None:
    prints, target = spread_of_design
    still = np.zeros(len(target))
    result = print_tolerances(prints, target, still, is_checked=False)
    assert result.allowed_mm is not None
    covariance = result.allowed_mm**2 * prints.by_unit_offset
    assert chance_noticed(target, ROLLS, covariance, still) == pytest.approx(NOTICED, abs=1e-4)
    assert result.noticed == chance_noticed(target, ROLLS, prints.covariance, still)
    assert f"within about {result.allowed_mm:.2g} mm" in result.answer
    np.testing.assert_allclose(result.deviations, np.sqrt(np.diag(prints.covariance)))
    drawn = np.random.default_rng(5).multivariate_normal(still, prints.covariance, size=100_000)
    expected = np.abs(drawn).sum(axis=1).mean() / 2.0
    assert result.total_variation == pytest.approx(expected, rel=0.02)


def test_a_biased_die_has_no_allowed_offset(
    spread_of_design: tuple[ProbabilitySpread, np.ndarray],
) -> None:
    prints, target = spread_of_design
    bias = np.zeros(len(target))
    bias[:2] = 0.05, -0.05
    result = print_tolerances(prints, target, bias, is_checked=False)
    assert result.allowed_mm == 0.0
    assert "however well" in result.answer
