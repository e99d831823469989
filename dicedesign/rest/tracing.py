"""Flow lines of the support function, cell by cell, many at a time.

Inside the Gauss cell of vertex p a flow line is a great arc through r_p. It leaves the cell through
the arc of one of p's edges; `exit_half_edges` says through which, and the crossing point is an
oblique projection. Kernels follow the lines one by one; here all lines advance together, one cell
per step.
"""

from __future__ import annotations

import numpy as np

from dicedesign.errors import DegenerateBodyError
from dicedesign.geometry.sphere import norms, oblique_projection
from dicedesign.kernels import ops as kernels
from dicedesign.rest.equilibria import Equilibria
from dicedesign.runtime.arrays import Booleans, Floats, Integers, ragged_ranges
from dicedesign.tolerances import ROUNDING


def exit_half_edges(
    equilibria: Equilibria,
    vertices: Integers,
    directions: Floats,
    errors: Floats,
    *,
    ascending: bool,
) -> tuple[Integers, Booleans]:
    """Half-edge of each vertex through whose arc the flow line leaves the vertex's cell.

    Candidates are only the edges along which distance from c grows (ascending) or shrinks
    (descending). They are consecutive around the vertex; the first lies to the right of every flow
    line and the last to the left, so that exactly one change of side exists, without tolerances.

    vertices: (k,), none of them a maximum if ascending; directions: (k, 3) in their cells, unit,
    within errors (k,) of the true lines.
    Returns (k,) half-edges that leave the vertices, and (k,) whether rounding cannot change them.
    """
    hull = equilibria.hull
    allowed = equilibria.ascending if ascending else equilibria.descending
    start, order = hull.outgoing
    owner, place = ragged_ranges(start[vertices], start[vertices + 1] - start[vertices])
    edges = order[place]
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
    # A corner between two candidates is at the left of one and at the right of the other.
    slack = norms(along)[owner] * (errors + ROUNDING)[owner]
    slack += (
        equilibria.tie_distance + norms(left_of_travel) * equilibria.normal_error[hull.facet[edges]]
    )
    unsure = ~last_of_chain & (np.abs(at_left) <= slack)
    certain = np.bincount(owner[unsure], minlength=len(vertices)) == 0
    return edges[best[np.searchsorted(owner, np.arange(len(vertices)))]], certain


def crossing(
    equilibria: Equilibria,
    half_edges: Integers,
    directions: Floats,
    errors: Floats,
    *,
    ascending: bool,
) -> tuple[Floats, Floats]:
    """Crossings of flow lines with the arcs of half-edges (k,): unit directions (k, 3), and bounds
    (k,) on their distances from the true line.

    With the line's plane through u and r_p, an error beside it shrinks with the distance to r_p and
    grows with the slant at which the arc is crossed. Rounding along the line is corrected by the
    next crossing; only the turn of the line into the next cell lets a part of it through.
    """
    hull = equilibria.hull
    r, v = equilibria.radii[hull.tail[half_edges]], equilibria.edge_vectors[half_edges]
    point = oblique_projection(directions, r, v)
    length = norms(point)
    directed = length > 0.0
    scale = np.where(directed, length, 1.0)
    # A line that starts exactly at r_p has no direction; the arc's end stands in for it.
    end = hull.normals[hull.facet[half_edges]]
    along = (point if ascending else -point) / scale[:, None]
    unit: Floats = np.where(directed[:, None], along, end)
    edge = equilibria.edge_lengths[half_edges]
    shrink = norms(np.linalg.cross(r, unit)) * edge / scale
    ahead = norms(np.linalg.cross(equilibria.radii[hull.head[half_edges]], unit))
    turn = edge / np.maximum(ahead, edge)
    errors = errors * shrink + ROUNDING * (1.0 + norms(r) * edge / scale * turn)
    errors = errors + equilibria.tie_distance * edge / scale
    return unit, np.where(directed, errors, 1.0)


def ascend(
    equilibria: Equilibria, saddles: Integers, vertices: Integers
) -> tuple[Integers, Integers, Integers]:
    """Follow flow lines uphill from saddles to their maxima.

    saddles: (k,) half-edges; vertices: (k,) the end of each into whose cell the line runs. A line
    visits vertices of growing distance from c and so ends by itself. Lines on which rounding could
    change a crossing are followed in exact arithmetic.

    Returns half-edges (c,) whose arcs the lines cross, in order, line after line; (k + 1,) the
    first of each line; and the vertex (k,) at which each ends.
    """
    hull = equilibria.hull
    vertices, ends = vertices.copy(), vertices.copy()
    directions, edge = equilibria.saddle_directions[saddles], equilibria.edge_lengths[saddles]
    length, radii = norms(directions), norms(equilibria.radii)
    nearest = np.minimum(radii[hull.tail[saddles]], radii[hull.head[saddles]])
    errors = ROUNDING * (1.0 + nearest * edge * edge / length)
    errors += equilibria.tie_distance * edge * edge / length
    directions = directions / length[:, None]
    lines: list[list[int]] = [[] for _ in saddles]
    active = np.flatnonzero(~equilibria.maximum[vertices])
    while len(active):
        edges, certain = exit_half_edges(
            equilibria, vertices[active], directions[active], errors[active], ascending=True
        )
        equilibria.settle(bool(certain.all()))
        for line in active[~certain]:
            lines[line], vertices[line] = equilibria.exact.ascend(
                equilibria, int(saddles[line]), int(ends[line])
            )
        active, edges = active[certain], edges[certain]
        directions[active], errors[active] = crossing(
            equilibria, edges, directions[active], errors[active], ascending=True
        )
        vertices[active] = hull.head[edges]
        for line, edge in zip(active, edges, strict=True):
            lines[line].append(int(edge))
        active = active[~equilibria.maximum[vertices[active]]]
    start = np.cumsum([0, *(len(line) for line in lines)])
    return np.array([e for line in lines for e in line], dtype=np.int64), start, vertices


