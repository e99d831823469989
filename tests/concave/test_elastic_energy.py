"""The elastic energy, compared with principal stretches, angles and finite differences."""

from __future__ import annotations

import numpy as np
import pytest
from common.bumpy import bent_capsule, bumpy_sphere

from dicedesign.concave.elastic_energy import ElasticEnergy
from dicedesign.errors import InputError
from dicedesign.geometry.sphere import rotation_between
from dicedesign.geometry.triangles import Surface
from dicedesign.runtime.arrays import Floats


def frame(corners: Floats) -> Floats:
    """(2, 2) edges of a triangle (3, 3) in a basis of its plane."""
    return np.linalg.qr((corners[1:] - corners[0]).T)[1]


def dihedral(points: Floats, hinge: list[int]) -> float:
    """Angle between the normals on the two sides of an edge."""
    start, end, left, right = points[hinge]
    first, second = np.cross(end - start, left - start), np.cross(start - end, right - end)
    angle = np.arccos(first @ second / np.linalg.norm(first) / np.linalg.norm(second))
    return float(np.copysign(angle, first @ (start - right)))


def test_energies_are_those_of_stretches_and_angles() -> None:
    surface, rng = bumpy_sphere(1), np.random.default_rng(1)
    points = surface.points + 0.05 * rng.normal(size=surface.points.shape)
    membrane = ElasticEnergy.of(surface, 1.0, 1e-300)
    expected = 0.0
    areas = []
    for triangle in surface.triangles:
        rest, now = frame(surface.points[triangle]), frame(points[triangle])
        stretches = np.linalg.svd(now @ np.linalg.inv(rest), compute_uv=False)
        areas.append(abs(np.linalg.det(rest)) / 2.0)
        ratio = stretches[0] / stretches[1]
        expected += areas[-1] * (0.5 * (ratio + 1.0 / ratio) - 1.0)
    assert membrane.value(points) == pytest.approx(expected / sum(areas), rel=1e-9)

    bending = ElasticEnergy.of(surface, 1e-300, 1.0)
    of_edge: dict[frozenset[int], list[int]] = {}
    for number, triangle in enumerate(surface.triangles.tolist()):
        for k in range(3):
            of_edge.setdefault(frozenset((triangle[k], triangle[k - 2])), []).append(number)
    expected = 0.0
    for edge, (one, other) in of_edge.items():
        triangle = surface.triangles[one].tolist()
        (left,) = set(triangle) - edge
        (right,) = set(surface.triangles[other].tolist()) - edge
        after = triangle.index(left)
        hinge = [triangle[after - 2], triangle[after - 1], left, right]
        change = dihedral(points, hinge) - dihedral(surface.points, hinge)
        squared = ((surface.points[hinge[0]] - surface.points[hinge[1]]) ** 2).sum()
        expected += 3.0 * squared / (areas[one] + areas[other]) * change**2
    assert bending.value(points) == pytest.approx(expected, rel=1e-9)


def test_the_reference_has_no_energy_in_any_place_and_size() -> None:
    surface = bent_capsule()
    energy = ElasticEnergy.of(surface, 1.0, 0.02)
    turn = rotation_between(np.array([1.0, 0.3, 0.2]), np.array([-0.2, 0.8, 0.1]))
    for points in (surface.points, 3.0 * surface.points @ turn.T + 7.0):
        assert energy.value(points) == pytest.approx(0.0, abs=1e-12)
        assert np.abs(energy.gradient(points)).max() < 1e-11


def test_gradient_and_hessian_of_the_whole_surface() -> None:
    surface = bumpy_sphere(1)
    rng = np.random.default_rng(5)
    energy = ElasticEnergy.of(surface, 1.0, 0.02)
    points = surface.points + 0.02 * rng.normal(size=surface.points.shape)
    direction = rng.normal(size=points.shape)
    step = 1e-6
    after, before = (energy.value(points + s * direction) for s in (step, -step))
    gradient = energy.gradient(points)
    assert (gradient * direction).sum() == pytest.approx((after - before) / (2.0 * step), rel=1e-6)
    dense = energy.hessian(points).toarray()
    np.testing.assert_allclose(dense, dense.T, atol=1e-12 * np.abs(dense).max())
    assert np.linalg.eigvalsh(dense).min() > -1e-12 * np.abs(dense).max()
    # At the reference nothing is projected.
    hessian = energy.hessian(surface.points)
    pulls = [energy.gradient(surface.points + s * direction) for s in (step, -step)]
    expected = ((pulls[0] - pulls[1]) / (2.0 * step)).ravel()
    np.testing.assert_allclose(
        hessian @ direction.ravel(), expected, atol=1e-6 * np.abs(expected).max()
    )


def test_a_flat_triangle_has_infinite_energy_and_is_no_reference() -> None:
    surface = bumpy_sphere(1)
    points = surface.points.copy()
    points[surface.triangles[3, 0]] = points[surface.triangles[3, 1]]
    assert ElasticEnergy.of(surface, 1.0, 0.02).value(points) == np.inf
    with pytest.raises(InputError, match="expected triangles with an area"):
        ElasticEnergy.of(Surface(points, surface.triangles), 1.0, 0.02)
