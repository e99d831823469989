"""How a body comes to rest from the pose that it is in, after it was changed."""

from __future__ import annotations

from typing import Final

import numpy as np

from dicedesign.geometry.sphere import angle_between
from dicedesign.rest.poses import standing_transform
from dicedesign.runtime.arrays import Floats
from dicedesign.view.bodies.viewed_body import ViewedBody
from dicedesign.view.scenes.motion import Motion, rolled, turned

__all__ = ["let_go", "settled"]

STANDS: Final = np.radians(0.01)
"""A body within this angle of a rest stands on it."""


def settled(viewed: ViewedBody, pose: Floats) -> Motion:
    """From a pose (4, 4) to rest, as the body rolls from there."""
    return let_go(viewed, pose, -pose[2, :3])


def let_go(viewed: ViewedBody, pose: Floats, down: Floats) -> Motion:
    """From a pose (4, 4), turned until a direction (3,) points down, and from there to rest."""
    poses = viewed.poses
    angles = angle_between(poses.normals, down)
    nearest = int(angles.argmin())
    if angles[nearest] <= STANDS:
        height = float(poses.hull.heights(poses.center_of_mass)[poses.facets[nearest]])
        end = standing_transform(poses.normals[nearest], height, poses.center_of_mass)
        return turned(viewed.hull, pose, end)
    roll = rolled(poses.morse.equilibria, down)
    return roll.after(turned(viewed.hull, pose, roll.poses[0]))
