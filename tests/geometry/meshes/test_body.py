"""What `make_body` accepts, welds and refuses."""

from __future__ import annotations

import numpy as np
import pytest

from dicedesign.geometry.meshes.body import is_rounded, make_body

CORNERS = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
TETRAHEDRON = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]


def test_float32_counts_as_single_precision_and_integers_do_not() -> None:
    assert make_body(np.array(CORNERS, dtype=np.float32)).single_precision
    assert make_body(np.array(CORNERS, dtype=np.float16)).single_precision
    assert not make_body(CORNERS).single_precision
    assert not make_body(np.array(CORNERS, dtype=np.float64)).single_precision
    assert make_body(CORNERS, single_precision=True).single_precision


@pytest.mark.parametrize("digits", [1, 6, 11, 12, 13, 15])
def test_decimal_digits_are_counted_at_every_magnitude(digits: int) -> None:
    rng = np.random.default_rng(digits)
    numbers = rng.integers(10 ** (digits - 1), 10**digits, size=(400, 3))
    numbers[:, 0] -= numbers[:, 0] % 10 - 1  # no trailing zero
    for exponent in (-300, -40, -23, -22, -12, -6, 0, 3, 20, 250):
        points = np.array([[float(f"{n}e{exponent}") for n in row] for row in numbers.tolist()])
        assert is_rounded(points) == (digits <= 12), exponent
        assert is_rounded(-points) == (digits <= 12), exponent


def test_welding_keeps_the_first_of_equal_positions_and_ignores_the_sign_of_zero() -> None:
    points = np.array([[2.0, 0, 0], [1, 0, 0], [2, -0.0, 0], [1, 0, 1e-300], [1, 0, 0], [0, 1, 0]])
    body = make_body(points, np.array([[0, 1, 3], [2, 4, 3], [0, 2, 3], [5, 1, 2]]))
    np.testing.assert_array_equal(body.points, points[[0, 1, 3, 5]])
    np.testing.assert_array_equal(body.triangles, [[0, 1, 2], [0, 1, 2], [3, 1, 0]])
    assert len(make_body(points).points) == 4


def test_stray_points_and_collapsed_triangles_are_dropped_with_a_note() -> None:
    points = [*CORNERS, [9, 9, 9], [0, 0, 0]]
    body = make_body(points, [*TETRAHEDRON, [0, 1, 5]])
    np.testing.assert_array_equal(body.points, CORNERS)
    np.testing.assert_array_equal(body.triangles, TETRAHEDRON)
    assert body.notes == (
        "ignored 1 points that are on no triangle",
        "welded 1 points to others at equal positions",
        "dropped 1 triangles with a repeated corner",
    )
