"""How far a surface is displaced by the corners of its hull, before it is filled."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.spatial import cKDTree

from dicedesign.concave.fill.space_elasticity import HeldCorners, spread_points
from dicedesign.runtime.arrays import Floats

__all__ = ["squared_displacement"]

SAMPLES: Final = 600
"""Points of the surface that stand for those around them."""


def squared_displacement(held: HeldCorners, forces: Floats) -> Floats:
    """(c, 3, c, 3) the quadratic form that is the mean squared displacement of the points of a
    surface, laid onto the original as well as a similarity can, for displacements of some of them.

    Parameters
    ----------
    held: those points, the corners.
    forces: (c, 3, c, 3) on them, for displacements relative to the center of mass, on which they
        act back (`HeldCorners.relative`).
    """
    points = held.elasticity.surface.points
    samples = spread_points(points, SAMPLES)
    nearest = cKDTree(points[samples]).query(points)[1]
    weights = np.sqrt(np.bincount(nearest, minlength=len(samples)) / len(points))
    gradient = np.moveaxis(held.elasticity.surface.centroid_derivatives(), 0, -1)
    by_center = held.elasticity.center_responses(gradient)[samples]
    moved = np.tensordot(held.by_corner[samples], forces, (1, 0))
    moved -= np.tensordot(by_center, forces.sum(axis=0), (2, 0))
    moved *= weights[:, None, None, None]
    flat = moved.reshape(3 * len(samples), -1)
    similar = _similarities(points[samples], weights)
    flat -= similar @ (similar.T @ flat)
    return np.asarray((flat.T @ flat).reshape(forces.shape))


def _similarities(points: Floats, weights: Floats) -> Floats:
    """(3 n, 7) orthonormal displacements, times their weights (n,), by which points (n, 3) are
    shifted, turned and scaled."""
    about = points - (weights**2) @ points
    axes = np.eye(3)
    moves = [np.broadcast_to(axis, points.shape) for axis in axes]
    moves += [np.cross(axis, about) for axis in axes]
    columns = np.stack([*moves, about], axis=-1) * weights[:, None, None]
    return np.asarray(np.linalg.qr(columns.reshape(-1, 7))[0])
