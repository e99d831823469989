"""The largest circle in a polygon, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from dicedesign.geometry.hulls.polygons import inscribed_box, inscribed_circle


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


@pytest.mark.parametrize("width", [1e-3, 3.0, 1e4])
def test_inscribed_circle_of_a_rectangle_is_in_its_middle(width):
    rectangle = np.array([(0.0, 0.0), (10.0, 0.0), (10.0, 2.0), (0.0, 2.0)]) * width
    center, radius = inscribed_circle(rectangle)
    assert radius == pytest.approx(width)
    np.testing.assert_allclose(center, (5.0 * width, width), rtol=1e-7)


def largest_factor_by_search(polygon: np.ndarray, size: tuple[float, float]) -> float:
    """Largest factor over a fine grid of middles, by the distances of a box's corners from the
    edges."""
    edges = np.roll(polygon, -1, axis=0) - polygon
    outward = np.column_stack([edges[:, 1], -edges[:, 0]])
    signs = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    reach = (outward @ (0.5 * signs * size).T).max(axis=1)
    low, high = polygon.min(axis=0), polygon.max(axis=0)
    best, middle = 0.0, 0.5 * (low + high)
    for _ in range(6):
        x, y = (np.linspace(low[k], high[k], 41) for k in range(2))
        grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        factors = (np.einsum("ij,ij->i", outward, polygon) - grid @ outward.T) / reach
        best = max(best, float(factors.min(axis=1).max()))
        middle = grid[factors.min(axis=1).argmax()]
        low, high = middle - 0.1 * (high - low), middle + 0.1 * (high - low)
    return best


@pytest.mark.parametrize("seed", range(12))
def test_inscribed_box_is_the_largest_by_search(seed):
    rng = np.random.default_rng(seed)
    count = 40 if seed == 11 else int(rng.integers(3, 9))
    angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, count))
    if np.diff(angles, append=angles[0] + 2.0 * np.pi).max() > 0.9 * np.pi:
        angles = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False) + angles[0]
    polygon = np.column_stack([3.0 * np.cos(angles), 2.0 * np.sin(angles)]) + rng.normal(size=2)
    size = (float(rng.uniform(0.3, 3.0)), 1.0)
    center, factor = inscribed_box(polygon, size)
    assert factor == pytest.approx(largest_factor_by_search(polygon, size), rel=1e-3)
    # Its corners are inside, and one of them on an edge.
    signs = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    corners = center + 0.5 * factor * signs * size
    edges = np.roll(polygon, -1, axis=0) - polygon
    inward = np.column_stack([-edges[:, 1], edges[:, 0]])
    inward /= np.linalg.norm(inward, axis=1, keepdims=True)
    distances = np.einsum("pfk,fk->pf", corners[:, None] - polygon, inward)
    assert distances.min() == pytest.approx(0.0, abs=1e-8)
    # A margin is the distance from the edges that are left, a rim that of the box of factor 1.
    center, smaller = inscribed_box(polygon, size, margin=0.2)
    corners = center + 0.5 * smaller * signs * size
    distances = np.einsum("pfk,fk->pf", corners[:, None] - polygon, inward)
    assert distances.min() == pytest.approx(0.2, abs=1e-8)
    assert inscribed_box(polygon, size, rim=0.2 / smaller)[1] == pytest.approx(smaller, rel=1e-6)
