"""A solid on the print bed, against solids whose areas and volumes are known."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from dicedesign.fabricate.printability import (
    PrintedSolid,
    beds,
)
from dicedesign.fabricate.printers import PRINTERS, Printer
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.rest.poses import rest_poses

GOLDEN = (1.0 + math.sqrt(5.0)) / 2.0


def upto(degrees: float) -> Printer:
    """A printer that needs supports up to an angle from level."""
    return replace(PRINTERS["fdm"], overhang_deg=degrees)


def icosahedron(edge: float) -> ConvexHull:
    corners = [
        np.roll((0.0, a, b * GOLDEN), shift)
        for shift in range(3)
        for a in (-1.0, 1.0)
        for b in (-1.0, 1.0)
    ]
    return convex_hull(0.5 * edge * np.array(corners))


def plain(hull: ConvexHull) -> PrintedSolid:
    return PrintedSolid(hull.vertices, hull.triangles, hull, (), np.zeros((0, 3)))


def test_a_box_hangs_over_nowhere() -> None:
    hull = convex_hull(np.array([(x, y, z) for x in (0, 2) for y in (0, 3) for z in (0, 5)]))
    poses = plain(hull).poses(hull.normals, upto(45.0))
    assert [pose.overhang_mm2 for pose in poses] == [0.0] * 6
    for pose in poses:
        side = int(np.abs(pose.normal).argmax())
        assert pose.height_mm == pytest.approx((2, 3, 5)[side])
        assert pose.contact_mm2 == pytest.approx((15, 10, 6)[side])


def test_an_icosahedron_hangs_over_by_three_faces() -> None:
    """Its neighbors rise at 41.8 degrees: filament cannot, resin can."""
    hull, face = icosahedron(10.0), math.sqrt(3.0) / 4.0 * 100.0
    solid = plain(hull)
    for pose in solid.poses(hull.normals, upto(45.0)):
        assert pose.contact_mm2 == pytest.approx(face)
        assert pose.overhang_mm2 == pytest.approx(3.0 * face)
        # Beneath a face that rises from an edge on the bed is a prism: its height is a third of
        # that of the tip, its base the face's shadow.
        rise = math.acos(math.sqrt(5.0) / 3.0)
        tip = math.sqrt(3.0) / 2.0 * 10.0 * math.sin(rise)
        beneath = 3.0 * face * math.cos(rise) * tip / 3.0
        assert pose.support_mm3 == pytest.approx(beneath)
    for limit in (0.0, 19.0, 41.8):
        poses = solid.poses(hull.normals, upto(limit))
        assert [pose.overhang_mm2 for pose in poses] == [0.0] * 20
    assert solid.overhanging(hull.normals, upto(45.0)).sum(axis=0).tolist() == [3] * 20


def test_numbers_on_supports_are_spoiled_too() -> None:
    """Each facet of an icosahedron has a number: its own and its neighbors' are spoiled where
    filament needs supports, and with resin its own."""
    hull = icosahedron(10.0)
    labels = tuple(str(n) for n in range(1, 21))
    solid = PrintedSolid(hull.vertices, hull.triangles, hull, labels, hull.normals)
    for limit, count in ((45.0, 4), (19.0, 1), (0.0, 1)):
        for n, pose in enumerate(solid.poses(hull.normals, upto(limit))):
            assert pose.label == labels[n]
            assert len(pose.spoiled) == count
            assert pose.label in pose.spoiled


def test_a_tip_is_no_bed_while_there_is_a_foot() -> None:
    """A tall prism stands on a small facet only where there is no other."""
    box = np.array([(x, y, z) for x in (0, 4) for y in (0, 4) for z in (0, 30)], dtype=float)
    hull = convex_hull(box)
    directions = beds(hull, rest_poses(box).facets, True)
    assert sorted(np.abs(directions[:, 2]).round(9).tolist()) == [0.0] * 4
    needle = convex_hull(box * (1.0, 0.05, 1.0))
    directions = beds(needle, np.array([0, 3]), True)
    # Slabs lie on their two wide sides.
    assert np.abs(directions @ (0.0, 1.0, 0.0)).min() == pytest.approx(1.0)


def test_a_round_die_has_no_foot_and_lies_on_a_rest() -> None:
    points = np.random.default_rng(2).normal(size=(400, 3))
    ball = convex_hull(points / np.linalg.norm(points, axis=1, keepdims=True))
    rests = np.array([1, 2])
    np.testing.assert_array_equal(beds(ball, rests, True), ball.normals[rests])
    # As any concave one does.
    np.testing.assert_array_equal(
        beds(icosahedron(5.0), rests, False), icosahedron(5.0).normals[rests]
    )
