"""Ways to read a die, and the regions of its labels."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from dicedesign.errors import EngravingError
from dicedesign.fabricate.finish_options import EngravingOptions
from dicedesign.fabricate.label_layout import Reading, die_readings, place_labels
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.runtime.arrays import Floats
from tests.reference.solids import PLATONIC

LETTERS = "abcdefghijklmnopqrst"


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


def test_dice_with_edges_on_top_are_read_from_below() -> None:
    """Around an odd prism there is an edge on top of each side."""
    hull = prism(5)
    sides = np.flatnonzero(np.abs(hull.normals[:, 2]) < 0.5).tolist()
    assert read_as(hull, "auto", sides).way == "down"
    with pytest.raises(EngravingError, match="leans by 36 degrees on top of 'a'; write read: down"):
        read_as(hull, "up", sides)
    assert read_as(prism(6), "auto").way == "up"


def test_facets_that_lean_by_five_degrees_are_level() -> None:
    cube = PLATONIC["cube"]
    for degrees, way in ((4.0, "up"), (6.0, "down")):
        bent = cube.copy()
        bent[:, 2] += np.tan(np.radians(degrees)) * cube[:, 0] * (cube[:, 2] > 0.0)
        assert read_as(convex_hull(bent), "auto").way == way


def test_both_sides_have_the_label() -> None:
    hull = prism(4, 0.7)
    base, top = int(hull.normals[:, 2].argmin()), int(hull.normals[:, 2].argmax())
    reading = read_as(hull, "both", [base])
    assert [place.facet for place in reading.places] == [base, top]
    assert {place.text for place in reading.places} == {"a"}
    with pytest.raises(EngravingError, match="'b' has too on top of 'a'"):
        read_as(hull, "both", [base, top])
    with pytest.raises(EngravingError, match="leans by 36 degrees on top of 'a'"):
        read_as(prism(5), "both", [int(np.abs(prism(5).normals[:, 2]).argmin())])


def test_corners_must_be_visible_from_above() -> None:
    """On its base a pyramid has its tip on top, unless that leans over the base's edge."""
    square = np.array([(1.0, 1.0, 0.0), (-1.0, 1.0, 0.0), (-1.0, -1.0, 0.0), (1.0, -1.0, 0.0)])
    for x, way in ((0.3, "corner"), (1.2, None)):
        hull = convex_hull(np.concatenate([square, [[x, 0.0, 2.0]]]))
        base = [int(hull.normals[:, 2].argmin())]
        assert read_as(hull, "auto", base).way == "down"
        if way is None:
            with pytest.raises(EngravingError, match=r"leans by .* degrees on top of .a."):
                read_as(hull, "up", base)
        else:
            reading = read_as(hull, "up", base)
            assert reading.way == way
            assert len(reading.places) == 4
