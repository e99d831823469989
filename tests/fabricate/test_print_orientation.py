"""Orientations on the print bed of solids with known areas and volumes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from dicedesign.fabricate.printability import PrintedSolid, beds
from dicedesign.fabricate.printers import PRINTERS, Printer
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.rest.poses import rest_poses
from tests.reference.solids import PLATONIC


def printer_with(degrees: float) -> Printer:
    """Printer that needs supports up to an angle from level."""
    return replace(PRINTERS["fdm"], overhang_deg=degrees)


def icosahedron(edge: float) -> ConvexHull:
    return convex_hull(0.5 * edge * PLATONIC["icosahedron"])


def plain(hull: ConvexHull) -> PrintedSolid:
    return PrintedSolid(hull.vertices, hull.triangles, hull, (), np.zeros((0, 3)))


def test_a_box_has_no_overhangs() -> None:
    hull = convex_hull(np.array([(x, y, z) for x in (0, 2) for y in (0, 3) for z in (0, 5)]))
    poses = plain(hull).poses(hull.normals, printer_with(45.0))
    assert [pose.overhang_mm2 for pose in poses] == [0.0] * 6
    for pose in poses:
        side = int(np.abs(pose.normal).argmax())
        assert pose.height_mm == pytest.approx((2, 3, 5)[side])
        assert pose.contact_mm2 == pytest.approx((15, 10, 6)[side])


def test_an_icosahedron_has_three_overhanging_faces() -> None:
    """Its neighbors rise at 41.8 degrees: filament cannot, resin can."""
    hull, face = icosahedron(10.0), math.sqrt(3.0) / 4.0 * 100.0
    solid = plain(hull)
    for pose in solid.poses(hull.normals, printer_with(45.0)):
        assert pose.contact_mm2 == pytest.approx(face)
        assert pose.overhang_mm2 == pytest.approx(3.0 * face)
        # The prism beneath a face that rises from an edge on the bed: its mean height is a third
        # of the tip's, its base the face's shadow.
        rise = math.acos(math.sqrt(5.0) / 3.0)
        tip = math.sqrt(3.0) / 2.0 * 10.0 * math.sin(rise)
        beneath = 3.0 * face * math.cos(rise) * tip / 3.0
        assert pose.support_mm3 == pytest.approx(beneath)
    for limit in (0.0, 19.0, 41.8):
        poses = solid.poses(hull.normals, printer_with(limit))
        assert [pose.overhang_mm2 for pose in poses] == [0.0] * 20
    assert solid.overhanging(hull.normals, printer_with(45.0)).sum(axis=0).tolist() == [3] * 20


def test_labels_on_supports_are_spoiled() -> None:
    """Each facet of an icosahedron has a number: its own and its neighbors' are spoiled where
    filament needs supports, and with resin its own."""
    hull = icosahedron(10.0)
    labels = tuple(str(n) for n in range(1, 21))
    solid = PrintedSolid(hull.vertices, hull.triangles, hull, labels, hull.normals)
    for limit, count in ((45.0, 4), (19.0, 1), (0.0, 1)):
        for n, pose in enumerate(solid.poses(hull.normals, printer_with(limit))):
            assert pose.label == labels[n]
            assert len(pose.spoiled) == count
            assert pose.label in pose.spoiled


def test_a_prism_stands_on_its_large_facets() -> None:
    """A tall prism stands on a small facet only where there is no other."""
    box = np.array([(x, y, z) for x in (0, 4) for y in (0, 4) for z in (0, 30)], dtype=float)
    directions = beds(rest_poses(box))
    assert sorted(np.abs(directions[:, 2]).round(9).tolist()) == [0.0] * 4
    directions = beds(rest_poses(box * (1.0, 0.05, 1.0)))
    # Slabs lie on their two wide sides.
    assert np.abs(directions @ (0.0, 1.0, 0.0)).min() == pytest.approx(1.0)


def test_a_round_die_stands_on_a_rest() -> None:
    points = np.random.default_rng(2).normal(size=(400, 3))
    ball = rest_poses(points / np.linalg.norm(points, axis=1, keepdims=True))
    np.testing.assert_array_equal(beds(ball), ball.normals)
