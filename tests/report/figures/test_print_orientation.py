"""The die on the print bed, measured by its pixels."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from dicedesign.fabricate.print_orientation import PrintedSolid, placement_on_bed
from dicedesign.fabricate.printers import PRINTERS, Printer
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.report.figures.print_orientation import print_orientation_figure


def upto(degrees: float) -> Printer:
    """A printer that needs supports up to an angle from level."""
    return replace(PRINTERS["fdm"], overhang_deg=degrees)


def icosahedron() -> ConvexHull:
    golden = (1.0 + math.sqrt(5.0)) / 2.0
    corners = [
        np.roll((0.0, a, b * golden), shift)
        for shift in range(3)
        for a in (-1.0, 1.0)
        for b in (-1.0, 1.0)
    ]
    return convex_hull(np.array(corners))


def colored(picture: np.ndarray) -> tuple[int, int]:
    """Pixels that are blue, and that are red."""
    red, green, blue = np.asarray(picture, dtype=float).transpose(2, 0, 1)
    return int((blue > red + 25).sum()), int((red > green + 60).sum())


@pytest.mark.parametrize("limit", [19.0, 45.0])
def test_colors_cover_what_touches_and_what_hangs(limit: float) -> None:
    """From beneath the face on the bed is seen whole, and its neighbors at 41.8 degrees."""
    hull = icosahedron()
    solid = PrintedSolid(hull.vertices, hull.triangles, hull, (), np.zeros((0, 3)))
    down = hull.normals[:1]
    placement = placement_on_bed(hull.vertices, down[0])
    points = hull.vertices @ placement[:3, :3].T + placement[:3, 3]
    touching = points[hull.triangles][:, :, 2].max(axis=1) < 1e-3
    hanging = solid.overhanging(down, upto(limit))[:, 0]
    figure = print_orientation_figure(points, hull.triangles, hanging, touching)
    assert len(figure.pictures) == len(figure.texts) == 2
    (blue, red), beneath = (colored(picture) for picture in figure.pictures)
    assert blue == 0
    assert (red > 0) == bool(hanging.any())
    blue, red = beneath
    assert blue > 1000
    shadow = 3.0 * math.sqrt(5.0) / 3.0 if limit > 41.8 else 0.0
    assert red / blue == pytest.approx(shadow, abs=0.1)
