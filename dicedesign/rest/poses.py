"""Resting poses of a body with their probabilities: the result of the forward model."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dicedesign.errors import MOST_COUNT, DegenerateBodyError, InputError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull, hull_precision
from dicedesign.geometry.meshes.body import (
    Body,
    MassProperties,
    body_of,
    resolve_center_of_mass,
    solid_triangles,
)
from dicedesign.geometry.meshes.parts import loose_part_notes
from dicedesign.geometry.sphere import angle_between, turns_down, unit_vectors
from dicedesign.geometry.triangles import Surface
from dicedesign.rest.basins import Basins, find_basins, merged_rests, rest_basins
from dicedesign.rest.equilibria import Equilibria
from dicedesign.rest.tracing import slide, trace_to_rests
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import (
    CLOSURE_TOLERANCE,
    NOTED_ROUNDING,
    VOLUME_TOLERANCE,
    WARP_TOLERANCE,
)

if TYPE_CHECKING:
    from dicedesign.rest.prior import Prior

Seed = int | np.random.Generator | None
"""Chance: a seed, at least 0, a generator to draw from, or None for another result every time."""


class SampledPoses(NamedTuple):
    """Poses of one body, drawn by their probabilities.

    Attributes
    ----------
    transforms: (n, 4, 4) rigid motions that stand the body on the plane z = 0 with the center of
        mass on the z axis, turned about that axis by any angle, all equally probable.
    rests: (n,) the rest of each, numbered from 0, the most probable first.
    """

    transforms: Floats
    rests: Integers


def generator_of(rng: Seed) -> np.random.Generator:
    """Random generator of a seed, or a given generator. Raises InputError for anything else."""
    if isinstance(rng, bool) or (isinstance(rng, int | np.integer) and rng < 0):
        raise InputError(f"rng: expected a seed of at least 0, got {rng!r}; choose another")
    if not (rng is None or isinstance(rng, int | np.integer | np.random.Generator)):
        raise InputError(
            f"rng: expected a seed, a numpy.random.Generator or None, got {type(rng).__name__}; "
            "pass numpy.random.default_rng(seed)"
        )
    return np.random.default_rng(rng)


TIED = (
    "the body balances somewhere to within rounding; the probabilities are the mean of those with "
    "its center of mass moved slightly aside, to opposite sides"
)
"""Note on a body with ties."""

UNEVEN = (
    "facets that are flat within the coplanar tolerance contradict each other, so that none were "
    "merged; another tolerance may merge them"
)
"""Note on a body whose merged facets could not be distinguished where it mattered."""


MAX_DIRECTIONS = 20_000
"""Maximum number of directions that are followed at a time, to limit memory."""


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
    equilibria: the classified hull (`ConvexHull.finer`, if there is one), in which ties are not
        looked for.
    rest_facets: (k,) facet of the body's hull that each rest stands on.
    facet: (m',) the facet of the body's hull to which each facet of the classified hull belongs.
    """

    minima: Floats
    saddles: Floats
    saddle_basins: Integers
    maxima: Floats
    branches: Floats
    equilibria: Equilibria
    rest_facets: Integers
    facet: Integers

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

    def basins_of(self, directions: Floats) -> Integers:
        """(m,) the rest to which the body rolls from each unit down direction (m, 3)."""
        rests = np.empty(len(directions), dtype=np.int64)
        for start in range(0, len(directions), MAX_DIRECTIONS):
            part = directions[start : start + MAX_DIRECTIONS]
            lowest = (part @ self.equilibria.radii.T).argmax(axis=1)
            facets, _ = slide(self.equilibria, lowest, part, np.zeros(len(part)))
            rests[start : start + MAX_DIRECTIONS] = self.basin_of_facet[facets]
        return rests

    @cached_property
    def basin_of_facet(self) -> Integers:
        """(m',) the rest to which each facet of the classified hull rolls."""
        place = np.full(int(self.facet.max()) + 1, -1, dtype=np.int64)
        place[self.rest_facets] = np.arange(len(self.rest_facets))
        facets = np.arange(len(self.facet))
        return place[self.facet[trace_to_rests(self.equilibria, facets)]]


