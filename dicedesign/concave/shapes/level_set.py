"""The surface where a distance function is 0, evenly triangulated."""

from __future__ import annotations

from typing import Final

import numpy as np

from dicedesign.concave.shapes.distance_functions import Distance
from dicedesign.geometry.repair.evening import evened
from dicedesign.geometry.repair.surface_nets import surface_nets
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["level_set"]

ROUNDS: Final = 15
"""Times that edges are flipped and points moved."""

DIFFERENCE: Final = 1e-5
"""Step of the difference quotients, in cells."""


def level_set(distance: Distance, low: Floats, high: Floats, spacing: float) -> Surface:
    """Triangles with edges of about one length on the surface where a distance function is 0.

    A surface between the nodes of a grid (`surface_nets`) is made even (`evened`).

    Parameters
    ----------
    distance: negative inside. No part of the body and no gap may be thinner than two cells.
    low, high: (3,) corners of a box that holds the surface with a cell to spare.
    spacing: side of the cells, above 0.

    Returns
    -------
    Surface, oriented outward; the same for the same input.
    """
    axes = [np.arange(a, b + spacing, spacing) for a, b in zip(low, high, strict=True)]
    values = distance(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1))

    def crossing(nodes: Integers, ahead: Integers) -> Floats:
        here, there = values[tuple(nodes.T)], values[tuple(ahead.T)]
        part = here / (here - there)
        return np.asarray(low + spacing * (nodes + part[:, None] * (ahead - nodes)))

    points, triangles = surface_nets(values < 0.0, crossing)
    return Surface(
        *evened(points, triangles, lambda moved, _: _onto(distance, moved, spacing), ROUNDS)
    )


def _onto(distance: Distance, points: Floats, spacing: float) -> Floats:
    """Points after a Newton step toward the level set, no longer than half a cell."""
    step = DIFFERENCE * spacing
    values = distance(points)
    slopes = (distance(points[:, None] + step * np.eye(3)) - values[:, None]) / step
    squares = (slopes * slopes).sum(axis=-1).clip(0.25)
    steps = (values / squares).clip(-0.5 * spacing, 0.5 * spacing)
    return points - steps[:, None] * slopes
