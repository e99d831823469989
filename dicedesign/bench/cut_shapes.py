"""Shapes to throw: pieces of boxes, of spheres and of models, each set from its seed alone."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import islice
from typing import Final

import numpy as np
from manifold3d import Manifold
from scipy.spatial.distance import pdist

from dicedesign.bench.cut_solids import (
    largest_part,
    planar_pieces,
    random_planes,
    random_sites,
    voronoi_cells,
)
from dicedesign.concave.shapes import SHAPES
from dicedesign.concave.surface import Surface
from dicedesign.geometry.body import Body, make_body
from dicedesign.geometry.solid import mesh_of, solid

__all__ = ["LEAST_THICKNESS", "cut_shapes", "made_models"]

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
    """The surfaces that the package builds itself, by name."""
    return {name: build() for name, build in SHAPES.items()}


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
