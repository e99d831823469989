"""The balance of a filled surface: where its center of mass goes, and that its hull stays."""

from __future__ import annotations

import numpy as np
import pytest
from common.bumpy import bent_capsule, bumpy_sphere
from numpy.typing import NDArray

from dicedesign.concave.fill.balance import BalanceOptions, balance
from dicedesign.concave.fill.elastic_energy import ElasticEnergy, ElasticWeights
from dicedesign.concave.fill.result import FillStatus, FillStep
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.surfaces.surface import Surface

Floats = NDArray[np.float64]


def test_derivatives_of_the_centroid_by_finite_differences() -> None:
    surface = bumpy_sphere(1)
    rng = np.random.default_rng(10)
    way = rng.normal(size=surface.points.shape)
    step = 1e-6
    after, before = (surface.moved(surface.points + s * way).centroid for s in (step, -step))
    derivatives = surface.centroid_derivatives()
    expected = (after - before) / (2.0 * step)
    np.testing.assert_allclose(np.tensordot(derivatives, way, 2), expected, rtol=1e-7)


def test_a_centroid_moves_and_grows_with_its_surface() -> None:
    surface = bent_capsule()
    derivatives = surface.centroid_derivatives()
    np.testing.assert_allclose(derivatives.sum(axis=1), np.eye(3), atol=1e-12)
    grown = np.tensordot(derivatives, surface.points, 2)
    np.testing.assert_allclose(grown, surface.centroid, atol=1e-12)


@pytest.mark.parametrize("way", [[-0.02, 0.0, 0.0], [0.004, -0.01, 0.003]])
def test_the_center_of_mass_is_met_and_the_hull_stays(way: list[float]) -> None:
    surface = bent_capsule(18, 10)
    hull = convex_hull(surface.points)
    center = surface.centroid + surface.diagonal * np.array(way)
    steps: list[FillStep] = []
    result = balance(surface, surface, hull, center, BalanceOptions(), on_step=steps.append)
    assert result.status is FillStatus.FITTED
    assert result.converged
    found = surface.moved(result.points)
    assert np.linalg.norm(found.centroid - center) < 1e-12 * surface.diagonal
    after = convex_hull(result.points)
    np.testing.assert_array_equal(after.source, hull.source)
    np.testing.assert_array_equal(after.vertices, hull.vertices)
    assert tuple(steps) == result.history
    assert [step.step for step in steps] == list(range(len(steps)))
    assert all(step.outside < 1e-14 for step in steps)
    assert set(steps[0].terms) == {"centering", "membrane", "bending"}
    moved = np.linalg.norm(result.points - surface.points, axis=1) / surface.diagonal
    assert moved.max() < 0.2


def test_the_elastic_energy_is_kept_low_on_the_way() -> None:
    """Newton's method alone, from where it starts at once, leaves a rougher surface."""
    surface = bent_capsule(14, 8)
    hull = convex_hull(surface.points)
    center = surface.centroid - np.array([0.015, 0.0, 0.0]) * surface.diagonal
    energy = ElasticEnergy.of(surface, ElasticWeights(1.0, 0.2))
    costs = []
    for steps, growth in ((30, 3.0), (1, 1e6)):
        options = BalanceOptions(energy.weights, steps=steps, growth=growth)
        result = balance(surface, surface, hull, center, options)
        assert result.converged
        costs.append(sum(energy.terms(result.points).values()))
    assert costs[0] < 0.8 * costs[1]


def test_a_balanced_surface_stays_as_it_is() -> None:
    surface = bumpy_sphere()
    hull = convex_hull(surface.points)
    result = balance(surface, surface, hull, surface.centroid, BalanceOptions())
    assert result.converged
    assert len(result.history) <= 3
    np.testing.assert_allclose(result.points, surface.points, atol=1e-12)


def test_a_convex_surface_cannot_be_balanced() -> None:
    """All its points are corners of the hull and stay."""
    surface = bumpy_sphere(1)
    convex = surface.moved(surface.points - surface.centroid)
    convex = convex.moved(convex.points / np.linalg.norm(convex.points, axis=1)[:, None])
    hull = convex_hull(convex.points)
    result = balance(convex, convex, hull, np.array([0.05, 0.0, 0.0]), BalanceOptions())
    assert result.status is FillStatus.NO_PROGRESS
    assert not result.converged
    assert "design the hull nearer" in result.message
    np.testing.assert_array_equal(result.points, convex.points)


def test_a_center_of_mass_outside_the_hull_is_refused() -> None:
    surface = bumpy_sphere()
    away = surface.centroid + surface.diagonal
    with pytest.raises(InputError, match="center of mass: expected one inside the hull"):
        balance(surface, surface, convex_hull(surface.points), away, BalanceOptions())


def test_units_do_not_matter() -> None:
    surface = bent_capsule(14, 8)
    center = surface.centroid - np.array([0.01, 0.0, 0.0]) * surface.diagonal
    large = Surface(1e3 * surface.points, surface.triangles)
    results = [
        balance(body, body, convex_hull(body.points), place, BalanceOptions())
        for body, place in ((surface, center), (large, 1e3 * center))
    ]
    np.testing.assert_allclose(results[1].points, 1e3 * results[0].points, rtol=1e-6, atol=1e-3)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"centering": 0.0}, "centering: expected a positive number, got 0"),
        ({"growth": 1.0}, "growth: expected a number above 1, got 1"),
        ({"steps": 0}, "steps: expected a whole number above 0, got 0"),
        ({"tolerance": 1e-13}, "tolerance: expected a number from 1e-12 on and below 1"),
    ],
)
def test_options_out_of_range(options: dict[str, float], text: str) -> None:
    with pytest.raises(InputError, match=text):
        BalanceOptions(**options)  # type: ignore[arg-type]
