"""Prisms with pointed ends."""

from __future__ import annotations

import numpy as np

from dicedesign.design.starts.start import Start, normalised_start
from dicedesign.errors import InputError

__all__ = ["prism"]


def prism(sides: int, height: float = 1.5, cap: float = 1.3) -> Start:
    """A prism with pointed caps, whose side faces carry the outcomes in order around the axis.

    Own coordinates: the center at the origin, the axis along z, the base's circumscribed radius 1,
    a corner of the base in direction x.

    Parameters
    ----------
    sides: 3 to 12.
    height: height of the side faces in units of the base's circumscribed radius, positive and
        finite.
    cap: height of each pointed cap in the same unit, not negative and finite; steep caps are
        unstable.

    Raises
    ------
    InputError: a parameter out of range.
    """
    if not 3 <= sides <= 12:
        raise InputError(
            f"start.prism.sides: expected 3 to 12, got {sides}; start from repulsion or a mesh"
        )
    if not 0.0 < height < np.inf:
        raise InputError(
            f"start.prism.height: expected a positive number, got {height:g}; leave it out for 1.5"
        )
    if not 0.0 <= cap < np.inf:
        raise InputError(
            f"start.prism.cap: expected a number not below 0, got {cap:g}; leave it out for 1.3"
        )
    corner = 2.0 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(corner), np.sin(corner)], axis=1)
    level = np.full((sides, 1), height / 2.0)
    apex = np.array([[0.0, 0.0, height / 2.0 + cap]])
    points = np.concatenate([np.hstack([ring, level]), np.hstack([ring, -level])])
    if cap > 0.0:
        points = np.concatenate([points, apex, -apex])
    middle = corner + np.pi / sides
    directions = np.stack([np.cos(middle), np.sin(middle), np.zeros(sides)], axis=1)
    return normalised_start(points, directions)
