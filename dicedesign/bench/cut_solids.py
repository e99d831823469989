"""Solids cut into pieces by planes and by Voronoi cells, as if they had been broken."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import numpy as np
from manifold3d import Manifold
from numpy.typing import NDArray

from dicedesign.geometry.solid import mesh_of
from dicedesign.geometry.sphere import unit_vectors

__all__ = ["largest_part", "planar_pieces", "random_planes", "random_sites", "voronoi_cells"]

Floats = NDArray[np.float64]

_MIDDLE: Final = (0.25, 0.75)
"""Part of the extent along a plane's normal that lies behind the plane, from and to."""


def planar_pieces(whole: Manifold, planes: Floats) -> list[Manifold]:
    """What planes cut a solid into, without empty pieces.

    planes: (k, 4) rows of a normal n, of any length, and an offset d: the points x with
    `n . x = d |n|`. Returns up to 2^k pieces, which may fall apart and together fill the whole.
    """
    pieces = [whole]
    for *normal, offset in planes.tolist():
        halves = [piece.split_by_plane(normal, offset) for piece in pieces]
        pieces = _solids(half for pair in halves for half in pair)
    return pieces


def voronoi_cells(whole: Manifold, sites: Floats) -> list[Manifold]:
    """What is nearest to each of several sites, without empty cells.

    sites: (n, 3) distinct points, which may lie outside. Returns up to n cells in the order of the
    sites, which may fall apart and together fill the whole.
    """
    return _solids(
        _voronoi_cell(whole, site, np.delete(sites, k, 0)) for k, site in enumerate(sites)
    )


def _voronoi_cell(whole: Manifold, site: Floats, others: Floats) -> Manifold:
    """What of a solid is nearer to a site (3,) than to any of the others (m, 3)."""
    cell = whole
    normals = unit_vectors(site - others)
    offsets = 0.5 * (normals * (site + others)).sum(-1)
    for normal, offset in zip(normals.tolist(), offsets.tolist(), strict=True):
        cell = cell.trim_by_plane(normal, offset)
    return cell


def _solids(pieces: Iterable[Manifold]) -> list[Manifold]:
    return [piece for piece in pieces if not piece.is_empty()]


def largest_part(piece: Manifold) -> Manifold:
    """The one of greatest volume of the parts that a piece falls into."""
    return max(piece.decompose(), key=lambda part: part.volume())


def random_planes(whole: Manifold, count: int, rng: np.random.Generator) -> Floats:
    """Planes (count, 4) for `planar_pieces`, with unit normals of uniformly random directions, each
    with a quarter to three quarters of the solid's extent along its normal behind it."""
    corners, _ = mesh_of(whole)
    normals = unit_vectors(rng.normal(size=(count, 3)))
    along = corners @ normals.T
    low, high = along.min(axis=0), along.max(axis=0)
    return np.column_stack([normals, low + rng.uniform(*_MIDDLE, size=count) * (high - low)])


def random_sites(whole: Manifold, count: int, rng: np.random.Generator) -> Floats:
    """Points (count, 3) that are uniformly random in the box around a solid."""
    box = np.array(whole.bounding_box())
    return rng.uniform(box[:3], box[3:], size=(count, 3))
