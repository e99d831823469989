"""Whether a surface has dents enough to be bent, and is far enough from a sphere."""

from __future__ import annotations

from typing import Final

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.surfaces.surface import Surface

__all__ = ["require_dents"]

CONVEX: Final = 1e-3
"""Part of its hull's volume that a convex surface leaves empty at most."""

ROUND: Final = 0.95
"""A hull is nearly a sphere when its facets are as far from the center of mass as this part of the
distance of its farthest corner: then it rests on nothing in particular."""


def require_dents(surface: Surface) -> None:
    """Raise InputError for a surface of which no concave die is made: one that is nearly convex, or
    whose hull is nearly a sphere."""
    hull = convex_hull(surface.points)
    heights = ((hull.vertices[hull.tail] - surface.centroid) * hull.normals[hull.facet]).sum(axis=1)
    radius = float(norms(hull.vertices - surface.centroid).max())
    roundness = float(heights.min()) / radius
    if roundness >= ROUND:
        raise InputError(
            f"start: expected a surface that rests on some sides rather than others, got nearly a "
            f"sphere, whose hull is at least {roundness:.3g} of its radius away from its center of "
            "mass: no fair die is near; take another model"
        )
    if surface.volume >= (1.0 - CONVEX) * Surface(hull.vertices, hull.triangles).volume:
        raise InputError(
            "start: expected a surface with dents for method concave, got a convex one; take "
            "method: {exact: {}}, which makes convex dice"
        )
