"""Pieces of solids: they fill what was cut, and are solids with rests themselves."""

from __future__ import annotations

import numpy as np
import pytest
from manifold3d import Error, Manifold
from scipy.spatial.distance import cdist, pdist

from dicedesign.bench.bodies.cut_shapes import (
    LEAST_THICKNESS,
    cut_shapes,
    largest_part,
    made_models,
    planar_pieces,
    random_planes,
    random_sites,
    voronoi_cells,
)
from dicedesign.concave.shapes.shapes import shape
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.manifold import mesh_of, solid
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.solid import is_closed, solid_properties
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.rest.poses import rest_poses


def volume(piece: Manifold) -> float:
    return solid_properties(*mesh_of(piece))[0]


def knot() -> Manifold:
    surface = shape("knot")
    return solid(surface.points, surface.triangles)


WHOLES = {
    "box": lambda: Manifold.cube((1.0, 2.0, 3.0)),
    "sphere": lambda: Manifold.sphere(2.0, 16),
    "knot": knot,
}


@pytest.fixture(scope="module")
def shapes() -> list[Body]:
    return cut_shapes(made_models())


@pytest.mark.parametrize("name", WHOLES)
@pytest.mark.parametrize("count", [2, 9])
def test_voronoi_cells_hold_what_is_nearest_and_fill_the_whole(name: str, count: int) -> None:
    whole = WHOLES[name]()
    sites = random_sites(whole, count, np.random.default_rng(count))
    cells = voronoi_cells(whole, sites)
    assert sum(volume(cell) for cell in cells) == pytest.approx(volume(whole), rel=1e-12)
    for cell in cells:
        corners, _ = mesh_of(cell)
        far = cdist(corners, sites)
        own = np.argmin((far - far.min(axis=1, keepdims=True)).sum(axis=0))
        np.testing.assert_allclose(far[:, own], far.min(axis=1), rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", WHOLES)
@pytest.mark.parametrize("count", [1, 3])
def test_planar_pieces_lie_beside_the_planes_and_fill_the_whole(name: str, count: int) -> None:
    whole = WHOLES[name]()
    planes = random_planes(whole, count, np.random.default_rng(count))
    pieces = planar_pieces(whole, planes)
    assert 2 <= len(pieces) <= 2**count
    assert sum(volume(piece) for piece in pieces) == pytest.approx(volume(whole), rel=1e-12)
    sides = set()
    for piece in pieces:
        corners, _ = mesh_of(piece)
        heights = corners @ planes[:, :3].T - planes[:, 3]
        above, below = heights.min(axis=0) > -1e-12, heights.max(axis=0) < 1e-12
        assert (above != below).all()
        sides.add(tuple(above))
    assert len(sides) == len(pieces)


def test_a_plane_may_miss_and_its_normal_may_have_any_length() -> None:
    cube = Manifold.cube((1.0, 1.0, 1.0))
    planes = np.array([[0.0, 0.0, 5.0, 0.25], [1.0, 0.0, 0.0, 7.0]])
    volumes = sorted(volume(piece) for piece in planar_pieces(cube, planes))
    np.testing.assert_allclose(volumes, [0.25, 0.75], rtol=1e-14)


def test_a_site_far_away_has_no_cell() -> None:
    cube = Manifold.cube((1.0, 1.0, 1.0))
    sites = np.array([[0.2, 0.5, 0.5], [0.6, 0.5, 0.5], [9.0, 0.5, 0.5]])
    volumes = [volume(cell) for cell in voronoi_cells(cube, sites)]
    np.testing.assert_allclose(volumes, [0.4, 0.6], rtol=1e-14)


def test_of_a_piece_that_falls_apart_the_largest_part_is_taken() -> None:
    one, other = Manifold.cube((1.0, 1.0, 1.0)), Manifold.cube((1.0, 1.0, 2.0))
    both = one + other.translate((3.0, 0.0, 0.0))
    assert volume(both) == pytest.approx(3.0)
    assert volume(largest_part(both)) == pytest.approx(2.0)


def test_there_are_many_different_shapes(shapes: list[Body]) -> None:
    assert len(shapes) >= 120
    assert len({body.name for body in shapes}) == len(shapes)
    for whole in ("box", "sphere", "duck", "gear", "kitten", "knot"):
        for cut in ("plane", "Voronoi"):
            assert sum(body.name.startswith(whole) and cut in body.name for body in shapes) >= 4


def test_every_shape_is_one_solid_and_no_sliver(shapes: list[Body]) -> None:
    hollow = 0
    for body in shapes:
        assert body.triangles is not None
        assert is_closed(body.triangles)
        piece = solid(body.points, body.triangles)
        assert piece.status() == Error.NoError
        assert len(piece.decompose()) == 1
        filled = solid_properties(body.points, body.triangles)[0]
        hull = convex_hull(body.points)
        assert filled >= LEAST_THICKNESS * pdist(hull.vertices).max() ** 3
        around = solid_properties(hull.vertices, hull.triangles)[0]
        assert 0.0 < filled <= around * (1.0 + 1e-12)
        hollow += filled < 0.95 * around
    assert hollow >= 30


def test_every_shape_rests(shapes: list[Body]) -> None:
    rests = [rest_poses(body) for body in shapes]
    for found in rests:
        assert found.center_of_mass_source == "uniform solid"
        assert found.probabilities.sum() == pytest.approx(1.0, abs=1e-12)
    counts = [len(found.probabilities) for found in rests]
    assert min(counts) <= 3
    assert max(counts) >= 20


def test_a_seed_always_gives_the_same_shapes() -> None:
    first, again, other = cut_shapes({}), cut_shapes({}), cut_shapes({}, seed=1)
    assert [body.name for body in first] == [body.name for body in again]
    for one, same in zip(first, again, strict=True):
        assert one.points.tobytes() == same.points.tobytes()
        assert one.triangles is not None
        np.testing.assert_array_equal(one.triangles, same.triangles)
    assert all(
        one.points.tobytes() != another.points.tobytes()
        for one, another in zip(first, other, strict=False)
    )


def test_boxes_and_spheres_do_not_depend_on_the_models(shapes: list[Body]) -> None:
    without = cut_shapes({})
    assert 80 <= len(without) < len(shapes)
    for one, same in zip(without, shapes, strict=False):
        assert one.name == same.name
        assert one.points.tobytes() == same.points.tobytes()


def test_pieces_of_a_thin_plate_that_are_slivers_are_left_out() -> None:
    plate = Surface(*mesh_of(Manifold.cube((1.0, 1.0, 0.02))))
    pieces = cut_shapes({"plate": plate})[len(cut_shapes({})) :]
    assert len(pieces) < 12
    for body in pieces:
        assert body.name.startswith("plate, ")
        assert body.triangles is not None
        filled = solid_properties(body.points, body.triangles)[0]
        assert filled >= LEAST_THICKNESS * pdist(body.points).max() ** 3


def test_a_model_must_be_closed() -> None:
    points, triangles = mesh_of(Manifold.cube((1.0, 1.0, 1.0)))
    with pytest.raises(InputError, match="expected finite vertices and a closed surface"):
        cut_shapes({"open": Surface(points, triangles[1:])})
