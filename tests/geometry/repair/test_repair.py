"""Meshes broken in every way come back as the closed surface of one solid, near what they were."""

from __future__ import annotations

import sys

import numpy as np
import pytest
import trimesh
from common.bumpy import ball, bent_capsule, bumpy_sphere, pushed_through
from common.paths import public_data
from manifold3d import Manifold

from dicedesign.errors import DegenerateBodyError, InputError
from dicedesign.geometry.manifold import solid
from dicedesign.geometry.meshes.body import Body, make_body
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.geometry.repair.repair import RepairedMesh, repaired
from dicedesign.geometry.surfaces.closed_surface import make_surface
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.rest.poses import rest_poses
from dicedesign.runtime.arrays import Floats, Integers

CELL = 0.01
"""Side of the grid's cells, over the longest side."""


def body_of(points: Floats, triangles: Integers) -> Body:
    return make_body(points, triangles, name="thing")


def joined(*surfaces: Surface) -> Body:
    starts = np.cumsum([0, *(len(surface.points) for surface in surfaces)])
    return body_of(
        np.concatenate([surface.points for surface in surfaces]),
        np.concatenate([s.triangles + n for s, n in zip(surfaces, starts, strict=False)]),
    )


def moved(surface: Surface, x: float, y: float = 0.0, z: float = 0.0) -> Surface:
    return surface.moved(surface.points + np.array([x, y, z]))


def scaled(surface: Surface, scale: float) -> Surface:
    return surface.moved(scale * surface.points)


