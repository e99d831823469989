"""Figures of dice with flat faces: views, faces, how they are read, how they are best printed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from common.drawings import color_mask, is_whole
from common.made_up_die import SIDES, box, designed

from dicedesign.errors import InputError
from dicedesign.fabricate.finish_options import EngravingOptions
from dicedesign.fabricate.label_layout import Placement, die_readings, place_labels
from dicedesign.fabricate.printability import PrintedSolid, placement_on_bed
from dicedesign.fabricate.printers import PRINTERS
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.hulls.polygons import signed_area
from dicedesign.geometry.triangles import doubled_area_vectors
from dicedesign.recipe.pipeline import Work, run_stages
from dicedesign.report.palette import ACCENT, DARK, rgb
from dicedesign.report.renderer import RenderMesh
from dicedesign.report.solid_figures import (
    Ablation,
    Face,
    ablation_figure,
    faces_figure,
    faces_of,
    paint_labels,
    print_orientation_figure,
    reading_figure,
    views_figure,
)
from dicedesign.rest.poses import rest_poses
from dicedesign.runtime.arrays import Floats
from tests.reference.solids import PLATONIC

BOX = np.array([(x, y, z) for x in (-9, 9) for y in (-6, 6) for z in (-4, 4)], dtype=float)


def labeled(texts: list[str], facets: list[int]):
    hull = convex_hull(BOX)
    places = die_readings(hull, np.array(facets), texts, "down")[0].places
    return hull, place_labels(places, EngravingOptions(), hull.diameter)


def test_faces_are_those_of_the_hull_with_the_areas_of_their_labels() -> None:
    hull, placements = labeled(["8", "16"], [3, 1])
    faces = faces_of(hull, placements, {3: "8: 50 %"})
    assert [face.title for face in faces] == ["8: 50 %", "", "", "", "", ""]
    areas = sorted(signed_area(face.outline) for face in faces)
    np.testing.assert_allclose(areas, sorted(hull.areas), rtol=1e-9)
    for face, placement in zip(faces, placements, strict=False):
        cut = sum(signed_area(contour) for contour in face.cuts)
        assert cut == pytest.approx(placement.section().area(), rel=1e-5)
        assert signed_area(face.outline) == pytest.approx(hull.areas[placement.facet])
        inside = np.concatenate(face.cuts)
        assert (inside >= face.outline.min(axis=0)).all()
        assert (inside <= face.outline.max(axis=0)).all()
    assert all(len(face.cuts) == 0 for face in faces[2:])


def test_of_many_faces_only_those_with_labels_are_drawn() -> None:
    points = np.random.default_rng(0).normal(size=(60, 3))
    hull = convex_hull(40.0 * points / np.linalg.norm(points, axis=1, keepdims=True))
    facet = int(hull.areas.argmax())
    options = EngravingOptions(min_height_mm=0.1)
    places = die_readings(hull, np.array([facet]), ["1"], "down")[0].places
    placements = place_labels(places, options, hull.diameter)
    assert len(hull.normals) > 60
    (face,) = faces_of(hull, placements, {facet: "1"})
    assert face.title == "1"


def test_ink_is_true_to_scale() -> None:
    """Dark pixels against the area of a square hole in a square, beside a larger face."""
    small = 10.0 * np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=float)
    hole = small[::-1] * 0.5 + 2.5
    faces = [
        Face(2.0 * small, (), ""),
        Face(small * 1.5, (small, hole), "7"),
    ]
    figure = faces_figure(faces)
    assert figure.texts == ["7", "20 mm"]
    dark = color_mask(figure, DARK)[: round(figure.height) - 60, round(figure.width) // 2 :]
    scale = 210.0 / 20.0  # pixels of the larger face
    letters = 60.0
    assert dark.sum() == pytest.approx(75.0 * scale**2, rel=0.03, abs=letters)


def test_no_faces_are_refused() -> None:
    with pytest.raises(InputError, match="faces: expected at least one"):
        faces_figure([])


@pytest.mark.parametrize("limit", [19.0, 45.0])
def test_colors_cover_what_touches_and_what_hangs(limit: float) -> None:
    """From beneath an icosahedron's face on the bed is seen whole, and its neighbors at 41.8
    degrees, which need supports up to a larger angle."""
    hull = convex_hull(PLATONIC["icosahedron"])
    solid = PrintedSolid(hull.vertices, hull.triangles, hull, (), np.zeros((0, 3)))
    down = hull.normals[:1]
    placement = placement_on_bed(hull.vertices, down[0])
    points = hull.vertices @ placement[:3, :3].T + placement[:3, 3]
    touching = points[hull.triangles][:, :, 2].max(axis=1) < 1e-3
    hanging = solid.overhanging(down, replace(PRINTERS["fdm"], overhang_deg=limit))[:, 0]
    figure = print_orientation_figure(points, hull.triangles, hanging, touching)
    counts = []
    for picture in figure.pictures:
        red, green, blue = np.asarray(picture, dtype=float).transpose(2, 0, 1)
        counts.append((int((blue > red + 25).sum()), int((red > green + 60).sum())))
    (blue, red), (blue_beneath, red_beneath) = counts
    assert blue == 0
    assert (red > 0) == bool(hanging.any())
    shadow = np.sqrt(5.0) if limit > 41.8 else 0.0
    assert red_beneath / blue_beneath == pytest.approx(shadow, abs=0.1)


def test_views_show_all_sides() -> None:
    hull = convex_hull(BOX)
    figure = views_figure(hull.vertices, hull.triangles)
    sizes = [(picture < 255).any(axis=2).sum() for picture in figure.pictures]
    assert len(sizes) == len(figure.texts) == 8
    # Pictures of the sides are as large as these: 12 x 8, 18 x 8 and 18 x 12 mm.
    np.testing.assert_allclose(np.array(sizes[:3]) / sizes[2], [96 / 216, 144 / 216, 1], rtol=0.05)


def engraved(points: Floats, directions: Floats, read: str, style: str = "engraved") -> Work:
    target = {"fair": len(directions)}
    entries = {"engrave": {"read": read, "style": style, "border_mm": 0.3}, "size_mm": 36.0}
    work = designed(points, directions, target=target, entries=entries)
    run_stages(work, after="design", last="engrave")
    assert work.engraved is not None
    return work


def labels_of(work: Work, outcome: int) -> list[Placement]:
    assert work.engraved is not None
    assert work.reading is not None
    pairs = zip(work.reading.places, work.engraved.placements, strict=True)
    return [placement for place, placement in pairs if place.outcome == outcome]


def area_of_color(surface: RenderMesh, color: Floats) -> float:
    """Area of the triangles of a color; a triangle's corners are of one."""
    assert surface.colors is not None
    colors = surface.colors[surface.triangles]
    assert (colors == colors[:, :1]).all()
    chosen = (colors[:, 0] == color).all(axis=1)
    areas = doubled_area_vectors(surface.points, surface.triangles[chosen])
    return 0.5 * float(np.linalg.norm(areas, axis=1).sum())


