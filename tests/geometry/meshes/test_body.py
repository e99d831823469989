"""What `make_body` accepts, welds and refuses."""

from __future__ import annotations

import re

import numpy as np
import pytest

from dicedesign.errors import DegenerateBodyError, InputError
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


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (
            [],
            "die: expected points as an (n, 3) array of real numbers, got shape (0,); pass one row",
        ),
        (np.empty((0, 3)), "got shape (0, 3)"),
        ([1.0, 2.0, 3.0], "got shape (3,)"),
        (np.zeros((5, 2)), "got shape (5, 2)"),
        (np.zeros((2, 5, 3)), "got shape (2, 5, 3)"),
        ([[1, 2, 3], [1, 2]], "got rows of different lengths"),
        ([["a", "b", "c"]] * 4, "got dtype <U1"),
        (np.zeros((4, 3), dtype=complex), "got dtype complex128"),
    ],
)
def test_wrong_points_are_refused(points: object, message: str) -> None:
    with pytest.raises(InputError, match=re.escape(message)):
        make_body(points, name="die")


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_points_that_are_not_finite_are_refused(value: float) -> None:
    points = np.array([*CORNERS, *CORNERS], dtype=np.float64)
    points[5, 1] = points[6, 2] = value
    with pytest.raises(DegenerateBodyError, match=r"die: .*, got \[1.* in point 5 \(2 of 8"):
        make_body(points, name="die")


@pytest.mark.parametrize("points", [CORNERS[:3], CORNERS[:3] * 4])
def test_fewer_than_four_distinct_points_are_refused(points: list[list[float]]) -> None:
    message = "die: expected at least 4 distinct points that span a solid, got 3; add points"
    with pytest.raises(DegenerateBodyError, match=message):
        make_body(points, name="die")


@pytest.mark.parametrize(
    ("triangles", "message"),
    [
        (
            [[0, 1, 2], [0, 1, 4]],
            "die: expected triangles of points 0 to 3, got point 4 in triangle 1; export",
        ),
        ([[0, -1, 2]], "got point -1 in triangle 0"),
        (
            [[0, 1, 2, 3]],
            "die: expected triangles as an (n, 3) array of integer numbers, got shape",
        ),
        ([[0.0, 1.0, 2.0]], "integer numbers, got dtype float64"),
    ],
)
def test_wrong_triangles_are_refused(triangles: object, message: str) -> None:
    with pytest.raises(InputError, match=re.escape(message)):
        make_body(CORNERS, triangles, name="die")


@pytest.mark.parametrize("scale", [1e-100, 1e60, 1e300])
def test_sizes_that_overflow_are_refused(scale: float) -> None:
    corners = scale * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    with pytest.raises(DegenerateBodyError, match="use another unit of length"):
        make_body(corners)
