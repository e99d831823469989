"""Pillars against a table whose top hangs over, and against another library."""

from __future__ import annotations

import numpy as np
import trimesh

from dicedesign.fabricate.printing.supports import LEAST, pillars
from dicedesign.geometry.manifold import solid as solid_of


def table() -> trimesh.Trimesh:
    """A mushroom on the bed: a stem of 4 mm, 10 mm high, and a plate of 20 mm on it."""
    stem = trimesh.creation.box((4.0, 4.0, 10.0)).apply_translation((0.0, 0.0, 5.0))
    plate = trimesh.creation.box((20.0, 20.0, 3.0)).apply_translation((0.0, 0.0, 11.5))
    return trimesh.boolean.union([stem, plate], engine="manifold")


def test_a_plate_stands_on_pillars() -> None:
    body = table()
    points, triangles = np.array(body.vertices), np.array(body.faces)
    below = (body.face_normals[:, 2] < -0.9) & (body.triangles_center[:, 2] > 5.0)
    made = pillars(points, triangles, below)
    assert made is not None
    solid = trimesh.Trimesh(made.points, made.triangles, process=False)
    assert solid.is_watertight
    assert solid.volume > 0.0
    parts = solid.split()
    # A grid of 2 mm below a plate of 20 mm, the stem apart; no node is at its border.
    assert 60 <= len(parts) <= 121
    for part in parts:
        assert part.bounds[0][2] == 0.0
        assert abs(part.bounds[1][2] - 10.0) < 1e-9
        x, y = part.bounds.mean(axis=0)[:2]
        assert max(abs(x), abs(y)) >= 2.0
    # They touch the plate and are outside of it.
    common = solid_of(points, triangles) ^ solid_of(made.points, made.triangles)
    assert common.volume() < 1e-9


def test_nothing_hangs_over_or_is_too_low() -> None:
    body = table()
    points, triangles = np.array(body.vertices), np.array(body.faces)
    assert pillars(points, triangles, np.zeros(len(triangles), dtype=bool)) is None
    below = (body.face_normals[:, 2] < -0.9) & (body.triangles_center[:, 2] > 5.0)
    sunk = points - (0.0, 0.0, 10.0 - 0.5 * LEAST)
    assert pillars(sunk, triangles, below) is None
