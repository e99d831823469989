"""Places of labels: ways to read a die, margins, uprights, line breaks and sizes."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
import pytest
from scipy.spatial import HalfspaceIntersection
from scipy.spatial.transform import Rotation

from dicedesign.errors import EngravingError, LabelRoomError
from dicedesign.fabricate.finish_options import EngravingOptions
from dicedesign.fabricate.label_layout import Placement, edge_margins, place_labels, upright_choices
from dicedesign.fabricate.label_reading import LabelPlace, Reading, die_readings
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.runtime.arrays import Floats
from tests.reference.solids import PLATONIC


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
    sizes = []
    for stroke in (0.0, 0.8):
        options = EngravingOptions(stroke_mm=stroke, min_height_mm=1.0, max_height_mm=2.0)
        (label,) = place_labels(body.places(["–"]), options, body.size_mm)
        left, bottom, right, top = label.section().bounds()
        sizes.append((right - left, top - bottom))
        assert clearances(label, body.polygons[0], body.normals[0]).min() >= 0.5 - 1e-6
    thin, wide = sizes
    assert thin[0] < wide[0]
    assert thin[1] < 0.6 < 0.72 <= wide[1] <= 0.808


def test_strokes_that_would_close_a_hole_are_refused(box):
    options = EngravingOptions(stroke_mm=2.0, max_height_mm=3.0)
    (placement,) = place_labels(box(9.0, 9.0, 9.0).places(["8"]), options, 15.0)
    with pytest.raises(EngravingError, match=r"'8' on facet 0: .*2 holes"):
        placement.section()


def test_the_advised_size_is_the_least(box):
    body, texts = box(6.0, 5.0, 4.0), ["1", "12", "123", "1234", "6", "3"]

    def place(factor: float) -> list[Placement]:
        sized = body.with_points(np.eye(3), factor)
        return place_labels(sized.places(texts), OPTIONS, sized.size_mm)

    with pytest.raises(LabelRoomError, match=r"'1234'.*facet 3") as caught:
        place(1.0)
    advised = caught.value.size_mm
    heights = [placement.height for placement in place(advised / body.size_mm)]
    assert min(heights) >= OPTIONS.min_height_mm
    with pytest.raises(LabelRoomError, match=f"{advised:.1f}"):
        place((advised - 0.11) / body.size_mm)


# Ways to read a die.


LETTERS = "abcdefghijklmnopqrstuvw"


def read_as(hull: ConvexHull, read: str, facets: list[int] | None = None) -> Reading:
    """Reading of a hull whose facets, or some of them, have letters."""
    chosen = np.arange(len(hull.normals)) if facets is None else np.array(facets)
    return die_readings(hull, chosen, LETTERS[: len(chosen)], read)[0]


def prism(sides: int, top: float = 1.0, height: float = 3.0) -> ConvexHull:
    """A regular prism along z, or a frustum."""
    angle = 2.0 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    low, high = np.full((sides, 1), 0.0), np.full((sides, 1), height)
    return convex_hull(np.concatenate([np.hstack([ring, low]), np.hstack([top * ring, high])]))


def disjoint(one: Floats, other: Floats, normal: Floats) -> bool:
    """Whether an edge separates two coplanar convex polygons."""
    for a, b in ((one, other), (other, one)):
        for start, end in zip(a, np.roll(a, -1, axis=0), strict=True):
            if ((b - start) @ np.cross(normal, end - start) <= 1e-12).all():
                return True
    return False


@pytest.mark.parametrize("name", ["cube", "icosahedron"])
def test_opposite_sides_are_read_from_above(name: str) -> None:
    hull = convex_hull(PLATONIC[name])
    reading = read_as(hull, "auto")
    assert reading.way == read_as(hull, "up").way == "up"
    for place in reading.places:
        assert place.text == LETTERS[place.outcome]
        np.testing.assert_allclose(place.normal, -hull.normals[place.outcome], atol=1e-12)
        heights = place.region @ place.normal
        np.testing.assert_allclose(heights, (hull.vertices @ place.normal).max())
    below = read_as(hull, "down")
    assert [place.facet for place in below.places] == list(range(len(hull.normals)))


def test_a_tetrahedron_is_read_around_the_corner_on_top() -> None:
    """A stretched one, whose facets have different angles."""
    hull = convex_hull(20.0 * PLATONIC["tetrahedron"] * [1.0, 1.1, 1.2])
    reading = read_as(hull, "auto")
    placements = place_labels(reading.places, EngravingOptions(), hull.diameter)
    for place, placement in zip(reading.places, placements, strict=True):
        top = hull.vertices[(hull.vertices @ -hull.normals[place.outcome]).argmax()]
        toward = top - placement.frame[:3, 3]
        # The label stands upright toward the corner.
        assert toward @ placement.frame[:3, 1] > 0.8 * np.linalg.norm(toward)
    assert reading.way == "corner"
    for outcome in range(4):
        top = hull.vertices[(hull.vertices @ -hull.normals[outcome]).argmax()]
        mine = [place for place in reading.places if place.outcome == outcome]
        assert sorted(place.facet for place in mine) == [f for f in range(4) if f != outcome]
        for place in mine:
            corners = hull.polygon(place.facet)
            # Each point of the region is nearer to that corner than to any other one.
            near = np.linalg.norm(place.region - top, axis=1)
            for corner in corners[np.linalg.norm(corners - top, axis=1) > 1e-9]:
                assert (np.linalg.norm(place.region - corner, axis=1) >= near - 1e-9).all()
    for one, other in combinations(reading.places, 2):
        if one.facet == other.facet:
            assert disjoint(one.region, other.region, one.normal)


def test_edges_on_top_have_their_label_on_both_sides() -> None:
    """Around an odd prism there is an edge on top of each side, and its ends are level."""
    hull = prism(5)
    is_side = np.abs(hull.normals[:, 2]) < 0.5
    assert read_as(prism(6), "auto").way == "up"
    for chosen in (np.arange(7), np.flatnonzero(is_side)):
        reading = read_as(hull, "auto", chosen.tolist())
        assert reading.way == read_as(hull, "up", chosen.tolist()).way == "edge"
        assert len(reading.places) == 2 * is_side[chosen].sum() + (~is_side[chosen]).sum()
        ups = [choice[0] for choice in upright_choices(reading.places, OPTIONS)]
        for place, up in zip(reading.places, ups, strict=True):
            heights = hull.vertices @ -hull.normals[chosen[place.outcome]]
            highest = hull.vertices[heights >= heights.max() - 1e-9]
            if len(highest) > 2:
                assert len(place.region) == 5
                continue
            # The label stands upright toward the edge on top, which its half of the facet meets.
            assert len(highest) == 2
            np.testing.assert_allclose(up @ (highest[1] - highest[0]), 0.0, atol=1e-9)
            near = (place.region - highest[0]) @ up
            np.testing.assert_allclose(sorted(near), [near.min()] * 2 + [0.0] * 2, atol=1e-9)
            assert -near.min() == pytest.approx(math.sin(math.pi / 5.0))
        for one, other in combinations(reading.places, 2):
            if one.facet == other.facet:
                assert disjoint(one.region, other.region, one.normal)


# Uprights.


def trapezohedron(sides: int) -> ConvexHull:
    """The polar dual of an antiprism, with a kite for each of its corners."""
    angle, z = np.pi * np.arange(2 * sides) / sides, 0.4 * (-1.0) ** np.arange(2 * sides)
    planes = np.stack([np.cos(angle), np.sin(angle), z, -np.ones(2 * sides)], axis=1)
    return convex_hull(HalfspaceIntersection(planes, np.zeros(3)).intersections)


@pytest.mark.parametrize(
    ("hull", "order", "alike"),
    [
        (convex_hull(PLATONIC["cube"]), 24, 6),
        (convex_hull(PLATONIC["octahedron"]), 24, 8),
        (trapezohedron(5), 10, 10),
        (convex_hull(PLATONIC["dodecahedron"]), 60, 6),
        (trapezohedron(7), 14, 14),
        (convex_hull(PLATONIC["icosahedron"]), 60, 10),
    ],
    ids=["d6", "d8", "d10", "d12", "d14", "d20"],
)
def test_uprights_are_images_of_each_other(hull: ConvexHull, order: int, alike: int) -> None:
    """Under all rotations of a body whose faces have none of their own, and under those about an
    axis of a regular one; in any orientation."""
    turn = Rotation.random(rng=np.random.default_rng(1)).as_matrix()
    for body in (hull, convex_hull(hull.vertices @ turn.T)):
        normals, everything = body.normals, np.arange(len(body.normals))
        places = read_as(body, "down", everything.tolist()).places
        ups = np.array([choice[0] for choice in upright_choices(places, OPTIONS)])
        frames, found, kept = [], 0, 0
        for place in places:
            for corner in place.region - place.region.mean(axis=0):
                right = corner / np.linalg.norm(corner)
                frames.append(np.stack([right, np.cross(place.normal, right), place.normal]).T)
        for frame in frames:
            motion = frame @ frames[0].T
            gaps = np.linalg.norm((body.vertices @ motion.T)[:, None] - body.vertices, axis=2)
            if gaps.min(axis=1).max() < 1e-6:
                image = (normals @ motion.T @ normals.T).argmax(axis=1)
                found += 1
                kept += np.allclose(ups @ motion.T, ups[image], atol=1e-3)
        assert (found, kept) == (order, alike)


def test_both_sides_have_the_label() -> None:
    hull = prism(4, 0.7)
    base, top = int(hull.normals[:, 2].argmin()), int(hull.normals[:, 2].argmax())
    reading = read_as(hull, "both", [base])
    assert [place.facet for place in reading.places] == [base, top]
    assert {place.text for place in reading.places} == {"a"}
    with pytest.raises(EngravingError, match=r"'b'.*'a'"):
        read_as(hull, "both", [base, top])
    with pytest.raises(EngravingError, match=r"36 degrees.*'a'"):
        read_as(prism(5), "both", [int(np.abs(prism(5).normals[:, 2]).argmin())])


def test_corners_must_be_visible_from_above() -> None:
    """On its base a pyramid has its tip on top, unless that leans over the base's edge."""
    square = np.array([(1.0, 1.0, 0.0), (-1.0, 1.0, 0.0), (-1.0, -1.0, 0.0), (1.0, -1.0, 0.0)])
    for x, way in ((0.3, "corner"), (1.2, None)):
        hull = convex_hull(np.concatenate([square, [[x, 0.0, 2.0]]]))
        base = [int(hull.normals[:, 2].argmin())]
        assert read_as(hull, "auto", base).way == "down"
        if way is None:
            with pytest.raises(EngravingError, match=r"degrees.*'a'"):
                read_as(hull, "up", base)
        else:
            reading = read_as(hull, "up", base)
            assert reading.way == way
            assert len(reading.places) == 4
