"""Surfaces that the package builds: level sets of distance functions, round parts that blend.

Each part maps points (..., 3) to values (...) that are below 0 inside, 0 on its surface and about
the distance from it outside, in the unit of the points."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from dicedesign.errors import InputError
from dicedesign.geometry.surfaces.grid_surface import evened, surface_nets
from dicedesign.geometry.triangles import Surface
from dicedesign.runtime.arrays import Floats, Integers

Distance = Callable[[Floats], Floats]

Vector = tuple[float, float, float]


def ellipsoid(center: Vector, radii: Vector, pitch: float = 0.0, yaw: float = 0.0) -> Distance:
    """A solid ellipsoid.

    center: of it; radii: half-axes along x, y and z, above 0, before it is turned; pitch: angle in
    degrees by which its x axis then rises toward z; yaw: angle in degrees by which that is then
    turned about z, from x toward y.
    """
    rise, turn = np.radians(pitch), np.radians(yaw)
    pitched = np.array(
        [[np.cos(rise), 0.0, -np.sin(rise)], [0.0, 1.0, 0.0], [np.sin(rise), 0.0, np.cos(rise)]]
    )
    yawed = np.array(
        [[np.cos(turn), -np.sin(turn), 0.0], [np.sin(turn), np.cos(turn), 0.0], [0.0, 0.0, 1.0]]
    )
    half_axes = np.array(radii)

    def distance(points: Floats) -> Floats:
        local = (points - np.array(center)) @ (yawed @ pitched) / half_axes
        norm = np.linalg.norm(local, axis=-1)
        slope = np.linalg.norm(local / half_axes, axis=-1)
        # To first order; at the center, where it is 0 / 0, the smallest half-axis inside.
        deep = np.full(norm.shape, -half_axes.min())
        return np.divide(norm * (norm - 1.0), slope, out=deep, where=slope > 0.0)

    return distance


def round_cone(start: Vector, end: Vector, start_radius: float, end_radius: float) -> Distance:
    """Balls whose centers run along a segment and whose radii change evenly along it.

    start and end: of the segment, not equal; the radii: above 0.
    """
    origin, axis = np.array(start), np.array(end) - np.array(start)

    def distance(points: Floats) -> Floats:
        offsets = points - origin
        along = (offsets @ axis / (axis @ axis)).clip(0.0, 1.0)
        away = np.linalg.norm(offsets - along[..., None] * axis, axis=-1)
        return away - start_radius - along * (end_radius - start_radius)

    return distance


def tube(line: Sequence[Vector] | Floats, start_radius: float, end_radius: float) -> Distance:
    """Round cones along a line of at least two points, its radius changing evenly from point to
    point."""
    radii = np.linspace(start_radius, end_radius, len(line)).tolist()
    pieces = [
        round_cone(line[k], line[k + 1], radii[k], radii[k + 1]) for k in range(len(line) - 1)
    ]
    return lambda points: np.minimum.reduce([piece(points) for piece in pieces])


def mirrored(part: Distance) -> Distance:
    """A part that lies at y above 0, and its mirror image in the plane y = 0."""

    def distance(points: Floats) -> Floats:
        x, y, z = np.moveaxis(points, -1, 0)
        return part(np.stack([x, np.abs(y), z], axis=-1))

    return distance


def stretched(part: Distance, factors: Vector) -> Distance:
    """A part whose extents along x, y and z are multiplied by factors above 0."""
    return lambda points: min(factors) * part(points / np.array(factors))


def blend(first: Distance, second: Distance, width: float) -> Distance:
    """The union of two parts, its crease rounded where both values are within `width`, above 0, of
    each other."""

    def distance(points: Floats) -> Floats:
        a, b = first(points), second(points)
        near = (1.0 - np.abs(a - b) / width).clip(0.0)
        joined: Floats = np.minimum(a, b) - near**2 * width / 4.0
        return joined

    return distance


ROUNDS = 15
"""Times that edges are flipped and points moved."""

DIFFERENCE = 1e-5
"""Step of the difference quotients, in cells."""


def level_set(distance: Distance, low: Floats, high: Floats, spacing: float) -> Surface:
    """Triangles with edges of about one length on the surface where a distance function is 0.

    A surface between the nodes of a grid (`surface_nets`) is made even (`evened`).

    Parameters
    ----------
    distance: negative inside. No part of the body and no gap may be thinner than two cells.
    low, high: (3,) corners of a box that holds the surface with a cell to spare.
    spacing: side of the cells, above 0.

    Returns
    -------
    Surface, oriented outward; the same for the same input.
    """
    axes = [np.arange(a, b + spacing, spacing) for a, b in zip(low, high, strict=True)]
    values = distance(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1))

    def crossing(nodes: Integers, ahead: Integers) -> Floats:
        here, there = values[tuple(nodes.T)], values[tuple(ahead.T)]
        part = here / (here - there)
        return np.asarray(low + spacing * (nodes + part[:, None] * (ahead - nodes)))

    points, triangles = surface_nets(values < 0.0, crossing)
    return Surface(
        *evened(points, triangles, lambda moved, _: _onto(distance, moved, spacing), ROUNDS)
    )


def _onto(distance: Distance, points: Floats, spacing: float) -> Floats:
    """Points after a Newton step toward the level set, no longer than half a cell."""
    step = DIFFERENCE * spacing
    values = distance(points)
    slopes = (distance(points[:, None] + step * np.eye(3)) - values[:, None]) / step
    squares = (slopes * slopes).sum(axis=-1).clip(0.25)
    steps = (values / squares).clip(-0.5 * spacing, 0.5 * spacing)
    return points - steps[:, None] * slopes


LENGTHENING = np.array([1.25, 1.0, 1.0])
"""Of the duck, from bill to tail: rounder, it rests on everything a little."""


def duck() -> Surface:
    """A bath duck; genus 0."""
    body = _blended(
        ellipsoid((0.0, 0.0, 0.0), (0.96, 0.76, 0.60)),
        # Tail, wings, head, bill and eyes.
        (round_cone((-0.60, 0.0, 0.20), (-1.02, 0.0, 0.52), 0.36, 0.16), 0.35),
        (mirrored(ellipsoid((-0.18, 0.62, 0.16), (0.56, 0.24, 0.32), -16.0, 10.0)), 0.12),
        (ellipsoid((0.46, 0.0, 1.02), (0.60, 0.60, 0.58)), 0.30),
        (ellipsoid((1.02, 0.0, 0.92), (0.44, 0.37, 0.21), 10.0), 0.12),
        (mirrored(ellipsoid((0.78, 0.35, 1.27), (0.15, 0.15, 0.17))), 0.06),
    )
    surface = level_set(body, np.array([-1.4, -1.1, -0.8]), np.array([1.6, 1.1, 1.8]), 0.105)
    return surface.moved(surface.points * LENGTHENING)


def kitten() -> Surface:
    """A sitting kitten with its tail around it; genus 0."""
    ear = round_cone((0.26, 0.34, 1.30), (0.26, 0.52, 1.86), 0.36, 0.13)
    angle = np.radians(np.linspace(190.0, 80.0, 8))
    tail = np.stack([0.80 * np.cos(angle) - 0.10, 0.74 * np.sin(angle), 0.0 * angle - 0.37], axis=1)
    body = _blended(
        ellipsoid((-0.18, 0.0, 0.02), (0.68, 0.64, 0.60)),
        (ellipsoid((0.18, 0.0, -0.20), (0.50, 0.46, 0.38)), 0.10),
        (round_cone((-0.05, 0.0, 0.10), (0.14, 0.0, 0.60), 0.54, 0.38), 0.25),
        # Haunches, hind paws, front legs, what is between the paws, and front paws.
        (mirrored(ellipsoid((0.00, 0.46, -0.14), (0.48, 0.28, 0.42), 10.0)), 0.14),
        (mirrored(ellipsoid((0.26, 0.56, -0.41), (0.34, 0.20, 0.17))), 0.16),
        (mirrored(round_cone((0.30, 0.20, 0.50), (0.50, 0.17, -0.36), 0.20, 0.19)), 0.14),
        (round_cone((0.28, 0.0, 0.30), (0.48, 0.0, -0.38), 0.20, 0.17), 0.08),
        (mirrored(ellipsoid((0.40, 0.38, -0.40), (0.24, 0.20, 0.16))), 0.12),
        (mirrored(ellipsoid((0.66, 0.17, -0.40), (0.24, 0.20, 0.18))), 0.08),
        # Head, ears, cheeks, nose and eyes.
        (ellipsoid((0.26, 0.0, 1.08), (0.58, 0.72, 0.56)), 0.24),
        (mirrored(stretched(ear, (0.7, 1.0, 1.0))), 0.10),
        (mirrored(ellipsoid((0.74, 0.13, 0.87), (0.21, 0.21, 0.16))), 0.08),
        (ellipsoid((0.83, 0.0, 1.02), (0.15, 0.16, 0.12)), 0.06),
        (mirrored(ellipsoid((0.70, 0.31, 1.20), (0.16, 0.15, 0.18))), 0.04),
        (tube(tail, 0.20, 0.17), 0.18),
    )
    return level_set(body, np.array([-1.3, -1.1, -0.8]), np.array([1.2, 1.1, 2.2]), 0.077)


def dragon() -> Surface:
    """A sitting dragon, its wings raised and its tail around it; genus 0."""
    neck = np.array([(0.22, 0.0, 0.46), (0.42, 0.0, 0.86), (0.38, 0.0, 1.22), (0.48, 0.0, 1.44)])
    angle = np.radians(np.linspace(200.0, 60.0, 10))
    tail = np.stack([0.92 * np.cos(angle), 0.80 * np.sin(angle), 0.02 * angle - 0.40], axis=1)
    wing = stretched(
        round_cone((-0.62, 0.58, 0.50), (-1.00, 1.06, 1.16), 0.36, 0.20), (1.0, 0.7, 1.0)
    )
    back = [(-0.10, 0.62, 0.18), (0.12, 0.86, 0.15), (0.16, 1.26, 0.14)]
    body = _blended(
        ellipsoid((-0.20, 0.0, 0.04), (0.66, 0.50, 0.54), 25.0),
        (tube(neck, 0.36, 0.22), 0.25),
        # Head, snout, brows and horns.
        (ellipsoid((0.58, 0.0, 1.50), (0.36, 0.28, 0.25), -8.0), 0.12),
        (ellipsoid((0.94, 0.0, 1.42), (0.30, 0.20, 0.15), -8.0), 0.12),
        (mirrored(ellipsoid((0.66, 0.19, 1.64), (0.18, 0.13, 0.14))), 0.06),
        (mirrored(round_cone((0.44, 0.14, 1.66), (0.12, 0.30, 2.00), 0.14, 0.11)), 0.08),
        # Haunches, hind paws, front legs and paws, and what is between them; shoulders and wings.
        (mirrored(ellipsoid((-0.12, 0.42, -0.14), (0.46, 0.26, 0.38), 10.0)), 0.12),
        (mirrored(ellipsoid((0.14, 0.54, -0.40), (0.30, 0.18, 0.16))), 0.14),
        (mirrored(round_cone((0.26, 0.24, 0.34), (0.50, 0.24, -0.36), 0.18, 0.14)), 0.10),
        (mirrored(ellipsoid((0.60, 0.22, -0.42), (0.22, 0.16, 0.14))), 0.10),
        (mirrored(ellipsoid((0.38, 0.36, -0.38), (0.20, 0.20, 0.17))), 0.10),
        (ellipsoid((-0.42, 0.0, 0.46), (0.30, 0.50, 0.24), 25.0), 0.12),
        (mirrored(wing), 0.20),
        (tube(tail, 0.24, 0.15), 0.16),
        (ellipsoid((0.50, 0.76, -0.36), (0.24, 0.18, 0.20), 0.0, -20.0), 0.10),
        # Spikes along the back.
        *((ellipsoid((x, 0.0, z), (r, 0.15, r)), 0.08) for x, z, r in back),
    )
    return level_set(body, np.array([-1.5, -1.2, -0.9]), np.array([1.5, 1.2, 2.4]), 0.082)


def _blended(first: Distance, *others: tuple[Distance, float]) -> Distance:
    """A part joined with others in turn, each with the width of its blend."""
    for part, width in others:
        first = blend(first, part, width)
    return first


def knot() -> Surface:
    """A tube along a trefoil knot; genus 1."""
    around, rings, radius = 16, 156, 0.24
    # Rings at even steps of the line's length, each turned by half a step against the one before.
    fine = np.linspace(0.0, 2.0 * np.pi, 64 * rings + 1)
    line, _ = _trefoil(fine)
    length = np.append(0.0, np.linalg.norm(np.diff(line, axis=0), axis=1).cumsum())
    t = np.interp(np.arange(rings) * length[-1] / rings, length, fine)
    line, tangent = _trefoil(t)
    # Across the line and as nearly upward as can be; the trefoil is nowhere vertical.
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
    """Points (n, 3) on a trefoil knot at parameters (n,), and its derivatives there."""
    x, y = np.sin(t) + 2.0 * np.sin(2.0 * t), np.cos(t) - 2.0 * np.cos(2.0 * t)
    u, v = np.cos(t) + 4.0 * np.cos(2.0 * t), 4.0 * np.sin(2.0 * t) - np.sin(t)
    z, w = -1.5 * np.sin(3.0 * t), -4.5 * np.cos(3.0 * t)
    return 0.4 * np.stack([x, y, z], axis=-1), 0.4 * np.stack([u, v, w], axis=-1)


SHAPES: dict[str, Callable[[], Surface]] = {
    "dragon": dragon,
    "duck": duck,
    "kitten": kitten,
    "knot": knot,
}
"""Builders by name."""


def shape(name: str) -> Surface:
    """The surface of a name in `SHAPES`, built anew, the same each time.

    Raises InputError for another name.
    """
    if name not in SHAPES:
        raise InputError(f"shape: expected one of {', '.join(SHAPES)}, got {name!r}; use one")
    return SHAPES[name]()
