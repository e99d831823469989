"""Odds as a function of where the planes of the facets lie.

Each facet's plane is moved outward on its own, and the corners follow: where three facets meet, to
the point where their planes then meet; where more do, to the one that is nearest to all of them,
in the sense of least squares.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from dicedesign.errors import DiceError
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.gradient.odds_model import OddsModel
from dicedesign.gradient.rest_odds import RestEvaluation, evaluate_rests
from dicedesign.runtime.arrays import Floats


def offset_derivatives(rests: RestEvaluation, rows: Floats) -> Floats:
    """(k, m) derivatives of functions in the offsets of the facets for those (k, 3 n) in the
    vertices, per unit of length."""
    hull = rests.hull
    moves = _corner_moves(hull, torch.from_numpy(hull.normals)).numpy()
    along = (rows.reshape(len(rows), -1, 3)[:, hull.tail] * moves).sum(axis=-1)
    return np.add.reduceat(along, hull.facet_start[:-1], axis=1)


def offset_secants(rests: RestEvaluation, model: OddsModel | None, step: Tensor | float) -> Tensor:
    """(k, m) changes of the odds of the rests, in the order of `rests.paths.rests`, when a facet
    goes from `step` inside of its place to `step` outside, over that distance; with gradients in
    the vertices.

    Where separatrices run along an edge odds have a kink, which a derivative sees but one side of.
    Where a facet breaks, the rests on its parts count together; one that is lost counts as 0. A
    side on which the body is none is left out.

    model: of the odds, where they are not those without momentum and with any side down alike;
    step: () positive, in the unit of the vertices.
    """
    hull, vertices = rests.hull, rests.vertices
    moves = _corner_moves(hull, rests.facet_normals(np.arange(len(hull.normals))))
    here = _odds_by_rest(rests, rests, model)
    columns = []
    for facet, first in enumerate(hull.facet_start[:-1]):
        border = slice(int(first), int(hull.facet_start[facet + 1]))
        tails = torch.from_numpy(hull.tail[border])
        outward = torch.zeros_like(vertices).index_add(0, tails, moves[border])
        ends, length = [], 0
        for side in (1, -1):
            try:
                there = vertices + side * step * outward
                moved = _odds_by_rest(evaluate_rests(there, rests.given_center), rests, model)
                length += 1
            except DiceError:
                moved = here
            ends.append(moved)
        columns.append((ends[0] - ends[1]) / (max(length, 1) * step))
    return torch.stack(columns, dim=1)


def _odds_by_rest(rests: RestEvaluation, named: RestEvaluation, model: OddsModel | None) -> Tensor:
    """(k,) odds of rests by the nearest of those of another body, k."""
    odds = rests.probabilities if model is None else model.tensor(rests)
    normals, names = rests.hull.normals[rests.facets], named.hull.normals[named.facets]
    nearest = torch.from_numpy(np.argmax(normals @ names.T, axis=1))
    return torch.zeros(len(names), dtype=torch.float64).index_add(0, nearest, odds)


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
