"""Resting probabilities: the areas of the basins of attraction."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from dicedesign.errors import DegenerateBodyError, OutsideHullError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.sphere import norms, unit_vectors
from dicedesign.kernels import ops as kernels
from dicedesign.kernels.ops import Tie
from dicedesign.rest.equilibria import Equilibria, classify, surroundings
from dicedesign.rest.morse import (
    Separatrices,
    basin_references,
    separatrices,
    separatrix_points,
    signed_areas,
    wraps,
)
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import (
    BOUNDARY_TOLERANCE,
    CLOSURE_TOLERANCE,
    TIE_TOLERANCE,
)

TIE_STEP = 4.0
"""Move of a tied body's center of mass, in units of the tie distance."""


@dataclass(frozen=True)
class Basins:
    """The basins of attraction of one body.

    Attributes
    ----------
    equilibria: the classified hull.
    paths: its separatrices.
    areas: (k,) in steradian, in the order of `paths.rests`, summing to 4 pi.
    """

    equilibria: Equilibria
    paths: Separatrices
    areas: Floats

    @cached_property
    def points(self) -> Floats:
        """(2 s, depth + 2, 3) points of the branches, see `separatrix_points`."""
        vertices, center = self.equilibria.hull.vertices, self.equilibria.center_of_mass
        return separatrix_points(self.paths, vertices, center, np)


def find_basins(hull: ConvexHull, center_of_mass: Floats) -> tuple[Basins, ...]:
    """Basins of a body; of a tied body, the basins of an even number of bodies beside it.

    A body is tied if a move of its center of mass by `TIE_TOLERANCE` could change the
    combinatorics: it balances on an edge, a corner or a saddle, or a path runs into such a balance
    or through a facet normal. It then falls equally often to both sides, whatever rounding says.
    Its probabilities are defined as the mean over slightly larger moves of the center of mass,
    within the body, in the directions of `aside_directions`: opposite pairs that turn with the body
    and that its symmetries permute. Where a bound on rounding leaves a decision open, bodies about
    ten times as far from a balance count as tied too.

    Facets that were merged within a coplanar tolerance are not quite flat, and near a balance the
    decisions about them can contradict each other: the body seems to roll in a circle, or its
    basins overlap. Such a body is tied to within its unevenness. If bodies beside it are
    contradictory too, the basins are those of the hull of its corners as they are.

    hull: the convex hull; center_of_mass: (3,) strictly inside it. Only in that last case do the
    basins have another hull; its `source` refers to the original points.

    Raises
    ------
    OutsideHullError: the center of mass is not strictly inside the hull.
    DegenerateBodyError: the basins do not close.
    """
    with suppress(DegenerateBodyError):
        return _basins(hull, center_of_mass)
    exact = convex_hull(hull.vertices, 0.0)
    return _basins(replace(exact, source=hull.source[exact.source]), center_of_mass)


def rest_basins(hull: ConvexHull, center_of_mass: Floats) -> tuple[ConvexHull, tuple[Basins, ...]]:
    """Basins of a body by its finer hull, if it has one, and the hull on whose facets its rests are
    shown: the given one, unless no facets are merged after all. See `find_basins`."""
    classified = hull if hull.finer is None else hull.finer.hull
    sides = find_basins(classified, center_of_mass)
    shown = sides[0].equilibria.hull
    return hull if shown is classified else shown, sides


def merged_rests(hull: ConvexHull, side: Basins) -> Integers:
    """(r,) the facet of a body's hull that each rest of a side stands on: its own, or the one that
    it is shown as part of where basins are those of `ConvexHull.finer`."""
    rests = side.paths.rests
    if hull.finer is None or side.equilibria.hull is hull:
        return rests
    return hull.finer.facet[rests]


def _basins(hull: ConvexHull, center_of_mass: Floats) -> tuple[Basins, ...]:
    """Basins as by `find_basins`, without making the hull again."""
    distance = tie_distance(hull, center_of_mass)
    try:
        return (_trace(classify(hull, center_of_mass, distance)),)
    except Tie:
        with suppress(DegenerateBodyError):
            return _beside(hull, center_of_mass, distance)
    except DegenerateBodyError:
        pass
    return _beside(hull, center_of_mass, distance + hull.unevenness)


def tie_distance(hull: ConvexHull, center_of_mass: Floats) -> float:
    """Length of a move of the center of mass (3,) that changes no decision about an untied body."""
    place = surroundings(hull, center_of_mass)
    return TIE_TOLERANCE * (place.far + place.extent)


def _beside(hull: ConvexHull, center_of_mass: Floats, distance: float) -> tuple[Basins, ...]:
    """The basins of a body tied to within a distance."""
    place = surroundings(hull, center_of_mass)
    room = place.height - BOUNDARY_TOLERANCE * place.offset
    move = min(TIE_STEP * distance, room / 2.0) * aside_directions(hull, center_of_mass)
    try:
        return tuple(_trace(classify(hull, center)) for center in center_of_mass + move)
    except OutsideHullError:
        # No room to move in floating point.
        return (_trace(classify(hull, center_of_mass)),)


