"""The one seam to the kernels: the inner loops of hulls, rests, gradients and throws in C++.

They are built when the package is installed, and a machine without a C++ compiler does without
them, but for the package's own simulator of throws. A kernel answers only what rounding cannot
change. So each function here returns its value or `UNDECIDED`, where there are no kernels or where
they leave the answer open, and its caller then finds it in NumPy or torch, in exact arithmetic
where it has to. That a body is tied is an exception (`Tie`). Kernels change speed only.

A hull is handed over once: kernels take it and its separatrices by a handle (`Handled`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import wraps
from typing import Any, Literal, ParamSpec, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

import dicedesign.tolerances as bounds
from dicedesign.runtime.arrays import Booleans, Floats, Integers

INTERFACE = 10
"""Version of the kernels' arguments and results; kernels of another version are not used."""

UNDECIDED = None
"""Result of functions here if there are no kernels, or if these leave the answer open."""

P = ParamSpec("P")
T = TypeVar("T")

compiled: Any
"""The module of kernels, or None where they were not built; for this file and for tests."""

try:
    import dicedesign_kernels

    compiled = dicedesign_kernels if dicedesign_kernels.INTERFACE == INTERFACE else None
except ModuleNotFoundError:
    compiled = None

_MEASURED = (bounds.SLIVER, bounds.THIN_VOLUME, bounds.ROUNDING)

_RESTING = (
    bounds.BOUNDARY_TOLERANCE,
    bounds.TIE_TOLERANCE,
    bounds.NEAR_ANTIPODE,
    bounds.CLOSURE_TOLERANCE,
)

_REUSED = (
    bounds.REUSE_FLATNESS,
    bounds.REUSE_MARGIN,
    bounds.REUSE_LEVERAGE,
    bounds.REUSE_TURN,
    bounds.REUSE_OFFSET,
)


class Handled:
    """Base of a hull, of its separatrices and of a momentum model: what kernels take by a `handle`,
    which borrows its arrays, is made at first use by a kernel and is left out of pickles."""

    handle: Any

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "handle"}


class Tie(Exception):
    """The combinatorics change under an infinitesimal move of the center of mass."""


class Bodies(Protocol):
    """Bodies that were put to rest together."""

    def rests(self) -> tuple[Integers, Integers, Floats, Floats]:
        """Number of rests of each body (b,), 0 if rounding leaves anything open; facets (b, k),
        normals (b, k, 3) and probabilities (b, k), the most probable first, padded with 0."""

    def pull_back(
        self,
        which: Integers,
        by_normals: Floats,
        by_probabilities: Floats,
        points: int,
        threads: int,
    ) -> tuple[Floats, Floats, Integers]:
        """Gradients in points (r, points, 3) and given centers (r, 3) from those in normals (r, k,
        3) and probabilities (r, k) of bodies (r,); and (r,) 0 where left open."""


class Energies(Protocol):
    """Terms of the energy of eq. 16: dice, coplanar, barycenter, neighbor."""

    def values(self) -> list[float]:
        """The four, 0 where they are not wanted."""

    def gradient(self, slopes: Sequence[float]) -> tuple[Floats, Floats]:
        """Gradient of the weighted sum of terms, weights (4,): (n, 3) and (3,)."""


def available() -> bool:
    """Whether there are kernels: for messages, and for features that require them."""
    return compiled is not None


def _kernel(function: Callable[P, T]) -> Callable[P, T | None]:
    """The function, or one that is undecided without kernels."""

    @wraps(function)
    def asked(*args: P.args, **kwargs: P.kwargs) -> T | None:
        return UNDECIDED if compiled is None else function(*args, **kwargs)

    return asked


def new_handle(kind: Literal["Hull", "Paths", "Momentum"], *parts: Any) -> Any:
    """C++ handle of a `ConvexHull`, a `Separatrices` or a `MomentumModel`, which borrows its
    arrays."""
    return getattr(compiled, kind)(*parts)


# Points and hulls.


def are_proper(points: Floats, smallest_extent: float) -> bool:
    """True where kernels find points (n, 3) finite, no coordinate above `1 / smallest_extent` and
    the largest extent not below it; False says nothing."""
    return compiled is not None and bool(compiled.are_proper(points, smallest_extent))


@_kernel
def merge_positions(points: Floats) -> tuple[Integers, Integers]:
    """The first point (m,) at each position of points (n, 3), in order, and (n,) the place of each
    point's position there."""
    return compiled.repeated_positions(points) or (np.arange(len(points)),) * 2


@_kernel
def convex_hull(
    points: NDArray[Any], coplanar_tolerance: float, precision: float
) -> dict[str, Any]:
    """Fields and properties by name of the `ConvexHull` of points.

    points: (n, 3) real; coplanar_tolerance: larger than 0; precision: relative spacing of the
    coordinates.
    """
    given = np.require(points, np.float64, ["C", "ALIGNED"])
    return compiled.convex_hull(given, coplanar_tolerance, precision, *_MEASURED)


