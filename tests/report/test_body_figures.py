"""Figures of dice: flat faces, surfaces before and after, hulls, rests, and sheets."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh
from common.drawings import is_whole, pictures, pixels, words
from common.finished import finished_box
from common.made_up_die import run_to_check, run_to_design
from matplotlib.patches import Patch
from scipy.ndimage import binary_fill_holes

from dicedesign.fabricate.die import FinishedDie, assess_file
from dicedesign.fabricate.finish_options import EngravingOptions
from dicedesign.fabricate.label_layout import Placement, place_labels
from dicedesign.fabricate.label_reading import die_readings
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.hulls.polygons import signed_area
from dicedesign.geometry.meshes.reading import stl_bytes
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.triangles import Surface, doubled_area_vectors
from dicedesign.optimize.targets import Target
from dicedesign.palette import outcome_colors, rgb, text_color
from dicedesign.recipe.output import make_finished_die
from dicedesign.recipe.pipeline import Work, run_stages
from dicedesign.report import solid_figures
from dicedesign.report.paper import PAGE_WIDTH
from dicedesign.report.renderer import RenderMesh
from dicedesign.report.sheet import Sheet
from dicedesign.report.solid_figures import (
    faces,
    paint_labels,
    print_orientation,
    reading,
    views,
)
from dicedesign.report.surface_figures import (
    before_after,
    crossings,
    displacement,
    rests,
)
from dicedesign.runtime.arrays import Floats
from tests.reference.solids import PLATONIC


def labeled_box(texts: list[str], facets: list[int]) -> FinishedDie:
    """Box of 14 x 16 x 20 mm with labels, each read from below, on facets."""
    die = finished_box()
    assert die.engraved is not None
    hull = die.plain.poses.hull
    places = die_readings(hull, np.array(facets), texts, "down")[0].places
    placements = place_labels(places, EngravingOptions(), hull.diameter)
    return replace(die, engraved=replace(die.engraved, placements=placements))


def rings(patch: Patch) -> list[np.ndarray]:
    """Contours (n, 2) of a patch, y upward."""
    return [ring * [1.0, -1.0] for ring in patch.get_path().to_polygons(closed_only=False)]


def test_faces_and_labels_are_true_to_scale() -> None:
    die = labeled_box(["2", "<6>"], [3, 1])
    assert die.engraved is not None
    hull, placements = die.plain.poses.hull, die.engraved.placements
    sheet = faces(die)
    assert is_whole(sheet)
    (bar,) = sheet.drawing.lines
    scale = float(np.ptp(bar.get_xdata())) / 20.0
    outlines, cuts = sheet.drawing.patches[::2], sheet.drawing.patches[1::2]
    areas = [signed_area(rings(patch)[0]) / scale**2 for patch in outlines]
    np.testing.assert_allclose(sorted(areas), sorted(hull.areas), rtol=1e-9)
    for area, patch, placement in zip(areas, cuts, placements, strict=False):
        assert area == pytest.approx(hull.areas[placement.facet])
        cut = sum(signed_area(ring) for ring in rings(patch)) / scale**2
        assert cut == pytest.approx(placement.section().area(), rel=1e-5)
    for outline, patch in zip(outlines, cuts[:2], strict=False):
        around, inner = outline.get_extents(), patch.get_extents()
        assert (around.min <= inner.min).all()
        assert (inner.max <= around.max).all()


def test_only_labeled_faces_of_many_are_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(solid_figures, "MAX_FACES", 5)
    assert len(faces(labeled_box(["3"], [2])).drawing.patches) == 2


@pytest.mark.parametrize(("printer", "ratio"), [("fdm", np.sqrt(5.0)), ("sla", 0.0)])
def test_colors_cover_touching_and_overhanging_surfaces(printer: str, ratio: float) -> None:
    """From beneath an icosahedron's face on the bed is seen whole, and its neighbors at 41.8
    degrees, which need supports only by filament."""
    points = PLATONIC["icosahedron"]
    work = run_to_check(points, convex_hull(points).normals, entries={"print": printer})
    run_stages(work, after="check", last="printing")
    figure = print_orientation(make_finished_die(work))
    counts = []
    for picture in pictures(figure):
        red, green, blue = np.asarray(picture, dtype=float).transpose(2, 0, 1)
        counts.append((int((blue > red + 25).sum()), int((red > green + 60).sum())))
    (blue, red), (blue_beneath, red_beneath) = counts
    assert blue == 0
    assert (red > 0) == (ratio > 0.0)
    assert red_beneath / blue_beneath == pytest.approx(ratio, abs=0.1)


def test_views_show_all_sides() -> None:
    solid = finished_box().printed
    figure = views(solid.points, solid.triangles)
    sizes = [(picture < 255).any(axis=2).sum() for picture in pictures(figure)]
    assert len(sizes) == len(words(figure)) == 8
    # Sides of 16 x 20, 14 x 20 and 14 x 16 mm.
    np.testing.assert_allclose(np.array(sizes[:3]) / sizes[2], [20 / 14, 20 / 16, 1], rtol=0.05)


def engrave(points: Floats, style: str = "engraved") -> tuple[Work, list[list[Placement]]]:
    """Engraved die, each of whose facets is an outcome, and the labels of each outcome."""
    directions = convex_hull(points).normals
    entries = {"engrave": {"read": "up", "style": style, "border_mm": 0.3}, "size_mm": 36.0}
    work = run_to_design(points, directions, target={"fair": len(directions)}, entries=entries)
    run_stages(work, after="design", last="engrave")
    assert work.engraved is not None
    assert work.reading is not None
    labels: list[list[Placement]] = [[] for _ in directions]
    for place, placement in zip(work.reading.places, work.engraved.placements, strict=True):
        labels[place.outcome].append(placement)
    return work, labels


def area_of_color(surface: RenderMesh, color: Floats) -> float:
    """Area of the triangles of a color; a triangle's corners are of one."""
    assert surface.colors is not None
    colors = surface.colors[surface.triangles]
    assert (colors == colors[:, :1]).all()
    chosen = (colors[:, 0] == color).all(axis=1)
    areas = doubled_area_vectors(surface.points, surface.triangles[chosen])
    return 0.5 * float(np.linalg.norm(areas, axis=1).sum())


