from __future__ import annotations

import math
import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dicedesign.errors import EngravingError, InputError, LabelRoomError
from dicedesign.fabricate.finish_options import EngravingOptions
from dicedesign.fabricate.label_layout import place_labels

OPTIONS = EngravingOptions()

ONE_LINE = "big\N{NO-BREAK SPACE}hit"


def on_body(placement) -> np.ndarray:
    flat = np.concatenate([np.asarray(part) for part in placement.section().to_polygons()])
    local = np.column_stack([flat, np.zeros(len(flat)), np.ones(len(flat))])
    return (local @ placement.frame.T)[:, :3]


def clearances(placement, polygon, normal) -> np.ndarray:
    """Distances (n, m) of the label's points from the edges, inward."""
    following = np.roll(polygon, -1, axis=0)
    inward = np.cross(normal, following - polygon)
    inward /= np.linalg.norm(inward, axis=1, keepdims=True)
    return np.einsum("pfk,fk->pf", on_body(placement)[:, None] - polygon[None], inward)


@pytest.mark.parametrize("seed", range(5))
def test_labels_lie_within_the_margin_of_their_facet(box, seed):
    body = box(14.0, 11.0, 9.0).moved(Rotation.random(rng=np.random.default_rng(seed)).as_matrix())
    texts = ["1", "6", "16", "8", "100", "9"]
    placements = place_labels(texts, body.polygons, body.normals, range(6), OPTIONS, body.size_mm)
    for placement, polygon, normal in zip(placements, body.polygons, body.normals, strict=True):
        points = on_body(placement)
        np.testing.assert_allclose((points - polygon[0]) @ normal, 0, atol=1e-12)
        assert clearances(placement, polygon, normal).min() >= OPTIONS.margin_mm - 1e-6
        # Upright: the longest edge is at the bottom; right-handed, hence not mirrored.
        following = np.roll(polygon, -1, axis=0)
        longest = np.linalg.norm(following - polygon, axis=1).max()
        below = (polygon - placement.frame[:3, 3]) @ placement.frame[:3, 1]
        bottom = np.sort(below)[:2]
        assert bottom[0] == pytest.approx(bottom[1])
        bottom_corners = polygon[np.argsort(below)[:2]]
        assert np.linalg.norm(bottom_corners[0] - bottom_corners[1]) == pytest.approx(longest)
        np.testing.assert_allclose(placement.frame[:3, 2], normal, atol=1e-12)
        assert np.linalg.det(placement.frame) == pytest.approx(1.0)


def test_a_label_fills_a_rectangle_up_to_the_margin():
    corners = np.array([(-5, -2, 1), (5, -2, 1), (5, 2, 1), (-5, 2, 1)], dtype=float)
    options = EngravingOptions(margin_mm=0.25)
    (placement,) = place_labels(["1"], [corners], [np.array([0, 0, 2.0])], [0], options, 9.0)
    points = on_body(placement)
    low, high = points.min(axis=0), points.max(axis=0)
    # It may give up a little height, as centring allows, but here its middle is that of the face.
    np.testing.assert_allclose(low + high, (0, 0, 2), atol=1e-6)
    assert 0.87 * 3.5 < high[1] - low[1] <= 3.5 + 1e-6


