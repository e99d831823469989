"""Hulls by the compiled kernels, as attributes of a `ConvexHull`."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dicedesign.kernels import ops as kernels
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import (
    REUSE_FLATNESS,
    REUSE_LEVERAGE,
    REUSE_MARGIN,
    REUSE_OFFSET,
    REUSE_TURN,
    ROUNDING,
    SLIVER,
    THIN_VOLUME,
)

__all__ = ["hull_attributes", "moved_attributes", "properties"]


def hull_attributes(
    points: NDArray[Any], coplanar_tolerance: float, precision: float
) -> dict[str, Any] | None:
    """Attributes of the hull of points, or None where rounding might change it.

    points: (n, 3) real; coplanar_tolerance: larger than 0, see `convex_hull`; precision: relative
    spacing of the coordinates.
    """
    if kernels.compiled is None:
        return None
    found: dict[str, Any] | None = kernels.compiled.convex_hull(
        np.require(points, np.float64, ["C", "ALIGNED"]),
        coplanar_tolerance,
        precision,
        SLIVER,
        THIN_VOLUME,
        ROUNDING,
    )
    return found


def properties(
    vertices: Floats, facet_start: Integers, tail: Integers, twin: Integers
) -> dict[str, Any]:
    """Cached properties of a hull, without those that need more than plain sums: the normals where
    a facet is a sliver, the centroid of a thin body. All hulls have them from here, so that equal
    hulls have equal ones to the last bit."""
    if kernels.compiled is None:
        return {}
    found: dict[str, Any] = kernels.compiled.hull_properties(
        vertices, facet_start, tail, twin, SLIVER, THIN_VOLUME, ROUNDING
    )
    return found


def moved_attributes(
    kernel: ModuleType,
    points: Floats,
    source: Integers,
    facet_start: Integers,
    tail: Integers,
    twin: Integers,
) -> dict[str, Any] | None:
    """Vertices and measures of a hull whose points moved, or None where it is in doubt that its
    facets are still the same, see `same_connectivity`; kernel: the compiled module."""
    found: dict[str, Any] | None = kernel.moved_hull(
        points,
        source,
        facet_start,
        tail,
        twin,
        REUSE_FLATNESS,
        REUSE_MARGIN,
        REUSE_LEVERAGE,
        REUSE_TURN,
        REUSE_OFFSET,
        SLIVER,
        THIN_VOLUME,
        ROUNDING,
    )
    return found
