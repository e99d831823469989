"""Resting poses of a body: the forward model's answer."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dicedesign.geometry.body import Body, as_numbers, is_rounded, make_body
from dicedesign.geometry.center_of_mass import resolve_center_of_mass
from dicedesign.geometry.hull import ConvexHull, convex_hull
from dicedesign.geometry.sphere import angle_between, rotation_between, unit_vectors
from dicedesign.rest.equilibria import Equilibria
from dicedesign.rest.morse import Separatrices
from dicedesign.rest.probabilities import find_basins
from dicedesign.rest.tracing import destined_facets
from dicedesign.tolerances import CLOSURE_TOLERANCE

__all__ = ["MorseComplex", "RestPoses", "analyse", "rest_poses", "standing_transform"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


TIED = (
    "the body balances somewhere to within rounding; the odds are the mean of those with its "
    "center of mass moved aside by a hair, to opposite sides"
)
"""Note on a body with ties."""

UNEVEN = (
    "some facets are no wider, or bend by no more, than they are uneven, so that others were made "
    "of the hull's corners; another coplanar tolerance may say more"
)
"""Note on a body whose facets could not be told apart where it mattered."""


@dataclass(frozen=True)
class MorseComplex:
    """The Morse-Smale complex of the support function on the Gauss sphere.

    Directions point down in the body's frame. Rests are numbered as in `RestPoses`.

    Attributes
    ----------
    minima: (k, 3) unit normals of the stable facets.
    saddles: (s, 3) unit directions of the saddles that divide two basins.
    saddle_basins: (s, 2) the two rests that a saddle divides.
    maxima: (v, 3) unit directions of the balancing vertices.
    branches: (2 s, d, 3) unit points of the separatrices from saddles to maxima, repeated where a
        branch waits; of saddle i, branch 2 i has the basin `saddle_basins[i, 0]` on its left and
        branch 2 i + 1 on its right.
    equilibria: the classified hull, in which ties are not looked for.
    rest_facets: (k,) facet of the hull that each rest stands on.
    """

    minima: Floats
    saddles: Floats
    saddle_basins: Integers
    maxima: Floats
    branches: Floats
    equilibria: Equilibria
    rest_facets: Integers

    @cached_property
    def polylines(self) -> tuple[Floats, ...]:
        """For each saddle the unit points (m, 3) of its separatrix from maximum to maximum, with
        the basin `saddle_basins[:, 0]` on its left; consecutive points span great arcs."""
        moving = np.ones(self.branches.shape[:2], dtype=bool)
        moving[:, 1:] = (self.branches[:, 1:] != self.branches[:, :-1]).any(-1)
        paths = [branch[distinct] for branch, distinct in zip(self.branches, moving, strict=True)]
        return tuple(
            np.concatenate([backward[:0:-1], forward])
            for forward, backward in zip(paths[::2], paths[1::2], strict=True)
        )

    @cached_property
    def basin_of_facet(self) -> Integers:
        """(m,) the rest to which each facet of the hull rolls."""
        facets = np.arange(len(self.equilibria.hull.normals))
        destined = destined_facets(self.equilibria, facets)
        place = np.full(len(facets), -1, dtype=np.int64)
        place[self.rest_facets] = np.arange(len(self.rest_facets))
        return place[destined]


@dataclass(frozen=True)
class RestPoses:
    """All rests of a body, the most probable first.

    Attributes
    ----------
    hull: the convex hull of the body.
    normals: (k, 3) outward unit normals of the stable facets: the direction that points down.
    probabilities: (k,) summing to 1.
    facets: (k,) facet numbers in `hull`.
    areas: (k,) areas of the facets stood on, in squared length units.
    margins: (k,) angle in radians from the facet normal to the nearest saddle of its basin; pi for
        a body with one rest.
    morse: the Morse-Smale complex.
    center_of_mass: (3,) and the source it came from in words.
    notes: what was repaired or assumed on the way.
    seconds: wall-clock seconds spent on "hull" and on "rest".
    """

    hull: ConvexHull
    normals: Floats
    probabilities: Floats
    facets: Integers
    areas: Floats
    margins: Floats
    morse: MorseComplex
    center_of_mass: Floats
    center_of_mass_source: str
    notes: tuple[str, ...]
    seconds: dict[str, float]

    @cached_property
    def transforms(self) -> Floats:
        """(k, 4, 4) rigid motions that stand the body on the plane z = 0 with the center of mass on
        the z axis."""
        heights = self.hull.heights(self.center_of_mass)[self.facets]
        return np.stack(
            [
                standing_transform(normal, height, self.center_of_mass)
                for normal, height in zip(self.normals, heights, strict=True)
            ]
        )


def standing_transform(normal: Floats, height: float, center_of_mass: Floats) -> Floats:
    """Rigid motion (4, 4) that turns `normal` down by the smallest rotation and puts the center of
    mass on the z axis at `height`."""
    transform = np.eye(4)
    transform[:3, :3] = rotation_between(normal, np.array([0.0, 0.0, -1.0]))
    transform[:3, 3] = np.array([0.0, 0.0, height]) - transform[:3, :3] @ center_of_mass
    return transform


def rest_poses(
    points_or_mesh: ArrayLike | Body,
    center_of_mass: ArrayLike | Literal["hull"] | None = None,
    *,
    coplanar_tolerance: float | None = None,
) -> RestPoses:
    """All rests of a body with their probabilities.

    Parameters
    ----------
    points_or_mesh: (n, 3) points in any length unit, a `Body`, or any mesh object with `vertices`
        (n, 3) and triangular `faces` (t, 3), such as a `trimesh.Trimesh`.
    center_of_mass: (3,) in the same unit, strictly inside the convex hull; "hull" for that of the
        uniform solid hull; None for that of the uniform solid bounded by a closed mesh, or of the
        hull for points and open meshes.
    coplanar_tolerance: see `convex_hull`.

    Raises
    ------
    DegenerateBodyError: fewer than 4 points, coplanar points, NaN or infinity, zero volume.
    OutsideHullError: the center of mass is not strictly inside the hull.
    InputError: `center_of_mass` is not three finite numbers.
    """
    if isinstance(points_or_mesh, Body):
        body = points_or_mesh
    elif hasattr(points_or_mesh, "vertices"):
        faces = getattr(points_or_mesh, "faces", None)
        vertices = as_numbers(points_or_mesh.vertices, "mesh")
        rounded = is_rounded(vertices)
        body = make_body(vertices, faces, name="mesh", single_precision=rounded)
    else:
        body = make_body(points_or_mesh)
    started = time.perf_counter()
    hull = convex_hull(body.points, coplanar_tolerance, single_precision=body.single_precision)
    hull_seconds = time.perf_counter() - started
    center, source, notes = resolve_center_of_mass(body, hull.centroid, center_of_mass)
    return analyse(hull, center, source, (*body.notes, *notes), hull_seconds)


def analyse(
    hull: ConvexHull,
    center_of_mass: Floats,
    center_of_mass_source: str = "given",
    notes: tuple[str, ...] = (),
    hull_seconds: float = 0.0,
) -> RestPoses:
    """All rests of a hull with a center of mass (3,) strictly inside it. Raises as `rest_poses`.

    A body that balances somewhere to within rounding gets the mean of the odds with its center of
    mass moved by a hair to either side (`find_basins`); its Morse complex is that of one side.
    `find_basins` also says when another hull of the same corners takes the place of the given one.
    """
    started = time.perf_counter()
    sides = find_basins(hull, center_of_mass)
    if sides[0].equilibria.hull is not hull:
        hull = sides[0].equilibria.hull
        notes = (*notes, UNEVEN)
    areas = np.zeros((len(sides), len(hull.normals)))
    for row, side in zip(areas, sides, strict=True):
        row[side.paths.rests] = side.areas
    if np.ptp(areas, axis=0).max() > CLOSURE_TOLERANCE:
        notes = (*notes, TIED)
    basins = areas.mean(axis=0)
    equilibria, paths, points = sides[0].equilibria, sides[0].paths, sides[0].points
    facets = np.argsort(-basins, kind="stable")[: np.count_nonzero(basins)]
    normals = hull.normals[facets]
    place = np.full(len(basins), -1, dtype=np.int64)
    place[facets] = np.arange(len(facets))
    morse = _complex(equilibria, paths, points, normals, facets, place[paths.rests])
    margins = np.full(len(facets), np.pi)
    for column in (0, 1):
        basin = morse.saddle_basins[:, column]
        np.minimum.at(margins, basin, angle_between(normals[basin], morse.saddles))
    return RestPoses(
        hull=hull,
        normals=normals,
        probabilities=basins[facets] / (4.0 * np.pi),
        facets=facets,
        areas=hull.areas[facets],
        margins=margins,
        morse=morse,
        center_of_mass=center_of_mass,
        center_of_mass_source=center_of_mass_source,
        notes=notes,
        seconds={"hull": hull_seconds, "rest": time.perf_counter() - started},
    )


def _complex(
    equilibria: Equilibria,
    paths: Separatrices,
    points: Floats,
    normals: Floats,
    facets: Integers,
    place: Integers,
) -> MorseComplex:
    unit = unit_vectors(points)
    return MorseComplex(
        minima=normals,
        saddles=unit[::2, 0],
        saddle_basins=place[paths.basins],
        maxima=unit_vectors(equilibria.radii[equilibria.maximum]),
        branches=unit,
        # A balance that no basin depends on is none to give up for when bodies are rolled.
        equilibria=replace(equilibria, tie_distance=0.0),
        rest_facets=facets,
    )