def hinge_facets(
    equilibria: Equilibria, half_edges: Integers, directions: Floats, errors: Floats
) -> tuple[Integers, Booleans]:
    """Facet onto which a body tips from a hinge edge.

    half_edges: (k,); directions: (k, 3) on their arcs with errors up to (k,). Returns (k,) facets,
    and (k,) whether rounding cannot change them.
    """
    hull = equilibria.hull
    r, v = equilibria.radii[hull.tail[half_edges]], equilibria.edge_vectors[half_edges]
    value = (r * np.linalg.cross(v, directions)).sum(-1)
    edge = equilibria.edge_lengths[half_edges]
    reach = norms(r) * edge
    twin = hull.twin[half_edges]
    right_is_uphill = equilibria.side_sign[twin] < 0
    left_is_uphill = equilibria.side_sign[half_edges] < 0
    to_left = ((value > 0.0) | right_is_uphill) & ~left_is_uphill
    certain = (
        (np.abs(value) > reach * (errors + ROUNDING) + equilibria.tie_distance * edge)
        | right_is_uphill
        | left_is_uphill
    )
    return np.where(to_left, hull.facet[half_edges], hull.facet[twin]), certain


def slide(
    equilibria: Equilibria, vertices: Integers, directions: Floats, errors: Floats
) -> tuple[Integers, Booleans]:
    """Follow flow lines downhill until they reach the arc of a hinge edge, all together, one cell
    per step.

    vertices: (k,) cells to start in; directions: (k, 3) unit, with errors up to (k,).
    Returns the facets (k,) that the body then tips onto, and (k,) whether rounding cannot change
    them.
    """
    body = equilibria.hull, equilibria.center_of_mass, equilibria.tie_distance
    answer = kernels.slides(*body, vertices, directions, errors)
    if answer is not kernels.UNDECIDED:
        return answer
    vertices, directions, errors = vertices.copy(), directions.copy(), errors.copy()
    facets = np.full(len(vertices), -1, dtype=np.int64)
    certain = np.ones(len(vertices), dtype=bool)
    active = np.arange(len(vertices))
    while len(active):
        edges, sure = exit_half_edges(
            equilibria, vertices[active], directions[active], errors[active], ascending=False
        )
        certain[active] &= sure
        directions[active], errors[active] = crossing(
            equilibria, edges, directions[active], errors[active], ascending=False
        )
        vertices[active] = equilibria.hull.head[edges]
        arrived = equilibria.hinge[edges]
        done = active[arrived]
        facets[done], sure = hinge_facets(
            equilibria, edges[arrived], directions[done], errors[done]
        )
        certain[done] &= sure
        active = active[~arrived]
    return facets, certain


def descend(equilibria: Equilibria, facets: Integers) -> Integers:
    """Facets (k,) that are reached from facets (k,) that tip onto a vertex, in exact arithmetic
    where rounding could change them."""
    start = equilibria.hull.normals[facets], equilibria.normal_error[facets]
    reached, certain = slide(equilibria, equilibria.roll_vertex[facets], *start)
    equilibria.settle(bool(certain.all()))
    for line in np.flatnonzero(~certain):
        reached[line] = equilibria.exact.descend(equilibria, int(facets[line]))
    return reached


def trace_to_rests(equilibria: Equilibria, facets: Integers) -> Integers:
    """Stable facets (k,) on which a body comes to rest from facets (k,), in exact arithmetic where
    rounding could change them.
    """
    body = equilibria.hull, equilibria.center_of_mass, equilibria.tie_distance
    answer = kernels.destinations(*body, facets)
    if answer is not kernels.UNDECIDED:
        return answer
    hull = equilibria.hull
    known = np.where(equilibria.stable, np.arange(len(equilibria.stable)), -1)
    rolls = equilibria.roll_edge >= 0
    known[rolls] = hull.facet[hull.twin[equilibria.roll_edge[rolls]]]
    current = facets.copy()
    for _ in range(len(known) + 1):
        if equilibria.stable[current].all():
            return current
        tipping = np.unique(current[known[current] < 0])
        if len(tipping):
            known[tipping] = descend(equilibria, tipping)
        current = known[current]
    raise DegenerateBodyError(
        "body: two neighboring facets are equally high to within rounding, and a path between "
        "them cannot be decided; merge them with a larger coplanar tolerance"
    )
