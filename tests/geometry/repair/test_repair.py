"""Broken meshes become the closed surface of one solid near the input; large ones are decimated."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from common.bumpy import ball, bent_capsule, bumpy_sphere, self_intersecting_sphere

from dicedesign.geometry.meshes.body import Body, make_body
from dicedesign.geometry.surfaces.closed_surface import make_surface
from dicedesign.geometry.surfaces.repair import RepairedMesh, input_surface, repair_mesh
from dicedesign.geometry.triangles import Surface
from dicedesign.runtime.arrays import Floats, Integers

CELL = 0.02
"""Side of the grid's cells, over the longest side."""


@pytest.fixture(autouse=True)
def coarse_grids(monkeypatch: pytest.MonkeyPatch) -> None:
    """A grid of half as many cells along each side takes an eighth of the time."""
    monkeypatch.setattr("dicedesign.geometry.surfaces.repair.CELLS", 40)


def body_of(points: Floats, triangles: Integers) -> Body:
    return make_body(points, triangles, name="thing")


def join(*surfaces: Surface) -> Body:
    starts = np.cumsum([0, *(len(surface.points) for surface in surfaces)])
    return body_of(
        np.concatenate([surface.points for surface in surfaces]),
        np.concatenate([s.triangles + n for s, n in zip(surfaces, starts, strict=False)]),
    )


def shift(surface: Surface, x: float, y: float = 0.0, z: float = 0.0) -> Surface:
    return surface.with_points(surface.points + np.array([x, y, z]))


def scale(surface: Surface, scale: float) -> Surface:
    return surface.with_points(scale * surface.points)


