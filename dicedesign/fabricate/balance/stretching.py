"""Bodies of any shape brought to wanted odds by a stretch along three axes of a few parts in a
thousand.

A linear image keeps what is flat, convex, closed or in contact, and its center of mass is the image
of that of the body: so the odds after it are known from the corners of the hull alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from dicedesign.errors import DiceError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.body import make_body
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.rest.outcomes import outcome_odds
from dicedesign.rest.poses import analyse, rest_poses
from dicedesign.runtime.arrays import Floats
from dicedesign.tolerances import BALANCED_ODDS

__all__ = ["Stretched", "stretched"]

STEP: Final = 1e-6
"""Of the differences that derivatives are taken from, as a stretch."""

MOST_STEPS: Final = 20
"""Of Newton's method."""

MOST_STRETCH: Final = 0.03
"""Largest stretch along an axis, relative: what is beyond is another shape."""

SHORTER: Final = 0.5
"""Ratio of the lengths of steps tried one after the other."""

RANK: Final = 1e-6
"""Singular values below this part of the largest are directions in which nothing changes: the size
is one."""

INDICES: Final = np.array([(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)])
"""Entries of a symmetric matrix."""


@dataclass(frozen=True, eq=False)
class Stretched:
    """A stretched body.

    Attributes
    ----------
    matrix: (3, 3) symmetric, the linear map. surface: the image.
    directions: (k, 3) unit, images of the outcomes' directions.
    unbalanced: (k,) odds before; errors: largest |p - q| before and after.
    """

    matrix: Floats
    surface: Surface
    directions: Floats
    unbalanced: Floats
    errors: tuple[float, float]


def stretched(surface: Surface, directions: Floats, target: Floats) -> Stretched:
    """Stretch a solid until its odds are as near to wanted ones as it can bring them.

    A stretch has five parameters beside the size, so that up to six outcomes can be met exactly.
    Newton's method takes the shortest way, with derivatives from differences, as bodies of any
    shape have corners by the thousand and a hull of a few hundred.

    surface: of the solid; directions: (k, 3) unit, down in its outcomes; target: (k,) odds. The
    best stretch found is returned, and none where nothing is gained. Raises DiceError if the body
    has no rests.
    """
    poses = rest_poses(make_body(surface.points, surface.triangles))
    corners, center = poses.hull.vertices, poses.center_of_mass

    def odds(parameters: Floats) -> Floats:
        matrix = _matrix(parameters)
        image = convex_hull((corners - center) @ matrix.T)
        return outcome_odds(analyse(image, np.zeros(3)), _turned(directions, matrix)).odds

    parameters = np.zeros(6)
    first = current = odds(parameters)
    before = error = float(np.abs(current - target).max())
    for _ in range(MOST_STEPS):
        if error <= 0.1 * BALANCED_ODDS:
            break
        jacobian = np.column_stack(
            [(odds(parameters + h) - odds(parameters - h)) / (2.0 * STEP) for h in STEP * np.eye(6)]
        )
        step = -np.linalg.pinv(jacobian, rcond=RANK) @ (current - target)
        while np.abs(step).max() > STEP * BALANCED_ODDS:
            candidate = parameters + step
            if np.abs(candidate).max() <= MOST_STRETCH:
                try:
                    tried = odds(candidate)
                except DiceError:
                    tried = np.full(len(target), np.inf)
                if np.abs(tried - target).max() < error:
                    break
            step = SHORTER * step
        else:
            break
        parameters, current = candidate, tried
        error = float(np.abs(current - target).max())
    matrix = _matrix(parameters)
    image = surface.moved((surface.points - center) @ matrix.T)
    return Stretched(matrix, image, _turned(directions, matrix), first, (before, error))


def _matrix(parameters: Floats) -> Floats:
    """The symmetric matrix (3, 3) of six parameters, the unit matrix for zeros."""
    matrix = np.eye(3)
    i, j = INDICES.T
    matrix[i, j] += parameters
    matrix[j[3:], i[3:]] += parameters[3:]
    return matrix


def _turned(directions: Floats, matrix: Floats) -> Floats:
    """Unit normals (k, 3) of the images of planes with normals (k, 3)."""
    images = directions @ np.linalg.inv(matrix)
    turned: Floats = images / np.linalg.norm(images, axis=1, keepdims=True)
    return turned