@pytest.mark.parametrize(
    ("points", "read", "places", "style"),
    [
        (box(1.0, 1.0, 1.0), "up", 1, "engraved"),
        (PLATONIC["tetrahedron"], "up", 3, "engraved"),
        (PLATONIC["tetrahedron"], "up", 3, "raised"),
    ],
)
def test_what_is_in_color_is_the_label_that_is_read(
    points: Floats, read: str, places: int, style: str
) -> None:
    """Its floor, or its top where it stands with others in a field."""
    work = engraved(points, convex_hull(points).normals, read, style)
    assert work.engraved is not None
    for outcome in range(len(work.target.labels)):
        mine = labels_of(work, outcome)
        assert len(mine) == places
        surface = paint_labels(work.engraved.points, work.engraved.triangles, mine)
        area = sum(placement.section().area() for placement in mine)
        label_color, facet_color = rgb([ACCENT, "#f2dd6e"])
        assert area_of_color(surface, label_color) == pytest.approx(area, rel=1e-3)
        if places == 1:
            facet = work.solid.poses.hull.areas[mine[0].facet]
            assert area_of_color(surface, facet_color) == pytest.approx(facet - area, rel=0.01)


def test_the_straight_view_shows_the_label() -> None:
    """As large a part of the picture of the facet is in its color as of the facet itself."""
    work = engraved(box(1.0, 1.0, 1.0), SIDES, "up")
    assert work.engraved is not None
    mine = labels_of(work, 2)
    (placement,) = mine
    surface = paint_labels(work.engraved.points, work.engraved.triangles, mine)
    sheet = reading_figure(
        surface,
        SIDES[2],
        placement.frame[:3, 1],
        [("from above", -SIDES[2], placement.frame[:3, 1])],
        "Read it.",
    )
    assert sheet.texts == ["as it lies", "from above", "Read it."]
    picture = sheet.pictures[1].astype(np.int64)
    red, green, blue = np.moveaxis(picture, -1, 0)
    seen = (picture < 255).any(axis=-1)
    part = (seen & (red > 2 * green)).sum() / seen.sum()
    area = placement.section().area()
    assert part == pytest.approx(area / work.solid.poses.hull.areas[placement.facet], rel=0.1)
    assert (blue[seen] < red[seen]).all()


def share_like_accent(picture: np.ndarray) -> float:
    """Part of the drawn pixels whose red, green and blue are in the proportions of the accent."""
    pixels = picture.reshape(-1, 3).astype(float)
    pixels = pixels[(pixels < 255).any(axis=1)]
    accent = rgb([ACCENT])[0]
    cosines = pixels @ accent / (np.linalg.norm(pixels, axis=1) * np.linalg.norm(accent))
    return float((cosines > 0.995).mean())


def test_further_rests_are_told_and_shown() -> None:
    poses = rest_poses(box(1.0, 1.0, 1.0))
    clean = Ablation("all terms", 1e-3, poses, np.arange(6))
    # Opposite facets for one outcome: three of the six rests are further ones.
    opposite = np.abs(poses.normals).argmax(axis=1)
    doubled = Ablation("without coplanar", 0.25, poses, opposite)
    figure = ablation_figure([clean, doubled])
    assert is_whole(figure)
    text = " ".join(figure.texts)
    assert "6 rests for 6 of them" in text
    assert "6 rests for 3 of them, up to 180.0° off" in text
    assert "2.5e-01" in text
    assert text.count("outcomes 90° apart") == 2
    shares = [share_like_accent(picture) for picture in figure.pictures]
    assert len(shares) == 4
    assert max(shares[:2]) < 0.02
    assert sum(shares[2:]) > 0.3
