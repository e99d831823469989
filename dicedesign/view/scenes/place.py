"""Where things are in the scene, whose unit is a body's own size."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.runtime.arrays import Floats

__all__ = ["BODY_AT", "SPHERE_AT", "SPHERE_RADIUS", "Place", "quaternion"]

BODY_AT: Final = np.array([-1.3, 0.0, 0.0])
"""The point of the floor on which the body stands."""

SPHERE_AT: Final = np.array([1.3, 0.0, 1.0])

SPHERE_RADIUS: Final = 0.95


@dataclass(frozen=True)
class Place:
    """From a body's coordinates to the scene's and back.

    Attributes
    ----------
    origin: (3,) point of the body that is the origin of its frame in the scene; scale: scene units
    for one of the body's.
    """

    origin: Floats
    scale: float

    @classmethod
    def of(cls, hull: ConvexHull) -> Place:
        """The farthest corner of the hull is 1 from the origin."""
        radius = np.linalg.norm(hull.vertices - hull.centroid, axis=1).max()
        return cls(hull.centroid, float(1.0 / radius))

    def into_scene(self, points: Floats) -> Floats:
        """Points (..., 3) of the body in its frame of the scene."""
        return (points - self.origin) * self.scale

    def from_scene(self, points: Floats) -> Floats:
        """The way back."""
        return points / self.scale + self.origin

    def frame(self, pose: Floats) -> tuple[Floats, Floats]:
        """Quaternion (4,) and position (3,) of the body's frame in the scene, for a pose (4, 4)
        that puts the body onto the plane z = 0."""
        turned = pose[:3, :3]
        return quaternion(turned), BODY_AT + self.scale * (turned @ self.origin + pose[:3, 3])

    def motion(self, wxyz: Floats, position: Floats, start: Floats) -> Floats:
        """The motion (4, 4) of the body's points that carries something at `start` (3,), a point of
        the body, as a gizmo was moved and turned in the body's frame."""
        motion = np.eye(4)
        motion[:3, :3] = Rotation.from_quat(wxyz, scalar_first=True).as_matrix()
        motion[:3, 3] = self.from_scene(position) - motion[:3, :3] @ start
        return motion


def quaternion(rotation: Floats) -> Floats:
    """(4,) unit, w, x, y, z, of a rotation matrix (3, 3)."""
    return np.asarray(Rotation.from_matrix(rotation).as_quat(scalar_first=True))
