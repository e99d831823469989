from __future__ import annotations

import io

import numpy as np
import pytest
import trimesh
from manifold3d import CrossSection, Manifold
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from dicedesign.errors import EngravingError, InputError
from dicedesign.fabricate.engraving import engrave, labels_below_hull, labels_off_surface
from dicedesign.fabricate.finish_options import EngravingOptions
from dicedesign.fabricate.label_art import BAR_THICKNESS, reads_upside_down, text_contours
from dicedesign.fabricate.label_layout import place_labels
from dicedesign.geometry.meshes.manifold import mesh_of, solid
from dicedesign.geometry.meshes.reading import stl_bytes
from dicedesign.geometry.triangles import Surface, doubled_area_vectors

OPTIONS = EngravingOptions()


def engraved(body, texts, options=OPTIONS):
    placements = place_labels(body.places(texts), options, body.size_mm)
    return engrave(body.surface, placements, options), placements


def outline_area(text: str) -> float:
    contours = text_contours(text)
    total = 0.0
    for contour in contours:
        following = np.roll(contour, -1, axis=0)
        total += 0.5 * (contour[:, 0] @ following[:, 1] - contour[:, 1] @ following[:, 0])
    bar = BAR_THICKNESS * np.ptp(np.concatenate(contours)[:, 0]) if reads_upside_down(text) else 0.0
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


def empty_at(section: CrossSection, x: float, y: float) -> bool:
    probe = CrossSection.square((1e-4, 1e-4), center=True).translate((x, y))
    return (section ^ probe).area() == 0.0


def test_pockets_have_the_depth(box):
    die, placements = engraved(box(20.0, 12.0, 10.0), ["8"])
    area = outline_area("8") * placements[0].height ** 2
    body = solid(die)
    for below, missing in ((0.001, area), (0.599, area), (0.601, 0.0)):
        assert 240.0 - body.slice(5.0 - below).area() == pytest.approx(missing, abs=1e-6)


def test_an_l_stands_upright_and_is_not_mirrored(box):
    # Seen from +z with x to the right, the 20 mm edges run along x: up is +y or -y, and the frame
    # of the first edge (its lower left corner first) makes it +y.
    die, _ = engraved(box(20.0, 12.0, 10.0), ["L"])
    section = solid(die).slice(4.7)
    cut = CrossSection.square((20.0, 12.0), center=True) - section
    left, bottom, right, top = cut.bounds()
    assert top - bottom > right - left
    inset = 0.05 * (top - bottom)
    assert empty_at(section, left + inset, bottom + inset)
    assert empty_at(section, left + inset, top - inset)
    assert empty_at(section, right - inset, bottom + inset)
    assert not empty_at(section, right - inset, top - inset)
    assert not empty_at(section, 0.5 * (left + right), 0.5 * (bottom + top))


@pytest.mark.parametrize(
    ("thickness", "texts", "depth_mm", "expected"),
    [
        (4.0, "871", 2.5, "break through another facet, at '8' on facet 0, '7' on facet 1: reduce"),
        (0.5, "0", 0.6, "one piece, got 2"),
        (0.5, "1", 0.6, r"0 handles \(genus\), got 1"),
    ],
)
def test_labels_that_meet_or_pierce_a_plate_are_refused(box, thickness, texts, depth_mm, expected):
    plate = box(20.0, 20.0, thickness)
    placements = place_labels(plate.places(list(texts)), OPTIONS, plate.size_mm)
    with pytest.raises(EngravingError, match=expected):
        engrave(plate.surface, placements, EngravingOptions(depth_mm=depth_mm))


def test_open_inward_and_malformed_meshes_are_refused(box):
    body = box(20.0, 20.0, 20.0)
    nan = np.where(body.vertices > 0, np.nan, body.vertices)
    for points, triangles, expected in (
        (body.vertices, body.triangles[1:], "got NotManifold for 11 triangles; repair"),
        (body.vertices, body.triangles[:, ::-1], "reverse their corners"),
        (nan, body.triangles, "NonFiniteVertex"),
        (body.vertices, body.triangles + 1, "VertexOutOfBounds"),
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
