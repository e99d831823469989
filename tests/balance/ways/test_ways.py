"""Cavities, infill and weights that put a center of mass in its place, by their files."""

from __future__ import annotations

import io

import numpy as np
import pytest
import trimesh
from common.boxes import box

from dicedesign.balance.ways.cavity import CAVITY
from dicedesign.balance.ways.infill import INFILL
from dicedesign.balance.ways.material import Material
from dicedesign.balance.ways.way import Made, Way
from dicedesign.balance.ways.weights import WEIGHTS
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.geometry.triangles import winding_number

SIZES = np.array([30.0, 40.0, 50.0])

BLOCK = box(SIZES)

MIDDLE = SIZES / 2.0

WALL = 2.0


def read(made: Made, rest: str = "") -> trimesh.Trimesh:
    """A file, by other code than what wrote it."""
    return trimesh.load(io.BytesIO(made.files[rest]), file_type="stl")


def depths(points: np.ndarray) -> np.ndarray:
    """Within the block: the distance from its nearest side."""
    return np.minimum(points, SIZES - points).min(axis=-1)


@pytest.mark.parametrize("shift", [(3.0, 0.0, 0.0), (1.0, -2.0, 2.5)])
def test_a_cavity(shift: tuple[float, float, float]) -> None:
    made = CAVITY.make(BLOCK, MIDDLE + shift, Material(wall_mm=WALL))
    mesh = read(made)
    assert mesh.is_watertight
    np.testing.assert_allclose(mesh.center_mass, MIDDLE + shift, atol=1e-5)
    np.testing.assert_allclose(made.center, mesh.center_mass, atol=1e-9)
    inner = mesh.vertices[depths(mesh.vertices) > 1e-3]
    assert made.wall_mm is not None
    assert depths(inner).min() == pytest.approx(made.wall_mm, abs=1e-5)
    assert made.wall_mm >= WALL
    assert made.facts["cavity_mm3"] == pytest.approx(SIZES.prod() - mesh.volume, rel=1e-6)


def test_a_cavity_with_a_drain() -> None:
    center, diameter = MIDDLE + np.array([2.0, 1.0, -2.0]), 4.0
    made = CAVITY.make(BLOCK, center, Material(wall_mm=WALL, drain_mm=diameter))
    mesh = read(made)
    np.testing.assert_allclose(mesh.center_mass, center, atol=1e-5)
    # One surface, a ball's but for the hole: the cavity is open to the outside.
    assert mesh.is_watertight
    assert mesh.body_count == 1
    assert mesh.euler_number == 2
    # A box still, so that the hull and what it stands on are the same.
    np.testing.assert_allclose(mesh.convex_hull.volume, SIZES.prod(), rtol=1e-6)
    (hole,) = made.facts["drains"]
    mouth, inward = np.array(hole["mouth"]), np.array(hole["inward"])
    assert depths(mouth) == pytest.approx(0.0, abs=1e-4)
    # All along the axis there is nothing, from the outside to the cavity and beyond.
    along = mouth + np.linspace(0.01, hole["length_mm"] + 0.3, 7)[:, None] * inward
    corners = np.asarray(mesh.triangles)
    assert [round(winding_number(place, corners)) for place in along] == [0] * 7
    # Walls elsewhere are as they are wanted.
    aside = np.linalg.norm(np.cross(mesh.vertices - mouth, inward), axis=1)
    inner = mesh.vertices[(depths(mesh.vertices) > 1e-3) & (aside > 0.6 * diameter)]
    assert depths(inner).min() >= 0.99 * WALL


def test_two_infills() -> None:
    center = MIDDLE + np.array([1.0, -1.5, 2.0])
    less, more = 0.1, 0.7
    made = INFILL.make(BLOCK, center, Material(wall_mm=WALL, infill=(less, more)))
    np.testing.assert_allclose(made.center, center, atol=1e-5)
    outside, sparse = read(made), read(made, "_sparse.stl")
    np.testing.assert_allclose(outside.volume, SIZES.prod(), rtol=1e-6)
    # By cubes of a quarter of a millimeter, with the exact depth within a box. The part is convex.
    axes = [np.arange(0.125, size, 0.25) for size in SIZES]
    cubes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    hull = convex_hull(np.asarray(sparse.vertices), single_precision=True)
    is_sparse = (hull.depths(cubes) > 0.0).all(axis=1)
    density = np.where(depths(cubes) < WALL, 1.0, np.where(is_sparse, less, more))
    np.testing.assert_allclose(density @ cubes / density.sum(), center, atol=0.05)


