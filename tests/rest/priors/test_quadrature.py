"""Adaptive quadrature, against polynomials, closed forms and its own errors."""

from __future__ import annotations

import numpy as np
import pytest

from dicedesign.geometry.sphere import signed_solid_angle
from dicedesign.rest.quadrature import COARSE, NODES, WEIGHTS, integrals, triangle_integrals


def test_the_rules_are_exact_for_as_many_powers_as_they_should() -> None:
    for power in range(24):
        exact = 1.0 / (power + 1)
        assert WEIGHTS @ NODES**power == pytest.approx(exact, abs=1e-15)
        if power < 14:
            assert COARSE @ NODES**power == pytest.approx(exact, abs=1e-15)
    assert abs(COARSE @ NODES**14 - 1.0 / 15.0) > 1e-10


def test_peaks_and_kinks_and_empty_intervals() -> None:
    widths = np.array([1.0, 1e-3, 1e-6])

    def peak(rows: np.ndarray, x: np.ndarray) -> np.ndarray:
        w = widths[rows, None]
        return np.stack([w / (w**2 + x**2), np.sqrt(np.abs(x))], axis=-1)

    edges = np.array([[0.0, 0.0, 2.0]] * 3)
    values, errors = integrals(peak, edges, 1e-13)
    np.testing.assert_allclose(values[:, 0], np.arctan(2.0 / widths), rtol=1e-12)
    np.testing.assert_allclose(values[:, 1], 2.0**1.5 * 2.0 / 3.0, rtol=1e-12)
    assert errors.max() < 1e-11


def test_areas_of_triangles_with_their_signs() -> None:
    corners = np.random.default_rng(0).normal(size=(20, 3, 3))
    # Of a triangle through the far side of the sphere the flat one tells nothing.
    corners[:, :, 2] = np.abs(corners[:, :, 2])
    values, errors = triangle_integrals(lambda u: np.ones(len(u)), corners, 1e-12)
    exact = signed_solid_angle(corners[:, 0], corners[:, 1], corners[:, 2], np)
    assert (np.abs(values - exact) <= errors + 1e-14).all()
    np.testing.assert_allclose(values, exact, atol=1e-12)
    flat = np.array([[[1.0, 0, 0], [0, 1.0, 0], [1.0, 1.0, 0]]])
    assert triangle_integrals(lambda u: np.ones(len(u)), flat, 1e-12)[0].tolist() == [0.0]
