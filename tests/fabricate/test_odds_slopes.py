"""Derivatives of a box's odds in what can go wrong with it, against closed forms.

The rests of a box with its center of mass near the middle are its faces as that center sees them:
each face's odds are its solid angle over the whole sphere's.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
import pytest

from dicedesign.fabricate.print_tolerances import OddsSlopes
from dicedesign.geometry.meshes.body import make_body
from dicedesign.rest.outcomes import outcome_odds
from dicedesign.rest.poses import rest_poses

FACES = np.concatenate([np.eye(3), -np.eye(3)])
HALF = np.array([9.0, 10.0, 12.0])


def slopes(low: np.ndarray, high: np.ndarray, given: np.ndarray | None = None) -> OddsSlopes:
    """Those of the box between two corners, with one outcome for each face."""
    body = make_body(np.array(list(product(*np.stack([low, high], axis=1)))))
    poses = rest_poses(body, given)
    return OddsSlopes.of(body, poses, outcome_odds(poses, FACES))


def rectangle(depth: float, sides: tuple[float, float], others: tuple[float, float]) -> float:
    """Solid angle of a rectangle that far away, from distances of its sides from the foot on it."""
    return sum(
        float(np.arctan(x * y / (depth * np.sqrt(depth**2 + x * x + y * y))))
        for x, y in product(sides, others)
    )


def box_odds(low: np.ndarray, high: np.ndarray, center: np.ndarray) -> np.ndarray:
    """(6,) by the closed form."""
    up, down = high - center, center - low
    found = []
    for depths in (up, down):
        for axis in range(3):
            b, c = (axis + 1) % 3, (axis + 2) % 3
            found.append(rectangle(depths[axis], (down[b], up[b]), (down[c], up[c])))
    return np.array(found) / (4.0 * np.pi)


def difference(odds_at: Callable[[float], np.ndarray], step: float = 1e-3) -> np.ndarray:
    """Derivative at 0 of a function of one number, by central differences of fourth order."""
    near, far = odds_at(step) - odds_at(-step), odds_at(2 * step) - odds_at(-2 * step)
    return (8.0 * near - far) / (12.0 * step)


def test_the_closed_form_is_that_of_the_forward_model() -> None:
    center = np.array([0.3, -0.2, 0.4])
    body = make_body(np.array(list(product(*np.stack([-HALF, HALF], axis=1)))))
    odds = outcome_odds(rest_poses(body, center), FACES).odds
    np.testing.assert_allclose(box_odds(-HALF, HALF, center), odds, atol=1e-12)


@pytest.mark.parametrize("offset", [np.zeros(3), np.array([5.0, -3.0, 100.0])])
def test_a_center_of_mass_that_moves(offset: np.ndarray) -> None:
    found = slopes(offset - HALF, offset + HALF)
    expected = [difference(lambda t, e=e: box_odds(-HALF, HALF, t * e)) for e in np.eye(3)]
    np.testing.assert_allclose(found.by_center, np.stack(expected, axis=1), atol=1e-10)
    assert found.volume == pytest.approx(8.0 * HALF.prod())
    np.testing.assert_allclose(found.inside, np.diag(HALF**2 / 3.0), atol=1e-9)


@pytest.mark.parametrize("given", [None, np.array([0.5, 0.2, -0.3])], ids=["uniform", "given"])
def test_faces_that_are_off(given: np.ndarray | None) -> None:
    found = slopes(-HALF, HALF, given)
    columns = np.argmax(found.hull.normals @ FACES.T, axis=1)
    for facet, face in enumerate(columns):
        axis = FACES[face]

        def moved(t: float, axis: np.ndarray = axis) -> np.ndarray:
            low = -HALF + t * np.minimum(axis, 0.0)
            high = HALF + t * np.maximum(axis, 0.0)
            center = (low + high) / 2.0 if given is None else given
            return box_odds(low, high, center)

        np.testing.assert_allclose(found.by_offsets[:, facet], difference(moved), atol=1e-10)


def test_axes_that_shrink() -> None:
    found = slopes(-HALF, HALF)
    expected = [
        difference(lambda t, e=e: box_odds(-HALF * (1 + t * e), HALF * (1 + t * e), np.zeros(3)))
        for e in np.eye(3)
    ]
    stretches = found.by_stretches(np.eye(3))
    np.testing.assert_allclose(stretches, np.stack(expected, axis=1), atol=1e-10)
    # A die that shrinks as a whole keeps its odds.
    np.testing.assert_allclose(stretches.sum(axis=1), 0.0, atol=1e-12)
    # Axes in another order, the printer's own.
    np.testing.assert_allclose(found.by_stretches(np.eye(3)[[2, 0, 1]]), stretches[:, [2, 0, 1]])


def test_a_density_that_grows_to_the_top() -> None:
    """From 1 - g/2 at the bottom of a box 2 c high to 1 + g/2 at its top the center of mass is at
    g c / 6."""
    found = slopes(-HALF, HALF)
    up = np.array([0.0, 0.0, 1.0])
    expected = difference(lambda g: box_odds(-HALF, HALF, g * HALF[2] / 6.0 * up))
    np.testing.assert_allclose(found.by_gradient(up), expected, atol=1e-10)
    assert found.by_gradient(up)[2] > 0.0 > found.by_gradient(up)[5]


def test_a_bubble_anywhere() -> None:
    """Its place has the variance a^2 / 3 along a half extent a, and the center of mass moves by its
    part of the volume."""
    found = slopes(-HALF, HALF)
    part = 1.0 / (8.0 * HALF.prod())
    expected = found.by_center @ np.diag(part**2 * HALF**2 / 3.0) @ found.by_center.T
    np.testing.assert_allclose(found.of_bubble(), expected, atol=1e-18)


def test_rests_of_one_outcome_count_together_and_others_not_at_all() -> None:
    body = make_body(np.array(list(product(*np.stack([-HALF, HALF], axis=1)))))
    poses = rest_poses(body)
    whole = slopes(-HALF, HALF)
    some = OddsSlopes.of(body, poses, outcome_odds(poses, FACES[[0, 2]]))
    np.testing.assert_allclose(some.by_center, whole.by_center[[0, 2]], atol=1e-15)