@pytest.mark.parametrize(
    ("name", "places", "style"),
    [("cube", 1, "engraved"), ("tetrahedron", 3, "engraved"), ("tetrahedron", 3, "raised")],
)
def test_the_label_to_read_is_in_color(name: str, places: int, style: str) -> None:
    """Its floor, or its top where it stands with others in a field."""
    work, labels = engrave(PLATONIC[name], style)
    for mine in labels:
        assert len(mine) == places
        surface = paint_labels(work.engraved, mine, "#f2dd6e")
        area = sum(placement.section().area() for placement in mine)
        label_color, facet_color = rgb([text_color("#f2dd6e"), "#f2dd6e"])
        assert area_of_color(surface, label_color) == pytest.approx(area, rel=1e-3)
        if places == 1:
            facet = work.solid.poses.hull.areas[mine[0].facet]
            assert area_of_color(surface, facet_color) == pytest.approx(facet - area, rel=0.01)


def test_the_straight_view_shows_the_label() -> None:
    """The label's share of its facet, which is in color, is equal in the picture and on the die."""
    work, labels = engrave(PLATONIC["cube"])
    (placement,) = labels[0]
    sheet = reading(make_finished_die(work), width=7.0)
    picture = pictures(sheet)[1].astype(np.int64)
    facet = np.ptp(picture, axis=-1) > 35
    part = 1.0 - facet.sum() / binary_fill_holes(facet).sum()
    area = placement.section().area()
    assert part == pytest.approx(area / work.solid.poses.hull.areas[placement.facet], rel=0.1)


# Surfaces.


UP = np.array([0.0, 0.0, 1.0])


def pictures_by_title(paper: Sheet) -> dict[str, np.ndarray]:
    """Pictures of a grid by their titles."""
    drawn = (picture for picture in pictures(paper) if (picture < 255).any())
    return dict(zip(words(paper), drawn, strict=True))


def dumbbell() -> trimesh.Trimesh:
    """Two boxes, one larger, along y."""
    small, large = trimesh.creation.box([0.6, 1.0, 0.6]), trimesh.creation.box([1.2, 0.8, 1.2])
    return trimesh.util.concatenate(
        [small.apply_translation([0, -0.8, 0]), large.apply_translation([0, 0.8, 0])]
    )


