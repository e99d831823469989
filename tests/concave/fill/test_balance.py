"""The balance of a filled surface: where its center of mass goes, and that its hull stays."""

from __future__ import annotations

import numpy as np
import pytest
from common.bumpy import ball, bent_capsule, bumpy_sphere

from dicedesign.concave.fill.balance import balance
from dicedesign.concave.fill.result import FillStatus
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.surfaces.surface import Surface


def ignored(energy: float) -> None:
    """No step is looked at."""


@pytest.mark.parametrize("way", [[-0.02, 0.0, 0.0], [0.004, -0.01, 0.003]])
def test_the_center_of_mass_is_met_and_the_hull_stays(way: list[float]) -> None:
    surface = bent_capsule(18, 10)
    hull = convex_hull(surface.points)
    center = surface.centroid + surface.diagonal * np.array(way)
    energies: list[float] = []
    result = balance(surface, surface, hull, center, energies.append)
    assert result.status is FillStatus.FITTED
    assert result.converged
    found = surface.moved(result.points)
    assert np.linalg.norm(found.centroid - center) < 1e-12 * surface.diagonal
    after = convex_hull(result.points)
    np.testing.assert_array_equal(after.source, hull.source)
    np.testing.assert_array_equal(after.vertices, hull.vertices)
    assert energies[-1] == result.energy
    moved = np.linalg.norm(result.points - surface.points, axis=1) / surface.diagonal
    assert moved.max() < 0.2


def test_a_balanced_surface_stays_as_it_is() -> None:
    surface = bumpy_sphere()
    hull = convex_hull(surface.points)
    result = balance(surface, surface, hull, surface.centroid, ignored)
    assert result.converged
    np.testing.assert_allclose(result.points, surface.points, atol=1e-12)


def test_a_convex_surface_cannot_be_balanced() -> None:
    """All its points are corners of the hull and stay."""
    convex = ball(1)
    hull = convex_hull(convex.points)
    result = balance(convex, convex, hull, np.array([0.05, 0.0, 0.0]), ignored)
    assert result.status is FillStatus.NO_PROGRESS
    assert not result.converged
    assert "design the hull nearer" in result.message
    np.testing.assert_array_equal(result.points, convex.points)


def test_units_do_not_matter() -> None:
    surface = bent_capsule(14, 8)
    center = surface.centroid - np.array([0.01, 0.0, 0.0]) * surface.diagonal
    large = Surface(1e3 * surface.points, surface.triangles)
    results = [
        balance(body, body, convex_hull(body.points), place, ignored)
        for body, place in ((surface, center), (large, 1e3 * center))
    ]
    np.testing.assert_allclose(results[1].points, 1e3 * results[0].points, rtol=1e-6, atol=1e-3)
