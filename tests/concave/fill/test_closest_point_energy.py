"""The closest point energy against a plain transcription of eq. 28, and finite differences."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from common.bumpy import bumpy_sphere, nearby_hull

from dicedesign.concave.paper_fill import ClosestPointEnergy
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Floats

SURFACE = bumpy_sphere(1)
CORNERS = nearby_hull(bumpy_sphere(2), 0.05).vertices


def transcribed(points: Floats) -> float:
    """`sum_p |p - CP(p)|^2`, one corner and one triangle after the other."""
    total = 0.0
    for corner in CORNERS:
        least = np.inf
        for triangle in SURFACE.triangles:
            foot = trimesh.triangles.closest_point(points[triangle][None], corner[None])[0]
            least = min(least, float(((corner - foot) ** 2).sum()))
        total += least
    return total


def energy_at(points: Floats) -> ClosestPointEnergy:
    return ClosestPointEnergy.of(Surface(points, SURFACE.triangles), CORNERS)


def test_the_energy_is_eq_28() -> None:
    assert energy_at(SURFACE.points).value(SURFACE.points) == pytest.approx(
        transcribed(SURFACE.points), rel=1e-12
    )


def test_its_gradient_is_that_of_the_true_distances() -> None:
    """To first order it does not matter that the closest points stay where they were."""
    rng = np.random.default_rng(2)
    gradient = energy_at(SURFACE.points).gradient(SURFACE.points)
    step = 1e-6
    for _ in range(4):
        way = rng.normal(size=SURFACE.points.shape)
        after, before = (transcribed(SURFACE.points + s * way) for s in (step, -step))
        slope = (after - before) / (2.0 * step)
        assert (gradient * way).sum() == pytest.approx(slope, rel=1e-5, abs=1e-7)


def test_gradient_and_hessian_tell_all_while_the_closest_points_stay() -> None:
    held = energy_at(SURFACE.points)
    move = 0.3 * np.random.default_rng(3).normal(size=SURFACE.points.shape)
    flat = move.ravel()
    change = (held.gradient(SURFACE.points) * move).sum() + 0.5 * flat @ (held.hessian @ flat)
    moved = SURFACE.points + move
    assert held.value(moved) == pytest.approx(held.value(SURFACE.points) + change, rel=1e-12)
    # Where they were is not nearer than where they are.
    assert held.value(moved) >= transcribed(moved)
