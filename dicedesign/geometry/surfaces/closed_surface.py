"""The closed surface of one solid that a body's triangles bound, checked; decimation and
refinement."""

from __future__ import annotations

import numpy as np

from dicedesign.errors import DegenerateBodyError, InputError, missing_extra
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.body import Body, close_triangles, distinct_triangles, shells_of
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.surfaces.self_intersections import intersecting_triangles
from dicedesign.geometry.triangles import (
    Surface,
    edge_keys,
    edge_neighbors,
    find_parts,
    surface_of,
    winding_number,
)
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import VOLUME_TOLERANCE

REPAIR = (
    "write start: {mesh: {path: FILE, repair: true}} (dicedesign design: --repair), or repair the "
    "file with dicedesign repair"
)
"""Remedy for triangles that do not bound one solid."""


def make_surface(body: Body) -> tuple[Surface, tuple[str, ...]]:
    """The surface of one solid that the triangles of a body bound.

    Repeated triangles are dropped, triangles that are wound against their neighbors are reversed, a
    surface that is oriented inward is turned, and points on no triangle are dropped.

    Returns
    -------
    The surface, and the notes of the body followed by one sentence for each repair.

    Raises
    ------
    InputError: the body is a point cloud; its surface is open or one-sided, has an edge with more
        than two triangles or a point where several sheets meet, consists of several shells, or
        intersects itself.
    DegenerateBodyError: the body is flat, or the surface encloses no volume.
    """
    surface, notes = one_shell(body)
    pairs = intersecting_triangles(surface.points, surface.triangles)
    if len(pairs) > 0:
        first = surface.points[surface.triangles[pairs[0]]].mean(axis=(0, 1))
        raise InputError(
            f"{body.name}: expected a surface that does not meet itself, got {len(pairs)} pairs of "
            f"triangles that do, the first near {_place(first)} (triangles {pairs[0, 0]} and "
            f"{pairs[0, 1]}); {REPAIR}"
        )
    return surface, notes


def one_shell(body: Body) -> tuple[Surface, tuple[str, ...]]:
    """Surface as by `make_surface`, in a tenth of the time, without the test for
    self-intersections."""
    name = body.name
    if body.triangles is None:
        raise InputError(
            f"{name}: expected a closed triangle mesh, got a point cloud; export the surface as a "
            "mesh"
        )
    offsets = body.points - body.points.mean(axis=0)
    extent = float(np.ptp(offsets, axis=0).max())
    across = np.linalg.eigh(offsets.T @ (offsets / extent**2))[1][:, 0]
    if np.ptp(offsets @ across) <= VOLUME_TOLERANCE * extent:
        raise DegenerateBodyError(
            f"{name}: expected a surface that encloses a volume, got a flat sheet; use a mesh with "
            "thickness"
        )
    distinct = distinct_triangles(body.triangles)
    _, uses = np.unique(edge_keys(distinct), return_counts=True)
    crowded, opened = np.count_nonzero(uses > 2), np.count_nonzero(uses == 1)
    if crowded or opened:
        got = (
            f"{crowded} edges with more than two triangles (not a manifold)"
            if crowded
            else f"{opened} edges with one triangle (the mesh is open)"
        )
        raise InputError(
            f"{name}: expected a closed surface in which each edge joins two triangles, got {got}; "
            f"{REPAIR}"
        )
    closed = close_triangles(distinct)
    if closed is None:
        raise InputError(
            f"{name}: expected a surface with an inside and an outside, got a one-sided one (not "
            f"orientable, like a Klein bottle); {REPAIR}"
        )
    triangles, notes = closed
    if len(distinct) < len(body.triangles):
        repeated = f"left {len(body.triangles) - len(distinct)} repeated triangles out"
        notes = (repeated, *notes)
    surface = surface_of(body.points, triangles)
    if len(surface.points) < len(body.points):
        unused = len(body.points) - len(surface.points)
        notes += (f"dropped {unused} points that are on no triangle",)
    _check_shells(surface.points, surface.triangles, name)
    volume = surface.volume
    extent = float(np.ptp(surface.points, axis=0).max())
    if abs(volume) <= VOLUME_TOLERANCE * extent**3:
        raise DegenerateBodyError(
            f"{name}: expected a surface that encloses a volume, got {volume:.3g} at an extent of "
            f"{extent:.3g}; use a mesh with thickness"
        )
    if volume < 0.0:
        surface = Surface(surface.points, surface.triangles[:, ::-1].copy())
        notes += ("turned the surface, which was oriented inward",)
    return surface, body.notes + notes


