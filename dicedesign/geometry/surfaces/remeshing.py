"""Surfaces with fewer or more points."""

from __future__ import annotations

from typing import Final

import numpy as np

from dicedesign.errors import InputError, missing_extra
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.surfaces.closed_surface import make_surface
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Floats, Integers

FEWEST: Final = 4
"""Points of the smallest closed surface, a tetrahedron."""

AGGRESSIVENESS: Final = (5.0, 4.0)
"""Speeds at which the decimation raises its threshold, tried in turn: slower keeps to small edges
longer and to the shape better, and may end before it has come to the wanted number."""

WEAKER: Final = 1.25
"""Factor by which the wanted number of points is raised where no decimation gives a good
surface."""

SHORTER: Final = 0.93
"""Factor by which edges are shortened until there are enough points."""


def decimated(surface: Surface, points: int) -> tuple[Surface, str]:
    """A surface with about so many points, by fast-simplification.

    Edges are collapsed in order of quadric error (Garland and Heckbert, Surface simplification
    using quadric error metrics, 1997). Where that makes a surface that is not closed, falls apart
    or meets itself, it is done more slowly, and then with a quarter more points, again and again.

    points: at least 4. Returns the surface, and what was done in a sentence; one that has no more
    points already is returned as it is.

    Raises
    ------
    InputError: fewer than 4 points are wanted, the extra `concave` is not installed, or no
        decimation gives a good surface.
    """
    if points < FEWEST:
        raise InputError(
            f"decimation: expected at least {FEWEST} points, got {points}; ask for more points"
        )
    before = len(surface.points)
    if before <= points:
        return surface, f"kept the surface: its {before} points are no more than {points}"
    handles = len(surface.triangles) - 2 * (before - 2)
    wanted = points
    while wanted < before:
        for aggressiveness in AGGRESSIVENESS:
            count = 2 * (wanted - 2) + handles
            coarser = Surface(*thinned(surface.points, surface.triangles, count, aggressiveness))
            if _is_good(coarser, handles):
                return coarser, (
                    f"decimated the surface from {before} to {len(coarser.points)} points "
                    f"(fast-simplification), {_change(surface, coarser)}"
                )
        wanted = int(np.ceil(WEAKER * wanted))
    raise InputError(
        f"decimation: expected a closed surface of {points} points that does not meet itself, got "
        f"none from {before} points by any reduction; remesh the surface, or leave it as it is"
    )


def thinned(
    points: Floats, triangles: Integers, count: int, aggressiveness: float = AGGRESSIVENESS[0]
) -> tuple[Floats, Integers]:
    """About so many triangles in place of more between points (n, 3), by fast-simplification,
    whatever they do to each other.

    aggressiveness: see `AGGRESSIVENESS`. Raises InputError where the extra `concave` is missing.
    """
    try:
        import fast_simplification
    except ImportError as error:
        raise missing_extra("concave", "decimation", error) from error
    fewer, joined = fast_simplification.simplify(
        points, triangles, target_count=count, agg=aggressiveness
    )
    return np.asarray(fewer, np.float64), np.asarray(joined, np.int64)


def refined(surface: Surface, points: int) -> tuple[Surface, str]:
    """The same shape with at least so many points, by manifold3d.

    Edges longer than a length are cut into pieces of about that length; it is shortened until there
    are enough points. All new points lie on the old triangles.

    points: wanted. Returns the surface, and what was done in a sentence; one that has as many
    already is returned as it is.

    Raises
    ------
    InputError: manifold3d takes the surface for no solid, or rounding makes the finer one meet
        itself.
    """
    before = len(surface.points)
    if before >= points:
        return surface, f"kept the surface: its {before} points are no less than {points}"
    # Imported late, with manifold3d: few surfaces are too coarse.
    from dicedesign.geometry.manifold import mesh_of, solid

    body = solid(surface.points, surface.triangles)
    # Of equilateral triangles, two for each point, edges would be half as long.
    length = 2.0 * np.sqrt(4.0 / np.sqrt(3.0) * body.surface_area() / (2.0 * points))
    finer = surface
    while len(finer.points) < points:
        finer = Surface(*mesh_of(body.refine_to_length(length)))
        length *= SHORTER
    if not _is_good(finer, len(surface.triangles) - 2 * (before - 2)):
        raise InputError(
            f"refinement: expected a closed surface of {points} points that does not meet itself, "
            f"got one that does from {before} points; remesh the surface"
        )
    return finer, (
        f"refined the surface from {before} to {len(finer.points)} points (manifold3d), all of "
        "them on the old triangles"
    )


def _is_good(surface: Surface, handles: int) -> bool:
    """True if nothing has to be repaired for a surface to be taken as one (`make_surface`) and it
    has as many handles as before; handles: four times their number."""
    points, triangles = surface.points, surface.triangles
    if len(triangles) - 2 * (len(points) - 2) != handles:
        return False
    try:
        return not make_surface(Body(points, triangles, "surface", False, ()))[1]
    except InputError:
        return False


def _change(before: Surface, after: Surface) -> str:
    change = after.volume / before.volume - 1.0
    shift = float(np.linalg.norm(after.centroid - before.centroid)) / before.diagonal
    return (
        f"which changes the volume by {100.0 * change:+.2g} % and moves the center of mass by "
        f"{100.0 * shift:.2g} % of the diagonal"
    )
