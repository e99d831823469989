"""Models made at random: solids of many kinds, each always the same."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull

from dicedesign.bench.bodies.models.model_blocks import blocks
from dicedesign.bench.bodies.models.model_parts import (
    closed_tube,
    ring,
    rippled,
    rounded_box,
    swept,
    turned,
    without,
)
from dicedesign.bench.bodies.models.random_models import (
    MODEL_KINDS,
    MODELS,
    is_model,
    model_names,
    random_model,
)
from dicedesign.bench.bodies.models.soft_surface import soft_surface
from dicedesign.concave.shapes.distance_functions import ellipsoid
from dicedesign.errors import InputError
from dicedesign.geometry.meshes.body import make_body
from dicedesign.geometry.surfaces.closed_surface import make_surface
from dicedesign.geometry.surfaces.surface import Surface


@pytest.fixture(scope="module")
def models() -> dict[str, Surface]:
    return {name: random_model(name) for name in MODELS}


def fill(surface: Surface) -> float:
    """Part of its hull, by Qhull."""
    return surface.volume / ConvexHull(surface.points).volume


def tunnels(surface: Surface) -> int:
    mesh = trimesh.Trimesh(surface.points, surface.triangles, process=False)
    return 1 - mesh.euler_number // 2


def test_each_is_a_closed_piece_that_does_not_meet_itself(models: dict[str, Surface]) -> None:
    for name, surface in models.items():
        body = make_body(surface.points, surface.triangles, name)
        assert make_surface(body)[1] == ()
        mesh = trimesh.Trimesh(surface.points, surface.triangles, process=False)
        assert mesh.is_watertight
        assert mesh.body_count == 1
        assert mesh.volume > 0.0
        assert 1500 <= len(surface.points) <= 4000


def test_they_are_of_many_kinds(models: dict[str, Surface]) -> None:
    """Compact and spidery, flat and tall, of few corners and many, with tunnels and without; none
    is nearly convex."""
    fills = [fill(surface) for surface in models.values()]
    assert 0.02 < min(fills) < 0.2
    assert 0.75 < max(fills) < 5.0 / 6.0 + 1e-12
    corners = [len(ConvexHull(surface.points).vertices) for surface in models.values()]
    assert min(corners) < 40
    assert max(corners) > 1000
    extents = np.array([np.ptp(surface.points, axis=0) for surface in models.values()])
    tall = extents[:, 2] / extents[:, :2].max(axis=1)
    assert tall.min() < 0.45
    assert tall.max() > 1.2
    assert {tunnels(surface) for surface in models.values()} == {0, 1, 2, 3}
    assert len({surface.points.tobytes() for surface in models.values()}) == len(MODELS) == 40


def test_kinds_take_turns_and_more_names_begin_with_the_same() -> None:
    assert model_names(60)[:40] == MODELS
    assert [name.rpartition("_")[0] for name in MODELS[:11]] == list(MODEL_KINDS)
    assert MODELS[11:13] == ("blobs_02", "animal_02")
    assert all(is_model(name) for name in model_names(1200))


@pytest.mark.parametrize("name", MODELS[:11])
def test_a_name_gives_the_same_each_time(name: str, models: dict[str, Surface]) -> None:
    again = random_model(name)
    assert again.points.tobytes() == models[name].points.tobytes()
    assert again.triangles.tobytes() == models[name].triangles.tobytes()


@pytest.mark.parametrize("name", ["blobs", "blobs_0", "blobs_00", "blobs_3", "swan_01", "kitten"])
def test_other_names_are_refused(name: str) -> None:
    assert not is_model(name)
    with pytest.raises(InputError, match=f"with a number, got '{name}'; write it such as blobs_01"):
        random_model(name)


def test_parts_are_as_far_away_as_they_should_be() -> None:
    points = np.array([[3.0, 0.0, 4.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    torus = ring(1.0, 0.25)
    assert torus(points) == pytest.approx(np.array([np.hypot(2.0, 4.0), 0.0, 2.0**0.5]) - 0.25)
    ball = ellipsoid((1.0, 0.0, 0.0), (0.25, 0.25, 0.25))
    assert swept(ball)(points) == pytest.approx(torus(points))
    angles = np.linspace(0.0, 2.0 * np.pi, 2000, endpoint=False)
    line = np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1)
    assert closed_tube(line, 0.25)(points) == pytest.approx(torus(points), abs=1e-5)
    box = rounded_box((0.0, 0.0, 1.0), (1.0, 2.0, 3.0), 0.5)
    beside = np.array([[4.0, 0.0, 1.0], [4.0, 6.0, 4.0], [0.0, 0.0, 1.0]])
    # To the side, to the ball at a corner of the core, and within.
    corner = np.linalg.norm([3.5, 4.5, 0.5]) - 0.5
    assert box(beside) == pytest.approx([3.0, corner, -1.0])


def test_parts_are_turned_cut_and_rippled() -> None:
    upright = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    on_it = np.array([[6.0, 5.0, 6.0], [4.0, 5.0, 6.0], [5.0, 5.0, 7.0]])
    assert turned(ring(1.0, 0.25), upright, (5.0, 5.0, 6.0))(on_it) == pytest.approx(-0.25)
    ball = ellipsoid((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    bitten = without(ball, ellipsoid((1.0, 0.0, 0.0), (0.5, 0.5, 0.5)))
    inside = np.array([[0.0, 0.6, 0.0], [0.7, 0.0, 0.0], [2.0, 0.0, 0.0]])
    assert (bitten(inside) < 0.0).tolist() == [True, False, False]
    waves, phases = np.array([[np.pi, 0.0, 0.0]]), np.zeros(1)
    places = np.array([[0.5, 0.0, 0.0], [1.0, 0.0, 0.0], [1.5, 0.0, 0.0]])
    assert rippled(ball, waves, phases, 0.1)(places) == pytest.approx([-0.4, 0.0, 0.4])


def test_a_soft_surface_is_the_largest_piece_with_as_many_points() -> None:
    ball = ellipsoid((0.3, 0.0, 0.0), (1.0, 1.0, 1.0))
    crumb = ellipsoid((-2.0, 0.0, 0.0), (0.25, 0.25, 0.25))
    surface = soft_surface(lambda points: np.minimum(ball(points), crumb(points)), 3.0, 2000)
    assert surface is not None
    assert len(surface.points) == pytest.approx(2000, rel=0.1)
    # Averages of what is curved lie a little within.
    assert surface.volume == pytest.approx(4.0 / 3.0 * np.pi, rel=0.05)
    assert surface.centroid == pytest.approx([0.3, 0.0, 0.0], abs=1e-3)


def test_what_meets_itself_along_an_edge_makes_no_surface() -> None:
    """Two quarters of a block that have an edge in common, under a lid that joins them."""
    block = rounded_box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), 0.1)
    lid = rounded_box((0.0, 0.0, 0.8), (1.0, 1.0, 0.4), 0.1)

    def quarters(points: np.ndarray) -> np.ndarray:
        part = np.maximum(block(points), -points[..., 0] * points[..., 1])
        return np.minimum(part, lid(points))

    assert soft_surface(block, 2.0, 2000) is not None
    assert soft_surface(quarters, 2.0, 2000) is None


def test_blocks_keep_their_flat_faces() -> None:
    """Most triangles lie in one of a few planes."""
    surface = blocks(np.random.default_rng(5), 1500)
    mesh = trimesh.Trimesh(surface.points, surface.triangles, process=False)
    assert len(surface.points) >= 1500
    planes = np.column_stack(
        [mesh.face_normals, (mesh.face_normals * mesh.triangles_center).sum(1)]
    )
    large = mesh.area_faces > 1e-8
    assert len(np.unique(np.round(planes[large], 5), axis=0)) < 80
