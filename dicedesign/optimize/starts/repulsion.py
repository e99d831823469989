"""Facets tangent to a sphere at points that repel each other."""

from __future__ import annotations

from typing import Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.optimize.starts.start import Start, normalised_start
from dicedesign.runtime.arrays import Floats

__all__ = ["FEWEST_FACETS", "repulsion", "spread_directions"]

FEWEST_FACETS: Final = 4
"""A body bounded by planes has at least so many facets."""

REPULSION_STEPS: Final = 400
"""Steps of gradient descent on the Coulomb energy."""


def repulsion(outcomes: int, seed: int) -> Start:
    """Facets tangent to the unit sphere at points that repel each other like charges.

    Own coordinates: the unit sphere has its center at the origin.

    Parameters
    ----------
    outcomes: number of facets, at least `FEWEST_FACETS`; all carry an outcome.
    seed: of the random first positions.

    Raises
    ------
    InputError: fewer than 4 outcomes.
    """
    if outcomes < FEWEST_FACETS:
        raise InputError(
            f"start.repulsion: expected at least {FEWEST_FACETS} outcomes, got {outcomes}; a "
            "body bounded by fewer facets does not exist, start from a prism"
        )
    from dicedesign.geometry.hulls.halfspaces import polyhedron_corners

    points = spread_directions(outcomes, np.random.default_rng(seed), REPULSION_STEPS)
    return normalised_start(polyhedron_corners(points, np.ones(outcomes)), points)


def spread_directions(count: int, rng: np.random.Generator, steps: int) -> Floats:
    """(count, 3) random unit vectors that repel each other like charges, after so many steps of
    gradient descent on the Coulomb energy."""
    points = rng.normal(size=(count, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    for step in range(steps):
        offset = points[:, None, :] - points[None, :, :]
        distance = np.sqrt((offset * offset).sum(-1)) + np.eye(count)
        force = (offset / distance[..., None] ** 3).sum(axis=1)
        force -= points * (force * points).sum(-1)[:, None]
        length = np.sqrt((force * force).sum(-1)).max()
        reach = 0.3 / np.sqrt(count) * (1.0 - step / steps)
        points += force * (reach / max(length, 1.0))
        points /= np.linalg.norm(points, axis=1)[:, None]
    return points