def test_before_and_after_are_drawn_at_one_scale() -> None:
    mesh = dumbbell()
    before = np.asarray(mesh.vertices)
    after = 0.5 * before
    both = RenderMesh(before, mesh.faces), RenderMesh(after, mesh.faces)
    figure = before_after(*both, UP)
    sizes = [
        np.ptp(np.nonzero((picture < 255).any(axis=2)), axis=1) + 1 for picture in pictures(figure)
    ]
    for large, small in zip(sizes[:3], sizes[3:], strict=True):
        np.testing.assert_allclose(small, 0.5 * large, atol=1.5)


def reshaped_die(points: Any, triangles: Any, downs: np.ndarray, before: Any = None) -> FinishedDie:
    """Die of a surface, with an outcome for each direction (k, 3) that points down."""
    surface = Surface(np.asarray(points, float), np.asarray(triangles, np.int64))
    start = surface if before is None else Surface(np.asarray(before), surface.triangles)
    target = Target([f"${k}$" for k in range(len(downs))], np.full(len(downs), 1.0 / len(downs)))
    data = stl_bytes(surface)
    die = finished_box(labels=target.labels)
    concave: Any = SimpleNamespace(before=start, after=surface, directions=downs)
    plain = assess_file(data, downs / norms(downs)[:, None], target)
    return replace(die, plain=plain, reshaped=concave, upward=UP)


def test_displacement_is_written_in_percent_of_the_diagonal_and_colored() -> None:
    mesh = trimesh.creation.icosphere(subdivisions=3)
    before = np.asarray(mesh.vertices)
    # The first camera looks at the side that moves, the second one from behind.
    after = before + np.where(before[:, 1:2] < 0.0, [[0.0, -0.1, 0.0]], 0.0)
    figure = displacement(reshaped_die(after, mesh.faces, np.eye(3), before))
    largest = 100.0 * 0.1 / np.linalg.norm(np.ptp(before, axis=0))
    mean = largest * (before[:, 1] < 0.0).mean()
    assert f"mean {mean:.2g} %, largest {largest:.2g} %" in " ".join(words(figure))
    assert is_whole(figure)
    moved, still = (
        picture[len(picture) // 2, picture.shape[1] // 2] for picture in pictures(figure)[:2]
    )
    assert still.astype(int).sum() > moved.astype(int).sum() + 200
    assert is_whole(displacement(reshaped_die(before, mesh.faces, np.eye(3))))


@pytest.mark.parametrize("count", [1, 4])
def test_each_outcome_is_shown_lying_and_from_below(count: int) -> None:
    """The facet that it rests on is seen straight from below, in the outcome's color."""
    mesh = dumbbell()
    downs = np.concatenate([np.eye(3)[1:], -np.eye(3), np.eye(3)[:1]])[:count] * 7.0
    die = reshaped_die(mesh.vertices, mesh.faces, downs)
    shown = pictures_by_title(rests(die))
    hues = rgb(outcome_colors(count))
    hues -= hues.mean(axis=1, keepdims=True)
    for k, p in enumerate(die.plain.outcomes.probabilities):
        assert f"${k}$: {100.0 * p:.2f} %" in shown
        underside = shown[f"${k}$: underside"].reshape(-1, 3).astype(float)
        spread = np.ptp(underside, axis=1)
        colored = underside[spread > 0.7 * spread.max()].mean(axis=0)
        assert int(np.argmax(hues @ (colored - colored.mean()) / norms(hues))) == k


def test_three_outcomes_fill_the_width_of_a_report() -> None:
    mesh = dumbbell()
    die = reshaped_die(mesh.vertices, mesh.faces, 7.0 * np.eye(3))
    drawn = pixels(rests(die, width=PAGE_WIDTH))
    fifths = np.array_split(drawn.min(axis=(0, 2)), 5)
    assert fifths[0].min() < 200
    assert fifths[-1].min() < 200


def test_intersecting_triangles_are_red() -> None:
    mesh = dumbbell()
    die = reshaped_die(mesh.vertices, mesh.faces, np.eye(3))

    def count_red(pairs: list[list[int]]) -> int:
        quality: Any = SimpleNamespace(intersections=np.reshape(pairs, (-1, 2)).astype(int))
        drawn = np.concatenate(pictures(crossings(replace(die, quality=quality))))
        channels = drawn[..., :3].astype(int)
        return int((channels[..., 0] > channels[..., 1] + 60).sum())

    everything = np.arange(len(mesh.faces)).reshape(-1, 2).tolist()
    assert count_red([]) == 0 < count_red([[0, 1]]) < count_red(everything)
