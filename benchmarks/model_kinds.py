"""Kinds of models that nobody tuned to, each drawn at random as a distance function.

They stand along z, if they stand. A distance function maps points (..., 3) to values (...) that are
below 0 inside and near the surface about the distance from it.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce

import numpy as np
from scipy.spatial import cKDTree

from dicedesign.concave.shapes import (
    Distance,
    blend,
    ellipsoid,
    mirror,
    round_cone,
    stretch,
    tube,
)
from dicedesign.geometry.sphere import unit_vectors
from dicedesign.runtime.arrays import Floats

Generator = np.random.Generator

Triple = Floats | tuple[float, float, float]

REACH = 4.0
"""Largest coordinate of any model along any axis."""


def _blobs(rng: Generator) -> Distance:
    """Ellipsoids, each about a place on one before, and waves all over."""
    centers, radii = [np.zeros(3)], [rng.uniform(0.4, 0.9, size=3)]
    for _ in range(int(rng.integers(3, 8))):
        base = int(rng.integers(len(centers)))
        centers.append(centers[base] + 1.1 * radii[base] * _direction(rng))
        radii.append(rng.uniform([0.2, 0.2, 0.45], [0.4, 0.4, 0.9]))
    parts = [
        ellipsoid(center, half_axes, *rng.uniform(-90.0, 90.0, size=2))
        for center, half_axes in zip(centers, radii, strict=True)
    ]
    return _wavy(rng, blend_parts(parts, rng.uniform(0.1, 0.4)), 0.12)


def _animal(rng: Generator) -> Distance:
    """A beast on four legs, with neck, head, ears and tail; it looks along x."""
    length, width, height = rng.uniform([0.5, 0.32, 0.32], [1.3, 0.75, 0.75])
    leg, thin = rng.uniform(0.2, 1.4), rng.uniform(0.13, 0.25)
    neck, lean = rng.uniform(0.1, 1.5), rng.uniform(0.1, 0.9)
    head, size = _at(length + neck * lean, 0.0, 0.2 + neck), rng.uniform(0.26, 0.65)
    foot = 0.6 * width + rng.uniform(0.05, 0.4)
    parts = [ellipsoid((0.0, 0.0, 0.0), (length, width, height))]
    for x in (-0.65 * length, 0.6 * length):
        hip, toe = _at(x, 0.6 * width, -0.2), _at(x, foot, -height - leg)
        toe[0] += rng.uniform(-0.2, 0.2)
        for side in ([1.0, 1.0, 1.0], [1.0, -1.0, 1.0]):
            parts.append(round_cone(side * hip, side * toe, 1.4 * thin, thin))
    parts.append(round_cone((0.6 * length, 0.0, 0.1), head, 0.5 * height + 0.1, 0.2))
    parts.append(ellipsoid(head, size * _at(1.2, 0.85, 0.9)))
    muzzle = head + size * _at(rng.uniform(1.0, 2.2), 0.0, -0.3)
    parts.append(round_cone(head, muzzle, 0.6 * size, rng.uniform(0.12, 0.2)))
    ear, tip = size * _at(0.0, 0.4, 0.4), size * _at(-0.2, *rng.uniform(0.7, 1.8, size=2))
    parts.append(mirror(round_cone(head + ear, head + tip, 0.18, 0.12)))
    steps = np.linspace(0.0, 1.0, 6)[:, None]
    way = rng.uniform([-1.6, -0.5, -0.6], [-0.3, 0.5, 1.2])
    curl = _at(0.0, 0.0, rng.uniform(-0.5, 0.8))
    parts.append(tube(_at(-0.85 * length, 0.0, 0.1) + steps * way + steps**2 * curl, 0.2, 0.13))
    return blend_parts(parts, rng.uniform(0.1, 0.25))


def _figure(rng: Generator) -> Distance:
    """Somebody standing, arms anywhere, perhaps with a hat, on a plinth or with a skirt."""
    leg, torso = rng.uniform(0.5, 1.3), rng.uniform(0.5, 1.0)
    girth, thin = rng.uniform(0.25, 0.5), rng.uniform(0.13, 0.2)
    feet = rng.uniform(0.15, 0.5)
    shoulder, size = np.array([0.0, 0.8 * girth, torso]), rng.uniform(0.25, 0.45)
    top = torso + 0.9 * size + 0.1
    parts = [
        round_cone((0.0, 0.0, 0.0), (0.0, 0.0, torso), 0.9 * girth, 0.75 * girth),
        mirror(round_cone((0.0, 0.45 * girth, 0.0), (0.0, feet, -leg), 1.4 * thin, thin)),
        ellipsoid((0.05, 0.0, top), (size, 0.9 * size, rng.uniform(0.9, 1.3) * size)),
    ]
    for side in (-1.0, 1.0):
        away = _direction(rng)
        elbow = shoulder + 0.45 * np.array([0.5 * away[0], 0.6 + 0.3 * abs(away[1]), away[2]])
        hand = elbow + rng.uniform(0.3, 0.6) * _direction(rng, least=[-1.0, 0.0, -1.0])
        arm = np.stack([shoulder, elbow, hand]) * [1.0, side, 1.0]
        parts.append(tube(arm, 1.2 * thin, 0.9 * thin))
    extra = rng.integers(4)
    if extra == 0:
        parts.append(rounded_box((0.0, 0.0, -leg - 0.1), (0.55, 0.6, 0.16), 0.08))
    elif extra == 1:
        parts.append(round_cone((0.0, 0.0, top), (0.0, 0.0, top + 2.2 * size), 0.9 * size, 0.12))
    elif extra == 2:
        parts.append(round_cone((0.0, 0.0, 0.0), (0.0, 0.0, -0.8 * leg), girth, 0.3 + girth))
    return blend_parts(parts, 0.12)


def _rings(rng: Generator) -> Distance:
    """One to three rings that hold on to each other, some oval."""
    parts, center = [], np.zeros(3)
    for _ in range(int(rng.integers(1, 5))):
        radius, thickness = rng.uniform(0.55, 1.1), rng.uniform(0.16, 0.34)
        oval = stretch(ring(radius, thickness), [1.0, rng.uniform(0.8, 1.5), 1.0])
        rotation = _rotation(rng)
        parts.append(rotate_part(oval, rotation, center))
        center = center + (1.9 * radius) * rotation[:, 0]
    return _wavy(rng, blend_parts(parts, 0.15), 0.1)


def _vase(rng: Generator) -> Distance:
    """A vessel with up to two handles: a thick wall, or full."""
    z = np.linspace(-1.0, rng.uniform(0.6, 1.6), 6)
    radii = np.cumsum(rng.uniform(-0.35, 0.4, size=6)) + rng.uniform(0.5, 0.8)
    line = np.stack([radii.clip(0.25, 1.15), 0.0 * z, z], axis=1)
    wall = rng.uniform(0.13, 0.19)
    line = np.concatenate([[[0.0, 0.0, -1.0]], line])
    parts = [swept(tube(line, 1.2 * wall, wall))]

    def within(points: Floats) -> Floats:
        """Left of the line, whose z rises after its first two points, at y = 0."""
        return points[..., 0] - np.interp(points[..., 2], line[1:, 2], line[1:, 0])

    handles = int(rng.integers(3))
    for side in (1.0, -1.0)[:handles]:
        middle = int(rng.integers(3, 5))
        upright = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
        reach = line[middle, 0] + rng.uniform(0.1, 0.3)
        grip = rotate_part(
            ring(rng.uniform(0.4, 0.55), rng.uniform(0.11, 0.15)),
            upright,
            (side * reach, 0.0, float(line[middle, 2])),
        )
        parts.append(subtract(grip, swept(within)))
    return blend_parts(parts, 0.1)


def _star(rng: Generator) -> Distance:
    """Arms all around in a plane, flat, and a hump."""
    count = int(rng.integers(3, 8))
    angles = 2.0 * np.pi * (np.arange(count) + rng.uniform(-0.25, 0.25, size=count)) / count
    lengths = rng.uniform(0.8, 1.8, size=count)
    thick, tip = rng.uniform(0.3, 0.5), rng.uniform(0.2, 0.35)
    parts = [
        round_cone(
            (0.0, 0.0, 0.0),
            [size * np.cos(angle), size * np.sin(angle), rng.uniform(-0.3, 0.3)],
            thick,
            tip,
        )
        for angle, size in zip(angles, lengths, strict=True)
    ]
    arms = stretch(blend_parts(parts, 0.2), (1.0, 1.0, rng.uniform(0.45, 0.8)))
    hump = ellipsoid((0.0, 0.0, 0.15), rng.uniform(0.3, 0.6, size=3))
    return _wavy(rng, blend_parts([arms, hump], 0.2), 0.06)


def _spider(rng: Generator) -> Distance:
    """A small body on long legs with knees, toward the floor or anywhere."""
    count, everywhere = int(rng.integers(5, 9)), rng.random() < 0.5
    body = rng.uniform(0.3, 0.6, size=3)
    parts, thin = [ellipsoid((0.0, 0.0, 0.0), body)], rng.uniform(0.13, 0.18)
    ways = _spread(rng, count)
    for k in range(count):
        if everywhere:
            way, bend = ways[k], 0.6 * _direction(rng)
        else:
            angle = 2.0 * np.pi * (k + rng.uniform(-0.2, 0.2)) / count
            way = np.array([np.cos(angle), np.sin(angle), rng.uniform(0.2, 0.8)])
            bend = np.array([0.0, 0.0, -rng.uniform(1.6, 2.2)])
        knee = rng.uniform(0.8, 1.3) * way
        foot = knee + rng.uniform(0.5, 0.9) * (way + bend)
        parts.append(tube(np.stack([0.0 * way, knee, foot]), 1.5 * thin, thin))
    return blend_parts(parts, 0.1)


def _knot(rng: Generator) -> Distance:
    """A tube along a closed line of three harmonics."""
    t = np.linspace(0.0, 2.0 * np.pi, 500, endpoint=False)
    size = np.array([1.0, 0.75, 0.4])[:, None]
    angles = np.multiply.outer(t, np.arange(1, 4))
    while True:
        cosines, sines = rng.normal(size=(2, 3, 3)) * size
        line = np.einsum("tk,ki->ti", np.cos(angles), cosines)
        line += np.einsum("tk,ki->ti", np.sin(angles), sines)
        line *= 1.5 / np.abs(line).max()
        radius = 0.35 * _room(line)
        if radius > 0.14:
            tree, width = cKDTree(line), min(radius, rng.uniform(0.16, 0.32))
            return lambda points: tree.query(points)[0] - width


def _room(line: Floats) -> float:
    """Least distance between places of a closed line (n, 3) that are not neighbors on it: half
    the way between them is longer than the distance."""
    steps = np.linalg.norm(np.roll(line, -1, axis=0) - line, axis=1)
    along = np.append(0.0, steps.cumsum())
    way = np.abs(np.subtract.outer(along[:-1], along[:-1]))
    way = np.minimum(way, along[-1] - way)
    x, y, z = line.T
    away = np.sqrt(sum(np.subtract.outer(u, u) ** 2 for u in (x, y, z)))
    return float(away[way > 1.6 * away].min(initial=1.0, where=(way > 0.0)[way > 1.6 * away]))


def _toy(rng: Generator) -> Distance:
    """Blocks upon and beside each other with balls and bars on them: vehicles, castles."""
    half = rng.uniform([0.7, 0.35, 0.2], [1.2, 0.7, 0.4])
    rounding = rng.uniform(0.03, 0.12)
    parts = [rounded_box((0.0, 0.0, 0.0), half, rounding)]
    for _ in range(int(rng.integers(2, 5))):
        sides = rng.uniform([0.18, 0.18, 0.25], [0.6, 0.5, 0.9])
        place = rng.uniform(-0.8, 0.8, size=3) * half
        place[2] = half[2] + 0.8 * sides[2]
        parts.append(rounded_box(place, sides, rounding))
    if rng.random() < 0.6:
        wheel = rng.uniform(0.25, 0.4)
        for x in (-0.65, 0.65):
            axle = (x * half[0], half[1], -half[2])
            parts.append(mirror(ellipsoid(axle, (wheel, 0.2, wheel))))
    for _ in range(int(rng.integers(0, 3))):
        start = rng.uniform(-0.7, 0.7, size=3) * half
        end = start + rng.uniform(0.9, 1.8) * _direction(rng, least=[-1.0, -1.0, 0.0])
        parts.append(round_cone(start, end, 0.14, rng.uniform(0.1, 0.3)))
    return blend_parts(parts, 0.04)


def _carve(rng: Generator) -> Distance:
    """A ball, oval or block that is bitten and drilled."""
    half = rng.uniform(0.65, 1.2, size=3)
    if rng.random() < 0.5:
        body = ellipsoid((0.0, 0.0, 0.0), half)
    else:
        body = rounded_box((0.0, 0.0, 0.0), half, 0.25)
    for _ in range(int(rng.integers(2, 5))):
        away = rng.uniform(0.9, 1.2) * half * _direction(rng)
        body = subtract(body, ellipsoid(away, rng.uniform(0.4, 0.9, size=3)))
    for _ in range(int(rng.integers(0, 2))):
        aim, off = 3.0 * _direction(rng), rng.uniform(-0.3, 0.3, size=3)
        width = rng.uniform(0.16, 0.3)
        body = subtract(body, round_cone(off - aim, off + aim, width, width))
    return _wavy(rng, body, 0.08)


def _wavy(rng: Generator, part: Distance, height: float) -> Distance:
    """A part whose surface goes up and down by up to a height, by the mean of four waves."""
    waves = rng.uniform(1.5, 5.0, size=(4, 1)) * np.stack([_direction(rng) for _ in range(4)])
    phases = rng.uniform(0.0, 2.0 * np.pi, size=4)
    height = rng.uniform(0.0, height)
    return lambda points: (
        part(points)
        + height * np.sin(np.einsum("...i,wi->...w", points, waves) + phases).mean(axis=-1)
    )


def _at(*coordinates: float) -> Floats:
    return np.array(coordinates)


def _direction(rng: Generator, least: list[float] | None = None) -> Floats:
    """A unit vector (3,) at random; where a least coordinate is 0, not below that."""
    vector = unit_vectors(rng.normal(size=(1, 3)))[0]
    if least is None:
        return vector
    return np.where(np.array(least) < 0.0, vector, np.abs(vector))


def _spread(rng: Generator, count: int) -> Floats:
    """Unit vectors (count, 3) at random, each of twenty the farthest from those before."""
    chosen = [_direction(rng)]
    while len(chosen) < count:
        others = unit_vectors(rng.normal(size=(20, 3)))
        nearest = np.max([(others * one).sum(axis=1) for one in chosen], axis=0)
        chosen.append(others[nearest.argmin()])
    return np.array(chosen)


def _rotation(rng: Generator) -> Floats:
    """A rotation (3, 3) at random."""
    first, other = _direction(rng), _direction(rng)
    third = unit_vectors(np.cross(first, other)[None])[0]
    return np.stack([first, np.cross(third, first), third], axis=1)


def ring(radius: float, thickness: float) -> Distance:
    """A torus about the z axis.

    radius: of the circle in its middle; thickness: radius of the tube about it.
    """
    return lambda points: (
        np.hypot(np.hypot(points[..., 0], points[..., 1]) - radius, points[..., 2]) - thickness
    )


def swept(part: Distance) -> Distance:
    """What a part sweeps that is turned once about the z axis, as far as it lies at y = 0 and x at
    least 0."""

    def distance(points: Floats) -> Floats:
        x, y, z = np.moveaxis(points, -1, 0)
        return part(np.stack([np.hypot(x, y), np.zeros_like(z), z], axis=-1))

    return distance


def rounded_box(center: Triple, half_sides: Triple, rounding: float) -> Distance:
    """A box along the axes whose edges are rounded by this radius, less than every half side."""

    def distance(points: Floats) -> Floats:
        beyond = np.abs(points - np.array(center)) - (np.array(half_sides) - rounding)
        outside = np.sqrt((beyond.clip(0.0) ** 2).sum(axis=-1))
        return outside + beyond.max(axis=-1).clip(max=0.0) - rounding

    return distance


def rotate_part(part: Distance, rotation: Floats, center: Triple) -> Distance:
    """A part about the origin, turned by a matrix (3, 3) and moved to a center."""
    return lambda points: part(np.einsum("...i,ij->...j", points - np.array(center), rotation))


def subtract(body: Distance, part: Distance) -> Distance:
    """A body from which a part is cut."""
    return lambda points: np.maximum(body(points), -part(points))


def blend_parts(parts: Sequence[Distance], width: float) -> Distance:
    """All parts joined in turn, creases rounded by blends of this width."""
    return reduce(lambda joined, part: blend(joined, part, width), parts)


ROUND_KINDS = {
    "blobs": _blobs,
    "animal": _animal,
    "rings": _rings,
    "star": _star,
    "figure": _figure,
    "carved": _carve,
    "spider": _spider,
    "vase": _vase,
    "toy": _toy,
    "knot": _knot,
}
"""What draws a model, by the kind."""
