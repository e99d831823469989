"""Built-in surfaces: level sets of blended round parts.

Each part is a function that maps points (..., 3) to values (...): negative inside, 0 on its surface
and about the distance from it outside, in the unit of the points.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib import resources
from itertools import pairwise
from typing import Any

import numpy as np
import yaml

from dicedesign.geometry.surfaces.grid_surface import GridValues
from dicedesign.geometry.triangles import Surface
from dicedesign.runtime.arrays import Floats

Distance = Callable[[Floats], Floats]

Vector = tuple[float, float, float]


def ellipsoid(center: Vector, radii: Vector, pitch: float = 0.0, yaw: float = 0.0) -> Distance:
    """Ellipsoid.

    center: its center; radii: half-axes along x, y and z, positive, before it is rotated; pitch:
    angle in degrees by which its x axis rises toward z; yaw: angle in degrees of the following
    rotation about z, from x toward y.
    """
    rise, turn = np.radians(pitch), np.radians(yaw)
    pitched = np.array(
        [[np.cos(rise), 0.0, -np.sin(rise)], [0.0, 1.0, 0.0], [np.sin(rise), 0.0, np.cos(rise)]]
    )
    yawed = np.array(
        [[np.cos(turn), -np.sin(turn), 0.0], [np.sin(turn), np.cos(turn), 0.0], [0.0, 0.0, 1.0]]
    )
    half_axes, rotation = np.array(radii), yawed @ pitched

    def distance(points: Floats) -> Floats:
        local = (points - np.array(center)) @ rotation / half_axes
        norm = np.linalg.norm(local, axis=-1)
        slope = np.linalg.norm(local / half_axes, axis=-1)
        # First-order distance; at the center, where it is 0 / 0, minus the smallest half-axis.
        deep = np.full(norm.shape, -half_axes.min())
        return np.divide(norm * (norm - 1.0), slope, out=deep, where=slope > 0.0)

    return distance


def round_cone(start: Vector, end: Vector, start_radius: float, end_radius: float) -> Distance:
    """Union of balls along a segment whose radii change linearly.

    start, end: ends of the segment, not equal; radii: positive.
    """
    origin, axis = np.array(start), np.array(end) - np.array(start)

    def distance(points: Floats) -> Floats:
        offsets = points - origin
        along = (offsets @ axis / (axis @ axis)).clip(0.0, 1.0)
        away = np.linalg.norm(offsets - along[..., None] * axis, axis=-1)
        return away - start_radius - along * (end_radius - start_radius)

    return distance


def tube(line: Sequence[Vector] | Floats, start_radius: float, end_radius: float) -> Distance:
    """Round cones along a polyline of at least two points, whose radius changes by equal amounts
    from point to point."""
    radii = np.linspace(start_radius, end_radius, len(line)).tolist()
    ends = pairwise(zip(line, radii, strict=True))
    pieces = [round_cone(a, b, start, end) for (a, start), (b, end) in ends]
    return lambda points: np.minimum.reduce([piece(points) for piece in pieces])


def mirror(part: Distance) -> Distance:
    """Part at positive y, and its mirror image in the plane y = 0."""
    return lambda points: part(np.where([False, True, False], np.abs(points), points))


def stretch(part: Distance, factors: Vector) -> Distance:
    """Part whose extents along x, y and z are multiplied by positive factors."""
    return lambda points: min(factors) * part(points / np.array(factors))


def blend(first: Distance, second: Distance, width: float) -> Distance:
    """Union of two parts, with a rounded crease where their values differ by less than `width`,
    which is positive."""

    def distance(points: Floats) -> Floats:
        a, b = first(points), second(points)
        near = (1.0 - np.abs(a - b) / width).clip(0.0)
        joined: Floats = np.minimum(a, b) - near**2 * width / 4.0
        return joined

    return distance


def level_set(distance: Distance, low: Floats, high: Floats, spacing: float) -> Surface:
    """Surface on which a distance function is 0.

    distance: negative inside; no part and no gap may be thinner than two grid steps; low, high:
    (3,) corners of a box that contains the surface; spacing: of the grid, positive.
    """
    return GridValues(lambda points: -distance(points), low, high, spacing).above(0.0)


PARTS: dict[str, Callable[..., Distance]] = {
    "ellipsoid": ellipsoid,
    "round_cone": round_cone,
    "tube": tube,
}
"""Kinds of parts in shapes.yaml, with their arguments there."""

SHAPES = ("dragon", "duck", "kitten", "knot")
"""Names of the built-in surfaces; all but the knot are in shapes.yaml."""


def shape(name: str) -> Surface:
    """Surface of a name in `SHAPES`, deterministic."""
    if name == "knot":
        return _knot()
    text = resources.files("dicedesign.concave").joinpath("shapes.yaml").read_text()
    described: dict[str, Any] = yaml.safe_load(text)[name]
    body: Distance | None = None
    for entry in described["parts"]:
        part = next(make(*entry[kind]) for kind, make in PARTS.items() if kind in entry)
        if "stretched" in entry:
            part = stretch(part, entry["stretched"])
        if entry.get("mirrored"):
            part = mirror(part)
        body = part if body is None else blend(body, part, entry["width"])
    assert body is not None
    low, high = np.array(described["low"]), np.array(described["high"])
    surface = level_set(body, low, high, described["spacing"])
    return surface.with_points(surface.points * described["lengthened"])


def _knot() -> Surface:
    """Tube along a trefoil knot, of genus 1."""
    around, rings, radius = 16, 156, 0.24
    # Rings at equal arc lengths, each rotated by half a step relative to the one before.
    fine = np.linspace(0.0, 2.0 * np.pi, 64 * rings + 1)
    line, _ = _trefoil(fine)
    length = np.append(0.0, np.linalg.norm(np.diff(line, axis=0), axis=1).cumsum())
    t = np.interp(np.arange(rings) * length[-1] / rings, length, fine)
    line, tangent = _trefoil(t)
    # Horizontal and upward directions across the line, which is nowhere vertical.
    side = np.cross([0.0, 0.0, 1.0], tangent)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    top = np.cross(tangent, side)
    top /= np.linalg.norm(top, axis=1, keepdims=True)
    ring, step = np.arange(rings)[:, None], np.arange(around)
    angle = 2.0 * np.pi * (step + 0.5 * (ring % 2)) / around
    points = line[:, None] + radius * (
        np.cos(angle)[..., None] * side[:, None] + np.sin(angle)[..., None] * top[:, None]
    )

    after, turned, odd = (ring + 1) % rings * around, (step + 1) % around, ring % 2
    this, beside = ring * around + step, ring * around + turned
    ahead, across = after + step + 0 * ring, after + turned
    # In even rings the ring ahead is half a step ahead, in odd ones half a step behind.
    lower = np.stack([this, beside, np.where(odd, across, ahead)], axis=-1)
    upper = np.stack([np.where(odd, this, beside), across, ahead], axis=-1)
    triangles = np.concatenate([lower.reshape(-1, 3), upper.reshape(-1, 3)])
    return Surface(points.reshape(-1, 3), triangles)


def _trefoil(t: Floats) -> tuple[Floats, Floats]:
    """Points (n, 3) of a trefoil knot at parameters (n,), and their derivatives."""
    x, y = np.sin(t) + 2.0 * np.sin(2.0 * t), np.cos(t) - 2.0 * np.cos(2.0 * t)
    u, v = np.cos(t) + 4.0 * np.cos(2.0 * t), 4.0 * np.sin(2.0 * t) - np.sin(t)
    z, w = -1.5 * np.sin(3.0 * t), -4.5 * np.cos(3.0 * t)
    return 0.4 * np.stack([x, y, z], axis=-1), 0.4 * np.stack([u, v, w], axis=-1)