def repair(body: Body) -> RepairedMesh:
    """Repaired mesh, whose surface needs no further repair."""
    repaired = repair_mesh(body)
    surface = repaired.surface
    _, notes = make_surface(body_of(surface.points, surface.triangles))
    assert notes == ()
    assert surface.volume > 0.0
    assert 1 - (len(surface.points) - len(surface.triangles) // 2) // 2 == repaired.numbers.handles
    return repaired


def assert_near(repaired: RepairedMesh, original: Surface) -> None:
    """The surface encloses nearly the original solid."""
    assert repaired.surface.volume == pytest.approx(original.volume, rel=0.01)
    off = np.abs(repaired.surface.centroid - original.centroid).max()
    assert off < 0.3 * CELL * np.ptp(original.points)


@pytest.mark.parametrize("original", [bumpy_sphere(3), bent_capsule()])
def test_a_surface_with_holes_is_closed(original: Surface) -> None:
    rng = np.random.default_rng(0)
    remaining = rng.random(len(original.triangles)) > 0.05
    repaired = repair(body_of(original.points, original.triangles[remaining]))
    assert_near(repaired, original)
    assert repaired.numbers.handles_before is None
    assert repaired.numbers.off_mean < 1e-3
    assert repaired.numbers.missed_mean < 5e-4


def test_two_overlapping_balls_are_one_solid() -> None:
    """Two caps of height 1 - d / 2 are missing from two whole balls."""
    distance = 1.2
    repaired = repair(join(ball(4), shift(ball(4), distance)))
    cap = 1.0 - distance / 2.0
    lens = 2.0 * np.pi * cap**2 * (3.0 - cap) / 3.0
    assert repaired.surface.volume == pytest.approx(8.0 / 3.0 * np.pi - lens, rel=0.01)
    assert (repaired.numbers.pieces, repaired.numbers.cavities, repaired.numbers.thin) == (
        1,
        0,
        0.0,
    )
    assert np.abs(repaired.surface.centroid - [distance / 2.0, 0.0, 0.0]).max() < 0.005


def test_a_self_intersecting_surface_is_untangled() -> None:
    """A finger that comes out on the other side has its walls inside out there."""
    repaired = repair(join(self_intersecting_sphere()))
    inside = 4.0 / 3.0 * np.pi
    assert 0.7 * inside < repaired.surface.volume < inside
    assert repaired.numbers.handles == 1  # the finger has become a hole


def test_cavities_are_filled_and_small_pieces_dropped() -> None:
    inner = scale(ball(3), 0.5)
    cavity = inner.reverse()
    pebble = shift(scale(ball(3), 0.3), 1.6)
    repaired = repair(join(ball(4), cavity, pebble))
    assert repaired.surface.volume == pytest.approx(4.0 / 3.0 * np.pi, rel=0.01)
    assert repaired.numbers.pieces == 2
    assert repaired.numbers.dropped == pytest.approx(0.027 / 1.027, rel=0.05)
    # The far side of what was dropped is that far away.
    diagonal = np.linalg.norm([2.9, 2.0, 2.0])
    assert repaired.numbers.missed_largest == pytest.approx(0.9 / diagonal, rel=0.02)


def test_thin_parts_are_thickened() -> None:
    """A ball with two blades of a fifth of a cell, neither torn nor lost."""
    blade = trimesh.creation.box((4.0, 1.0, 0.016))
    turned = np.array([[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]])
    flat = Surface(np.asarray(blade.vertices), np.asarray(blade.faces))
    repaired = repair(join(scale(ball(3), 0.7), flat, flat.with_points(flat.points @ turned)))
    assert (repaired.numbers.pieces, repaired.numbers.handles) == (1, 0)
    cell = 0.08 / np.linalg.norm([4.0, 1.4, 2.4])
    assert repaired.numbers.off_largest < 1.2 * cell
    assert 0.4 < repaired.numbers.thin < 0.6  # both sides of the blades, as far as they stick out
    assert repaired.numbers.missed_largest < 1.5 * cell


@pytest.mark.parametrize(
    ("whole", "missing"),
    [
        (trimesh.creation.box(), 1),
        (trimesh.creation.box((1.0, 2.0, 3.0)), 3),
        (trimesh.creation.box().subdivide().subdivide(), 12),
        (trimesh.creation.icosphere(3), 60),
        (trimesh.creation.torus(2.0, 0.5), 40),
        (trimesh.creation.cylinder(1.0, 2.0), 12),
    ],
)
def test_missing_triangles_are_filled_without_moving_a_point(
    whole: trimesh.Trimesh, missing: int
) -> None:
    for seed in range(3):
        lost = np.random.default_rng(seed).choice(len(whole.faces), missing, replace=False)
        body = body_of(np.array(whole.vertices), np.delete(np.array(whole.faces), lost, axis=0))
        surface, _, repaired = input_surface(body, 100_000, repair=True)
        assert repaired is None
        assert len(surface.triangles) == len(whole.faces)
        np.testing.assert_array_equal(surface.points, body.points)
        kept = len(body.triangles)
        np.testing.assert_array_equal(surface.triangles[:kept], body.triangles)
        assert surface.volume == pytest.approx(whole.volume)


def test_a_missing_wall_is_a_flat_polygon() -> None:
    """The lid of a prism over an L, whose 6 corners lie in one hole."""
    corners = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]
    points = np.array([(x, y, z) for z in (0, 2) for x, y in corners], dtype=float)
    sides = [(i, (i + 1) % 6, (i + 1) % 6 + 6, i + 6) for i in range(6)]
    walls = [t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))]
    floor = [(0, k + 1, k) for k in range(1, 5)]
    surface, _, repaired = input_surface(body_of(points, np.array(walls + floor)), repair=True)
    assert repaired is None
    assert surface.volume == pytest.approx(6.0)


@pytest.mark.full
@pytest.mark.skipif(sys.platform != "linux", reason="the peak is read from /proc")
def test_a_repair_takes_little_memory(tmp_path: Path) -> None:
    """10,240 triangles of a cube and a ball that overlap, which fill the grid."""
    box = trimesh.creation.box((3.0, 3.0, 3.0)).subdivide().subdivide().subdivide().subdivide()
    ball = trimesh.creation.icosphere(4, radius=1.9)
    trimesh.util.concatenate([box, ball]).export(tmp_path / "a.stl")
    script = """
from pathlib import Path
from dicedesign.cli.main import main
assert main(["repair", "a.stl", "b.stl"]) == 0
status = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
print(status["VmHWM"].split()[0])
"""
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert int(done.stdout.split()[-1]) < 300_000


def large() -> Surface:
    """10,242 points."""
    return bumpy_sphere(5)


@pytest.mark.parametrize("points", [300, 4000])
def test_a_large_mesh_is_decimated(points: int) -> None:
    original = large()
    surface, notes, _ = input_surface(body_of(original.points, original.triangles), points)
    assert 0.8 * points < len(surface.points) <= points
    assert surface.volume == pytest.approx(original.volume, rel=0.02)
    assert trimesh.Trimesh(surface.points, surface.triangles).is_volume
    assert f"{len(original.points)} to" in notes[0]
