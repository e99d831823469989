"""Labels cut into convex bodies, and marks cut into surfaces."""

from __future__ import annotations

import io

import numpy as np
import pytest
import trimesh
from common.bumpy import ball, surface_of
from manifold3d import Manifold
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from dicedesign.errors import EngravingError, InputError, LabelRoomError
from dicedesign.fabricate.engraving import engrave, labels_below_hull, labels_off_surface
from dicedesign.fabricate.finish_options import EngravingOptions
from dicedesign.fabricate.label_art import BAR_THICKNESS, text_contours
from dicedesign.fabricate.label_layout import place_labels
from dicedesign.fabricate.marks import engrave_marks, relief
from dicedesign.geometry.meshes.manifold import mesh_of, solid
from dicedesign.geometry.meshes.reading import stl_bytes
from dicedesign.geometry.triangles import Surface, doubled_area_vectors

OPTIONS = EngravingOptions()


def engraved(body, texts, options=OPTIONS):
    placements = place_labels(body.places(texts), options, body.size_mm)
    return engrave(body.surface, placements, options), placements


def outline_area(text: str, is_marked: bool = False) -> float:
    contours = text_contours(text)
    total = 0.0
    for contour in contours:
        following = np.roll(contour, -1, axis=0)
        total += 0.5 * (contour[:, 0] @ following[:, 1] - contour[:, 1] @ following[:, 0])
    bar = BAR_THICKNESS * np.ptp(np.concatenate(contours)[:, 0]) if is_marked else 0.0
    return abs(total) + bar


def test_a_cube_loses_outline_area_times_depth(box):
    body = box(20.0, 20.0, 20.0).with_points(Rotation.from_rotvec((0.3, 1.1, -0.7)).as_matrix())
    die, placements = engraved(body, list("123456"))
    removed = sum(outline_area(p.text) * p.height**2 * OPTIONS.depth_mm for p in placements)
    assert die.volume == pytest.approx(8000.0 - removed, rel=1e-9)
    mesh = trimesh.load(io.BytesIO(stl_bytes(die)), file_type="stl")
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert (mesh.body_count, mesh.euler_number) == (1, 2)
    assert ConvexHull(die.points).volume == pytest.approx(8000.0, rel=1e-9)


@pytest.mark.parametrize(
    ("thickness", "texts", "depth_mm", "expected"),
    [
        (4.0, "871", 2.5, "break through.* '8' on facet 0, '7' on facet 1"),
        (0.5, "0", 0.6, "got 2"),
        (0.5, "1", 0.6, "genus.*got 1"),
    ],
)
def test_labels_that_meet_or_pierce_a_plate_are_refused(box, thickness, texts, depth_mm, expected):
    with pytest.raises(EngravingError, match=expected):
        engraved(box(20.0, 20.0, thickness), texts, EngravingOptions(depth_mm=depth_mm))


def test_open_inward_and_malformed_meshes_are_refused(box):
    body = box(20.0, 20.0, 20.0).surface
    nan = np.where(body.points > 0, np.nan, body.points)
    for points, triangles, expected in (
        (body.points, body.triangles[1:], "NotManifold for 11 triangles"),
        (body.points, body.triangles[:, ::-1], "reverse"),
        (nan, body.triangles, "NonFiniteVertex"),
        (body.points, body.triangles + 1, "VertexOutOfBounds"),
    ):
        with pytest.raises(InputError, match=expected):
            solid(Surface(points, triangles))


DEPTH = EngravingOptions().depth_mm


def area(surface: Surface, which: np.ndarray) -> float:
    doubled = doubled_area_vectors(surface.points, surface.triangles[which])
    return 0.5 * float(np.linalg.norm(doubled, axis=1).sum())


def floors_and_walls(placements) -> tuple[float, float]:
    """Areas by the outlines of the labels."""
    floors = walls = 0.0
    for placement in placements:
        for contour in placement.section().to_polygons():
            edges = np.roll(contour, -1, axis=0) - contour
            walls += DEPTH * np.linalg.norm(edges, axis=1).sum()
            floors += 0.5 * (contour[:, 0] @ edges[:, 1] - contour[:, 1] @ edges[:, 0])
    return floors, walls


def test_labels_have_the_areas_of_their_floors_and_walls(contents, placements, box) -> None:
    (part,) = contents.parts
    floors, walls = floors_and_walls(placements)
    # A hollow inside is no label.
    hollow = mesh_of(solid(Surface(part.points, part.triangles)) - Manifold.sphere(3.0, 24))
    labels = labels_below_hull(hollow, DEPTH)
    assert area(hollow, labels) == pytest.approx(floors + walls, rel=1e-6)
    sides = 2.0 * (14.0 * 16.0 + 16.0 * 20.0 + 20.0 * 14.0)
    ball = mesh_of(Manifold.sphere(3.0, 24))
    around = area(ball, np.ones(len(ball.triangles), dtype=bool))
    assert area(hollow, ~labels) == pytest.approx(sides - floors + around, rel=1e-6)
    # A body that is not convex.
    dent = Manifold.sphere(30.0, 60).translate((0.0, -34.0, 0.0))
    plain = mesh_of(solid(box(14.0, 16.0, 20.0).surface) - dent)
    marked = engrave(plain, placements, EngravingOptions())
    labels = labels_off_surface(marked, plain, DEPTH)
    assert area(marked, labels) == pytest.approx(floors + walls, rel=1e-6)


