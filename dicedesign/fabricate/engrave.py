"""Cut labels into a solid as pockets, and check what comes out.

Lengths are in millimetres, volumes in cubic millimetres.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from manifold3d import Error, Manifold, Mesh64, OpType
from numpy.typing import NDArray

from dicedesign.errors import EngravingError, InputError
from dicedesign.fabricate.engraving_options import EngravingOptions
from dicedesign.fabricate.glyphs import text_section
from dicedesign.fabricate.layout import Placement
from dicedesign.tolerances import ENGRAVED_VOLUME_TOLERANCE

__all__ = ["EngravedDie", "engrave", "solid"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class EngravedDie:
    """A solid with its labels cut in: closed and one piece.

    Attributes
    ----------
    vertices: (n, 3) in mm.
    triangles: (t, 3) counter-clockwise seen from outside.
    """

    vertices: Floats
    triangles: Integers


def solid(vertices: Floats, triangles: Integers) -> Manifold:
    """A closed triangle mesh as a solid, in double precision.

    Parameters
    ----------
    vertices: (n, 3) in mm, each point once.
    triangles: (t, 3) in [0, n), counter-clockwise seen from outside.

    Returns
    -------
    Manifold of positive volume.

    Raises
    ------
    InputError: wrong shapes, indices out of range, not finite, not closed, not oriented, or
        without positive volume.
    """
    points = np.ascontiguousarray(vertices, dtype=np.float64)
    corners = np.ascontiguousarray(triangles, dtype=np.int64)
    if points.ndim != 2 or points.shape[1] != 3 or corners.ndim != 2 or corners.shape[1] != 3:
        raise InputError(
            "solid: expected vertices of shape (n, 3) and triangles of shape (t, 3), got "
            f"{points.shape} and {corners.shape}; pass one row for each"
        )
    if corners.size and (corners.min() < 0 or corners.max() >= len(points)):
        raise InputError(
            f"solid: expected triangles of vertices 0 to {len(points) - 1}, got indices from "
            f"{corners.min()} to {corners.max()}; number the vertices from 0"
        )
    body = Manifold(Mesh64(points, corners.astype(np.uint64)))
    if body.status() != Error.NoError:
        raise InputError(
            "solid: expected finite vertices and a closed surface in which each edge joins two "
            f"triangles, got {body.status().name} for {len(corners)} triangles; repair the mesh or "
            "merge its duplicate vertices"
        )
    if not body.volume() > 0:
        raise InputError(
            f"solid: expected a positive volume, got {body.volume():g} mm3; if it is negative the "
            "triangles face inward: reverse their corners"
        )
    return body


def _pocket(placement: Placement, depth: float) -> tuple[Manifold, float]:
    """The cutter of one label, and the volume that it takes below the facet's plane."""
    section = text_section(placement.text).scale((placement.height, placement.height))
    # It reaches as far above the facet as below, so that no face of it lies in the facet.
    cutter = section.extrude(2 * depth).translate((0.0, 0.0, -depth))
    return cutter.transform(placement.frame[:3]), section.area() * depth


def engrave(
    vertices: Floats,
    triangles: Integers,
    placements: Sequence[Placement],
    options: EngravingOptions,
) -> EngravedDie:
    """Cut labels into a solid, `options.depth_mm` deep below their facets.

    Parameters
    ----------
    vertices, triangles: the plain solid, as `solid` takes it.
    placements: labels on flat facets of it, from `place_labels`.
    options: the depth; sizes and places are those of the placements.

    Returns
    -------
    EngravedDie that passed the checks: no boolean error, one piece, as many handles as the plain
    solid, and the volume of the plain solid less the labels to `ENGRAVED_VOLUME_TOLERANCE`.

    Raises
    ------
    InputError: the plain mesh is no solid.
    EngravingError: a check failed; the message says which, and names the labels at fault.
    """
    plain = solid(vertices, triangles)
    cuts = [_pocket(placement, options.depth_mm) for placement in placements]
    expected = sum(volume for _, volume in cuts)
    body = Manifold.batch_boolean([plain, *(cutter for cutter, _ in cuts)], OpType.Subtract)

    failure = _failed_check(plain, body, expected)
    if failure:
        raise EngravingError(
            f"engraved solid: {failure}; {_culprits(plain, placements, cuts)}: reduce depth_mm "
            f"(now {options.depth_mm:g}) or increase size_mm or margin"
        )
    mesh = body.to_mesh64()
    return EngravedDie(
        vertices=np.array(mesh.vert_properties[:, :3], dtype=np.float64),
        triangles=np.array(mesh.tri_verts, dtype=np.int64),
    )


def _failed_check(plain: Manifold, body: Manifold, expected: float) -> str | None:
    """The first check that the engraved solid fails, in words, or None."""
    if body.status() != Error.NoError:
        return f"expected a boolean subtraction without error, got {body.status().name}"
    pieces = len(body.decompose())
    if pieces != 1:
        return f"expected one piece, got {pieces}"
    if body.genus() != plain.genus():
        return f"expected {plain.genus()} handles (genus), got {body.genus()}"
    if not body.volume() > 0:
        return f"expected a positive volume, got {body.volume():g} mm3"
    removed = plain.volume() - body.volume()
    if abs(removed - expected) > ENGRAVED_VOLUME_TOLERANCE * expected:
        return f"expected pockets of {expected:.6g} mm3, got {removed:.6g} mm3"
    return None


def _culprits(
    plain: Manifold, placements: Sequence[Placement], cuts: Sequence[tuple[Manifold, float]]
) -> str:
    """Which pockets meet others or break through, in words."""
    involved = {
        index
        for index, (cutter, volume) in enumerate(cuts)
        if _failed_check(plain, plain - cutter, volume)
    }
    for (first, (a, _)), (second, (b, _)) in combinations(enumerate(cuts), 2):
        if (a ^ b ^ plain).volume() > 0.0:
            involved |= {first, second}
    labels = ", ".join(repr(placements[index].text) for index in sorted(involved)) or "some labels"
    return f"pockets meet, or break through another facet, at {labels}"
