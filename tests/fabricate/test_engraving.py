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
from dicedesign.geometry.triangles import Surface, doubled_area_vectors, solid_properties

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


def volume(die) -> float:
    return solid_properties(die.points, die.triangles)[0]


def test_a_cube_loses_outline_area_times_depth(box):
    body = box(20.0, 20.0, 20.0).with_points(Rotation.from_rotvec((0.3, 1.1, -0.7)).as_matrix())
    die, placements = engraved(body, list("123456"))
    removed = sum(outline_area(p.text) * p.height**2 * OPTIONS.depth_mm for p in placements)
    assert volume(die) == pytest.approx(8000.0 - removed, rel=1e-9)
    mesh = trimesh.load(io.BytesIO(stl_bytes(die.points, die.triangles)), file_type="stl")
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.body_count == 1
    assert mesh.euler_number == 2
    assert mesh.volume == pytest.approx(volume(die), rel=1e-5)
    assert ConvexHull(die.points).volume == pytest.approx(8000.0, rel=1e-9)


def empty_at(section: CrossSection, x: float, y: float) -> bool:
    probe = CrossSection.square((1e-4, 1e-4), center=True).translate((x, y))
    return (section ^ probe).area() == 0.0


def test_pockets_have_the_depth(box):
    die, placements = engraved(box(20.0, 12.0, 10.0), ["8"])
    area = outline_area("8") * placements[0].height ** 2
    body = solid(die.points, die.triangles)
    for below, missing in ((0.001, area), (0.599, area), (0.601, 0.0)):
        assert 240.0 - body.slice(5.0 - below).area() == pytest.approx(missing, abs=1e-6)


def test_an_l_stands_upright_and_is_not_mirrored(box):
    # Seen from +z with x to the right, the 20 mm edges run along x: up is +y or -y, and the frame
    # of the first edge (its lower left corner first) makes it +y.
    die, _ = engraved(box(20.0, 12.0, 10.0), ["L"])
    section = solid(die.points, die.triangles).slice(4.7)
    cut = CrossSection.square((20.0, 12.0), center=True) - section
    left, bottom, right, top = cut.bounds()
    assert top - bottom > right - left
    inset = 0.05 * (top - bottom)
    assert empty_at(section, left + inset, bottom + inset)
    assert empty_at(section, left + inset, top - inset)
    assert empty_at(section, right - inset, bottom + inset)
    assert not empty_at(section, right - inset, top - inset)
    assert not empty_at(section, 0.5 * (left + right), 0.5 * (bottom + top))


def test_the_labels_at_fault_are_named(box):
    plate = box(20.0, 20.0, 4.0)
    placements = place_labels(plate.places(["8", "7", "1"]), OPTIONS, plate.size_mm)
    with pytest.raises(
        EngravingError,
        match="break through another facet, at '8' on facet 0, '7' on facet 1: reduce",
    ):
        engrave(plate.surface, placements, EngravingOptions(depth_mm=2.5))


@pytest.mark.parametrize(
    ("text", "expected"), [("0", "one piece, got 2"), ("1", r"0 handles \(genus\), got 1")]
)
def test_labels_that_pierce_a_thin_plate_are_reported(box, text, expected):
    with pytest.raises(EngravingError, match=expected):
        engraved(box(20.0, 20.0, 0.5), [text])


def test_open_inward_and_malformed_meshes_are_refused(box):
    body = box(20.0, 20.0, 20.0)
    with pytest.raises(InputError, match="got NotManifold for 11 triangles; repair"):
        solid(body.vertices, body.triangles[1:])
    with pytest.raises(InputError, match="reverse their corners"):
        solid(body.vertices, body.triangles[:, ::-1])
    with pytest.raises(InputError, match="NonFiniteVertex"):
        solid(np.where(body.vertices > 0, np.nan, body.vertices), body.triangles)
    with pytest.raises(InputError, match="indices from 1 to 8"):
        solid(body.vertices, body.triangles + 1)
    with pytest.raises(InputError, match=r"got \(8, 2\) and"):
        solid(body.vertices[:, :2], body.triangles)
    with pytest.raises(InputError, match="positive volume, got 0;"):
        solid(np.zeros((0, 3)), np.zeros((0, 3), dtype=int))


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
            doubled = contour[:, 0] @ edges[:, 1] - contour[:, 1] @ edges[:, 0]
            floors += 0.5 * doubled
    return floors, walls


@pytest.fixture
def mark_surface(contents) -> Surface:
    (part,) = contents.parts
    return Surface(part.points, part.triangles)


def test_labels_have_the_areas_of_their_floors_and_walls(mark_surface, placements) -> None:
    floors, walls = floors_and_walls(placements)
    labels = labels_below_hull(mark_surface, DEPTH)
    assert area(mark_surface, labels) == pytest.approx(floors + walls, rel=1e-6)
    box = 2.0 * (14.0 * 16.0 + 16.0 * 20.0 + 20.0 * 14.0)
    assert area(mark_surface, ~labels) == pytest.approx(box - floors, rel=1e-6)


def test_a_hollow_inside_is_no_label(mark_surface, placements) -> None:
    hollow = Manifold.sphere(3.0, 24)
    with_hollow = Surface(*mesh_of(solid(mark_surface.points, mark_surface.triangles) - hollow))
    labels = labels_below_hull(with_hollow, DEPTH)
    assert area(with_hollow, labels) == pytest.approx(sum(floors_and_walls(placements)), rel=1e-6)


def test_labels_of_a_stretched_surface(box, mark_surface, placements) -> None:
    """A stretch does not change which triangles belong to labels."""
    body = box(14.0, 16.0, 20.0)
    ball = Manifold.sphere(30.0, 60).translate((0.0, -34.0, 0.0))
    dented = solid(body.vertices, body.triangles) - ball
    plain = Surface(*mesh_of(dented))
    engraved = engrave(plain, placements, EngravingOptions())
    expected = labels_off_surface(engraved, plain, DEPTH)
    assert area(engraved, expected) == pytest.approx(sum(floors_and_walls(placements)), rel=1e-6)
    matrix = np.eye(3) + 0.004 * np.random.default_rng(0).uniform(-1.0, 1.0, (3, 3))
    moved = engraved.with_points(engraved.points @ matrix + [0.02, -0.03, 0.05])
    np.testing.assert_array_equal(labels_off_surface(moved, plain, DEPTH), expected)
