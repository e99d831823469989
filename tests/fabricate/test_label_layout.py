"""Places of labels: margins, uprights, line breaks and sizes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dicedesign.errors import EngravingError, InputError, LabelRoomError
from dicedesign.fabricate.finish_options import EngravingOptions
from dicedesign.fabricate.label_layout import LabelPlace, edge_margins, place_labels
from dicedesign.geometry.hulls.hull import convex_hull


def wedge(degrees: float) -> np.ndarray:
    """A prism over an isosceles triangle with an angle at its apex, in mm."""
    half = math.radians(degrees) / 2.0
    triangle = 20.0 * np.array([(0.0, 0.0), (math.cos(half), math.sin(half))])
    triangle = np.vstack([triangle, triangle[1] * (1.0, -1.0)])
    return np.array([(x, y, z) for x, y in triangle for z in (-15.0, 15.0)])


@pytest.mark.parametrize("degrees", [30.0, 90.0, 150.0])
def test_pockets_keep_a_wall_from_the_bisector_of_an_edge(degrees: float) -> None:
    options = EngravingOptions(depth_mm=0.8, margin_mm=0.4)
    hull = convex_hull(wedge(degrees))
    facet = int(np.argmax(hull.normals[:, 1]))
    margins = edge_margins(hull, facet, options)
    polygon = hull.polygon(facet)
    following = np.roll(polygon, -1, axis=0)
    apex = np.flatnonzero((abs(polygon[:, 0]) < 1e-9) & (abs(following[:, 0]) < 1e-9))
    expected = max(0.4, 0.8 / math.tan(math.radians(degrees) / 2.0) + 0.2)
    assert margins[apex] == pytest.approx(expected)
    ends = np.flatnonzero(abs(polygon[:, 2] - following[:, 2]) < 1e-9)
    assert margins[ends] == pytest.approx(1.0)  # the ends are upright


OPTIONS = EngravingOptions()

ONE_LINE = "big\N{NO-BREAK SPACE}hit"


def to_body_frame(placement) -> np.ndarray:
    flat = np.concatenate([np.asarray(part) for part in placement.section().to_polygons()])
    local = np.column_stack([flat, np.zeros(len(flat)), np.ones(len(flat))])
    return (local @ placement.frame.T)[:, :3]


def clearances(placement, polygon, normal) -> np.ndarray:
    """Distances (n, m) of the label's points from the edges, inward."""
    following = np.roll(polygon, -1, axis=0)
    inward = np.cross(normal, following - polygon)
    inward /= np.linalg.norm(inward, axis=1, keepdims=True)
    return np.einsum("pfk,fk->pf", to_body_frame(placement)[:, None] - polygon[None], inward)


@pytest.mark.parametrize("upright", ["edge", (0.3, -0.8, 0.5)])
def test_labels_lie_upright_within_the_margin_of_their_facet(box, upright):
    turn = Rotation.random(rng=np.random.default_rng(0)).as_matrix()
    body = box(14.0, 11.0, 9.0).with_points(turn)
    options = EngravingOptions(upright=upright, min_height_mm=2.0)
    placements = place_labels(body.places(["1", "6", "16", "8", "100", "9"]), options, body.size_mm)
    for placement, polygon, normal in zip(placements, body.polygons, body.normals, strict=True):
        points = to_body_frame(placement)
        np.testing.assert_allclose((points - polygon[0]) @ normal, 0, atol=1e-12)
        assert clearances(placement, polygon, normal).min() >= options.margin_mm - 1e-6
        _, up, out = placement.frame[:3, :3].T
        np.testing.assert_allclose(out, normal, atol=1e-12)
        # Right-handed, hence not mirrored.
        assert np.linalg.det(placement.frame) == pytest.approx(1.0)
        if upright == "edge":
            # The longest edge is at the bottom.
            below = np.argsort((polygon - placement.frame[:3, 3]) @ up)[:2]
            longest = np.linalg.norm(np.roll(polygon, -1, axis=0) - polygon, axis=1).max()
            assert np.linalg.norm(np.diff(polygon[below], axis=0)) == pytest.approx(longest)
        else:
            toward = upright - (upright @ normal) * normal
            np.testing.assert_allclose(up, toward / np.linalg.norm(toward), atol=1e-12)


