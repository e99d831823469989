from __future__ import annotations

import math
import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dicedesign.errors import EngravingError, InputError, LabelRoomError
from dicedesign.fabricate.labels.glyphs import label_contours
from dicedesign.fabricate.labels.layout import place_labels
from dicedesign.fabricate.labels.options import EngravingOptions

OPTIONS = EngravingOptions()


def on_body(placement) -> np.ndarray:
    flat = placement.height * np.concatenate(label_contours(placement.text))
    local = np.column_stack([flat, np.zeros(len(flat)), np.ones(len(flat))])
    return (local @ placement.frame.T)[:, :3]


@pytest.mark.parametrize("seed", range(5))
def test_labels_lie_within_the_margin_of_their_facet(box, seed):
    body = box(14.0, 11.0, 9.0).moved(Rotation.random(rng=np.random.default_rng(seed)).as_matrix())
    texts = ["1", "6", "16", "8", "100", "9"]
    placements = place_labels(texts, body.polygons, body.normals, range(6), OPTIONS, body.size_mm)
    for placement, polygon, normal in zip(placements, body.polygons, body.normals, strict=True):
        points = on_body(placement)
        np.testing.assert_allclose((points - polygon[0]) @ normal, 0, atol=1e-12)
        following = np.roll(polygon, -1, axis=0)
        inward = np.cross(normal, following - polygon)
        inward /= np.linalg.norm(inward, axis=1, keepdims=True)
        distance = np.einsum("pfk,fk->pf", points[:, None] - polygon[None], inward)
        half_width = 0.5 * min(np.linalg.norm(following - polygon, axis=1))
        assert distance.min() >= OPTIONS.margin * half_width - 1e-9
        # Upright: the longest edge is at the bottom; right-handed, hence not mirrored.
        longest = np.linalg.norm(following - polygon, axis=1).max()
        below = (polygon - placement.frame[:3, 3]) @ placement.frame[:3, 1]
        bottom = np.sort(below)[:2]
        assert bottom[0] == pytest.approx(bottom[1])
        bottom_corners = polygon[np.argsort(below)[:2]]
        assert np.linalg.norm(bottom_corners[0] - bottom_corners[1]) == pytest.approx(longest)
        np.testing.assert_allclose(placement.frame[:3, 2], normal, atol=1e-12)
        assert np.linalg.det(placement.frame) == pytest.approx(1.0)


def test_a_label_touches_the_circle_that_the_margin_leaves():
    square = np.array([(-3, -3, 1), (3, -3, 1), (3, 3, 1), (-3, 3, 1)], dtype=float)
    options = EngravingOptions(margin=0.2, min_height_mm=0.1)
    (placement,) = place_labels(["16"], [square], [np.array([0, 0, 2.0])], [0], options, 9.0)
    points = on_body(placement)
    low, high = points.min(axis=0), points.max(axis=0)
    np.testing.assert_allclose(low + high, (0, 0, 2), atol=1e-7)
    assert np.linalg.norm(high - low) == pytest.approx(2 * 0.8 * 3.0)


@pytest.mark.parametrize("scale", [1.0, 0.01])
def test_the_longest_edge_is_below_wherever_the_facet_is(scale):
    """Of a triangle, which has no second one like it, beside the origin; however small."""
    corners = scale * np.array([(10, 0, 5), (16, 0, 5), (10, 8, 5)], dtype=float)
    options = EngravingOptions(min_height_mm=1e-3)
    (placement,) = place_labels(["7"], [corners], [np.array([0, 0, 1.0])], [0], options, 17 * scale)
    np.testing.assert_allclose(placement.frame[:3, 0], [-0.6, 0.8, 0.0], atol=1e-12)
    # It is in the incircle, of radius (6 + 8 - 10) / 2, or near to it.
    middle = on_body(placement)
    middle = (middle.min(axis=0) + middle.max(axis=0)) / 2.0 / scale
    assert np.linalg.norm(middle - [12, 2, 5]) < 0.7


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
    assert "diameter 4.00 mm" in message
    assert "(4 of 6 labels are too small" in message
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
        ({"margin": 1.0}, r"margin: expected a number in \[0, 1\), got 1.0"),
        ({"margin": "0.1"}, "margin: expected a finite number, got '0.1'"),
        ({"min_height_mm": -1}, "min_height_mm: expected a number above 0, got -1"),
        ({"max_height_mm": 2.0}, "max_height_mm: expected at least min_height_mm = 2.5, got 2.0"),
    ],
)
def test_options_say_what_is_wrong(values, expected):
    with pytest.raises(InputError, match=expected):
        EngravingOptions(**values)
