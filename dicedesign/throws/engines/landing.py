"""The rest of a body that can no more leave the basin it is in."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dicedesign.runtime.arrays import Floats

if TYPE_CHECKING:
    from dicedesign.throws.rigid_body import RigidBody

__all__ = ["final_rest", "rest_below"]


def rest_below(body: RigidBody, down: Floats) -> int:
    """The rest in whose basin a direction lies; -1 where rounding hides the path to it.

    down: (3,) unit vector that points down, in the frame of the principal axes. The path is that
    without momentum: it runs away from the lowest vertex, over ridges into the next cell, along
    hinges to a facet, and heights fall along it.
    """
    vertices = body.vertices
    p = int(np.argmax(vertices @ down))
    for _ in range(len(vertices)):
        edges = slice(body.start[p], body.start[p + 1])
        neighbors = body.neighbors[edges]
        v = vertices[p] - vertices[neighbors]
        approach = v @ vertices[p]
        ahead = np.flatnonzero(approach > 0.0)
        if len(ahead) == 0:
            return -1
        when = (v[ahead] @ down) / approach[ahead]
        soonest = int(np.argmin(when))
        down = down - max(float(when[soonest]), 0.0) * vertices[p]
        down = down / np.linalg.norm(down)
        exit_edge = int(ahead[soonest])
        q, across = int(neighbors[exit_edge]), v[exit_edge]
        if across @ vertices[q] >= 0.0:
            p = q
            continue
        foot = vertices[p] - (vertices[p] @ across) / (across @ across) * across
        left, right = int(body.left[edges][exit_edge]), int(body.right[edges][exit_edge])
        to_left = (down @ foot * down - foot) @ (body.normals[left] - body.normals[right])
        return int(body.rest_of_facet[left if to_left > 0.0 else right])
    return -1


def final_rest(body: RigidBody, down: Floats, energy: float) -> int:
    """The rest that a body cannot miss any more, or -1.

    down: as for `rest_below`; energy: all of it, as the height in radii to which it would lift the
    center of mass. Below every saddle on the border of a basin, a body cannot leave it.
    """
    if energy >= body.barriers.max():
        return -1
    rest = rest_below(body, down)
    return rest if rest >= 0 and energy < body.barriers[rest] else -1
