"""The closed surface of one solid from any triangles, with a limited number of points.

The solid is the set of points with a winding number above one half.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from dicedesign.errors import DegenerateBodyError, InputError
from dicedesign.geometry.meshes.body import Body, distinct_triangles, outward_patches, shells_of
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.surfaces.closed_surface import decimate, make_surface, one_shell, thin
from dicedesign.geometry.surfaces.grid_surface import (
    GridValues,
    distances_from_surface,
    winding_numbers,
)
from dicedesign.geometry.surfaces.holes import fill_holes
from dicedesign.geometry.triangles import Surface, doubled_area_vectors, edge_keys, surface_of
from dicedesign.results.parts import Repair
from dicedesign.runtime.arrays import Floats, Integers

CELLS = 75
"""Grid steps along the longest side."""

HALF = 0.5
"""Winding number of a point from which on it is inside."""

WINDING_CELLS = 2.0
"""Depth in grid steps that a winding number of one more counts as, where no triangle is nearer."""

BESIDE = 0.02
"""Distance from a triangle, in grid steps, at which both of its sides are tested for being
inside."""

BORDERS = (2.13, 2.41)
"""Grid steps beyond the box on its low and high sides, such that no nodes are on faces along the
axes, where it is chance whether they are inside."""

THIN = 0.01
"""Thickness over the longest side below which a part is thin, as nodes of the grid may miss it."""

THICKENING = 0.5
"""Grid steps by which a thin part is thickened on each side, so that nodes cannot miss it."""

PIECES = 2.0
"""Longest edge, in grid steps, of the pieces into which triangles are cut to be tested for
thinness."""


class WoundSolid:
    """All places with a winding number above one half, and those beside thin parts.

    The winding number is an integer where the triangles close, grows with each shell around a
    place, and changes smoothly across a hole: so holes are covered, shells are joined, and walls
    inside vanish.

    Attributes
    ----------
    triangles: surface of the triangles, consistently oriented, not necessarily closed.
    spacing: of the grid.
    thin: pieces of the triangles where the solid beneath is thinner than `THIN`.
    """

    def __init__(self, points: Floats, triangles: Integers) -> None:
        """points: (n, 3); triangles: (t, 3)."""
        self.triangles = Surface(points, outward_patches(points, triangles))
        self.spacing = float(np.ptp(points, axis=0).max()) / CELLS
        self.thin = Surface(points, triangles[:0])
        self.thin = self._thin_parts()

    def depths(self, places: Floats) -> Floats:
        """(k,) values of places (k, 3), above 0 inside: near the triangles that bound the solid,
        and thin parts, distances in grid steps."""
        excess = WINDING_CELLS * (winding_numbers(self.triangles, places) - HALF)
        near = distances_from_surface(self.triangles, places) / self.spacing
        depths: Floats = np.clip(excess, -near, near)
        if len(self.thin.triangles):
            away = distances_from_surface(self.thin, places) / self.spacing
            depths = np.maximum(depths, THICKENING - away)
        return depths

    def surface(self) -> Surface:
        """All surfaces of the solid, to the accuracy of the grid; no two meet, and there are none
        where no node is inside."""
        points, (below, above) = self.triangles.points, BORDERS
        low = points.min(axis=0) - below * self.spacing
        high = points.max(axis=0) + above * self.spacing
        return GridValues(self.depths, low, high, self.spacing).above(0.0)

    def _thin_parts(self) -> Surface:
        corners = _cut_edges(self.triangles, PIECES * self.spacing)
        pieces = Surface(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
        vectors = doubled_area_vectors(pieces.points, pieces.triangles)
        normals = vectors / norms(vectors)[:, None].clip(np.finfo(float).tiny)
        middles, beside = corners.mean(axis=1), BESIDE * self.spacing * normals
        beneath = THIN * CELLS * self.spacing * normals
        thin = (
            (self.depths(middles - beside) > 0.0)
            & (self.depths(middles + beside) <= 0.0)
            & (self.depths(middles - beneath) <= 0.0)
        )
        return Surface(pieces.points, pieces.triangles[thin])


def _cut_edges(surface: Surface, longest: float) -> Floats:
    """(p, 3, 3) corners of triangles, cut in halves until no edge is longer than a length."""
    corners, done = surface.points[surface.triangles], []
    while len(corners):
        lengths = norms(np.roll(corners, -1, axis=1) - corners)
        long = lengths.max(axis=1) > longest
        done.append(corners[~long])
        start = lengths[long].argmax(axis=1)
        rows = np.arange(len(start))
        a, b, c = (corners[long][rows, (start + k) % 3] for k in range(3))
        middle = (a + b) / 2.0
        corners = np.concatenate([np.stack(t, axis=1) for t in ((a, middle, c), (middle, b, c))])
    return np.concatenate(done)


def _area(surface: Surface) -> float:
    return float(norms(doubled_area_vectors(surface.points, surface.triangles)).sum()) / 2.0


MOST_TRIANGLES = 100_000
"""Most triangles of a repair; more are decimated first."""

SAMPLES = 20_000
"""Random points on a surface for measuring distances."""

SEED = 0
"""Seed of these points."""

SHEETS = 0.5
"""Largest area share of sheets with no solid on either side."""

REPORTED_SHARE = 5e-3
"""Area share from which on sheets and thin parts are reported: some are at every sharp edge."""


@dataclass(frozen=True, eq=False)
class RepairedMesh:
    """Repaired surface of triangles that do not bound one solid.

    Attributes
    ----------
    points, triangles: (n, 3) and (t, 3) of the input, consistently oriented and without repeated
        triangles.
    surface: of one solid.
    numbers: comparison of the two.
    notes: what was done, one sentence each, after the notes of the body.
    """

    points: Floats
    triangles: Integers
    surface: Surface
    numbers: Repair
    notes: tuple[str, ...]


def repair_mesh(body: Body) -> RepairedMesh:
    """The closed surface of the largest solid that the triangles of a body bound.

    What they wind around more than half a turn is solid (`WoundSolid`): holes are covered, shells
    that overlap are joined, walls and cavities inside are filled. Parts thinner than a hundredth of
    the longest side are thickened to about that, and gaps as narrow may close.

    Raises
    ------
    InputError: the body is a point cloud, or is large and the extra `concave` is not installed.
    DegenerateBodyError: the triangles bound no solid, or are mostly sheets.
    """
    if body.triangles is None:
        raise InputError(
            f"{body.name}: expected a triangle mesh to repair, got a point cloud; export the "
            "surface as a mesh"
        )
    notes = body.notes
    points, triangles = body.points, body.triangles
    if len(triangles) > MOST_TRIANGLES:
        points, triangles = thin(points, triangles, MOST_TRIANGLES)
        notes += (
            f"thinned out {len(body.triangles)} triangles to {len(triangles)} before the repair "
            "(fast-simplification)",
        )
    distinct = distinct_triangles(triangles)
    if len(distinct) < len(triangles):
        notes += (f"left {len(triangles) - len(distinct)} repeated triangles out",)
    solid = WoundSolid(points, distinct)
    whole = solid.surface()
    if len(whole.triangles) == 0:
        raise _nothing_inside(body)
    shell = shells_of(whole.triangles)
    a, b, c = (whole.points[whole.triangles] - whole.points.mean(axis=0)).transpose(1, 0, 2)
    volumes = np.bincount(shell, (a * np.linalg.cross(b, c)).sum(axis=1) / 6.0)
    solids = volumes[volumes > 0.0]
    # The surface of the largest solid without its cavities.
    surface = surface_of(whole.points, whole.triangles[shell == volumes.argmax()])
    numbers = _compare(
        solid,
        surface,
        body.triangles,
        pieces=len(solids),
        dropped=1.0 - float(solids.max() / solids.sum()),
        cavities=len(volumes) - len(solids),
    )
    if numbers.sheets > SHEETS:
        raise _nothing_inside(body)
    return RepairedMesh(
        points,
        solid.triangles.triangles,
        surface,
        numbers,
        notes + _sentences(numbers, surface),
    )


def _nothing_inside(body: Body) -> DegenerateBodyError:
    return DegenerateBodyError(
        f"{body.name}: expected triangles that enclose a solid, got sheets, open or thinner than "
        f"{THIN:g} of the longest side; give them a thickness (Solidify in Blender) or "
        "close large holes"
    )


def _sample_points(points: Floats, triangles: Integers) -> tuple[Floats, Floats]:
    """Points drawn evenly on triangles, and their normals, (k, 3) each."""
    rng = np.random.default_rng(SEED)
    vectors = doubled_area_vectors(points, triangles)
    areas = norms(vectors)
    chosen = rng.choice(len(areas), SAMPLES, p=areas / areas.sum())
    weights = rng.dirichlet((1.0, 1.0, 1.0), SAMPLES)
    places = (weights[:, :, None] * points[triangles[chosen]]).sum(axis=1)
    return places, vectors[chosen] / areas[chosen][:, None]


def _compare(solid: WoundSolid, surface: Surface, triangles: Integers, **counted: Any) -> Repair:
    """Comparison of a repaired surface with the input triangles; counted: further fields of
    `Repair`."""
    given = solid.triangles
    ours, _ = _sample_points(surface.points, surface.triangles)
    off = distances_from_surface(given, ours) / given.diagonal
    theirs, normals = _sample_points(given.points, given.triangles)
    beside = BESIDE * solid.spacing * normals
    above, below = (winding_numbers(given, theirs + way * beside) > HALF for way in (1.0, -1.0))
    missed = distances_from_surface(surface, theirs[~(above & below)]) / given.diagonal
    closed = (np.unique(edge_keys(triangles), return_counts=True)[1] == 2).all()
    euler = len(np.unique(triangles)) - len(triangles) // 2
    return Repair(
        **counted,
        cells=CELLS,
        # Of shells in which each edge is of two triangles.
        handles_before=int(shells_of(triangles).max()) + 1 - euler // 2 if closed else None,
        handles=1 - (len(surface.points) - len(surface.triangles) // 2) // 2,
        off_mean=float(off.mean()),
        off_largest=float(off.max()),
        missed_mean=float(missed.mean()),
        missed_largest=float(missed.max()),
        thin=_area(solid.thin) / _area(given),
        sheets=float((~above & ~below).mean()),
    )


def _sentences(numbers: Repair, surface: Surface) -> tuple[str, ...]:
    before = "" if numbers.handles_before is None else f", {numbers.handles_before} before"
    sentences = [
        f"repaired the mesh: the surface of the solid that its triangles enclose, on a grid of "
        f"{numbers.cells} steps along the longest side, has {len(surface.points)} points and "
        f"{numbers.handles} handle{'' if numbers.handles == 1 else 's'}{before}",
        f"the repaired surface is {_percent(numbers.off_mean)} of the diagonal from the triangles "
        f"on average and {_percent(numbers.off_largest)} at most, these from it "
        f"{_percent(numbers.missed_mean)} and {_percent(numbers.missed_largest)}",
    ]
    if numbers.pieces > 1:
        sentences.append(
            f"kept the largest of {numbers.pieces} pieces and dropped "
            f"{_percent(numbers.dropped)} of the volume; pieces that overlap are kept as one"
        )
    if numbers.cavities:
        sentences.append(
            f"filled {numbers.cavities} {'cavity' if numbers.cavities == 1 else 'cavities'}"
        )
    if numbers.thin > REPORTED_SHARE:
        sentences.append(
            f"{_percent(numbers.thin)} of the area is over parts thinner than {THIN:g} of "
            "the longest side, which were thickened to about that"
        )
    if numbers.sheets > REPORTED_SHARE:
        sentences.append(
            f"{_percent(numbers.sheets)} of the area are sheets that enclose nothing and are gone"
        )
    return tuple(sentences)


def _percent(part: float) -> str:
    return f"{100.0 * part:.2g} %"


MOST_POINTS = 20_000
"""Default number of points to which a surface is decimated."""

FINEST = 60_000
"""Number of points to which a surface is decimated that is written as it is or decimated again."""

FIRST = 2
"""Factor of the wanted points to which a large mesh is thinned before the search for triangles that
meet."""


def input_surface(
    body: Body, points: int = MOST_POINTS, *, repair: bool = False
) -> tuple[Surface, tuple[str, ...], RepairedMesh | None]:
    """Closed surface of one solid, with at most a number of points.

    Larger meshes are decimated before anything slow is done.

    Parameters
    ----------
    body: a mesh of any size.
    points: most of them, at least 4.
    repair: whether to repair a mesh that does not bound one solid, by `fill_holes` if that is
        enough, or else by `repair_mesh`.

    Returns
    -------
    The surface; what was done, one sentence each; and the repair by `repair_mesh`, if any.

    Raises
    ------
    InputError, DegenerateBodyError: as `make_surface`, or, to be repaired, as `repair_mesh`; the
        extra `concave` is not installed and the mesh is larger; no decimation gives a good surface.
    """
    repaired = None
    try:
        surface, notes = _take_as_is(body, points)
        if repair:
            notes += ("the mesh needed no repair",)
    except InputError:
        if not repair:
            raise
        filled = fill_holes(body)
        try:
            if filled is None:
                raise
            surface, notes = _take_as_is(filled, points)
        except InputError:
            repaired = repair_mesh(body)
            surface, notes = repaired.surface, repaired.notes
    if len(surface.points) > points:
        surface, note = decimate(surface, points)
        notes += (note,)
    return surface, notes, repaired


def _take_as_is(body: Body, points: int) -> tuple[Surface, tuple[str, ...]]:
    """The surface of a body that needs no repair, thinned out where it is large."""
    most = FIRST * points
    if len(body.points) <= most:
        return make_surface(body)
    surface, notes = one_shell(body)
    fewer = Body(*thin(surface.points, surface.triangles, 2 * most), body.name, False, ())
    try:
        thinned, more = make_surface(fewer)
    except InputError:
        # The thinning alone may be the cause: the mesh itself is tested, which takes longer.
        return make_surface(body)
    return thinned, (
        *notes,
        f"thinned out the surface from {len(surface.points)} to {len(thinned.points)} points "
        "(fast-simplification)",
        *more,
    )
