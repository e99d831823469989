"""Cavities and infill that move a center of mass, by their files."""

from __future__ import annotations

import io

import numpy as np
import pytest
import trimesh
from common.bodies import box

from dicedesign.balance.options import BodyMaterial
from dicedesign.balance.ways import MovedCenter, move_center, reachable_shifts
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.triangles import winding_number

SIZES = np.array([30.0, 40.0, 50.0])

BLOCK = box(SIZES)

MIDDLE = SIZES / 2.0

WALL = 2.0


def read(balanced: MovedCenter, rest: str = "") -> trimesh.Trimesh:
    """Read a file by another library."""
    return trimesh.load(io.BytesIO(balanced.files[rest]), file_type="stl")


def depths(points: np.ndarray) -> np.ndarray:
    """Distances from the nearest side of the block."""
    return np.minimum(points, SIZES - points).min(axis=-1)


def test_a_cavity() -> None:
    shift = np.array([1.0, -2.0, 2.5])
    balanced = move_center(BLOCK, MIDDLE + shift, "cavity", BodyMaterial(wall_mm=WALL))
    mesh = read(balanced)
    assert mesh.is_watertight
    np.testing.assert_allclose(mesh.center_mass, MIDDLE + shift, atol=1e-5)
    np.testing.assert_allclose(balanced.center, mesh.center_mass, atol=1e-9)
    inner = mesh.vertices[depths(mesh.vertices) > 1e-3]
    assert balanced.wall_mm is not None
    assert depths(inner).min() == pytest.approx(balanced.wall_mm, abs=1e-5)
    assert balanced.wall_mm >= WALL
    assert balanced.facts["cavity_mm3"] == pytest.approx(SIZES.prod() - mesh.volume, rel=1e-6)


def test_a_cavity_with_a_drain() -> None:
    center, diameter = MIDDLE + np.array([2.0, 1.0, -2.0]), 4.0
    balanced = move_center(BLOCK, center, "cavity", BodyMaterial(wall_mm=WALL, drain_mm=diameter))
    mesh = read(balanced)
    np.testing.assert_allclose(mesh.center_mass, center, atol=1e-5)
    # One surface of genus 0: the cavity is open to the outside.
    assert mesh.is_watertight
    assert mesh.body_count == 1
    assert mesh.euler_number == 2
    # The hull is unchanged.
    np.testing.assert_allclose(mesh.convex_hull.volume, SIZES.prod(), rtol=1e-6)
    (hole,) = balanced.facts["drains"]
    mouth, inward = np.array(hole["mouth"]), np.array(hole["inward"])
    assert depths(mouth) == pytest.approx(0.0, abs=1e-4)
    # The axis is empty from the outside into the cavity.
    along = mouth + np.linspace(0.01, hole["length_mm"] + 0.3, 7)[:, None] * inward
    corners = np.asarray(mesh.triangles)
    assert [round(winding_number(place, corners)) for place in along] == [0] * 7
    # Walls away from the hole have the wanted thickness.
    aside = np.linalg.norm(np.cross(mesh.vertices - mouth, inward), axis=1)
    inner = mesh.vertices[(depths(mesh.vertices) > 1e-3) & (aside > 0.6 * diameter)]
    assert depths(inner).min() >= 0.99 * WALL


def test_two_infills() -> None:
    center = MIDDLE + np.array([1.0, -1.5, 2.0])
    less, more = 0.1, 0.7
    balanced = move_center(BLOCK, center, "infill", BodyMaterial(wall_mm=WALL, infill=(less, more)))
    np.testing.assert_allclose(balanced.center, center, atol=1e-5)
    outside, sparse = read(balanced), read(balanced, "_sparse.stl")
    np.testing.assert_allclose(outside.volume, SIZES.prod(), rtol=1e-6)
    # By cubes of 0.5 mm, with exact depths in a box. The sparse part is convex.
    axes = [np.arange(0.25, size, 0.5) for size in SIZES]
    cubes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    hull = convex_hull(np.asarray(sparse.vertices), single_precision=True)
    is_sparse = (hull.depths(cubes) > 0.0).all(axis=1)
    density = np.where(depths(cubes) < WALL, 1.0, np.where(is_sparse, less, more))
    np.testing.assert_allclose(density @ cubes / density.sum(), center, atol=0.05)


@pytest.mark.parametrize("way", ["cavity", "infill"])
def test_a_center_within_reach_can_be_made(way: str) -> None:
    material = BodyMaterial(wall_mm=WALL)
    shifts = reachable_shifts(BLOCK, way, material)
    assert (shifts.heights(np.zeros(3)) > 0.0).all()
    toward = shifts.vertices[np.argmax(shifts.vertices @ [-0.2, -1.0, 0.4])]
    center = MIDDLE + 0.6 * toward
    balanced = move_center(BLOCK, center.astype(np.float64), way, material)
    np.testing.assert_allclose(balanced.center, center, atol=1e-4)


def test_a_center_out_of_reach_of_infill() -> None:
    with pytest.raises(InputError, match=r"expected .* got"):
        move_center(
            BLOCK, MIDDLE + np.array([13.0, 0.0, 0.0]), "infill", BodyMaterial(wall_mm=WALL)
        )


def test_a_drain_larger_than_any_side() -> None:
    center = MIDDLE + np.array([2.0, 0.0, 0.0])
    with pytest.raises(InputError, match=r"drain_mm: expected .*; reduce drain_mm"):
        move_center(BLOCK, center, "cavity", BodyMaterial(wall_mm=WALL, drain_mm=45.0))