@_kernel
def exact_hull(
    points: NDArray[Any], coplanar_tolerance: float, precision: float
) -> tuple[dict[str, Any], dict[str, Any] | None, Integers]:
    """Fields and properties of the hull of points as they are; the same with its facets merged, if
    any are; and the merged facet of each. Arguments as `convex_hull`; the tolerance may be 0."""
    given = np.require(points, np.float64, ["C", "ALIGNED"])
    return compiled.exact_hull(given, coplanar_tolerance, precision, *_MEASURED)


@_kernel
def hull_properties(
    vertices: Floats, facet_start: Integers, tail: Integers, twin: Integers
) -> dict[str, Any]:
    """Properties of a `ConvexHull` by name, except those that need more than plain sums: the
    normals if a facet is a sliver, the centroid of a thin body. All hulls get them here, so that
    equal hulls have equal properties to the last bit."""
    return compiled.hull_properties(vertices, facet_start, tail, twin, *_MEASURED)


@_kernel
def move_hull(
    points: Floats, source: Integers, facet_start: Integers, tail: Integers, twin: Integers
) -> dict[str, Any] | None:
    """Vertices and measures by name of a hull whose points moved to (n, 3), of which `source` are
    the corners; undecided if its facets may have changed."""
    return (
        compiled.moved_hull(points, source, facet_start, tail, twin, _REUSED, *_MEASURED)
        or UNDECIDED
    )


# Triangle surfaces. Triangles (t, 3) are numbers of points.


@_kernel
def is_closed(triangles: Integers) -> bool:
    """Whether every edge is passed equally often in both directions."""
    return bool(compiled.is_closed(triangles, int(triangles.max()) + 1))


@_kernel
def shells(triangles: Integers) -> Integers:
    """(t,) number of the shell of each triangle; triangles of one shell are joined by edges."""
    return compiled.shells(triangles, int(triangles.max()) + 1)


@_kernel
def rasterize(positions: Floats, triangles: Integers, size: int) -> tuple[Integers, Floats]:
    """Kernel of `dicedesign.report.raster`."""
    return compiled.rasterize(positions, triangles, size)


# Rests of a hull with a center of mass (3,).


@_kernel
def surroundings(hull: Handled, center: Floats) -> tuple[int, float, float, float, float]:
    """Kernel of `dicedesign.rest.equilibria.Surroundings`."""
    return compiled.surroundings(hull.handle, center)


@_kernel
def separatrices(hull: Handled, center: Floats, tie_distance: float) -> list[Any]:
    """The arrays of a `Separatrices`, in order, their handle, and the `growth_sign` and `side_sign`
    (h,) of `Equilibria`. Raises Tie where a move of the center by no more than a tie distance above
    0 could change them; so do `destinations` and `slides`."""
    return _raise_ties(compiled.separatrices(hull.handle, center, bounds.ROUNDING, tie_distance))


@_kernel
def destinations(hull: Handled, center: Floats, tie_distance: float, facets: Integers) -> Integers:
    """Stable facet (k,) on which a body comes to rest that is let go on facets (k,)."""
    return _raise_ties(
        compiled.destinations(hull.handle, center, bounds.ROUNDING, tie_distance, facets)
    )


@_kernel
def slides(
    hull: Handled, center: Floats, tie_distance: float, *lines: NDArray[Any]
) -> tuple[Integers, Booleans]:
    """Kernel of `dicedesign.rest.tracing.slide`; lines: its vertices, directions and errors."""
    answer = _raise_ties(
        compiled.slides(hull.handle, center, bounds.ROUNDING, tie_distance, *lines)
    )
    return answer and (answer[0], answer[1] > 0)


def _raise_ties(answer: Any) -> Any:
    """Answer of a kernel; raises Tie if it is False, for a tied body."""
    if answer is False:
        raise Tie
    return answer


@_kernel
def basin_areas(hull: Handled, paths: Handled, center: Floats) -> Floats:
    """(k,) in steradian of the basins between separatrices."""
    return compiled.basin_areas(
        hull.handle, paths.handle, center, bounds.NEAR_ANTIPODE, bounds.CLOSURE_TOLERANCE
    )


# Gradients: for those in a result, those in the vertices (n, 3) and the center of mass (3,).


@_kernel
def area_gradient(
    hull: Handled, paths: Handled, center: Floats, weights: Floats
) -> tuple[Floats, Floats]:
    """Gradient of the weighted sum of basin areas, weights (k,): (n, 3) and (3,)."""
    return compiled.area_gradient(hull.handle, paths.handle, center, weights)


@_kernel
def area_jacobian(hull: Handled, paths: Handled, center: Floats) -> tuple[Floats, Floats]:
    """Jacobian of the basin areas: (k, 3 n) and (k, 3)."""
    return compiled.area_jacobian(hull.handle, paths.handle, center)


