"""A print of solid walls and less material inside, as a body of two densities.

The walls are all that is nearer to the surface than they are thick, and solid. What is left
inside, the outer body moved inward by that much, has the density of the infill, as if it were
spread evenly: its lattice is fine beside the die. Lengths are in mm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dicedesign.geometry.hulls.halfspaces import deepest_point, polyhedron_corners
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.solid import solid_properties
from dicedesign.runtime.arrays import Floats

if TYPE_CHECKING:
    from manifold3d import CrossSection, Manifold

    from dicedesign.fabricate.labels.layout import Placement

__all__ = ["Inside", "inside_walls", "pocket_walls", "weighed"]


@dataclass(frozen=True, eq=False)
class Inside:
    """The part of a print that is infill.

    Attributes
    ----------
    volume: in mm3, 0 where the walls meet.
    centroid: (3,), anything then.
    """

    volume: float
    centroid: Floats


def inside_walls(hull: ConvexHull, walls_mm: float, pockets: Sequence[Manifold] = ()) -> Inside:
    """What walls leave of a convex body: its half-spaces, moved inward.

    walls_mm: above 0; pockets: solids that are not infill either, from `pocket_walls`.
    """
    middle = hull.centroid
    depths = hull.heights(middle)
    if depths.min() <= walls_mm:
        move, _ = deepest_point(hull.normals, depths)
        depths, middle = depths - hull.normals @ move, middle + move
    if depths.min() <= walls_mm:
        return Inside(0.0, middle)
    inner = convex_hull(middle + polyhedron_corners(hull.normals, depths - walls_mm))
    points, triangles = inner.vertices, inner.triangles
    if pockets:
        from manifold3d import Manifold, OpType

        from dicedesign.geometry.manifold import mesh_of, solid

        left = Manifold.batch_boolean([solid(points, triangles), *pockets], OpType.Subtract)
        if not left.volume() > 0.0:
            return Inside(0.0, middle)
        points, triangles = mesh_of(left)
    return Inside(*solid_properties(points, triangles))


def pocket_walls(
    sections: Sequence[tuple[Placement, CrossSection]], depth_mm: float, walls_mm: float
) -> list[Manifold]:
    """The walls around pockets, as solids that reach from outside of the facet to below the
    pocket's floor. Their lower rims are square where those of slicers may be round.

    sections: of the pockets, from `cut_sections`; depth_mm: of them.
    """
    from manifold3d import JoinType

    solids = []
    for placement, section in sections:
        deep = depth_mm + walls_mm
        block = section.offset(walls_mm, JoinType.Round).extrude(2.0 * deep)
        solids.append(block.translate((0.0, 0.0, -deep)).transform(placement.frame[:3]))
    return solids


def weighed(volume: float, centroid: Floats, inside: Inside, infill: float) -> tuple[float, Floats]:
    """Mass of a print over that of the solid one, and its center of mass (3,).

    volume, centroid: of the outer body, labels cut in where it has them; infill: 0 to 1.
    """
    missing = (1.0 - infill) * inside.volume
    mass = volume - missing
    return mass / volume, (volume * centroid - missing * inside.centroid) / mass