@dataclass(frozen=True, eq=False)
class RestPoses:
    """All rests of a body, the most probable first. Further properties are computed on first use.

    Attributes
    ----------
    hull: the convex hull of the body.
    probabilities: (k,) summing to 1.
    facets: (k,) facet numbers in `hull`.
    center_of_mass: (3,) and the source it came from in words.
    notes: what was repaired or assumed on the way.
    seconds: wall-clock seconds spent on "hull" and on "rest".
    basins: of the body, or, if it is tied, of bodies beside it (`find_basins`).
    prior: distribution of the initial orientations; None where all are equally likely.
    errors: (k,) estimated errors of the probabilities under a prior; None without one, where they
        are exact to rounding.
    """

    hull: ConvexHull
    probabilities: Floats
    facets: Integers
    center_of_mass: Floats
    center_of_mass_source: str
    notes: tuple[str, ...]
    seconds: dict[str, float]
    basins: tuple[Basins, ...]
    prior: Prior | None = None
    errors: Floats | None = None

    def __repr__(self) -> str:
        return f"<RestPoses: {len(self.probabilities)} rests, {self.probabilities}>"

    def _repr_html_(self) -> str:
        """HTML of the hull to turn and a table of the rests, for notebooks."""
        from dicedesign.notebook import solid_and_table

        rests = range(len(self.probabilities))
        margins = np.degrees(self.margins)
        return solid_and_table(
            (self.hull.vertices, self.hull.triangles),
            self.normals,
            rests,
            f"{len(rests)} resting poses",
            ("rest", "probability", "margin"),
            [(f"{k}", f"{self.probabilities[k]:.4%}", f"{margins[k]:.1f}°") for k in rests],
        )

    def under(self, prior: Prior | str | None) -> RestPoses:
        """Rests with their probabilities under a prior, the most probable first. A rest whose
        basin the prior excludes stays, with probability 0.

        prior: such as `VonMisesFisher([0, 0, -1], 5.0)` or the text "vmf:0,0,-1:5", see `PRIORS`;
        its directions are those that point down in the body's frame. None for uniform directions.

        Raises
        ------
        InputError: the prior cannot be read, or is none.
        """
        if prior is None:
            if self.prior is None:
                return self
            areas = self.mean_of_sides(self.basins, [side.areas for side in self.basins])
            return self._with_probabilities(None, areas / (4.0 * np.pi), None)
        # Imported late: most queries do not need it.
        from dicedesign.rest.prior import prior_of

        prior = prior_of(prior)
        estimates = [prior.probabilities(side) for side in self.basins]
        probabilities = self.mean_of_sides(self.basins, [each.probabilities for each in estimates])
        errors = self.mean_of_sides(self.basins, [each.errors for each in estimates])
        return self._with_probabilities(prior, probabilities, errors)

    def mean_of_sides(self, sides: tuple[Basins, ...], values: list[Floats]) -> Floats:
        """(k,) sums of values over the facets that a rest stands on, of which each side has one
        (r,) for each of its own rests; the mean of the sides."""
        of_facet = np.zeros(len(self.hull.normals))
        for side, own in zip(sides, values, strict=True):
            np.add.at(of_facet, merged_rests(self.hull, side), own)
        mean: Floats = of_facet[self.facets] / len(values)
        return mean

    def _with_probabilities(
        self, prior: Prior | None, probabilities: Floats, errors: Floats | None
    ) -> RestPoses:
        order = np.argsort(-probabilities, kind="stable")
        return replace(
            self,
            probabilities=probabilities[order],
            facets=self.facets[order],
            prior=prior,
            errors=None if errors is None else errors[order],
        )

    @cached_property
    def normals(self) -> Floats:
        """(k, 3) outward unit normals of the stable facets: the direction that points down."""
        return self.hull.normals[self.facets]

    @cached_property
    def areas(self) -> Floats:
        """(k,) areas of the stable facets, in squared length units."""
        return self.hull.areas[self.facets]

    @cached_property
    def margins(self) -> Floats:
        """(k,) angle in radians from the facet normal to the nearest saddle of its basin; pi for a
        body with one rest."""
        margins = np.full(len(self.facets), np.pi)
        for basin in self.morse.saddle_basins.T:
            angles = angle_between(self.normals[basin], self.morse.saddles)
            np.minimum.at(margins, basin, angles)
        return margins

    @cached_property
    def morse(self) -> MorseComplex:
        """The Morse-Smale complex; for a tied body, of one side."""
        side = self.basins[0]
        place = np.full(len(self.hull.normals), -1, dtype=np.int64)
        place[self.facets] = np.arange(len(self.facets))
        basins = place[merged_rests(self.hull, side)][side.paths.basins]
        # What divides facets that are shown as one divides no rests.
        divides = basins[:, 0] != basins[:, 1]
        unit = unit_vectors(side.points[np.repeat(divides, 2)])
        radii, finer = side.equilibria.radii, self.hull.finer
        facet = np.arange(len(self.hull.normals))
        if finer is not None and side.equilibria.hull is not self.hull:
            facet = finer.facet
        return MorseComplex(
            minima=self.normals,
            saddles=unit[::2, 0],
            saddle_basins=basins[divides],
            maxima=unit_vectors(radii[side.equilibria.maximum]),
            branches=unit,
            # A balance that no basin depends on must not stop bodies from rolling.
            equilibria=replace(side.equilibria, tie_distance=0.0),
            rest_facets=self.facets,
            facet=facet,
        )

    def with_flat_facets(self) -> RestPoses:
        """These rests with the basins of the hull as it is shown, whose facets are flat; or as they
        are, where that hull has other rests or is warped. What looks at edges, as models and
        simulations of throws, takes bends by the rounding of a file for ridges."""
        hull = self.hull
        if hull.finer is None or hull.warp > WARP_TOLERANCE:
            return self
        flat = find_basins(hull, self.center_of_mass)
        rests = np.concatenate([side.paths.rests for side in flat])
        is_same = np.array_equal(np.unique(rests), np.sort(self.facets))
        return replace(self, basins=flat) if is_same and flat[0].equilibria.hull is hull else self

    @cached_property
    def transforms(self) -> Floats:
        """(k, 4, 4) rigid motions that stand the body on the plane z = 0 with the center of mass on
        the z axis."""
        return self.stand_on(self.facets)

    def stand_on(self, facets: Integers) -> Floats:
        """(n, 4, 4) `transforms` onto any facets (n,) of the hull, stable or not."""
        heights = self.hull.heights(self.center_of_mass)[facets]
        return standing_transforms(self.hull.normals[facets], heights, self.center_of_mass)

    def sample(self, n: int, rng: Seed = None) -> SampledPoses:
        """Draw n poses by their probabilities, with random headings.

        rng: a seed, a `numpy.random.Generator` to draw from, or None for other poses every time.
        Raises InputError: `n` is not a whole number of at least 0, or `rng` is none of these.
        """
        if isinstance(n, bool) or not isinstance(n, int | np.integer) or not 0 <= n <= MOST_COUNT:
            raise InputError(
                f"n: expected a whole number from 0 to {MOST_COUNT}, got {n!r}; ask for others"
            )
        chance = generator_of(rng)
        # One random number for each draw, searched in the sums of probabilities.
        ends = np.cumsum(self.probabilities)
        rests = np.searchsorted(ends, ends[-1] * chance.random(n), side="right")
        rests = np.minimum(rests, len(ends) - 1).astype(np.int64)
        angles = 2.0 * math.pi * chance.random(n)
        cosines, sines = np.cos(angles), np.sin(angles)
        turns = np.tile(np.eye(4), (n, 1, 1))
        turns[:, :2, :2] = np.array([(cosines, -sines), (sines, cosines)]).transpose(2, 0, 1)
        return SampledPoses(turns @ self.transforms[rests], rests)


