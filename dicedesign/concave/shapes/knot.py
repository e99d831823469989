"""A tube along a trefoil knot."""

from __future__ import annotations

import numpy as np

from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Floats

__all__ = ["knot"]


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
