"""Shapes to throw: pieces of boxes, of spheres and of models, each set from its seed alone.

Solids cut into pieces by planes and by Voronoi cells, as if they had been broken."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import islice
from typing import Final

import numpy as np
from manifold3d import Manifold
from scipy.spatial.distance import pdist

from dicedesign.concave.shapes import SHAPES
from dicedesign.geometry.manifold import mesh_of, solid
from dicedesign.geometry.meshes.body import Body, make_body
from dicedesign.geometry.sphere import unit_vectors
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Floats
from tests.reference.gear import gear

__all__ = [
    "LEAST_THICKNESS",
    "cut_shapes",
    "largest_part",
    "made_models",
    "planar_pieces",
    "random_planes",
    "random_sites",
    "voronoi_cells",
]

LEAST_THICKNESS: Final = 0.02
"""Volume of a piece over the cube of the largest distance between two of its points, below which it
is a sliver and left out: a square plate 18 times as wide as thick, a square bar 7 times as long."""

BOXES: Final = ((1.0, 1.0, 1.0), (1.0, 1.0, 3.0), (1.0, 2.0, 3.0), (1.0, 3.0, 3.0))
"""Edges."""

SEGMENTS: Final = (12, 20, 28)
"""Edges around the equator of each sphere."""

PLANES: Final = (1, 2, 3)
"""How many planes a whole is cut by, each number once."""

SITES: Final = (4, 8, 16)
"""How many Voronoi cells a whole is cut into, each number once."""

PIECES: Final = 2
"""Most pieces that are taken of a cut."""


def made_models() -> dict[str, Surface]:
    """Some surfaces that the package builds itself, by name."""
    return {
        "duck": SHAPES["duck"](),
        "gear": gear(),
        "kitten": SHAPES["kitten"](),
        "knot": SHAPES["knot"](),
    }


def cut_shapes(models: Mapping[str, Surface], seed: int = 0) -> list[Body]:
    """Pieces of four boxes, three spheres and the models given, one whole after another.

    Each whole is cut by 1, 2 and 3 random planes, and into 4, 8 and 16 Voronoi cells of random
    sites. Of each cut the first two pieces are taken that are no slivers (`LEAST_THICKNESS`), of a
    piece that falls apart its largest part: 12 shapes of each whole, unless slivers are in the way.

    Parameters
    ----------
    models: closed surfaces by the names that their pieces begin with.
    seed: of all cuts; those of the boxes and spheres do not depend on the models.

    Returns
    -------
    Bodies named by whole, cut and number, such as "box 1:2:3, 2 planes, piece 1", each with a
    closed mesh of one part, oriented outward, in the unit of the whole.

    Raises
    ------
    InputError: a model bounds no solid of positive volume.
    """
    return [
        body
        for number, (name, whole) in enumerate(_wholes(models))
        for cut, pieces in _cuts(whole, np.random.default_rng([seed, number]))
        for body in _bodies(f"{name}, {cut}", pieces)
    ]


def _wholes(models: Mapping[str, Surface]) -> Iterator[tuple[str, Manifold]]:
    """What is cut, with names."""
    for edges in BOXES:
        yield f"box {':'.join(f'{edge:g}' for edge in edges)}", Manifold.cube(edges, center=True)
    for segments in SEGMENTS:
        whole = Manifold.sphere(1.0, segments)
        yield f"sphere of {whole.num_vert()} points", whole
    for name, surface in models.items():
        yield name, solid(surface.points, surface.triangles)


def _cuts(whole: Manifold, rng: np.random.Generator) -> Iterator[tuple[str, list[Manifold]]]:
    """All pieces of each cut, with what the cut is called."""
    for count in PLANES:
        label = "1 plane" if count == 1 else f"{count} planes"
        yield label, planar_pieces(whole, random_planes(whole, count, rng))
    for count in SITES:
        yield f"{count} Voronoi cells", voronoi_cells(whole, random_sites(whole, count, rng))


def _bodies(name: str, pieces: Iterable[Manifold]) -> Iterator[Body]:
    """The first pieces that are no slivers."""
    parts = (largest_part(piece) for piece in pieces)
    thick = (part for part in parts if part.volume() >= LEAST_THICKNESS * _diameter(part) ** 3)
    for number, part in enumerate(islice(thick, PIECES), 1):
        points, triangles = mesh_of(part)
        yield make_body(points, triangles, name=f"{name}, piece {number}")


def _diameter(part: Manifold) -> float:
    """The largest distance between two points."""
    corners, _ = mesh_of(part.hull())
    return float(pdist(corners).max())


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