def standing_transforms(normals: Floats, heights: Floats | float, center_of_mass: Floats) -> Floats:
    """Rigid motions (..., 4, 4) that turn unit `normals` (..., 3) down by the smallest rotation and
    put the center of mass on the z axis at `heights` (...)."""
    transforms = np.zeros((*normals.shape[:-1], 4, 4))
    transforms[..., :3, :3] = turns_down(normals)
    transforms[..., :3, 3] = -transforms[..., :3, :3] @ center_of_mass
    transforms[..., 2, 3] += heights
    transforms[..., 3, 3] = 1.0
    return transforms


def mass_properties(body: Body, poses: RestPoses) -> MassProperties:
    """Mass properties of a body: its own, or those of density 1 of its uniform solid about its own
    centroid; of the uniform hull if it bounds no solid or has the hull's center of mass.

    poses: its rests. Raises DegenerateBodyError if the mesh is closed and encloses no volume.
    """
    is_hull = poses.center_of_mass_source == "uniform solid hull"
    if body.mass_properties is not None and not is_hull:
        return body.mass_properties
    closed = None if is_hull else solid_triangles(body)
    surface = poses.hull.surface if closed is None else Surface(body.points, closed[0])
    volume, extent = surface.volume, float(np.ptp(surface.points, axis=0).max())
    if closed is not None and abs(volume) <= VOLUME_TOLERANCE * extent**3:
        raise DegenerateBodyError(
            f"{body.name}: expected a closed mesh that encloses a volume, got {volume:.3g} at an "
            f"extent of {extent:.3g}; repair the mesh"
        )
    volume = abs(volume)
    return MassProperties(volume, surface.centroid, surface.inertia, "uniform solid", volume)


