"""Measures of the facets of a die: probabilities as functions of the places of their planes, and
the largest circles in facets.

The plane of each facet is moved outward on its own, and the corners follow. A corner of three
facets moves to where their planes meet, a corner of more facets to the nearest point in the sense
of least squares. Circles limit the size of labels; a smooth measure of them serves as an objective.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
import torch
from torch import Tensor

from dicedesign.errors import DiceError
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import norms
from dicedesign.gradient.probability_model import RESTING, ProbabilityModel
from dicedesign.gradient.rest_probabilities import RestEvaluation, evaluate_rests
from dicedesign.runtime.arrays import Floats, Integers, ragged_ranges


def offset_derivatives(rests: RestEvaluation, rows: Floats) -> Floats:
    """Convert derivatives (k, 3 n) of functions in the vertices to derivatives (k, m) in the
    offsets of the facets."""
    hull = rests.hull
    moves = _corner_moves(hull, torch.from_numpy(hull.normals)).numpy()
    along = (rows.reshape(len(rows), -1, 3)[:, hull.tail] * moves).sum(axis=-1)
    return np.add.reduceat(along, hull.facet_start[:-1], axis=1)


def offset_secants(
    rests: RestEvaluation, step: Tensor | float, model: ProbabilityModel = RESTING
) -> Tensor:
    """(k, m) difference quotients of the probabilities of the rests, in the order of their facets,
    as the plane of each facet moves from `step` inside to `step` outside of its place; with
    gradients in the vertices.

    Unlike a derivative, this sees both sides of the kinks of probabilities where separatrices
    run along an edge. If a facet breaks, the rests on its parts count together; a lost rest counts
    as 0. If a body is degenerate on one side, only the other is used.

    step: () positive, in the unit of the vertices; model: of the probabilities.
    """
    hull, vertices = rests.hull, rests.vertices
    moves = _corner_moves(hull, rests.facet_normals(np.arange(len(hull.normals))))
    normals = hull.normals[rests.facets]

    def probabilities(moved: RestEvaluation) -> Tensor:
        """(k,) probabilities of a moved body, summed by the nearest rest of the given one."""
        cosines = moved.hull.normals[moved.facets] @ normals.T
        nearest = torch.from_numpy(np.argmax(cosines, axis=1))
        zeros = torch.zeros(len(normals), dtype=torch.float64)
        return zeros.index_add(0, nearest, model.tensor(moved))

    unmoved = probabilities(rests)
    columns = []
    for facet, first in enumerate(hull.facet_start[:-1]):
        border = slice(int(first), int(hull.facet_start[facet + 1]))
        tails = torch.from_numpy(hull.tail[border])
        outward = torch.zeros_like(vertices).index_add(0, tails, moves[border])
        ends, length = [], 0
        for side in (1, -1):
            try:
                moved = vertices + side * step * outward
                ends.append(probabilities(evaluate_rests(moved, rests.given_center)))
                length += 1
            except DiceError:
                ends.append(unmoved)
        columns.append((ends[0] - ends[1]) / (max(length, 1) * step))
    return torch.stack(columns, dim=1)


def _corner_moves(hull: ConvexHull, normals: Tensor) -> Tensor:
    """Move (h, 3) of the corner at the tail of each half-edge, for an outward move by 1 of the
    plane of the facet to its left; the shortest move, if it is not unique.

    normals: (m, 3) unit, of the facets.
    """
    own = normals[torch.from_numpy(hull.facet)]
    tails = torch.from_numpy(hull.tail)
    squares = torch.zeros((len(hull.vertices), 3, 3), dtype=torch.float64)
    squares = squares.index_add(0, tails, own[:, :, None] * own[:, None, :])
    inverse = torch.linalg.pinv(squares, hermitian=True)
    return (inverse[tails] @ own[:, :, None])[:, :, 0]


SOFTNESS = 12.0
"""Power of the means that approximate a least or a largest value."""


@dataclass(frozen=True)
class FacetEdges:
    """The edges of k facets, e in all.

    Attributes
    ----------
    owner: (e,) facet of each edge, 0 to k - 1, ascending.
    first: (k,) first edge of each facet.
    tails: (e, 3) starts of edges.
    lengths: (e,) lengths of edges.
    inward: (e, 3) unit vectors in the facets, perpendicular to the edges.
    """

    owner: Integers
    first: Integers
    tails: Tensor
    lengths: Tensor
    inward: Tensor

    @classmethod
    def of(cls, rests: RestEvaluation, facets: Integers) -> FacetEdges:
        """Edges of facets (k,) of a die."""
        hull = rests.hull
        start = hull.facet_start[facets]
        counts = hull.facet_start[facets + 1] - start
        owner, edges = ragged_ranges(start, counts)
        tails = rests.vertices[hull.tail[edges]]
        along = rests.vertices[hull.head[edges]] - tails
        lengths = torch.linalg.vector_norm(along, dim=1)
        normals = rests.facet_normals(facets)[owner]
        inward = torch.linalg.cross(normals, along) / lengths[:, None]
        return cls(owner, np.cumsum(counts) - counts, tails, lengths, inward)

    def distances(self, points: Tensor) -> Tensor:
        """Signed distances (e,) of points (e, 3) from the lines of the edges, positive inside.
        Points are projected onto the plane of the facet."""
        return ((points - self.tails) * self.inward).sum(-1)

    def sums(self, values: Tensor) -> Tensor:
        """Sums (k,) of values (e,) over the edges of each facet."""
        zeros = torch.zeros(len(self.first), dtype=torch.float64)
        return zeros.index_add(0, torch.as_tensor(self.owner), values)

    def mean_power(self, values: Tensor, power: float) -> Tensor:
        """Means (k,) `mean(values^power)^(1/power)` of values (e,) >= 0 over the border of each
        facet.

        Edges are weighted by length, so that a new edge at a corner has no weight at first.
        """
        numbers = values.detach().numpy()
        extreme = np.maximum if power > 0.0 else np.minimum
        unit = torch.as_tensor(extreme.reduceat(numbers, self.first))
        powers = (values / unit[self.owner]) ** power
        mean = self.sums(self.lengths * powers) / self.sums(self.lengths)
        return unit * mean ** (1.0 / power)


MOST_TRIPLED = 24
"""Largest number of edges of a facet for which all triples of edges are tried."""

SLIDING = 1e-9
"""Largest multiplier, and largest sine of an angle, for which two edges count as parallel."""

CENTERED = 1e-9
"""Tolerance on the center of a soft circle, over its radius."""

FREE = 1e-12
"""Part of the stiffness across a facet that is added in all directions."""

CENTERING_STEPS = 50
"""Limit on the Newton steps to the center of a soft circle."""


def circle_radii(rests: RestEvaluation, facets: Integers) -> Tensor:
    """Radii (k,) of the largest circles in facets, over the diameter of the hull.

    The center of the circle solves a linear program. Its solution has a multiplier for each edge
    that the circle touches. By the envelope theorem, the gradient of the radius is the gradient of
    the mean distance of these edges from the fixed center, weighted by multiplier.

    facets: (k,) numbers of facets.
    """
    edges = FacetEdges.of(rests, facets)
    centers, multipliers = _largest_circles(edges, *_frames(rests, facets, edges))
    distances = edges.distances(torch.as_tensor(centers[edges.owner]))
    radii = edges.sums(torch.as_tensor(multipliers) * distances)
    return radii / torch.sqrt(_pairwise_squared_distances(rests).max())


def soft_circle_radii(rests: RestEvaluation, facets: Integers) -> Tensor:
    """Smooth approximation (k,) of `circle_radii`, without kinks where a circle touches another
    edge or another pair of vertices spans the diameter.

    With the power p of `SOFTNESS`, `mean(d^-p)^(-1/p)` over the border of a facet replaces the
    least distance d of an edge, at the center where it is largest, and `(sum d^2p)^(1/2p)` over all
    pairs of vertices replaces the diameter.
    """
    edges = FacetEdges.of(rests, facets)
    centers = _soft_centers(edges, *_frames(rests, facets, edges))
    distances = edges.distances(torch.as_tensor(centers[edges.owner]))
    return edges.mean_power(distances, -SOFTNESS) / soft_diameter(rests)


def soft_diameter(rests: RestEvaluation) -> Tensor:
    """Smooth approximation () of the largest distance of two vertices; see `soft_circle_radii`."""
    squared = _pairwise_squared_distances(rests)
    largest = squared.max().detach()
    return torch.sqrt(largest) * ((squared / largest) ** SOFTNESS).sum() ** (0.5 / SOFTNESS)


def _pairwise_squared_distances(rests: RestEvaluation) -> Tensor:
    """Squared distances (n (n - 1) / 2,) of all pairs of vertices."""
    first, second = np.triu_indices(len(rests.vertices), 1)
    return ((rests.vertices[first] - rests.vertices[second]) ** 2).sum(-1)


def _frames(
    rests: RestEvaluation, facets: Integers, edges: FacetEdges
) -> tuple[Floats, Floats, Floats, Floats]:
    """Coordinates in facets: points (k, 3) inside, orthonormal vectors (k, 2, 3), and for the edges
    in these coordinates inward vectors (e, 2) and distances (e,) of the points."""
    tails, inward = edges.tails.detach().numpy(), edges.inward.detach().numpy()
    middle = np.add.reduceat(tails, edges.first) / np.bincount(edges.owner)[:, None]
    right = inward[edges.first]
    frame = np.stack([right, np.linalg.cross(rests.hull.normals[facets], right)], axis=1)
    lines = np.einsum("eax,ex->ea", frame[edges.owner], inward)
    return middle, frame, lines, ((middle[edges.owner] - tails) * inward).sum(-1)


def _largest_circles(
    edges: FacetEdges, middle: Floats, frame: Floats, lines: Floats, distances: Floats
) -> tuple[Floats, Floats]:
    """Centers (k, 3) and multipliers (e,) of the largest circles."""
    counts = np.bincount(edges.owner)
    if counts.max() > MOST_TRIPLED:
        # Imported late, as it takes longer than most designs.
        from scipy.optimize import linprog

        moved, multipliers = np.zeros((len(middle), 2)), np.zeros(len(edges.owner))
        for facet in range(len(middle)):
            own = edges.owner == facet
            widest = linprog(
                (0, 0, -1),
                A_ub=np.column_stack([-lines[own], np.ones(own.sum())]),
                b_ub=distances[own],
                bounds=[(None, None), (None, None), (0, None)],
            )
            moved[facet], multipliers[own] = widest.x[:2], -widest.ineqlin.marginals
        return middle + np.einsum("ka,kax->kx", moved, frame), multipliers
    # Facets of fewer edges repeat their last edge, which changes no circle.
    numbers = edges.first[:, None] + np.minimum(np.arange(counts.max()), counts[:, None] - 1)
    triples = numbers[:, np.array(list(combinations(range(counts.max()), 3)))]
    a, b, c = (lines[triples[..., column]] for column in range(3))
    # By duality, the largest circle in all lines is the smallest of the circles in three lines.
    weights = np.stack([_cross(b, c), _cross(c, a), _cross(a, b)], axis=-1)
    total = weights.sum(-1)
    around = (weights >= 0.0).all(-1) & (total > 0.0)
    weights = weights / np.where(around, total, 1.0)[..., None]
    radii = np.where(around, (weights * distances[triples]).sum(-1), np.inf)
    best = np.arange(len(counts)), np.argmin(radii, axis=1)
    touched, weights = triples[best], weights[best]
    multipliers = np.zeros(len(edges.owner))
    np.add.at(multipliers, touched, weights)
    # Between parallel edges the circle can slide; it stays near the middle.
    counted = weights > SLIDING
    offsets = (radii[best][:, None] - distances[touched]) * counted
    inverse = np.linalg.pinv(lines[touched] * counted[..., None], rcond=SLIDING)
    moved = np.einsum("kae,ke->ka", inverse, offsets)
    return middle + np.einsum("ka,kax->kx", moved, frame), multipliers


def _cross(a: Floats, b: Floats) -> Floats:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _soft_centers(
    edges: FacetEdges, middle: Floats, frame: Floats, lines: Floats, distances: Floats
) -> Floats:
    """Centers (k, 3) of the soft circles, by Newton's method with a matrix that is always positive
    definite and converges to the Hessian."""
    owner, first = edges.owner, edges.first
    lengths = edges.lengths.detach().numpy()
    outer = lines[:, :, None] * lines[:, None, :]
    moved = np.zeros((len(first), 2))
    for _ in range(CENTERING_STEPS):
        away = distances + (lines * moved[owner]).sum(-1)
        nearest = np.minimum.reduceat(away, first)
        weights = lengths * (nearest[owner] / away) ** SOFTNESS
        weights /= np.add.reduceat(weights, first)[owner]
        slope = np.add.reduceat((weights / away)[:, None] * lines, first)
        bend = np.add.reduceat((weights / away**2)[:, None, None] * outer, first)
        # In a long facet nothing holds the center in its direction.
        bend += FREE * np.trace(bend, axis1=1, axis2=2)[:, None, None] * np.eye(2)
        step = np.linalg.solve((1.0 + SOFTNESS) * bend, slope[..., None])[..., 0]
        # At most half of the way to an edge.
        fall = np.maximum.reduceat(-(lines * step[owner]).sum(-1) / away, first)
        moved += step / np.maximum(1.0, 2.0 * fall)[:, None]
        if (norms(step) <= CENTERED * nearest).all():
            break
    return middle + np.einsum("ka,kax->kx", moved, frame)
