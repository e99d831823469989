"""Make the triangles of a closed surface pass every shared edge in opposite directions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from dicedesign.geometry.solid import is_closed

__all__ = ["consistent_winding"]


def consistent_winding(triangles: NDArray[np.int64]) -> NDArray[np.int64] | None:
    """Reverse as few triangles as needed for a closed, consistently oriented surface.

    Each triangle stands twice in a graph, once kept and once reversed, and two triangles that
    share an edge link the copies that agree. An orientable part of the surface falls into two
    components, one the reverse of the other, and the one that keeps more triangles is taken.

    triangles: (t, 3) vertex indices, nonnegative. Returns the same triangles in the same order,
    some reversed, or None when no choice closes the surface, because it has a boundary or is
    one-sided.
    """
    count = len(triangles)
    if count == 0:
        return None
    tails = triangles.ravel()
    heads = np.roll(triangles, -1, axis=1).ravel()
    faces = np.repeat(np.arange(count), 3)
    rising = tails < heads
    keys = np.minimum(tails, heads) * (int(triangles.max()) + 1) + np.maximum(tails, heads)
    order = np.argsort(keys, kind="stable")
    starts = np.flatnonzero(np.diff(keys[order], prepend=-1))
    sizes = np.diff(starts, append=len(order))
    pairs = starts[sizes == 2]
    first, second = order[pairs], order[pairs + 1]
    left, right = faces[first], faces[second]
    shift = np.where(rising[first] == rising[second], count, 0)
    rows = np.concatenate((left, left + count))
    columns = np.concatenate((right + shift, right + count - shift))
    graph = coo_array((np.ones(len(rows)), (rows, columns)), shape=(2 * count, 2 * count))
    _, labels = connected_components(graph, directed=False)
    kept, reversed_ = labels[:count], labels[count:]
    weight = np.bincount(kept, minlength=int(labels.max()) + 1)
    flip = (weight[kept] < weight[reversed_]) | (
        (weight[kept] == weight[reversed_]) & (kept > reversed_)
    )
    oriented = np.where(flip[:, None], triangles[:, ::-1], triangles)
    return oriented if is_closed(oriented) else None
