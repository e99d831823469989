"""Bodies of any shape brought to wanted odds by a stretch along three axes of a few parts in a
thousand.

A linear image keeps what is flat, convex, closed or in contact, and its center of mass is the image
of that of the body: so the odds after it are known from the corners of the hull alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from dicedesign.errors import DiceError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.body import make_body
from dicedesign.geometry.triangles import Surface
from dicedesign.rest.outcomes import outcome_odds
from dicedesign.rest.poses import analyse, rest_poses
from dicedesign.rest.prior import Prior
from dicedesign.runtime.arrays import Floats
from dicedesign.tolerances import BALANCED_ODDS, FILE_ODDS

STEP: Final = 1e-6
"""Of the differences that derivatives are taken from, as a stretch."""

MOST_STEPS: Final = 20
"""Of Newton's method, from one place."""

LENGTHS: Final = (0.0, *np.geomspace(3e-4, 1e-2, 31).tolist())
"""Of random stretches that it begins with, one after the other until one leads to the odds: those
of bodies of many corners jump where a facet becomes a rest, which may be in the way."""

MOST_STRETCH: Final = 0.03
"""Largest stretch along an axis, relative: what is beyond is another shape."""

GAINED: Final = 0.5
"""Part of the error that a better stretch leaves at most: a little is not worth another shape."""

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


def stretched(
    surface: Surface, directions: Floats, target: Floats, prior: Prior | None = None
) -> Stretched:
    """Stretch a solid until its odds are as near to wanted ones as it can bring them.

    A stretch has five parameters beside the size, so that up to six outcomes can be met exactly.
    Newton's method takes the shortest way, with derivatives from differences of the hull's odds.

    surface: of the solid; directions: (k, 3) unit, down in its outcomes; target: (k,) odds; prior:
    they are under, if any, which stays where it is as the body is stretched. The best stretch found
    is returned, and none where nothing is gained. Raises DiceError if the body has no rests.
    """
    poses = rest_poses(make_body(surface.points, surface.triangles))
    body = _Body(poses.hull.vertices - poses.center_of_mass, directions, target, prior)
    first = best = body.tried(np.zeros(6))
    random = np.random.default_rng(0)
    for length in LENGTHS:
        end = body.solved(body.tried(length * random.standard_normal(6)))
        if end.error < GAINED * best.error and body.in_file(end) <= max(2.0 * end.error, FILE_ODDS):
            best = end
        if best.error <= BALANCED_ODDS:
            break
    matrix, center = _matrix(best.parameters), poses.center_of_mass
    image = surface.moved(center + (surface.points - center) @ matrix.T)
    before, after = (float(np.abs(trial.odds - target).max()) for trial in (first, best))
    return Stretched(matrix, image, _turned(directions, matrix), first.odds, (before, after))


@dataclass(frozen=True)
class _Trial:
    """A stretch, the odds (k,) after it, and the root of the sum of squares of p - q."""

    parameters: Floats
    odds: Floats
    error: float


@dataclass(frozen=True)
class _Body:
    """Corners (n, 3) of a hull about the center of mass, directions, target and prior."""

    corners: Floats
    directions: Floats
    target: Floats
    prior: Prior | None

    def tried(self, parameters: Floats) -> _Trial:
        """The body after a stretch, whose error is infinite where it has no rests."""
        odds = self._odds(parameters)
        return _Trial(parameters, odds, float(np.linalg.norm(odds - self.target)))

    def in_file(self, trial: _Trial) -> float:
        """The error with coordinates in single precision."""
        odds = self._odds(trial.parameters, in_file=True)
        return float(np.linalg.norm(odds - self.target))

    def solved(self, trial: _Trial) -> _Trial:
        """The body where Newton's method ends."""
        for _ in range(MOST_STEPS):
            if not 0.1 * BALANCED_ODDS < trial.error < np.inf:
                break
            jacobian = np.column_stack(
                [
                    (self._odds(trial.parameters + h) - self._odds(trial.parameters - h)) / 2.0
                    for h in STEP * np.eye(6)
                ]
            )
            step = -STEP * np.linalg.pinv(jacobian, rcond=RANK) @ (trial.odds - self.target)
            following = trial
            while following is trial and np.abs(step).max() > STEP * BALANCED_ODDS:
                if np.abs(trial.parameters + step).max() <= MOST_STRETCH:
                    candidate = self.tried(trial.parameters + step)
                    following = candidate if candidate.error < trial.error else trial
                step = SHORTER * step
            if following is trial:
                break
            trial = following
        return trial

    def _odds(self, parameters: Floats, in_file: bool = False) -> Floats:
        matrix = _matrix(parameters)
        corners = self.corners @ matrix.T
        if in_file:
            corners = corners.astype(np.float32).astype(np.float64)
        try:
            image = convex_hull(corners, single_precision=in_file)
            poses = analyse(image, np.zeros(3)).under(self.prior)
        except DiceError:
            return np.full(len(self.target), np.inf)
        return outcome_odds(poses, _turned(self.directions, matrix)).odds


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