@pytest.mark.parametrize("scale", [1.0, 0.01])
def test_the_longest_edge_is_below_wherever_the_facet_is(scale):
    """Of a triangle, which has no second one like it, beside the origin; however small."""
    corners = scale * np.array([(10, 0, 5), (16, 0, 5), (10, 8, 5)], dtype=float)
    options = EngravingOptions(min_height_mm=1e-3, margin_mm=0.0)
    (placement,) = place_labels(["7"], [corners], [np.array([0, 0, 1.0])], [0], options, 17 * scale)
    np.testing.assert_allclose(placement.frame[:3, 0], [-0.6, 0.8, 0.0], atol=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_labels_are_upright_toward_a_direction(box, seed):
    rng = np.random.default_rng(seed)
    body = box(16.0, 15.0, 14.0).moved(Rotation.random(rng=rng).as_matrix())
    toward = rng.normal(size=3)
    options = EngravingOptions(upright=tuple(toward.tolist()))
    placements = place_labels(
        list("123456"), body.polygons, body.normals, range(6), options, body.size_mm
    )
    for placement, polygon, normal in zip(placements, body.polygons, body.normals, strict=True):
        up = toward - (toward @ normal) * normal
        np.testing.assert_allclose(placement.frame[:3, 1], up / np.linalg.norm(up), atol=1e-12)
        assert clearances(placement, polygon, normal).min() >= options.margin_mm - 1e-6


def test_a_direction_says_nothing_on_the_facet_that_it_is_normal_to(box):
    body = box(16.0, 12.0, 10.0)
    options = EngravingOptions(upright=(0.0, 0.0, 1.0))
    top, _, side, *_ = place_labels(
        list("123456"), body.polygons, body.normals, range(6), options, body.size_mm
    )
    assert abs(top.frame[0, 0]) == pytest.approx(1.0)  # along the longest edge
    np.testing.assert_allclose(side.frame[:3, 1], (0, 0, 1), atol=1e-12)


def test_the_largest_label_of_all_edges_is_at_least_that_of_the_longest():
    """A number is taller than wide: in a box of 4 by 12 it has most room on a short edge."""
    corners = np.array([(-6, -2, 0), (6, -2, 0), (6, 2, 0), (-6, 2, 0)], dtype=float)
    arguments = ([corners], [np.array([0, 0, 1.0])], [0])
    heights = {}
    for upright in ("edge", "largest"):
        options = EngravingOptions(upright=upright, min_height_mm=0.5, max_height_mm=20.0)
        (placement,) = place_labels(["1"], *arguments, options, 12.6)
        heights[upright] = placement.height
        assert abs(placement.frame[0, 0]) == pytest.approx(float(upright == "edge"))
    assert heights["largest"] > 1.3 * heights["edge"]


def test_words_take_as_many_lines_as_make_them_largest():
    """In a square two lines, in a long rectangle one."""
    options = EngravingOptions(max_height_mm=20.0, min_height_mm=0.5)
    heights = {}
    for shape in ((8.0, 8.0), (30.0, 3.0)):
        corners = 0.5 * np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]) * (*shape, 1)
        for text in ("big hit", ONE_LINE):
            (label,) = place_labels([text], [corners], [np.array([0, 0, 1.0])], [0], options, 40.0)
            heights[shape, text] = label.height
    assert heights[(8.0, 8.0), "big hit"] > 1.2 * heights[(8.0, 8.0), ONE_LINE]
    assert heights[(30.0, 3.0), "big hit"] == pytest.approx(heights[(30.0, 3.0), ONE_LINE])


def test_pips_are_as_large_on_facets_of_one_size():
    square = 6 * np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], dtype=float)
    options = EngravingOptions(content="pips", max_height_mm=20.0)
    normals = np.tile([0.0, 0.0, 1.0], (9, 1))
    texts = [str(number) for number in range(1, 10)]
    placements = place_labels(texts, [square] * 9, normals, range(9), options, 17.0)
    areas = [placement.section().area() / int(placement.text) for placement in placements]
    np.testing.assert_allclose(areas, areas[0], rtol=1e-5)


@pytest.mark.parametrize("stroke_mm", [0.5, 0.8, 1.0])
def test_strokes_grow_to_their_least_width_within_the_margin(box, stroke_mm):
    """A bar of known thickness: a minus sign is a rectangle."""
    body = box(9.0, 9.0, 9.0)
    options = EngravingOptions(stroke_mm=stroke_mm, min_height_mm=1.0, max_height_mm=2.0)
    plain = EngravingOptions(min_height_mm=1.0, max_height_mm=2.0)
    arguments = (body.polygons[:1], body.normals[:1], [0])
    (wide,) = place_labels(["–"], *arguments, options, body.size_mm)
    (thin,) = place_labels(["–"], *arguments, plain, body.size_mm)
    left, bottom, right, top = wide.section().bounds()
    assert top - bottom >= stroke_mm * 0.9
    thinner = thin.section().bounds()
    if thinner[3] - thinner[1] >= stroke_mm:
        assert wide.growth == 0.0
    else:
        assert top - bottom <= stroke_mm * 1.01
        assert right - left > thinner[2] - thinner[0]
    assert clearances(wide, body.polygons[0], body.normals[0]).min() >= options.margin_mm - 1e-6


