"""Which rests may become outcomes, and which of them which outcome."""

from __future__ import annotations

import numpy as np
import pytest
from common.bumpy import bumpy_sphere, unit
from common.dented_cube import CORNERS, NORMALS

from dicedesign import rest_poses
from dicedesign.concave.hull.outcome_directions import outcome_choices
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull


def bumpy_hull() -> ConvexHull:
    return convex_hull(unit(bumpy_sphere()).points)


def test_likelier_rests_become_likelier_outcomes() -> None:
    box = CORNERS * np.array([1.0, 0.8, 0.6]) / np.sqrt(2.0)
    target = np.array([0.03, 0.3, 0.1, 0.35, 0.04, 0.18])
    best = outcome_choices(convex_hull(box), target)[0]
    poses = rest_poses(box, center_of_mass=np.zeros(3))
    found = [poses.probabilities[np.argmax(poses.normals @ direction)] for direction in best]
    ranked = np.argsort(target)
    assert (np.diff(np.array(found)[ranked]) > -1e-12).all()
    np.testing.assert_allclose(sorted(map(tuple, best)), sorted(map(tuple, NORMALS)), atol=1e-15)


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_choices_are_of_unit_directions_far_apart(count: int) -> None:
    choices = outcome_choices(bumpy_hull(), np.full(count, 1.0 / count))
    assert len(choices) > 1
    for directions in choices:
        assert directions.shape == (count, 3)
        np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, rtol=1e-12)
        cosines = directions @ directions.T - 2.0 * np.eye(count)
        assert np.degrees(np.arccos(cosines.max(initial=-1.0))) >= 20.0
    assert len({tuple(sorted(map(tuple, choice.tolist()))) for choice in choices}) == len(choices)


def test_where_all_rests_are_wanted_that_is_the_first_choice() -> None:
    target = np.full(6, 1.0 / 6.0)
    best = outcome_choices(convex_hull(CORNERS / np.sqrt(3.0)), target)[0]
    np.testing.assert_allclose(sorted(map(tuple, best)), sorted(map(tuple, NORMALS)), atol=1e-15)


@pytest.mark.parametrize(("count", "degrees"), [(7, 20.0), (12, 20.0), (40, 10.0)])
def test_many_outcomes_are_spread_where_rests_are_too_close(count: int, degrees: float) -> None:
    for directions in outcome_choices(bumpy_hull(), np.full(count, 1.0 / count)):
        cosines = directions @ directions.T - 2.0 * np.eye(count)
        assert np.degrees(np.arccos(cosines.max())) > degrees


def test_more_outcomes_than_facets() -> None:
    """The facets could be split, up to the number that the text names."""
    cube = convex_hull(CORNERS / np.sqrt(3.0))
    for directions in outcome_choices(cube, np.full(12, 1.0 / 12.0)):
        assert (directions @ directions.T - 2.0 * np.eye(12)).max() < 0.9
    text = (
        "target: expected at most 12 outcomes for a hull of 8 corners, got 13; join some, or "
        "refine the surface with method.concave.points"
    )
    with pytest.raises(InputError, match=text):
        outcome_choices(cube, np.full(13, 1.0 / 13.0))
