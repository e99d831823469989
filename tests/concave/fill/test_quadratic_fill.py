"""The hull fill by quadratic programs on small surfaces."""

from __future__ import annotations

import sys
from importlib.util import find_spec

import numpy as np
import pytest
from common.bumpy import bent_capsule, bumpy_sphere, nearby_hull

from dicedesign.concave.fill import quadratic_fill
from dicedesign.concave.fill.elastic_energy import ElasticEnergy
from dicedesign.concave.fill.quadratic_fill import fill_by_quadratic_programs
from dicedesign.concave.fill.result import FillResult, FillStatus
from dicedesign.concave.fill.space_elasticity import Elasticity, HeldCorners
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Floats

needs_clarabel = pytest.mark.skipif(
    find_spec("clarabel") is None,
    reason="the optional extra 'concave' is not installed",
)


def fill(
    surface: Surface, hull: ConvexHull, center: Floats | None = None
) -> tuple[FillResult, list[float]]:
    """Filled with the corners of the surface's own hull, which the hull is made of, and with its
    center of mass where it is wanted, or where the corners alone would take it."""
    corners = convex_hull(surface.points).source[hull.source]
    if center is None:
        held = HeldCorners(Elasticity(surface), corners)
        followed = held.followed(hull.vertices - surface.points[corners])
        center = surface.moved(surface.points + followed).centroid
    energies: list[float] = []
    result = fill_by_quadratic_programs(surface, hull, corners, center, energies.append)
    assert energies[-1] == result.energy
    np.testing.assert_array_equal(result.points[corners], hull.vertices)
    # The surface's hull is the wanted one to the last bit, and nothing is outside.
    spanned = convex_hull(result.points).vertices
    assert sorted(spanned.tolist()) == sorted(hull.vertices.tolist())
    middle = hull.vertices.mean(axis=0)
    slacks = hull.heights(middle) - (result.points - middle) @ hull.normals.T
    assert slacks.min() > -1e-14 * surface.diagonal
    return result, energies


@needs_clarabel
@pytest.mark.parametrize(
    ("surface", "amount"), [(bumpy_sphere(), 0.04), (bent_capsule(18, 10), 0.02)]
)
def test_the_hull_is_the_wanted_one(surface: Surface, amount: float) -> None:
    result, _ = fill(surface, nearby_hull(surface, amount))
    assert result.status is FillStatus.FITTED
    assert result.message == "reached what was wanted"
    moved = np.linalg.norm(result.points - surface.points, axis=1) / surface.diagonal
    assert moved.mean() < 1.5 * amount
    assert moved.max() < 3.0 * amount


@needs_clarabel
def test_the_elastic_energy_is_least() -> None:
    """No move of the points that are off the hull lowers it and keeps the center of mass."""
    surface = bumpy_sphere()
    hull = nearby_hull(surface, 0.03)
    result, _ = fill(surface, hull)
    pulls = ElasticEnergy.of(surface).gradient(result.points)
    slacks = (hull.heights(np.zeros(3)) - result.points @ hull.normals.T).min(axis=1)
    free = slacks > 0.01 * surface.diagonal
    assert free.sum() > 20
    center = surface.moved(result.points).centroid_derivatives()[:, free].reshape(3, -1).T
    held, *_ = np.linalg.lstsq(center, pulls[free].ravel(), rcond=None)
    left = (pulls[free].ravel() - center @ held).reshape(-1, 3)
    lengths = np.linalg.norm(pulls[~free], axis=1)
    assert np.linalg.norm(left, axis=1).max() < 0.02 * lengths.max()


@needs_clarabel
def test_its_own_hull_leaves_a_surface_as_it_is() -> None:
    surface = bumpy_sphere()
    result, _ = fill(surface, convex_hull(convex_hull(surface.points).vertices))
    assert result.converged
    np.testing.assert_allclose(result.points, surface.points, atol=1e-3 * surface.diagonal)


@needs_clarabel
def test_the_center_of_mass_is_met_to_first_order() -> None:
    surface = bent_capsule(18, 10)
    center = surface.centroid - np.array([0.015, 0.0, 0.0]) * surface.diagonal
    result, _ = fill(surface, nearby_hull(surface, 0.03), center)
    assert result.converged
    reached = surface.moved(result.points).centroid
    assert np.linalg.norm(reached - center) < 1e-4 * surface.diagonal


@needs_clarabel
def test_a_hull_far_away_from_the_surface() -> None:
    """The surface begins in the hull wherever it was."""
    surface = bumpy_sphere()
    hull = convex_hull(convex_hull(surface.points).vertices + 100.0)
    result, _ = fill(surface, hull, surface.centroid + 100.0)
    assert result.converged
    np.testing.assert_allclose(result.points, surface.points + 100.0, atol=0.01)


def test_without_clarabel_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "clarabel", None)
    surface = bumpy_sphere(1)
    with pytest.raises(InputError, match=r"pip install 'dicedesign\[concave\]'"):
        fill(surface, nearby_hull(surface, 0.02))


@needs_clarabel
def test_what_is_said_when_it_ends_before(monkeypatch: pytest.MonkeyPatch) -> None:
    surface = bent_capsule(14, 8)
    monkeypatch.setattr(quadratic_fill, "MOST_STEPS", 1)
    center = surface.centroid - np.array([0.02, 0.0, 0.0]) * surface.diagonal
    result, _ = fill(surface, nearby_hull(surface, 0.03), center)
    assert result.status is FillStatus.STEP_LIMIT
    assert not result.converged
    assert "allow more steps" in result.message


@needs_clarabel
def test_a_program_that_cannot_be_solved() -> None:
    """Its right sides are no numbers."""
    surface = bumpy_sphere(1)
    hull = nearby_hull(surface, 0.05)
    corners = convex_hull(surface.points).source[hull.source]
    nowhere = np.full(3, np.nan)
    result = fill_by_quadratic_programs(surface, hull, corners, nowhere, lambda energy: None)
    assert result.status is FillStatus.UNSOLVED
    assert "remesh the surface" in result.message
