"""A toothed wheel."""

from __future__ import annotations

from itertools import pairwise
from typing import Final

import numpy as np
from scipy.spatial import Delaunay

from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Booleans, Floats, Integers, sums_by_index

__all__ = ["gear"]

EVENING_ROUNDS: Final = 20
"""Times that points are moved to the middle of the triangles around them."""

FLAT: Final = 1e-6
"""Part of the mean area up to which a triangle has none."""


def gear() -> Surface:
    """A spur gear of nine teeth with a hole; its rims stay sharp; genus 1."""
    teeth, spacing, thickness = 9, 0.085, 0.5
    turn = 2.0 * np.pi / teeth
    profile = [(0.78, -0.5), (0.78, -0.30), (1.08, -0.17), (1.08, 0.17), (0.78, 0.30)]
    corners = np.array(
        [
            (radius * np.cos(turn * (k + part)), radius * np.sin(turn * (k + part)))
            for k in range(teeth)
            for radius, part in profile
        ]
    )
    rim = _subdivided(corners, spacing)
    sides = round(2.0 * np.pi * 0.33 / spacing)
    angle = -2.0 * np.pi * np.arange(sides) / sides
    hole = 0.33 * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    flat, faces = _filled(rim, hole, spacing)

    layers = round(thickness / spacing)
    loops = len(rim) + len(hole)
    ahead = np.append(
        np.roll(np.arange(len(rim)), -1), len(rim) + np.roll(np.arange(len(hole)), -1)
    )
    # The bottom face, the top face, and between them the layers of points of the two loops.
    levels = np.linspace(-0.5 * thickness, 0.5 * thickness, layers + 1)
    points = [np.column_stack([flat, np.full(len(flat), z)]) for z in levels[[0, -1]]]
    points += [np.column_stack([flat[:loops], np.full(loops, z)]) for z in levels[1:-1]]
    start = [0, *(2 * len(flat) + loops * k for k in range(layers - 1)), len(flat)]
    triangles = [faces[:, ::-1], faces + len(flat)]
    corner = np.arange(loops)
    for below, above in pairwise(start):
        triangles.append(np.column_stack([corner + below, ahead + below, ahead + above]))
        triangles.append(np.column_stack([corner + below, ahead + above, corner + above]))
    return Surface(np.concatenate(points), np.concatenate(triangles))


def _subdivided(corners: Floats, spacing: float) -> Floats:
    """Points (n, 2) along a closed line through corners (m, 2), these among them, about as far
    apart as `spacing`."""
    points = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        pieces = max(1, round(float(np.linalg.norm(b - a)) / spacing))
        points += [a + (b - a) * k / pieces for k in range(pieces)]
    return np.array(points)


def _filled(rim: Floats, hole: Floats, spacing: float) -> tuple[Floats, Integers]:
    """Even triangles, counter-clockwise, between a rim (n, 2) that runs counter-clockwise and a
    hole (m, 2) that runs clockwise; their points come first, in this order."""
    loops = np.concatenate([rim, hole])
    extent = np.abs(rim).max()
    x, y = np.meshgrid(
        np.arange(-extent, extent, spacing), np.arange(-extent, extent, spacing * np.sqrt(0.75))
    )
    lattice = np.column_stack(
        [(x + 0.5 * spacing * (np.arange(len(x)) % 2)[:, None]).ravel(), y.ravel()]
    )
    away = np.linalg.norm(lattice[:, None] - loops, axis=-1).min(axis=1)
    points = np.concatenate([loops, lattice[_within(lattice, rim, hole) & (away > 0.7 * spacing)]])
    for _ in range(EVENING_ROUNDS):
        triangles = _between(points, rim, hole)
        middles = points[triangles].mean(axis=1)
        sums = sums_by_index(triangles.ravel(), middles.repeat(3, axis=0), len(points))
        count = np.bincount(triangles.ravel())
        points[len(loops) :] = (sums / count[:, None])[len(loops) :]
    return points, _between(points, rim, hole)


def _between(points: Floats, rim: Floats, hole: Floats) -> Integers:
    """Delaunay triangles of points (n, 2), counter-clockwise, as far as they lie between a rim and
    a hole that are sampled densely enough to be among their edges."""
    triangles = Delaunay(points).simplices.astype(np.int64)
    a, b, c = points[triangles].transpose(1, 0, 2)
    area = np.linalg.det(np.stack([b - a, c - a], axis=-1))
    triangles = np.where((area < 0.0)[:, None], triangles[:, ::-1], triangles)
    # Points in line on the rim can span triangles without area along it.
    solid = np.abs(area) > FLAT * np.abs(area).mean()
    return triangles[solid & _within(points[triangles].mean(axis=1), rim, hole)]


def _within(points: Floats, rim: Floats, hole: Floats) -> Booleans:
    """True (n,) where points (n, 2) lie inside the rim and outside the hole, by winding numbers."""
    total = np.zeros(len(points))
    for loop in (rim, hole):
        a = loop - points[:, None]
        b = np.roll(loop, -1, axis=0) - points[:, None]
        total += np.arctan2(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0], (a * b).sum(-1)).sum(1)
    return total > np.pi