def fixed(body: Body) -> RepairedMesh:
    """Repaired, and taken as the surface of one solid, with nothing left to repair."""
    made = repaired(body)
    surface = made.surface
    _, notes = make_surface(body_of(surface.points, surface.triangles))
    assert notes == ()
    assert surface.volume > 0.0
    assert 1 - (len(surface.points) - len(surface.triangles) // 2) // 2 == made.numbers.handles
    return made


def assert_near(made: RepairedMesh, original: Surface) -> None:
    """The surface encloses nearly the same solid."""
    assert made.surface.volume == pytest.approx(original.volume, rel=0.01)
    off = np.abs(made.surface.centroid - original.centroid).max()
    assert off < 0.3 * CELL * np.ptp(original.points)


@pytest.mark.parametrize("original", [bumpy_sphere(3), bent_capsule()])
def test_a_surface_with_holes_is_closed(original: Surface) -> None:
    rng = np.random.default_rng(0)
    kept = rng.random(len(original.triangles)) > 0.05
    made = fixed(body_of(original.points, original.triangles[kept]))
    assert_near(made, original)
    assert made.numbers.handles_before is None
    assert made.numbers.off_mean < 1e-3
    assert made.numbers.missed_mean < 5e-4


def test_the_odds_of_a_repaired_surface_are_near_those_of_the_original() -> None:
    """Those of lying on either flat side, and on either half of the arc."""
    original = bent_capsule()
    kept = np.random.default_rng(1).random(len(original.triangles)) > 0.03
    surface = fixed(body_of(original.points, original.triangles[kept])).surface
    sides = np.array([[0, 0, -1], [0, 0, 1], [0.97, 0, 0.26], [0.97, 0, -0.26]])

    def odds(own: Surface) -> Floats:
        poses = rest_poses(body_of(own.points, own.triangles))
        near = poses.normals @ sides.T > np.cos(np.radians(15.0))
        return poses.probabilities @ near

    assert odds(original).sum() == pytest.approx(1.0)
    np.testing.assert_allclose(odds(surface), odds(original), atol=0.02)


def test_triangles_wound_at_random_and_repeated_do_not_matter() -> None:
    original = bumpy_sphere(3)
    rng = np.random.default_rng(2)
    flipped = rng.random(len(original.triangles)) < 0.3
    triangles = np.where(flipped[:, None], original.triangles[:, ::-1], original.triangles)
    triangles = np.concatenate([triangles, triangles[rng.random(len(triangles)) < 0.2]])[40:]
    assert_near(fixed(body_of(original.points, triangles)), original)


def test_a_surface_with_two_sides_is_taken_once() -> None:
    original = bumpy_sphere(3)
    both = np.concatenate([original.triangles, original.triangles[:, ::-1]])
    made = fixed(body_of(original.points, both[:-2]))
    assert_near(made, original)


def test_two_overlapping_balls_are_one_solid() -> None:
    """Two caps of height 1 - d / 2 are missing from two whole balls."""
    distance = 1.2
    made = fixed(joined(ball(4), moved(ball(4), distance)))
    cap = 1.0 - distance / 2.0
    lens = 2.0 * np.pi * cap**2 * (3.0 - cap) / 3.0
    assert made.surface.volume == pytest.approx(8.0 / 3.0 * np.pi - lens, rel=0.01)
    assert (made.numbers.pieces, made.numbers.cavities, made.numbers.thin) == (1, 0, 0.0)
    assert np.abs(made.surface.centroid - [distance / 2.0, 0.0, 0.0]).max() < 0.005


def test_three_shells_are_their_union() -> None:
    ring = trimesh.creation.torus(0.9, 0.2, major_sections=60, minor_sections=24)
    shells = [
        moved(bumpy_sphere(3), -5.0, 2.0, -1.0),
        moved(scaled(ball(4), 0.7), 1.2, 0.3, 0.1),
        Surface(ring.vertices + np.array([1.9, 0.3, 0.4]), np.asarray(ring.faces)),
    ]
    union = Manifold()
    for shell in shells:
        union += solid(shell.points, shell.triangles)
    made = fixed(joined(*shells))
    assert made.surface.volume == pytest.approx(union.volume(), rel=0.01)
    assert made.numbers.handles == union.genus()
    assert made.numbers.missed_mean < 1e-3


def test_a_surface_that_meets_itself_is_untied() -> None:
    """A finger that comes out on the other side has its walls inside out there."""
    made = fixed(joined(pushed_through()))
    inside = 4.0 / 3.0 * np.pi
    assert 0.7 * inside < made.surface.volume < inside
    assert made.numbers.handles == 1  # the finger has become a hole


def test_cavities_are_filled_and_small_pieces_dropped() -> None:
    inner = scaled(ball(3), 0.5)
    cavity = Surface(inner.points, inner.triangles[:, ::-1])
    pebble = moved(scaled(ball(3), 0.3), 1.6)
    made = fixed(joined(ball(4), cavity, pebble))
    assert made.surface.volume == pytest.approx(4.0 / 3.0 * np.pi, rel=0.01)
    assert made.numbers.pieces == 2
    assert made.numbers.dropped == pytest.approx(0.027 / 1.027, rel=0.05)
    # The far side of what was dropped is that far away.
    diagonal = np.linalg.norm([2.9, 2.0, 2.0])
    assert made.numbers.missed_largest == pytest.approx(0.9 / diagonal, rel=0.02)


def test_a_wall_between_two_bodies_is_none() -> None:
    box = trimesh.creation.box((1.0, 0.8, 0.6)).subdivide()
    first = Surface(np.asarray(box.vertices), np.asarray(box.faces))
    made = fixed(joined(first, moved(first, 1.0)))
    assert made.surface.volume == pytest.approx(2.0 * 0.48, rel=0.01)
    assert made.numbers.pieces == 1


def test_thin_parts_are_thickened() -> None:
    """A ball with two blades of a fifth of a cell, neither torn nor lost."""
    blade = trimesh.creation.box((4.0, 1.0, 0.008))
    turned = np.array([[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]])
    flat = Surface(np.asarray(blade.vertices), np.asarray(blade.faces))
    made = fixed(joined(scaled(ball(3), 0.7), flat, flat.moved(flat.points @ turned)))
    assert (made.numbers.pieces, made.numbers.handles) == (1, 0)
    cell = 0.04 / np.linalg.norm([4.0, 1.4, 2.4])
    assert made.numbers.off_largest < 1.2 * cell
    assert 0.4 < made.numbers.thin < 0.6  # both sides of the blades, as far as they stick out
    assert made.numbers.missed_largest < 1.5 * cell


def test_the_unit_of_length_does_not_matter() -> None:
    original = bumpy_sphere(2)
    ours = fixed(body_of(original.points, original.triangles[7:]))
    for scale in (1e-6, 1e6):
        theirs = fixed(body_of(scale * original.points, original.triangles[7:]))
        assert theirs.surface.volume == pytest.approx(scale**3 * ours.surface.volume, rel=1e-4)
        assert theirs.numbers.off_mean == pytest.approx(ours.numbers.off_mean, rel=0.05)


def test_a_sheet_encloses_nothing() -> None:
    i, j = np.meshgrid(np.arange(12.0), np.arange(9.0), indexing="ij")
    points = np.stack([i, j, 0.3 * np.sin(i) * np.cos(j)], axis=-1).reshape(-1, 3)
    corner = (np.arange(11)[:, None] * 9 + np.arange(8)).ravel()
    halves = ([0, 9, 10], [0, 10, 1])
    triangles = np.concatenate([corner[:, None] + np.array(half) for half in halves])
    for heights in (0.0, 1.0):
        with pytest.raises(DegenerateBodyError, match="give them a thickness"):
            repaired(body_of(points * [1.0, 1.0, heights], triangles))


def test_a_point_cloud_has_no_surface() -> None:
    with pytest.raises(InputError, match="point cloud"):
        repaired(make_body(ball(2).points, name="thing"))


def test_without_the_extra_it_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "igl", None)
    with pytest.raises(InputError, match=r"pip install 'dicedesign\[repair\]'"):
        repaired(joined(ball(2)))


@pytest.mark.parametrize("name", ["spot", "koala", "armadillo"])
def test_models_with_holes_are_repaired(name: str) -> None:
    body = read_body(public_data(f"models/{name}.obj"))
    original, _ = make_surface(body)
    kept = np.random.default_rng(3).random(len(original.triangles)) > 0.05
    made = fixed(body_of(original.points, original.triangles[kept]))
    assert_near(made, original)
    assert made.numbers.off_mean < 1e-3
