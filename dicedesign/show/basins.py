"""Which rest a body reaches from given directions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dicedesign.rest.poses import RestPoses
from dicedesign.rest.tracing import slide

__all__ = ["basin_of_directions"]

_CHUNK = 20_000


def basin_of_directions(poses: RestPoses, directions: NDArray[np.float64]) -> NDArray[np.int64]:
    """Index into `poses` of the rest reached from each direction.

    directions: (k, 3) unit vectors that point down in the body's frame.
    Returns (k,).
    """
    equilibria = poses.morse.equilibria
    rests = np.empty(len(directions), dtype=np.int64)
    for start in range(0, len(directions), _CHUNK):
        part = directions[start : start + _CHUNK]
        lowest = np.argmax(part @ equilibria.radii.T, axis=1)
        facets, _ = slide(equilibria, lowest, part, np.zeros(len(part)))
        rests[start : start + _CHUNK] = poses.morse.basin_of_facet[facets]
    return rests
