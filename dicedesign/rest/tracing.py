"""Flow lines of the support function, cell by cell, many at a time.

Inside the Gauss cell of vertex p a flow line is a great arc through r_p. It leaves the cell through
the arc of one of p's edges; `exit_half_edges` says through which, and the crossing point is an
oblique projection. All lines advance together, one cell per step.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dicedesign.errors import DegenerateBodyError
from dicedesign.geometry.sphere import oblique_projection
from dicedesign.rest.equilibria import Equilibria

__all__ = ["ascend", "crossing", "descend", "destined_facets", "exit_half_edges", "hinge_facets"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


def exit_half_edges(
    equilibria: Equilibria, vertices: Integers, directions: Floats, *, ascending: bool
) -> Integers:
    """Half-edge of each vertex through whose arc the flow line leaves the vertex's cell.

    Candidates are only the edges along which distance from c grows (ascending) or shrinks
    (descending). They are consecutive around the vertex; the first lies to the right of every flow
    line and the last to the left, so that exactly one change of side exists, without tolerances.

    vertices: (k,), none of them a maximum if ascending; directions: (k, 3) in their cells.
    Returns (k,) half-edges that leave the vertices.
    """
    hull = equilibria.hull
    allowed = equilibria.ascending if ascending else equilibria.descending
    start, order = hull.outgoing
    degree = start[vertices + 1] - start[vertices]
    owner = np.repeat(np.arange(len(vertices)), degree)
    within = np.arange(len(owner)) - np.repeat(np.cumsum(degree) - degree, degree)
    edges = order[start[vertices][owner] + within]
    keep = allowed[edges]
    edges, owner = edges[keep], owner[keep]

    along = equilibria.radii[vertices]
    left_of_travel = np.linalg.cross(directions, along if ascending else -along)[owner]
    twin = hull.twin[edges]
    at_right = (left_of_travel * hull.normals[hull.facet[twin]]).sum(-1)
    at_left = (left_of_travel * hull.normals[hull.facet[edges]]).sum(-1)
    first_of_chain = ~allowed[hull.next[twin]]
    last_of_chain = ~allowed[hull.twin[hull.previous[edges]]]
    leaves = (first_of_chain | (at_right < 0.0)) & (last_of_chain | (at_left >= 0.0))
    score = np.where(leaves, np.inf, np.minimum(at_left, -at_right))
    best = np.lexsort((-score, owner))
    return edges[best[np.searchsorted(owner, np.arange(len(vertices)))]]


def crossing(
    equilibria: Equilibria, half_edges: Integers, directions: Floats, *, ascending: bool
) -> Floats:
    """Where flow lines cross the arcs of half-edges (k,): unit directions (k, 3)."""
    hull = equilibria.hull
    radii = equilibria.radii[hull.tail[half_edges]]
    point = oblique_projection(directions, radii, equilibria.edge_vectors[half_edges])
    length = np.sqrt((point * point).sum(-1))[:, None]
    return point / (length if ascending else -length)


def ascend(
    equilibria: Equilibria, vertices: Integers, directions: Floats
) -> tuple[Integers, Integers, Integers]:
    """Follow flow lines uphill to their maxima.

    vertices: (k,) cells to start in; directions: (k, 3).
    Returns the half-edges crossed (k, depth), padded with -1; how many they are (k,); and the
    vertices (k,) that are the lines' maxima. A line visits vertices of growing distance from c and
    so ends by itself.
    """
    vertices, directions = vertices.copy(), directions.copy()
    lengths = np.zeros(len(vertices), dtype=np.int64)
    steps = []
    active = np.flatnonzero(~equilibria.maximum[vertices])
    while len(active):
        edges = exit_half_edges(equilibria, vertices[active], directions[active], ascending=True)
        directions[active] = crossing(equilibria, edges, directions[active], ascending=True)
        vertices[active] = equilibria.hull.head[edges]
        crossed = np.full(len(vertices), -1, dtype=np.int64)
        crossed[active] = edges
        steps.append(crossed)
        lengths[active] += 1
        active = active[~equilibria.maximum[vertices[active]]]
    depthless = np.empty((len(vertices), 0), dtype=np.int64)
    return (np.stack(steps, axis=1) if steps else depthless), lengths, vertices


def hinge_facets(equilibria: Equilibria, half_edges: Integers, directions: Floats) -> Integers:
    """Facet that a body tips onto which touches the table along a hinge edge.

    half_edges: (k,); directions: (k, 3) on their arcs; returns (k,) facets. A body that balances
    exactly on a saddle goes to the left facet of its half-edge.
    """
    hull = equilibria.hull
    across = np.linalg.cross(equilibria.edge_vectors[half_edges], directions)
    to_left = (equilibria.radii[hull.tail[half_edges]] * across).sum(-1) >= 0.0
    twin = hull.twin[half_edges]
    to_left = (to_left | (equilibria.side[twin] <= 0.0)) & (equilibria.side[half_edges] > 0.0)
    return np.where(to_left, hull.facet[half_edges], hull.facet[twin])


def descend(equilibria: Equilibria, vertices: Integers, directions: Floats) -> Integers:
    """Follow flow lines downhill from the cells of vertices (k,) at directions (k, 3) until they
    reach the arc of a hinge edge; returns the (k,) facets that they slide to."""
    vertices, directions = vertices.copy(), directions.copy()
    facets = np.empty(len(vertices), dtype=np.int64)
    active = np.arange(len(vertices))
    while len(active):
        edges = exit_half_edges(equilibria, vertices[active], directions[active], ascending=False)
        directions[active] = crossing(equilibria, edges, directions[active], ascending=False)
        vertices[active] = equilibria.hull.head[edges]
        arrived = equilibria.hinge[edges]
        done = active[arrived]
        facets[done] = hinge_facets(equilibria, edges[arrived], directions[done])
        active = active[~arrived]
    return facets


def destined_facets(equilibria: Equilibria, facets: Integers) -> Integers:
    """Stable facet (k,) on which a body comes to rest that is let go on facets (k,)."""
    hull = equilibria.hull
    known = np.where(equilibria.stable, np.arange(len(equilibria.stable)), -1)
    rolls = equilibria.roll_edge >= 0
    known[rolls] = hull.facet[hull.twin[equilibria.roll_edge[rolls]]]
    current = facets.copy()
    for _ in range(len(known) + 1):
        tipping = np.unique(current[known[current] < 0])
        if len(tipping):
            known[tipping] = descend(
                equilibria, equilibria.roll_vertex[tipping], hull.normals[tipping]
            )
        following = known[current]
        if (following == current).all() and equilibria.stable[current].all():
            return current
        current = following
    raise DegenerateBodyError(
        "body: two neighbouring facets lie at the same height within rounding, and a path between "
        "them cannot be decided; merge them with a larger coplanar tolerance"
    )