# Marks.


OPTIONS = EngravingOptions()
DOWNS = np.array([(0, 0, -1), (0, 0, 1), (1, 0, 0), (-0.3, -1, 0.2)], dtype=float)


def ellipsoid(x: float, y: float, z: float):
    unit = ball(4)
    return unit.with_points(0.5 * unit.points * (x, y, z))


def torus(outer: float, tube: float):
    return surface_of(trimesh.creation.torus(0.5 * outer - 0.5 * tube, 0.5 * tube, 96, 40))


def test_marks_of_a_ring_are_visible_and_have_the_given_depth():
    body = torus(45.0, 15.0)
    die, marks = engrave_marks(body, DOWNS, list("1269"), OPTIONS)
    ring = solid(body)
    for mark, down in zip(marks, DOWNS, strict=True):
        up = -down / np.linalg.norm(down)
        assert mark.frame[:3, 2] == pytest.approx(up, abs=1e-12)
        assert mark.frame[:3, :3].T @ mark.frame[:3, :3] == pytest.approx(np.eye(3), abs=1e-12)
        start = mark.frame[:3, 3] + 1e-3 * mark.frame[:3, 2]
        assert not ring.ray_cast(start, start + 100.0 * mark.frame[:3, 2])
    expected = sum(mark.art.section.area() * mark.height**2 * OPTIONS.depth_mm for mark in marks)
    assert body.volume - die.volume == pytest.approx(expected, rel=1e-4)
    mesh = trimesh.load(io.BytesIO(stl_bytes(die)), file_type="stl")
    assert mesh.is_watertight
    assert (mesh.body_count, mesh.euler_number) == (1, 0)


def test_an_l_is_cut_straight_down_by_the_depth_upright_and_not_mirrored():
    body = ellipsoid(40.0, 25.0, 16.0)
    die, (mark,) = engrave_marks(body, DOWNS[:1], ["L"], OPTIONS)
    to_mark = np.linalg.inv(mark.frame)
    cut = relief(solid(die).transform(to_mark[:3]))
    plain = relief(solid(body).transform(to_mark[:3]))
    inside = np.argwhere(np.isfinite(plain.height))
    fall = plain.height[tuple(inside.T)] - cut.height[tuple(inside.T)]
    is_cut = fall > 0.5 * OPTIONS.depth_mm
    assert fall[is_cut] == pytest.approx(OPTIONS.depth_mm, abs=1e-9)
    assert fall[~is_cut] == pytest.approx(0.0, abs=1e-9)
    x, y = (cut.corner + cut.spacing * inside[is_cut]).T
    # The stem is on the left and the foot below: its right half is only at the bottom.
    assert np.ptp(y) > np.ptp(x)
    assert y[x > x.mean() + 0.25 * np.ptp(x)].max() < y.mean()
    assert y[x < x.min() + 0.2 * np.ptp(x)].max() == y.max()


def test_marks_are_on_the_visible_surface():
    # A lid over one half of a block: there is room on top of the lid and on the uncovered half.
    block = trimesh.creation.box((30, 30, 10))
    post = trimesh.creation.box((4, 30, 20), trimesh.transformations.translation_matrix((13, 0, 5)))
    lid = trimesh.creation.box((18, 30, 4), trimesh.transformations.translation_matrix((6, 0, 13)))
    pieces = [solid(Surface(m.vertices, m.faces)) for m in (block, post, lid)]
    whole = mesh_of(pieces[0] + pieces[1] + pieces[2])
    _, marks = engrave_marks(whole, np.tile(DOWNS[:1], (3, 1)), list("123"), OPTIONS)
    for mark in marks:
        x, _, z = mark.frame[:3, 3]
        assert z == pytest.approx(15.0 if x > -3.0 else 5.0)
    # Marks of one direction lie beside each other.
    places = np.array([mark.frame[:3, 3] for mark in marks])
    apart = np.linalg.norm(places[:, None] - places, axis=-1)[np.triu_indices(3, 1)]
    assert apart.min() > max(mark.height for mark in marks)


def test_bodies_without_room_are_refused_with_a_sufficient_size():
    body = torus(12.0, 4.0)
    with pytest.raises(LabelRoomError, match=r"'16'.*min_height_mm") as caught:
        engrave_marks(body, DOWNS[2:], ["7", "16"], OPTIONS)
    assert f"size_mm = {caught.value.size_mm:.1f}" in str(caught.value)
    grown = body.with_points(body.points * caught.value.size_mm / 12.0)
    assert len(engrave_marks(grown, DOWNS[2:], ["7", "16"], OPTIONS)[1]) == 2
    with pytest.raises(EngravingError, match=r"'1'.*1.2 mm"):
        engrave_marks(ellipsoid(20.0, 20.0, 1.0), DOWNS[:1], ["1"], OPTIONS)