def _trace(equilibria: Equilibria) -> Basins:
    """Basins of a classified hull.

    Source: eq. 9, 10.
    """
    paths = separatrices(equilibria)
    return Basins(equilibria, paths, basin_areas(equilibria, paths))


def basin_areas(equilibria: Equilibria, paths: Separatrices) -> Floats:
    """Areas (k,) in steradian of the basins that a body's separatrices divide, summing to 4 pi.

    Raises
    ------
    DegenerateBodyError: the basins do not cover the sphere once.
    """
    areas = kernels.basin_areas(equilibria.hull, paths, equilibria.center_of_mass)
    if areas is not kernels.UNDECIDED:
        return areas
    if len(paths.rests) == 1:
        return np.array([4.0 * np.pi])
    hull = equilibria.hull
    points = separatrix_points(paths, hull.vertices, equilibria.center_of_mass, np)
    references = basin_references(paths, points, hull.normals[paths.rests])
    return close_areas(signed_areas(paths, points, references))


def close_areas(signed: Floats) -> Floats:
    """Areas (k,) of basins from their signed areas (k,), which are right up to multiples of 4 pi.

    Raises
    ------
    DegenerateBodyError: the basins do not cover the sphere once.
    """
    areas = signed + 4.0 * np.pi * wraps(signed)
    gap = abs(float(areas.sum()) - 4.0 * np.pi)
    if not (gap <= CLOSURE_TOLERANCE and (areas > -CLOSURE_TOLERANCE).all()):
        raise DegenerateBodyError(
            f"body: expected basins that cover the sphere once, got a difference of {gap:.3g} "
            "steradian; its facets are flat only within the coplanar tolerance, so give a smaller "
            "or larger one"
        )
    # The smallest basins are rounding noise.
    return np.maximum(areas, np.finfo(np.float64).tiny)


MIXTURE = (0.73, 0.41, 0.58, -0.36)
"""Weights of a flag's directions in its direction aside: from the center of mass to the corner,
along the edge, from the edge into the facet, and the facet's normal. The sum is unlikely to be in
the plane of an edge or a symmetry."""

MOST_FLAGS = 64
"""Most equivalent flags of which all are used; of more, only the first."""

NEAREST = 100
"""Number of corners nearest to the center of mass whose flags are compared first."""

SAME = 9
"""Decimal digits to which the lengths that distinguish flags are compared."""


def aside_directions(hull: ConvexHull, center: Floats) -> Floats:
    """Directions (2 k, 3), unit vectors in opposite pairs, that a symmetry of the body permutes.

    A flag is a corner with an edge at it and a facet beside that edge. Flags that a symmetry maps
    to each other have equal distances and areas; the flags with the rarest set of these numbers
    give one direction each. A body without symmetry is moved along one line, a regular pyramid
    along one for each of its symmetries. Of more than `MOST_FLAGS`, only the first is used.

    center: (3,) inside.
    """
    radii = hull.vertices - center
    scale = float(norms(radii).max())
    corner = np.concatenate([hull.tail, hull.head])
    other = np.concatenate([hull.head, hull.tail])
    facet = np.tile(hull.facet, 2)
    beyond = np.tile(hull.facet[hull.twin], 2)
    distance, heights = (norms(radii) / scale).round(SAME), hull.heights(center) / scale
    areas = hull.areas / scale**2
    # No set of numbers is rarer than one that comes once, and the first of these is wanted: mostly
    # it is at the nearest corners.
    nearest = np.partition(distance, NEAREST)[NEAREST] if len(distance) > NEAREST else np.inf
    for limit in (nearest, np.inf):
        flags = np.flatnonzero(distance[corner] <= limit)
        p, q, f, g = (part[flags] for part in (corner, other, facet, beyond))
        middle = norms((radii[p] + radii[q]) / (2.0 * scale))
        keys = (distance[p], distance[q], middle, heights[f], heights[g], areas[f], areas[g])
        _, member, count = np.unique(
            np.column_stack(keys).round(SAME), axis=0, return_inverse=True, return_counts=True
        )
        if count.min() == 1:
            break
    flags = flags[member == np.argmin(count)]
    flags = flags[:1] if len(flags) > MOST_FLAGS else flags
    along_edge = unit_vectors(hull.vertices[other[flags]] - hull.vertices[corner[flags]])
    normal = hull.normals[facet[flags]]
    # Counter-clockwise around the facet its inside is to the left, and the other way to the right.
    left = np.where(flags < len(hull.tail), 1.0, -1.0)[:, None]
    parts = (
        radii[corner[flags]] / scale,
        along_edge,
        left * np.linalg.cross(normal, along_edge),
        normal,
    )
    mixed = sum(weight * part for weight, part in zip(MIXTURE, parts, strict=True))
    along = unit_vectors(mixed)
    return np.stack([along, -along], axis=1).reshape(-1, 3)
