"""Surfaces of a few hundred points, mostly concave, and hulls close to their hulls."""

from __future__ import annotations

import numpy as np
import trimesh
from manifold3d import CrossSection, Manifold

from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.meshes.manifold import mesh_of
from dicedesign.geometry.triangles import Surface


def surface_of(mesh: trimesh.Trimesh) -> Surface:
    """Copy the points and triangles of a mesh."""
    return Surface(np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int64))


def ball(subdivisions: int) -> Surface:
    """Triangulated unit sphere."""
    return surface_of(trimesh.creation.icosphere(subdivisions=subdivisions))


def self_intersecting_sphere(subdivisions: int = 4) -> Surface:
    """Self-intersecting sphere: its top is pushed through the bottom, near (0, 0, -1)."""
    surface = ball(subdivisions)
    tip = np.exp(-((np.linalg.norm(surface.points - [0, 0, 1], axis=1) / 0.25) ** 2))
    return surface.with_points(surface.points - 2.6 * tip[:, None] * [0.0, 0.0, 1.0])


def unit(surface: Surface) -> Surface:
    """Move the centroid to the origin, and scale the circumscribed radius to 1."""
    offsets = surface.points - surface.centroid
    return surface.with_points(offsets / np.linalg.norm(offsets, axis=1).max())


def bumpy_sphere(subdivisions: int = 2) -> Surface:
    """Stretched sphere with three dents and three humps: 42, 162 or 642 points."""
    surface = ball(subdivisions)
    x, y, z = surface.points.T
    radii = 1.0 + 0.25 * np.sin(3.0 * np.arctan2(y, x)) * (1.0 - z * z) ** 1.5 + 0.1 * z
    stretched = surface.points * radii[:, None] * np.array([1.3, 1.0, 0.8])
    return surface.with_points(stretched + np.array([5.0, -2.0, 1.0]))


def bent_capsule(rings: int = 24, around: int = 12) -> Surface:
    """Tube with round ends along a third of a circle."""
    length = np.linspace(-1.0, 1.0, rings)
    radii = 0.25 * np.sqrt(1.0 - 0.96 * np.abs(length) ** 6)
    angles = 2.0 * np.pi / around * np.arange(around)
    bend = length[:, None] * np.pi / 3.0
    out = 1.0 + radii[:, None] * np.cos(angles)
    rows = [out * np.cos(bend), out * np.sin(bend), radii[:, None] * np.sin(angles) + 0.0 * bend]
    points = np.stack(rows, axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(rings - 1), np.arange(around), indexing="ij")
    a, b = i * around + j, i * around + (j + 1) % around
    sides = np.stack([a, b, a + around, b, b + around, a + around], axis=-1).reshape(-1, 3)
    first, last = len(points), len(points) + 1
    turn = np.arange(around)
    caps = [np.stack([np.full(around, first), (turn + 1) % around, turn], axis=1)]
    top = (rings - 1) * around
    caps += [np.stack([np.full(around, last), top + turn, top + (turn + 1) % around], axis=1)]
    centers = np.stack([points[:around].mean(axis=0), points[-around:].mean(axis=0)])
    triangles = np.concatenate([sides, *caps])
    surface = Surface(np.concatenate([points, centers]), triangles)
    return surface if surface.volume > 0.0 else Surface(surface.points, triangles[:, ::-1].copy())


def gear() -> Surface:
    """A spur gear of nine teeth with a hole, with sharp rims and edges of at most 0.085."""
    turn = 2.0 * np.pi / 9
    profile = ((0.78, -0.5), (0.78, -0.30), (1.08, -0.17), (1.08, 0.17), (0.78, 0.30))
    rim = [
        (radius * np.cos(turn * (tooth + part)), radius * np.sin(turn * (tooth + part)))
        for tooth in range(9)
        for radius, part in profile
    ]
    face = CrossSection([rim]) - CrossSection.circle(0.33, 24)
    wheel = Manifold.extrude(face, 0.5).translate((0.0, 0.0, -0.25)).refine_to_length(0.085)
    return mesh_of(wheel)


def nearby_hull(surface: Surface, amount: float, seed: int = 0) -> ConvexHull:
    """Deform the hull of a surface smoothly, by at most `amount` times the diagonal."""
    rng = np.random.default_rng(seed)
    corners = convex_hull(surface.points).vertices
    places = (corners - surface.centroid) / surface.diagonal
    field = np.zeros_like(corners)
    for _ in range(4):
        wave = np.sin(places @ rng.normal(size=3) * 4.0 + rng.uniform(0.0, 6.0))
        field += wave[:, None] * rng.normal(size=3)
    field *= amount * surface.diagonal / np.linalg.norm(field, axis=1).max()
    return convex_hull(corners + field)
