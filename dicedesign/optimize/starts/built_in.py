"""The kinds of starting shapes that come with the package."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Final, Literal

import numpy as np

from dicedesign.errors import InputError
from dicedesign.optimize.starts.start import (
    Start,
    StartKind,
    StartSurface,
    Task,
    check_sides,
    normalised_start,
)
from dicedesign.runtime.arrays import Floats
from dicedesign.runtime.registry import STRICT

if TYPE_CHECKING:
    from dicedesign.geometry.hulls.hull import ConvexHull
    from dicedesign.geometry.meshes.body import Body


@dataclass(frozen=True)
class PrismOptions:
    """`start.prism`; see `prism`.

    Attributes
    ----------
    sides: 3 to 12; the number of outcomes unless given.
    height: of the side faces, over the base's circumscribed radius, positive.
    cap: height of each pointed cap over the same, not negative; steep caps are unstable.
    """

    __pydantic_config__: ClassVar = {**STRICT, "allow_inf_nan": False}

    sides: int | None = None
    height: float = 1.5
    cap: float = 1.3


def prism(sides: int, height: float = 1.5, cap: float = 1.3) -> Start:
    """A prism with pointed caps, whose side faces carry the outcomes in order around the axis.

    Own coordinates: the center at the origin, the axis along z, the base's circumscribed radius 1,
    a corner of the base in direction x.

    Parameters
    ----------
    sides: 3 to 12.
    height: height of the side faces in units of the base's circumscribed radius, positive and
        finite.
    cap: height of each pointed cap in the same unit, not negative and finite; steep caps are
        unstable.

    Raises
    ------
    InputError: a parameter out of range.
    """
    _check_proportions(sides, height, cap)
    corner = 2.0 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(corner), np.sin(corner)], axis=1)
    level = np.full((sides, 1), height / 2.0)
    apex = np.array([[0.0, 0.0, height / 2.0 + cap]])
    points = np.concatenate([np.hstack([ring, level]), np.hstack([ring, -level])])
    if cap > 0.0:
        points = np.concatenate([points, apex, -apex])
    middle = corner + np.pi / sides
    directions = np.stack([np.cos(middle), np.sin(middle), np.zeros(sides)], axis=1)
    return normalised_start(points, directions)


def _check_proportions(sides: int, height: float, cap: float) -> None:
    if not 3 <= sides <= 12:
        raise InputError(
            f"start.prism.sides: expected 3 to 12, got {sides}; start from repulsion or a mesh"
        )
    if not 0.0 < height < np.inf:
        raise InputError(
            f"start.prism.height: expected a positive number, got {height:g}; leave it out for 1.5"
        )
    if not 0.0 <= cap < np.inf:
        raise InputError(
            f"start.prism.cap: expected a number not below 0, got {cap:g}; leave it out for 1.3"
        )


def _check_prism(options: PrismOptions, outcomes: int) -> None:
    check_sides(outcomes)
    sides = outcomes if options.sides is None else options.sides
    _check_proportions(sides, options.height, options.cap)
    if sides != outcomes:
        raise InputError(
            f"start.prism.sides: expected {outcomes}, one side for each outcome of the target, got "
            f"{sides}; leave it out"
        )


def _make_prism(options: PrismOptions, task: Task) -> Start:
    sides = task.outcomes if options.sides is None else options.sides
    return prism(sides, options.height, options.cap)


PRISM: Final = StartKind(
    name="prism",
    line="a prism with pointed caps, one side for each outcome in order around the axis",
    options=PrismOptions,
    check=_check_prism,
    make=_make_prism,
)


FACETS: Final = 11


def hendecahedron(kind: str) -> Start:
    """An 11-faced polyhedron for the total of two dice; `kind` is "bisymmetric" or "circus".

    Raises InputError for another kind.
    """
    if kind not in HENDECAHEDRA:
        raise InputError(
            f"start.hendecahedron: expected one of {', '.join(HENDECAHEDRA)}, got {kind!r}"
        )
    return HENDECAHEDRA[kind]()


def _bisymmetric() -> Start:
    """The space-filling hendecahedron with two mirror planes (G. Inchbald, The Mathematical
    Gazette 80, 1996); mirror images follow each other.

    Own coordinates: the mirror planes are x = 0 and y = 0, the floor is at z = -1.2, the top at
    z = 1.8, and x and y run from -2 to 2.
    """
    normals = np.array(
        [
            (1, 0, 2),
            (0, 1, 1),
            (1, 1, -1),
            (1, -1, -1),
            (2, 0, -1),
            (0, 0, -1),
            (-2, 0, -1),
            (-1, -1, -1),
            (-1, 1, -1),
            (0, -1, 1),
            (-1, 0, 2),
        ],
        dtype=np.float64,
    )
    inside = np.array([0.0, 0.0, 1.2])
    offsets = np.array([6, 3, 1, 1, 2, 0, 2, 1, 1, 3, 6]) - normals @ inside
    directions = normals / np.linalg.norm(normals, axis=1)[:, None]
    return _polyhedron(normals, offsets, directions)


def _circus() -> Start:
    """A five-sided tent: pentagonal prism under a pentagonal pyramid; wall and roof of each side
    follow each other, the floor comes in the middle.

    Own coordinates: every facet is tangent to the unit sphere about the origin, the floor is at
    z = -1, and the first wall faces x.
    """
    angle = 2.0 * np.pi * np.arange(5) / 5.0
    wall = np.stack([np.cos(angle), np.sin(angle), np.zeros(5)], axis=1)
    roof = np.stack([np.cos(angle), np.sin(angle), np.full(5, 0.809)], axis=1)
    roof /= np.linalg.norm(roof, axis=1)[:, None]
    floor = np.array([[0.0, 0.0, -1.0]])
    pairs = np.stack([wall, roof], axis=1).reshape(10, 3)
    directions = np.concatenate([pairs[:5], floor, pairs[5:]])
    return _polyhedron(directions, np.ones(11), directions)


def _polyhedron(normals: Floats, offsets: Floats, directions: Floats) -> Start:
    from dicedesign.geometry.hulls.hull import polyhedron_corners

    return normalised_start(polyhedron_corners(normals, offsets), directions)


def _check_hendecahedron(kind: str, outcomes: int) -> None:
    check_sides(outcomes)
    if outcomes != FACETS:
        raise InputError(
            f"start.hendecahedron: expected a target of {FACETS} outcomes, one for each facet, got "
            f"{outcomes}; take another start"
        )


HENDECAHEDRA: Final[dict[str, Callable[[], Start]]] = {
    "bisymmetric": _bisymmetric,
    "circus": _circus,
}

HENDECAHEDRON: Final = StartKind(
    name="hendecahedron",
    line="a body of eleven facets, `bisymmetric` or `circus`, for the total of two dice",
    options=Literal["bisymmetric", "circus"],
    check=_check_hendecahedron,
    make=lambda kind, task: hendecahedron(kind),
)


@dataclass(frozen=True)
class RepulsionOptions:
    """`start.repulsion`: nothing to choose."""

    __pydantic_config__ = STRICT


def _check_repulsion(options: RepulsionOptions, outcomes: int) -> None:
    from dicedesign.optimize.starts.half_space_odds import FEWEST_FACETS

    check_sides(outcomes)
    if outcomes < FEWEST_FACETS:
        raise InputError(
            f"start.repulsion: expected a target of at least {FEWEST_FACETS} outcomes, got "
            f"{outcomes}; take a prism"
        )


def _make_repulsion(options: RepulsionOptions, task: Task) -> Start:
    from dicedesign.optimize.starts.half_space_odds import repulsion

    return repulsion(task.outcomes, task.seed)


REPULSION: Final = StartKind(
    name="repulsion",
    line="facets tangent to a sphere at points that repel each other, one for each outcome",
    options=RepulsionOptions,
    check=_check_repulsion,
    make=_make_repulsion,
)


@dataclass(frozen=True)
class MeshOptions:
    """`start.mesh`.

    Attributes
    ----------
    path: of the file, relative to the recipe's folder, or to the working directory in a change from
        the command line.
    repair: of a mesh that is open, no manifold, of several bodies or meets itself, take the closed
        surface of the largest solid that it encloses; for method concave.
    """

    __pydantic_config__ = STRICT

    path: str
    repair: bool = False


def mesh_start(body: Body, outcomes: int, center_of_mass: Floats | None = None) -> Start:
    """The convex hull of a body, with its `outcomes` most probable rests carrying the outcomes.

    Own coordinates: those of the body.

    Parameters
    ----------
    body: any mesh or point cloud.
    outcomes: how many rests carry an outcome.
    center_of_mass: (3,) in the body's unit, or None for that of the uniform solid hull.

    Raises
    ------
    InputError: the hull has fewer rests than outcomes.
    DegenerateBodyError, OutsideHullError: as `dicedesign.rest_poses`.
    """
    from dicedesign.rest.poses import rest_poses

    poses = rest_poses(body, "hull" if center_of_mass is None else center_of_mass)
    if len(poses.normals) < outcomes:
        raise InputError(
            f"start.mesh: expected a body with at least {outcomes} rests, one for each outcome, "
            f"got {len(poses.normals)} in {body.name}; take another start"
        )
    return normalised_start(_exact_corners(poses.hull), poses.normals[:outcomes], poses.notes)


def _exact_corners(hull: ConvexHull) -> Floats:
    """(n, 3) corners where the planes of a hull's facets meet. Rounded coordinates scatter about
    the plane of a merged facet; these lie on it, so that it stays one facet."""
    from dicedesign.geometry.hulls.hull import polyhedron_corners

    start = hull.facet_start[:-1]
    offsets = ((hull.vertices[hull.tail] - hull.centroid) * hull.normals[hull.facet]).sum(-1)
    heights = np.add.reduceat(offsets, start) / np.diff(hull.facet_start)
    return polyhedron_corners(hull.normals, heights) + hull.centroid


def _make_mesh(options: MeshOptions, task: Task) -> Start:
    from dicedesign.geometry.meshes.reading import read_body

    if options.repair:
        raise InputError(
            "start.mesh.repair: expected method concave, which keeps the mesh, got one that takes "
            "its convex hull, with nothing to repair; leave it out"
        )
    return mesh_start(read_body(Path(options.path)), task.outcomes, task.center_of_mass)


def _mesh_surface(options: MeshOptions, points: int) -> StartSurface:
    from dicedesign.geometry.meshes.reading import read_body
    from dicedesign.geometry.surfaces.repair import input_surface

    return StartSurface(
        *input_surface(read_body(Path(options.path)), points, repair=options.repair)
    )


MESH: Final = StartKind(
    name="mesh",
    line="the convex hull of a mesh file, its most probable rests for the outcomes; or its "
    "surface, with method concave",
    options=MeshOptions,
    make=_make_mesh,
    surface=_mesh_surface,
)


MOST_HELPERS: Final = 60


@dataclass(frozen=True)
class SearchOptions:
    """`start.search`.

    Attributes
    ----------
    helpers: least number of facets without an outcome, 0 to `MOST_HELPERS`: they leave more dice of
        the same odds to choose from.
    """

    __pydantic_config__ = STRICT

    helpers: int = 0


def _check_search(options: SearchOptions, outcomes: int) -> None:
    if not 0 <= options.helpers <= MOST_HELPERS:
        raise InputError(
            f"start.search.helpers: expected 0 to {MOST_HELPERS}, got {options.helpers}; leave it "
            "out"
        )


def _shapes(
    options: SearchOptions, target: Floats, group: Floats | None, seed: int
) -> Iterator[Start | None]:
    """See `shapes_near` and `symmetric_shapes_near`."""
    if group is None:
        from dicedesign.optimize.starts.search import shapes_near

        return shapes_near(target, seed, options.helpers)
    from dicedesign.optimize.starts.symmetric_search import symmetric_shapes_near

    return symmetric_shapes_near(target, group, seed, options.helpers)


SEARCH: Final = StartKind(
    name="search",
    line="random shapes with odds near the target's, until one leads there",
    options=SearchOptions,
    check=_check_search,
    search=_shapes,
)
