"""Odds as a function of where the planes of the facets lie.

Each facet's plane is moved outward on its own, and the corners follow: where three facets meet, to
the point where their planes then meet; where more do, to the one that is nearest to all of them,
in the sense of least squares.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.gradient.rest_formulas import rest_probabilities
from dicedesign.gradient.rest_odds import RestEvaluation
from dicedesign.gradient.solid_moments import formula_centroid
from dicedesign.gradient.thrown_odds import ThrownOdds
from dicedesign.runtime.arrays import Floats

__all__ = ["offset_derivatives", "offset_jacobian"]


def _corner_moves(hull: ConvexHull, normals: Tensor) -> Tensor:
    """(h, 3) move of the corner at the tail of each half-edge for an outward move by 1 of the plane
    of the facet to its left, the shortest where the facets there leave a direction open.

    normals: (m, 3) unit, of the facets.
    """
    own = normals[torch.from_numpy(hull.facet)]
    tails = torch.from_numpy(hull.tail)
    squares = torch.zeros((len(hull.vertices), 3, 3), dtype=torch.float64)
    squares = squares.index_add(0, tails, own[:, :, None] * own[:, None, :])
    inverse = torch.linalg.pinv(squares, hermitian=True)
    return (inverse[tails] @ own[:, :, None])[:, :, 0]


def _by_offsets(hull: ConvexHull, moves: Tensor, rows: Tensor) -> Tensor:
    """(k, m) derivatives of functions in the offsets of the facets for those (k, n, 3) in the
    vertices; moves: (h, 3) as from `_corner_moves`."""
    along = (rows[:, torch.from_numpy(hull.tail)] * moves).sum(-1)
    sums = torch.zeros((len(rows), len(hull.normals)), dtype=torch.float64)
    return sums.index_add(1, torch.from_numpy(hull.facet), along)


def offset_jacobian(rests: RestEvaluation, thrown: ThrownOdds | None = None) -> Tensor:
    """(k, m) derivatives of the odds of the rests, in the order of `rests.paths.rests`, in the
    offsets of the facets, per unit of length, with which the center of mass of a uniform solid
    moves.

    They can be differentiated in turn, in `rests.vertices` or what these are made from.

    thrown: the model of odds when thrown, or None for odds without momentum.
    """
    hull, vertices = rests.hull, rests.vertices
    with torch.enable_grad():
        if not vertices.requires_grad:
            vertices = vertices.detach().requires_grad_()
        given = rests.given_center
        center = formula_centroid(vertices, hull.triangles) if given is None else given
        odds = rest_probabilities(hull, rests.paths, vertices, center)
        if thrown is not None:
            odds = thrown.formula(rests, vertices, odds, given)
        (rows,) = torch.autograd.grad(
            odds,
            vertices,
            torch.eye(len(odds), dtype=torch.float64),
            is_grads_batched=True,
            create_graph=True,
        )
    normals = rests.facet_normals(np.arange(len(hull.normals)))
    return _by_offsets(hull, _corner_moves(hull, normals), rows)


def offset_derivatives(rests: RestEvaluation, rows: Floats) -> Floats:
    """(k, m) the same as numbers, for derivatives (k, 3 n) in the vertices."""
    hull = rests.hull
    moves = _corner_moves(hull, torch.from_numpy(hull.normals))
    by_vertices = torch.from_numpy(rows.reshape(len(rows), -1, 3))
    return _by_offsets(hull, moves, by_vertices).numpy()