def _check_shells(points: Floats, triangles: Integers, name: str) -> None:
    shell = shells_of(triangles)
    sizes = np.bincount(shell)
    if len(sizes) > 1:
        largest = points[triangles[shell == sizes.argmax()]]
        middles = (points[triangles[np.argmax(shell == k)]].mean(axis=0) for k in range(len(sizes)))
        windings = [abs(winding_number(middle, largest)) for middle in middles]
        inside = sum(w > 0.5 for k, w in enumerate(windings) if k != sizes.argmax())
        raise InputError(
            f"{name}: expected one connected surface, got {len(sizes)} shells: the largest of "
            f"{sizes.max()} triangles, {inside} inside it (cavities or parts) and "
            f"{len(sizes) - 1 - inside} outside; keep one shell, or {REPAIR}"
        )
    # The triangles around a point where several sheets meet make more than one ring.
    across = np.roll(edge_neighbors(triangles), -1, axis=1)  # the next triangle around a corner
    corner = (triangles[across] == triangles[:, :, None]).argmax(axis=2)
    following = (3 * across + corner).ravel()
    ring = find_parts(np.arange(triangles.size), following, triangles.size)
    rings = np.unique(triangles.ravel() * np.int64(triangles.size) + ring) // triangles.size
    pinched = np.flatnonzero(np.bincount(rings) > 1)
    if len(pinched) > 0:
        raise InputError(
            f"{name}: expected one sheet of the surface at each point, got several at "
            f"{len(pinched)} points (not a manifold), the first at "
            f"{_place(points[pinched[0]])}; {REPAIR}"
        )


def _place(point: Floats) -> str:
    return "(" + ", ".join(f"{x:.4g}" for x in point) + ")"


CONVEX = 1e-3
"""Largest share of its hull's volume that a convex surface leaves empty."""

ROUND = 0.95
"""Least distance of a facet from the center of mass, relative to the farthest corner's, from which
on a hull is nearly a sphere."""


def require_dents(surface: Surface) -> None:
    """Raise InputError for a surface that cannot become a concave die: it is nearly convex, or its
    hull is nearly a sphere."""
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
    if surface.volume >= (1.0 - CONVEX) * hull.surface.volume:
        raise InputError(
            "start: expected a surface with dents for method concave, got a convex one; take "
            "method: {exact: {}}, which makes convex dice"
        )


FEWEST = 4
"""Points of the smallest closed surface, a tetrahedron."""

AGGRESSIVENESS = (5.0, 4.0)
"""Speeds at which the decimation raises its threshold, tried in turn: a slower one keeps the shape
better, but may end before the wanted number of points is reached."""

WEAKER = 1.25
"""Factor by which the number of points is raised where no decimation gives a good surface."""

SHORTER = 0.93
"""Factor by which edges are shortened until there are enough points."""


def decimate(surface: Surface, points: int) -> tuple[Surface, str]:
    """Surface reduced to about a number of points, by fast-simplification.

    Edges are collapsed in order of quadric error (Garland and Heckbert, Surface simplification
    using quadric error metrics, 1997). If the result is not closed, falls apart or intersects
    itself, the reduction is repeated more slowly, and then with a quarter more points each time.

    points: at least 4. Returns the surface, unchanged if it has no more points already, and a
    sentence on the change.

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
            coarser = Surface(*thin(surface.points, surface.triangles, count, aggressiveness))
            if _is_good(coarser, handles):
                change = coarser.volume / surface.volume - 1.0
                shift = float(norms(coarser.centroid - surface.centroid)) / surface.diagonal
                return coarser, (
                    f"decimated the surface from {before} to {len(coarser.points)} points "
                    f"(fast-simplification), which changes the volume by {100.0 * change:+.2g} % "
                    f"and moves the center of mass by {100.0 * shift:.2g} % of the diagonal"
                )
        wanted = int(np.ceil(WEAKER * wanted))
    raise InputError(
        f"decimation: expected a closed surface of {points} points that does not meet itself, got "
        f"none from {before} points by any reduction; remesh the surface, or leave it as it is"
    )


def thin(
    points: Floats, triangles: Integers, count: int, aggressiveness: float = AGGRESSIVENESS[0]
) -> tuple[Floats, Integers]:
    """Triangles between points (n, 3) reduced to about a number, by fast-simplification; they may
    intersect.

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


def refine(surface: Surface, points: int) -> tuple[Surface, str]:
    """Surface of equal shape with at least a number of points, by manifold3d.

    Edges longer than a length are cut into pieces of about that length; it is shortened until there
    are enough points. All new points lie on the old triangles.

    points: wanted. Returns the surface, unchanged if it has as many already, and a sentence on what
    was done.

    Raises
    ------
    InputError: the surface is not a solid for manifold3d, or rounding makes the finer one meet
        itself.
    """
    before = len(surface.points)
    if before >= points:
        return surface, f"kept the surface: its {before} points are no less than {points}"
    # Imported late, with manifold3d: few surfaces are too coarse.
    from dicedesign.geometry.meshes.manifold import mesh_of, solid

    body = solid(surface)
    # Of equilateral triangles, two for each point, edges would be half as long.
    length = 2.0 * np.sqrt(4.0 / np.sqrt(3.0) * body.surface_area() / (2.0 * points))
    finer = surface
    while len(finer.points) < points:
        finer = mesh_of(body.refine_to_length(length))
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
    """Whether `make_surface` accepts a surface without any repair, and it has as many handles as
    before; handles: four times their number."""
    points, triangles = surface.points, surface.triangles
    if len(triangles) - 2 * (len(points) - 2) != handles:
        return False
    try:
        return not make_surface(Body(points, triangles, "surface", False, ()))[1]
    except InputError:
        return False