def rest_poses(
    points_or_mesh: ArrayLike | Body | Surface,
    center_of_mass: ArrayLike | Literal["hull"] | None = None,
    *,
    coplanar_tolerance: float | None = None,
) -> RestPoses:
    """All rests of a body with their probabilities.

    Parameters
    ----------
    points_or_mesh: (n, 3) points in any length unit, a `Body` or `Surface`, or any mesh object with
        `vertices` (n, 3) and triangular `faces` (t, 3), such as a `trimesh.Trimesh`.
    center_of_mass: (3,) in the unit of the points, strictly inside the convex hull; "hull" for the
        center of the uniform solid hull; None for the center of a body of several densities, of the
        uniform solid bounded by a closed mesh, or of the hull for points and open meshes.
    coplanar_tolerance: see `convex_hull`.

    Raises
    ------
    DegenerateBodyError: fewer than 4 points, coplanar points, NaN or infinity, zero volume.
    OutsideHullError: the center of mass is not strictly inside the hull.
    InputError: `center_of_mass` is not three finite numbers.
    """
    body = body_of(points_or_mesh)
    started = time.perf_counter()
    try:
        hull = convex_hull(body.points, coplanar_tolerance, single_precision=body.single_precision)
    except DegenerateBodyError as error:
        said = str(error).removeprefix("points: ")
        raise DegenerateBodyError(f"{body.name}: {said}") from error
    hull_seconds = time.perf_counter() - started
    center, source, notes = resolve_center_of_mass(body, hull.centroid, center_of_mass)
    _, step = hull_precision(body.single_precision)
    step *= float(np.abs(hull.vertices[0]).max())
    # The extent is at least this.
    if step > NOTED_ROUNDING * float(np.abs(hull.vertices[0] - hull.centroid).max()):
        part = step / float(np.ptp(hull.vertices, axis=0).max())
        if part > NOTED_ROUNDING:
            notes = (
                *notes,
                f"far from the origin: coordinates are rounded to {part:.1g} of the body's extent, "
                "which bends facets; the rests are those of the body as it is in the file; move it "
                "to the origin before it is rounded",
            )
    notes = (*body.notes, *loose_part_notes(body, hull.source), *notes)
    return analyze(hull, center, source, notes, hull_seconds)


def analyze(
    hull: ConvexHull,
    center_of_mass: Floats,
    center_of_mass_source: str = "given",
    notes: tuple[str, ...] = (),
    hull_seconds: float = 0.0,
) -> RestPoses:
    """All rests of a hull with a center of mass (3,) strictly inside it. Raises as `rest_poses`.

    A body that balances somewhere to within rounding has the mean of the probabilities with its
    center of mass moved slightly to either side (`find_basins`), and the Morse complex of one side.
    `find_basins` also says when no facets are merged after all. Rests on facets that are shown as
    one are one rest.
    """
    started = time.perf_counter()
    shown, sides = rest_basins(hull, center_of_mass)
    if shown is not hull:
        hull, notes = shown, (*notes, UNEVEN)
    facets, areas, tied = _combine_sides(hull, sides)
    order = np.argsort(-areas, kind="stable")
    return RestPoses(
        hull=hull,
        probabilities=areas[order] / (4.0 * np.pi),
        facets=facets[order],
        center_of_mass=center_of_mass,
        center_of_mass_source=center_of_mass_source,
        notes=(*notes, TIED) if tied else notes,
        seconds={"hull": hull_seconds, "rest": time.perf_counter() - started},
        basins=sides,
    )


def _combine_sides(hull: ConvexHull, sides: tuple[Basins, ...]) -> tuple[Integers, Floats, bool]:
    """Facets (k,) that a body rests on, the mean areas (k,) of their basins, and whether the sides
    differ."""
    if len(sides) == 1 and hull.finer is None:
        return sides[0].paths.rests, sides[0].areas, False
    areas = np.zeros((len(sides), len(hull.normals)))
    for row, side in zip(areas, sides, strict=True):
        np.add.at(row, merged_rests(hull, side), side.areas)
    mean = areas.mean(axis=0)
    facets = np.flatnonzero(mean)
    return facets, mean[facets], bool(np.ptp(areas, axis=0).max() > CLOSURE_TOLERANCE)