def test_line_breaks_make_words_largest():
    """In a square two lines, in a long rectangle one."""
    options = EngravingOptions(max_height_mm=20.0, min_height_mm=0.5)
    heights = {}
    for shape in ((8.0, 8.0), (30.0, 3.0)):
        corners = 0.5 * np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]) * (*shape, 1)
        for text in ("big hit", ONE_LINE):
            place = LabelPlace(text, 0, 0, corners, np.array([0.0, 0.0, 1.0]))
            (label,) = place_labels([place], options, 40.0)
            heights[shape, text] = label.height
    assert heights[(8.0, 8.0), "big hit"] > 1.2 * heights[(8.0, 8.0), ONE_LINE]
    assert heights[(30.0, 3.0), "big hit"] == pytest.approx(heights[(30.0, 3.0), ONE_LINE])


def test_strokes_grow_to_their_least_width_within_the_margin(box):
    """A bar of known thickness: a minus sign is a rectangle."""
    body = box(9.0, 9.0, 9.0)
    options = EngravingOptions(stroke_mm=0.8, min_height_mm=1.0, max_height_mm=2.0)
    plain = EngravingOptions(min_height_mm=1.0, max_height_mm=2.0)
    (wide,) = place_labels(body.places(["–"]), options, body.size_mm)
    (thin,) = place_labels(body.places(["–"]), plain, body.size_mm)
    left, bottom, right, top = wide.section().bounds()
    thin_left, thin_bottom, thin_right, thin_top = thin.section().bounds()
    assert thin_top - thin_bottom < 0.6
    assert 0.72 <= top - bottom <= 0.808
    assert right - left > thin_right - thin_left
    assert clearances(wide, body.polygons[0], body.normals[0]).min() >= options.margin_mm - 1e-6


def test_strokes_that_would_close_a_hole_are_refused(box):
    body = box(9.0, 9.0, 9.0)
    options = EngravingOptions(stroke_mm=2.0, max_height_mm=3.0)
    (placement,) = place_labels(body.places(["8"]), options, 15.0)
    with pytest.raises(EngravingError, match=r"label '8' on facet 0: expected 2 holes .* reduce"):
        placement.section()


def test_the_advised_size_is_the_least(box):
    body = box(6.0, 5.0, 4.0)
    texts = ["1", "12", "123", "1234", "6", "3"]
    with pytest.raises(LabelRoomError) as caught:
        place_labels(body.places(texts), OPTIONS, body.size_mm)
    assert str(caught.value).startswith("label '1234': expected room on facet 3 for digits")
    advised = caught.value.size_mm
    larger = body.with_points(np.eye(3), advised / body.size_mm)
    placements = place_labels(larger.places(texts), OPTIONS, larger.size_mm)
    assert min(placement.height for placement in placements) >= OPTIONS.min_height_mm

    smaller = body.with_points(np.eye(3), (advised - 0.11) / body.size_mm)
    with pytest.raises(EngravingError, match=f"use size_mm = {advised:.1f}"):
        place_labels(smaller.places(texts), OPTIONS, smaller.size_mm)


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ({"margin_mm": -1.0}, "margin_mm"),
        ({"font": " "}, "font: expected a name or a path, got ' '"),
        ({"upright": "down"}, "upright: expected edge or largest, .*, got 'down'"),
        ({"upright": (0.0, 0.0, 0.0)}, "three finite numbers that are not all 0, got"),
        ({"max_height_mm": 2.0}, "max_height_mm: expected at least min_height_mm = 2.5, got 2.0"),
    ],
)
def test_invalid_options_are_refused(values, expected):
    with pytest.raises(InputError, match=expected):
        EngravingOptions(**values)