def test_weights() -> None:
    center = MIDDLE + np.array([0.5, 0.8, -1.0])
    material = Material(wall_mm=WALL, weights_mm=(6.0, 8.0), density=1.2, weight_density=7.5)
    made = WEIGHTS.make(BLOCK, center, material)
    mesh = read(made)
    assert mesh.is_watertight
    balls = np.array(made.facts["weights"])
    diameter = made.facts["diameter_mm"]
    assert diameter in (6.0, 8.0)
    # Masses and moments by hand: what is printed, and the balls.
    ball = np.pi / 6.0 * diameter**3 * 7.5
    printed = mesh.volume * 1.2
    moment = printed * mesh.center_mass + ball * balls.sum(axis=0)
    mass = printed + len(balls) * ball
    np.testing.assert_allclose(moment / mass, center, atol=1e-5)
    np.testing.assert_allclose(made.center, center, atol=1e-5)
    assert made.facts["mass_g"] == pytest.approx(mass / 1000.0)
    # Each ball has its place, and nothing is nearer to the outside than the wall.
    pockets = mesh.vertices[depths(mesh.vertices) > 1e-3]
    distances = np.linalg.norm(pockets[:, None] - balls[None], axis=-1)
    assert distances.min() >= 0.5 * diameter
    assert depths(pockets).min() >= WALL - 1e-4
    between = np.linalg.norm(balls[:, None] - balls[None], axis=-1)[np.triu_indices(len(balls), 1)]
    assert (between > diameter + WALL).all()
    # A ball can be put in: straight above it is nothing up to where the print stops.
    assert sorted({round(place[2] + 0.5 * diameter + 0.15, 2) for place in balls}) == list(
        made.facts["stops_mm"]
    )


@pytest.mark.parametrize("way", [CAVITY, INFILL, WEIGHTS])
def test_what_is_within_reach_can_be_made(way: Way) -> None:
    material = Material(wall_mm=WALL)
    shifts = way.reach(BLOCK, material)
    assert (shifts.heights(np.zeros(3)) > 0.0).all()
    for direction in ([1.0, 0.2, 0.1], [-0.2, -1.0, 0.4]):
        toward = shifts.vertices[np.argmax(shifts.vertices @ direction)]
        center = MIDDLE + 0.6 * toward
        made = way.make(BLOCK, center.astype(np.float64), material)
        np.testing.assert_allclose(made.center, center, atol=1e-4)


@pytest.mark.parametrize("way", [CAVITY, INFILL, WEIGHTS])
def test_walls_that_leave_no_room(way: Way) -> None:
    with pytest.raises(InputError, match="wall_mm"):
        way.reach(BLOCK, Material(wall_mm=20.0))


@pytest.mark.parametrize("way", [CAVITY, INFILL, WEIGHTS])
def test_a_place_too_far_away(way: Way) -> None:
    with pytest.raises(InputError, match=r"expected .* got"):
        way.make(BLOCK, MIDDLE + np.array([13.0, 0.0, 0.0]), Material(wall_mm=WALL))


def test_a_drain_larger_than_any_side() -> None:
    with pytest.raises(InputError, match=r"drain_mm: expected .*; reduce drain_mm"):
        CAVITY.make(
            BLOCK, MIDDLE + np.array([2.0, 0.0, 0.0]), Material(wall_mm=WALL, drain_mm=45.0)
        )


def test_nothing_is_made_where_nothing_is_to_be_moved() -> None:
    made = CAVITY.make(BLOCK, MIDDLE, Material(wall_mm=WALL))
    assert read(made).volume == pytest.approx(SIZES.prod())
    assert made.wall_mm is None


@pytest.mark.parametrize(
    ("entries", "said"),
    [
        ({"wall_mm": 0.0}, "wall_mm: expected a number from 0.05"),
        ({"wall_mm": float("nan")}, "wall_mm"),
        ({"drain_mm": -1.0}, "drain_mm"),
        ({"infill": (0.5, 0.5)}, "infill: expected two parts .* lesser first"),
        ({"infill": (0.5,)}, "infill"),
        ({"weights_mm": ()}, "weights_mm: expected from 1 to 20 diameters"),
        ({"weights_mm": (0.0,)}, "weights_mm"),
        ({"density": 8.0}, "weight_density: expected more than the 8 g/cm3"),
    ],
)
def test_materials_that_are_none(entries: dict[str, object], said: str) -> None:
    with pytest.raises(InputError, match=said):
        Material(**entries)  # type: ignore[arg-type]


def test_a_leaning_block_keeps_its_outside() -> None:
    body = box((20.0, 30.0, 40.0), (12.0, 5.0, 0.0))
    surface = Surface(body.points.astype(np.float32).astype(np.float64), body.triangles)
    made = CAVITY.make(surface, surface.centroid + np.array([1.0, 0.5, -1.0]), Material())
    hull = convex_hull(made.body.points, single_precision=True)
    assert {tuple(corner) for corner in hull.vertices} == {tuple(c) for c in surface.points}