@_kernel
def centroid_gradient(hull: Handled, gradient: Floats) -> Floats:
    """(n, 3) for that (3,) in the centroid of the uniform solid, unless that is thin."""
    return compiled.centroid_gradient(hull.handle, gradient, bounds.THIN_VOLUME)


@_kernel
def normal_gradient(hull: Handled, facets: Integers, gradients: Floats) -> Floats:
    """(n, 3) for those (k, 3) in the unit normals of facets (k,)."""
    return compiled.normal_gradient(hull.handle, facets, gradients)


@_kernel
def facet_depths(hull: Handled, center: Floats) -> Floats:
    """(m,) how far inside each facet the foot of the center of mass lies: its signed distance from
    the nearest edge's line over the circumscribed radius."""
    return compiled.facet_depths(hull.handle, center)


@_kernel
def depth_gradient(hull: Handled, center: Floats, slopes: Floats) -> tuple[Floats, Floats]:
    """Gradient of the weighted sum of facet depths, weights (m,): (n, 3) and (3,)."""
    return compiled.depth_gradient(hull.handle, center, slopes)


@_kernel
def corner_gradients(
    normals: Floats, polar: Floats, planes: Integers, corners: Floats, gradients: Floats
) -> Floats:
    """Gradients (r, 4 m) in half-spaces, first all normals and then all logarithms of distances,
    for those (r, 3 t) in corners (t, 3), each where three planes (t, 3) meet.

    normals: (m, 3) of any length; polar: (m, 3) unit normals over distances.
    """
    return compiled.corner_gradients(normals, polar, planes.ravel(), corners, gradients)


@_kernel
def bodies(
    points: Floats,
    start: Integers,
    counts: Integers,
    centers: Floats | None,
    coplanar_tolerance: float,
    precision: float,
    threads: int,
) -> Bodies:
    """Rests of bodies, on a number of threads.

    points: (t, 3), of which each body has `counts` (b,) from `start` (b,) on; centers: of mass,
    (b, 3), or None for those of the uniform solids; others: as `convex_hull` has them.
    """
    numbers = (coplanar_tolerance, precision, *_MEASURED, *_RESTING)
    return compiled.Bodies(points, start, counts, centers, numbers, threads)


@_kernel
def energies(
    hull: Handled,
    paths: Handled,
    center: Floats,
    *,
    probabilities: Floats,
    of_rest: Integers,
    directions: Floats,
    target: Floats,
    neighbor_radius: float,
    smallest_mean: float,
    no_rest: float,
    wanted: Sequence[bool],
) -> Energies:
    """The energies of a body.

    probabilities: (r,) of the rests; of_rest: (r,) outcome that each counts for; directions: (k, 3)
        of the
    outcomes; target: (k,) their probabilities; smallest_mean: length of the sum of a region's
    maxima below which it is not stretched to 1; no_rest: what the barycenter term charges for an
    outcome without a rest; wanted: (4,) terms to compute.
    """
    arrays = center, probabilities, of_rest, directions, target
    numbers = neighbor_radius, smallest_mean, no_rest
    return compiled.Energies(hull.handle, paths.handle, *arrays, *numbers, wanted)


# Throws.


@_kernel
def throw_probabilities(
    hull: Handled,
    paths: Handled,
    model: Handled,
    center: Floats,
    inertia: Floats,
    probabilities: Floats,
) -> Floats:
    """Probabilities (k,) of the rests of a thrown body by the momentum model.

    inertia: (3, 3) tensor about the center over the mass; probabilities: (k,) without momentum.
    """
    handles = hull.handle, paths.handle, model.handle
    return compiled.throw_probabilities(*handles, center, inertia, probabilities)


@_kernel
def thrown_gradients(
    hull: Handled,
    paths: Handled,
    model: Handled,
    center: Floats,
    probabilities: Floats,
    weights: Floats,
) -> tuple[Floats, Floats, Floats]:
    """Gradients (r, 3 n), (r, 3) and (r, k) of weighted sums (r, k) of a thrown uniform solid's
    probabilities, in the vertices, the center of mass and the probabilities without momentum."""
    handles = hull.handle, paths.handle, model.handle
    return compiled.thrown_gradients(*handles, center, probabilities, weights)


@_kernel
def solid_inertia(hull: Handled) -> Floats:
    """(3, 3) tensor of inertia of the uniform solid about its centroid over its mass."""
    return compiled.solid_inertia(hull.handle)


@_kernel
def advance_throws(
    landscape: Sequence[NDArray[Any]],
    moments: Floats,
    how: Floats,
    states: Floats,
    steps: int,
) -> tuple[Integers, Integers]:
    """Advance states (n, 13) of a body in place by at most a number of steps: the rest that each
    cannot miss any more, or -1, and the steps taken.

    how: step, gravity, drag, restitution and friction.
    """
    return compiled.advance_throws(*landscape, moments, how, states, steps)