def test_strokes_that_would_close_a_hole_are_refused_with_facet_numbers_and_remedy(box):
    body = box(9.0, 9.0, 9.0)
    options = EngravingOptions(stroke_mm=2.0, max_height_mm=3.0)
    (placement,) = place_labels(["8"], body.polygons[:1], body.normals[:1], [4], options, 15.0)
    with pytest.raises(EngravingError, match=r"label '8' on facet 4: expected 2 holes .* reduce"):
        placement.section()


def test_digits_stop_at_the_largest_height():
    square = 50 * np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], dtype=float)
    (placement,) = place_labels(["5"], [square], [np.array([0, 0, 1.0])], [0], OPTIONS, 150.0)
    assert placement.height == OPTIONS.max_height_mm


def test_the_advised_size_does_for_all_labels_and_little_less_does_not(box):
    body = box(6.0, 5.0, 4.0)
    texts = ["1", "12", "123", "1234", "6", "3"]
    arguments = (body.normals, range(6), OPTIONS)
    with pytest.raises(LabelRoomError) as caught:
        place_labels(texts, body.polygons, *arguments, body.size_mm)
    message = str(caught.value)
    assert message.startswith("label '1234': expected room on facet 3 for digits")
    assert "in a rectangle of " in message
    advised = float(re.search(r"use size_mm = ([\d.]+)", message).group(1))
    assert caught.value.size_mm == advised

    larger = body.moved(np.eye(3), advised / body.size_mm)
    placements = place_labels(texts, larger.polygons, *arguments, larger.size_mm)
    assert min(placement.height for placement in placements) >= OPTIONS.min_height_mm

    smaller = body.moved(np.eye(3), (advised - 0.11) / body.size_mm)
    with pytest.raises(EngravingError, match=f"use size_mm = {advised:.1f}"):
        place_labels(texts, smaller.polygons, *arguments, smaller.size_mm)


def test_a_clockwise_facet_is_refused(box):
    body = box(20.0, 20.0, 20.0)
    with pytest.raises(InputError, match="facet 4: expected corners that run counter-clockwise"):
        place_labels(["1"], [body.polygons[4][::-1]], [body.normals[4]], [4], OPTIONS, body.size_mm)


@pytest.mark.parametrize(
    ("normal", "size", "expected"),
    [(np.zeros(3), 9.0, "not zero"), (np.ones(2), 9.0, r"shape \(3,\)"), (np.ones(3), 0.0, "size")],
)
def test_unusable_arguments_are_refused(box, normal, size, expected):
    with pytest.raises(InputError, match=expected):
        place_labels(["1"], box(20.0, 20.0, 20.0).polygons[:1], [normal], [0], OPTIONS, size)


def test_sequences_of_different_length_are_refused(box):
    body = box(20.0, 20.0, 20.0)
    with pytest.raises(InputError, match="2 labels, 6 polygons"):
        place_labels(["1", "2"], body.polygons, body.normals, range(6), OPTIONS, body.size_mm)


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ({"depth_mm": 0.0}, "depth_mm: expected a number above 0, got 0.0"),
        ({"depth_mm": math.nan}, "depth_mm: expected a finite number, got nan"),
        ({"depth_mm": -0.5}, "depth_mm: expected a number above 0, got -0.5"),
        ({"margin_mm": -1.0}, "margin_mm: expected a number of at least 0, got -1.0"),
        ({"margin_mm": "0.1"}, "margin_mm: expected a finite number, got '0.1'"),
        ({"stroke_mm": -0.1}, "stroke_mm: expected a number of at least 0, got -0.1"),
        ({"content": "dots"}, "content: expected text or pips, got 'dots'"),
        ({"ambiguous": "line"}, "ambiguous: expected bar or dot or none, got 'line'"),
        ({"font": " "}, "font: expected a name or a path, got ' '"),
        ({"upright": "down"}, "upright: expected edge or largest, .*, got 'down'"),
        ({"upright": (0.0, 0.0, 0.0)}, "three finite numbers that are not all 0, got"),
        ({"upright": (0.0, math.inf, 0.0)}, "three finite numbers that are not all 0, got"),
        ({"min_height_mm": -1}, "min_height_mm: expected a number above 0, got -1"),
        ({"max_height_mm": 2.0}, "max_height_mm: expected at least min_height_mm = 2.5, got 2.0"),
    ],
)
def test_options_say_what_is_wrong(values, expected):
    with pytest.raises(InputError, match=expected):
        EngravingOptions(**values)
