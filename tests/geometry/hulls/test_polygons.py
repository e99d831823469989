"""The largest circle in a polygon, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.polygons import inscribed_circle


def regular(corners: int, circumradius: float) -> np.ndarray:
    angles = 2 * np.pi * np.arange(corners) / corners
    return circumradius * np.column_stack([np.cos(angles), np.sin(angles)])


@pytest.mark.parametrize("corners", [3, 4, 5, 6, 11])
@pytest.mark.parametrize("turn", [1, -1])
def test_inscribed_circle_of_regular_polygons(corners, turn):
    shift = np.array([40.0, -7.0])
    center, radius = inscribed_circle(regular(corners, 5.0)[::turn] + shift)
    assert radius == pytest.approx(5.0 * math.cos(math.pi / corners), rel=1e-9)
    np.testing.assert_allclose(center, shift, atol=1e-8)


def test_inscribed_circle_of_a_right_triangle():
    center, radius = inscribed_circle(np.array([(0.0, 0.0), (4.0, 0.0), (0.0, 3.0)]))
    assert radius == pytest.approx(1.0)
    np.testing.assert_allclose(center, (1.0, 1.0), atol=1e-9)


@pytest.mark.parametrize("width", [1e-3, 3.0, 1e4])
def test_inscribed_circle_of_a_rectangle_lies_in_its_middle(width):
    rectangle = np.array([(0.0, 0.0), (10.0, 0.0), (10.0, 2.0), (0.0, 2.0)]) * width
    center, radius = inscribed_circle(rectangle)
    assert radius == pytest.approx(width)
    np.testing.assert_allclose(center, (5.0 * width, width), rtol=1e-7)


@pytest.mark.parametrize(
    "polygon",
    [np.zeros((3, 2)), np.zeros((2, 2)), np.zeros((3, 3)), np.array([(0, 0), (1, 0), (np.nan, 1)])],
)
def test_inscribed_circle_refuses_what_is_no_polygon(polygon):
    with pytest.raises(InputError, match=r"^polygon: expected"):
        inscribed_circle(polygon)
