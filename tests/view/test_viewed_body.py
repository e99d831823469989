"""A dragged body has the probabilities of the model, stable row numbers, and a center inside."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import dicedesign as dd
from dicedesign.geometry.meshes.body import make_body
from dicedesign.throws.momentum_model import momentum_model
from dicedesign.view.viewed_body import Outcomes, ViewedBody, facet_vertices

BLOCK = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.5, 1.5) for z in (-2.0, 2.0)])


@pytest.fixture
def viewed(random_points: Callable[..., np.ndarray]) -> ViewedBody:
    return ViewedBody.of(make_body(random_points(3, 40, (1.0, 1.1, 0.9))))


def by_number(viewed: ViewedBody) -> dict[str, float]:
    return {row.label: row.probability for row in viewed.rows}


def test_a_moved_center_has_the_probabilities_of_the_model(viewed: ViewedBody) -> None:
    place = viewed.center + 0.05
    moved, outside = viewed.with_center(place)
    assert not outside
    expected = dd.rest_poses(viewed.hull.vertices, place)
    probabilities = sorted(by_number(moved).values())
    np.testing.assert_allclose(probabilities, np.sort(expected.probabilities), atol=1e-12)
    np.testing.assert_array_equal(moved.center, place)


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_a_center_dragged_outside_stays_inside(size: float) -> None:
    viewed = ViewedBody.of(make_body(size * BLOCK))
    moved, outside = viewed.with_center(size * np.array([50.0, 10.0, 0.0]))
    assert outside
    assert moved.hull.heights(moved.center).min() > 0.0
    np.testing.assert_allclose(moved.center / size, [0.999, 0.1998, 0.0], atol=1e-12)


def test_a_center_that_is_not_finite_is_refused(viewed: ViewedBody) -> None:
    with pytest.raises(dd.InputError, match="three finite numbers"):
        viewed.with_center(np.array([0.0, np.nan, 0.0]))


def test_rests_keep_their_numbers_while_the_center_moves(viewed: ViewedBody) -> None:
    moved, ranks_changed = viewed, 0
    for step in np.linspace(0.02, 0.2, 9):
        before = dict(zip(moved.poses.facets.tolist(), moved.numbers.tolist(), strict=True))
        last = moved.poses.facets.tolist()
        moved, _ = moved.with_center(viewed.center + np.array([0.0, 0.0, step]))
        now = dict(zip(moved.poses.facets.tolist(), moved.numbers.tolist(), strict=True))
        assert len(set(now.values())) == len(now)
        assert all(now[facet] == before[facet] for facet in now.keys() & before.keys())
        ranks_changed += moved.poses.facets.tolist() != last
    assert ranks_changed > 5


def test_a_block_with_a_facet_pulled_is_a_longer_block() -> None:
    viewed = ViewedBody.of(make_body(BLOCK))
    assert viewed.has_uniform_center
    top = int(viewed.hull.normals[:, 2].argmax())
    vertices = facet_vertices(viewed.hull, top)
    moved = viewed.with_vertices(vertices, viewed.hull.vertices[vertices] + [0.0, 0.0, 1.0])
    longer = BLOCK * [1.0, 1.0, 1.25]
    np.testing.assert_allclose(
        np.sort(list(by_number(moved).values())), np.sort(dd.rest_poses(longer).probabilities)
    )
    np.testing.assert_allclose(moved.center, [0.0, 0.0, 0.5], atol=1e-12)
    assert moved.is_dragged


def test_a_pulled_corner_has_the_probabilities_of_the_model(viewed: ViewedBody) -> None:
    points = viewed.hull.vertices.copy()
    points[5] *= 1.5
    moved = viewed.with_vertices(np.array([5]), points[5])
    probabilities = np.sort(list(by_number(moved).values()))
    np.testing.assert_allclose(
        probabilities, np.sort(dd.rest_poses(points).probabilities), atol=1e-12
    )
    assert len(moved.hull.vertices) < len(points)


def test_a_center_that_was_moved_stays_in_place(viewed: ViewedBody) -> None:
    put, _ = viewed.with_center(viewed.center + 0.03)
    assert not put.has_uniform_center
    moved = put.with_vertices(np.array([2]), 1.2 * put.hull.vertices[2])
    np.testing.assert_array_equal(moved.center, put.center)
    again = moved.with_uniform_center()
    np.testing.assert_allclose(again.center, dd.rest_poses(moved.hull.vertices).center_of_mass)


def test_a_hull_pulled_flat_is_refused() -> None:
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.3, 0.3, 1.0]])
    viewed = ViewedBody.of(make_body(corners))
    apex = int(viewed.hull.vertices[:, 2].argmax())
    with pytest.raises(dd.DegenerateBodyError):
        viewed.with_vertices(np.array([apex]), np.array([0.3, 0.3, 0.0]))


def test_rows_of_a_die_are_its_outcomes() -> None:
    directions = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
    outcomes = Outcomes(("a", "b", "c", "d"), directions, np.full(4, 0.25))
    viewed = ViewedBody.of(make_body(BLOCK), outcomes=outcomes)
    expected = dd.rest_poses(BLOCK)
    probabilities = [
        float(expected.probabilities[(expected.normals @ way).argmax()]) for way in directions
    ]
    assert [row.label for row in viewed.rows] == ["a", "b", "c", "d", "other"]
    np.testing.assert_allclose(
        [row.probability for row in viewed.rows], [*probabilities, 1.0 - sum(probabilities)]
    )
    assert [row.target for row in viewed.rows] == [0.25, 0.25, 0.25, 0.25, None]
    for row, way in enumerate(directions):
        (rest,) = np.flatnonzero(viewed.row_of_rest == row)
        np.testing.assert_allclose(viewed.poses.normals[rest], way, atol=1e-12)


def test_outcomes_with_several_faces_are_their_sums() -> None:
    directions = np.concatenate([np.eye(3), -np.eye(3)])
    outcome_of = np.array([0, 0, 1, 0, 1, 1])
    outcomes = Outcomes(("a", "b"), directions, np.full(2, 0.5), outcome_of=outcome_of)
    viewed = ViewedBody.of(make_body(BLOCK), outcomes=outcomes)
    for body in (viewed, viewed.with_center(np.array([0.1, 0.2, 0.3]))[0]):
        expected = dd.rest_poses(BLOCK, body.center)
        faces = outcome_of[(expected.normals @ directions.T).argmax(axis=1)]
        assert [row.label for row in body.rows] == ["a", "b"]
        np.testing.assert_allclose(
            [row.probability for row in body.rows], np.bincount(faces, expected.probabilities)
        )


def test_throw_probabilities_are_those_of_the_model() -> None:
    body = make_body(BLOCK)
    viewed = ViewedBody.of(body)
    thrown = viewed.throw_probabilities(momentum_model("board-game"))
    expected = dd.throw_probabilities(body, viewed.poses, "board-game")
    np.testing.assert_allclose(thrown, expected)
    moved, _ = viewed.with_center(np.array([0.0, 0.0, 0.7]))
    inertia = np.diag([1.5**2 + 2.0**2, 1.0 + 2.0**2, 1.0 + 1.5**2]) / 3.0
    np.testing.assert_allclose(moved.rigid.inertia, inertia, atol=1e-12)
    assert moved.throw_probabilities(momentum_model("board-game")).sum() == pytest.approx(1.0)


def test_a_die_under_a_prior_keeps_it_while_it_is_dragged() -> None:
    """The prior has no effect on throws."""
    directions = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]])
    outcomes = Outcomes(("low", "high"), directions, None, "vmf:0,0,-1:2")
    viewed = ViewedBody.of(make_body(BLOCK), outcomes=outcomes)
    moved, _ = viewed.with_center(np.array([0.1, 0.0, 0.3]))
    for body in (viewed, moved):
        expected = dd.rest_poses(BLOCK, body.center)
        under = expected.under("vmf:0,0,-1:2")
        probabilities = [
            float(under.probabilities[(under.normals @ way).argmax()]) for way in directions
        ]
        np.testing.assert_allclose([row.probability for row in body.rows[:2]], probabilities)
        thrown = dd.throw_probabilities(make_body(BLOCK), expected, "board-game")
        landed = [float(thrown[(expected.normals @ way).argmax()]) for way in directions]
        np.testing.assert_allclose(
            body.throw_probabilities(momentum_model("board-game"))[:2], landed, rtol=0.0, atol=1e-9
        )
