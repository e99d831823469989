"""The closed surface of one solid from any triangles, with a limited number of points.

The solid is the set of points with a winding number above one half.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from dicedesign.errors import DegenerateBodyError, InputError, missing_extra
from dicedesign.geometry.meshes.body import Body, distinct_triangles, outward_patches, shells_of
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.surfaces.closed_surface import decimate, make_surface, one_shell, thin
from dicedesign.geometry.surfaces.grid_surface import (
    smooth_mesh,
    surface_nets,
    untangle,
    without_double_cuts,
)
from dicedesign.geometry.triangles import Surface, doubled_area_vectors, edge_keys, surface_of
from dicedesign.results.parts import Repair
from dicedesign.runtime.arrays import Booleans, Floats, Integers, sums_by_index


class Soup:
    """Triangles (t, 3) between points (n, 3), for queries by libigl."""

    def __init__(self, points: Floats, triangles: Integers) -> None:
        """Raises InputError without the extra `repair`."""
        try:
            import igl
        except ImportError as error:
            raise missing_extra("repair", "repair", error) from error
        self._igl: Any = igl
        self.points = np.ascontiguousarray(points, dtype=np.float64)
        self.triangles = np.ascontiguousarray(triangles, dtype=np.int64)
        self._tree = igl.AABB()
        self._tree.init(self.points, self.triangles)

    @property
    def area(self) -> float:
        """Area of all triangles."""
        return float(norms(doubled_area_vectors(self.points, self.triangles)).sum()) / 2.0

    def turns(self, places: Floats) -> Floats:
        """(k,) winding numbers around places (k, 3)."""
        queries = np.ascontiguousarray(places)
        return np.asarray(self._igl.fast_winding_number(self.points, self.triangles, queries))

    def closest(self, places: Floats) -> Floats:
        """(k, 3) the points of the triangles that are closest to places (k, 3)."""
        queries = np.ascontiguousarray(places)
        if len(queries) == 0:
            return queries
        return np.asarray(self._tree.squared_distance(self.points, self.triangles, queries)[2])

    def pieces(self, longest: float) -> Floats:
        """(p, 3, 3) corners of the triangles, cut in halves until no edge is longer than that."""
        corners, done = self.points[self.triangles], []
        while len(corners):
            lengths = norms(np.roll(corners, -1, axis=1) - corners)
            long = lengths.max(axis=1) > longest
            done.append(corners[~long])
            start = lengths[long].argmax(axis=1)
            rows = np.arange(len(start))
            a, b, c = (corners[long][rows, (start + k) % 3] for k in range(3))
            middle = (a + b) / 2.0
            corners = np.concatenate(
                [np.stack(t, axis=1) for t in ((a, middle, c), (middle, b, c))]
            )
        return np.concatenate(done)


HALF: Final = 0.5
"""Winding number of a point from which on it is inside."""

HALVINGS: Final = 5
"""Bisections that locate the surface on an edge of the grid or a line of that length."""

ROUNDS: Final = 3
"""Rounds of moving points and flipping edges."""

REACH: Final = 0.5
"""Distance, in cells, within which the surface is looked for."""

BESIDE: Final = 0.02
"""Distance from a triangle, in cells, at which both of its sides are tested for being inside."""

BORDER: Final = 2.5
"""Cells of the grid beyond the box on each side, not whole, so that flat faces along the box are
between nodes."""

THIN: Final = 1.0
"""Thickness in cells below which a part is thin, as nodes of the grid may miss it."""

THICKENING: Final = 0.6
"""Cells by which a thin part is thickened on each side, so that nodes cannot miss it."""

PIECES: Final = 2.0
"""Longest edge, in cells, of the pieces into which triangles are cut to be tested for thinness."""


class WoundSolid:
    """All places with a winding number above one half, and those beside thin parts.

    The winding number is an integer where the triangles close, grows with each shell around a
    place, and changes smoothly across a hole: so holes are covered, shells are joined, and walls
    inside vanish.

    Attributes
    ----------
    soup: the triangles, consistently oriented.
    cell: side of the grid's cells.

    Source: Barill et al., Fast winding numbers for soups and clouds (2018).
    """

    def __init__(self, points: Floats, triangles: Integers, cells: int) -> None:
        """points: (n, 3) in a box of about 1; triangles: (t, 3); cells: of a grid, along the
        longest side. Raises InputError without the extra `repair`."""
        self.soup = Soup(points, outward_patches(points, triangles))
        self.cell = float(np.ptp(points, axis=0).max()) / cells
        self._thin: Soup | None = None
        self._thin = self._thin_parts()

    @property
    def thin_area(self) -> float:
        """Area of the triangles over thin parts."""
        return 0.0 if self._thin is None else self._thin.area

    def holds(self, places: Floats) -> Booleans:
        """(k,) whether places (k, 3) are inside."""
        return np.asarray(self._depths(places) > 0.0)

    def surfaces(self, shift: float) -> tuple[Floats, Integers]:
        """Points and triangles of all surfaces of the solid, to the accuracy of the grid.

        shift: of the grid, in cells. No two sheets are joined at a point or an edge; there are none
        where no node is inside.
        """
        origin = self.soup.points.min(axis=0) - (BORDER + shift) * self.cell
        counts = np.ceil(np.ptp(self.soup.points, axis=0) / self.cell).astype(np.int64) + 7
        nodes = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1)
        values = np.full(counts, -HALF)
        # Shells that are open on one side may wind around places beyond it: there it ends.
        within = (slice(1, -1),) * 3
        places = origin + self.cell * nodes[within].reshape(-1, 3)
        values[within] = self._depths(places).reshape(counts - 2)
        inside = without_double_cuts(values)

        def crossing(nodes: Integers, ahead: Integers) -> Floats:
            leaves = inside[tuple(nodes.T)][:, None]
            return self._between(
                origin + self.cell * np.where(leaves, nodes, ahead),
                origin + self.cell * np.where(leaves, ahead, nodes),
            )

        return surface_nets(inside, crossing)

    def _depths(self, places: Floats) -> Floats:
        """(k,) values of places (k, 3), above 0 inside, and growing toward the solid outside."""
        depths = self.soup.turns(places) - HALF
        if self._thin is not None:
            outer = np.flatnonzero(depths <= 0.0)
            near = norms(self._thin.closest(places[outer]) - places[outer])
            depths[outer[near < THICKENING * self.cell]] = HALF
        return depths

    def _thin_parts(self) -> Soup | None:
        """Pieces of the triangles where the solid beneath is thinner than `THIN`."""
        corners = self.soup.pieces(PIECES * self.cell)
        flat = corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)
        vectors = doubled_area_vectors(*flat)
        normals = vectors / norms(vectors)[:, None].clip(np.finfo(float).tiny)
        middles = corners.mean(axis=1)
        outer = self._parts(middles, BESIDE * self.cell * normals)
        thin = np.flatnonzero(outer)
        thin = thin[~self.holds(middles[thin] - THIN * self.cell * normals[thin])]
        return Soup(flat[0], flat[1][thin]) if len(thin) else None

    def onto(self, points: Floats, triangles: Integers) -> Floats:
        """Points moved to the closest triangle between inside and outside; where none is near, to
        the surface along the normal, if it is within `REACH`."""
        vectors = doubled_area_vectors(points, triangles).repeat(3, axis=0)
        normals = sums_by_index(triangles.ravel(), vectors, len(points))
        normals /= norms(normals)[:, None].clip(np.finfo(float).tiny)
        moved = self.soup.closest(points)
        near = norms(moved - points) <= REACH * self.cell
        near[near] = self._parts(moved[near], BESIDE * self.cell * normals[near])
        far = np.flatnonzero(~near)
        moved[far] = points[far]
        reach = REACH * self.cell * normals[far]
        parted = self._parts(points[far], reach)
        far, reach = far[parted], reach[parted]
        moved[far] = self._between(points[far] - reach, points[far] + reach)
        return moved

    def _parts(self, points: Floats, reach: Floats) -> Booleans:
        """(k,) whether the surface is within a reach (k, 3) inward and outward of points (k, 3)."""
        return self.holds(points - reach) & ~self.holds(points + reach)

    def _between(self, inner: Floats, outer: Floats) -> Floats:
        """(k, 3) points of the surface between one inside and one outside."""
        for _ in range(HALVINGS):
            middle = (inner + outer) / 2.0
            held = self.holds(middle)[:, None]
            inner, outer = np.where(held, middle, inner), np.where(held, outer, middle)
        return (inner + outer) / 2.0


GRIDS: Final = ((100, 0.0), (100, 0.25), (80, 0.0), (64, 0.25))
"""Cells along the longest side and the grid's shift, in cells, tried in turn until a surface does
not meet itself."""

MOST_TRIANGLES: Final = 100_000
"""Most triangles of a repair; more are decimated first."""

SAMPLES: Final = 20_000
"""Random points on a surface for measuring distances."""

SEED: Final = 0
"""Seed of these points."""

SHEETS: Final = 0.5
"""Largest area share of sheets with no solid on either side."""

REPORTED_SHARE: Final = 5e-3
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
    InputError: the body is a point cloud; the extra `repair` is not installed; every surface meets
        itself.
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
    low, extent = points.min(axis=0), float(np.ptp(points, axis=0).max())
    distinct = distinct_triangles(triangles)
    if len(distinct) < len(triangles):
        notes += (f"left {len(triangles) - len(distinct)} repeated triangles out",)
    for cells, shift in GRIDS:
        solid = WoundSolid((points - low) / extent, distinct, cells)
        solid_surface, joined = solid.surfaces(shift)
        if len(joined) == 0:
            raise _nothing_inside(body)
        shell = shells_of(joined)
        a, b, c = (solid_surface[joined] - solid_surface.mean(axis=0)).transpose(1, 0, 2)
        volumes = np.bincount(shell, (a * np.linalg.cross(b, c)).sum(axis=1) / 6.0)
        solids = volumes[volumes > 0.0]
        # The surface of the largest solid without its cavities.
        largest = surface_of(solid_surface, joined[shell == volumes.argmax()])
        even = untangle(
            Surface(*smooth_mesh(largest.points, largest.triangles, solid.onto, ROUNDS))
        )
        if even is None:
            continue
        numbers = _compare(
            solid,
            even,
            body.triangles,
            cells=cells,
            pieces=len(solids),
            dropped=1.0 - float(solids.max() / solids.sum()),
            cavities=len(volumes) - len(solids),
        )
        if numbers.sheets > SHEETS:
            raise _nothing_inside(body)
        surface = even.with_points(low + extent * even.points)
        return RepairedMesh(
            points, solid.soup.triangles, surface, numbers, notes + _sentences(numbers, surface)
        )
    raise InputError(
        f"{body.name}: expected triangles whose solid has a surface that does not meet itself, got "
        f"none on {len(GRIDS)} grids; take the mesh apart, or repair it in a modeling program"
    )


def _nothing_inside(body: Body) -> DegenerateBodyError:
    return DegenerateBodyError(
        f"{body.name}: expected triangles that enclose a solid, got sheets, open or thinner than "
        f"1/{GRIDS[0][0]} of the longest side; give them a thickness (Solidify in Blender) or "
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
    """Comparison of a repaired surface, in the coordinates of the solid, with the input triangles;
    counted: further fields of `Repair`."""
    diagonal = float(norms(np.ptp(solid.soup.points, axis=0)))
    ours, _ = _sample_points(surface.points, surface.triangles)
    off = norms(solid.soup.closest(ours) - ours) / diagonal
    theirs, normals = _sample_points(solid.soup.points, solid.soup.triangles)
    beside = BESIDE * solid.cell * normals
    above, below = (solid.soup.turns(theirs + way * beside) > HALF for way in (1.0, -1.0))
    outer = theirs[~(above & below)]
    missed = norms(Soup(surface.points, surface.triangles).closest(outer) - outer) / diagonal
    closed = (np.unique(edge_keys(triangles), return_counts=True)[1] == 2).all()
    euler = len(np.unique(triangles)) - len(triangles) // 2
    return Repair(
        **counted,
        # Of shells in which each edge is of two triangles.
        handles_before=int(shells_of(triangles).max()) + 1 - euler // 2 if closed else None,
        handles=1 - (len(surface.points) - len(surface.triangles) // 2) // 2,
        off_mean=float(off.mean()),
        off_largest=float(off.max()),
        missed_mean=float(missed.mean()),
        missed_largest=float(missed.max()),
        thin=solid.thin_area / solid.soup.area,
        sheets=float((~above & ~below).mean()),
    )


def _sentences(numbers: Repair, surface: Surface) -> tuple[str, ...]:
    before = "" if numbers.handles_before is None else f", {numbers.handles_before} before"
    sentences = [
        f"repaired the mesh: the surface of the solid that its triangles enclose, on a grid of "
        f"{numbers.cells} cells along the longest side, has {len(surface.points)} points and "
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
            f"{_percent(numbers.thin)} of the area is over parts thinner than 1/{numbers.cells} of "
            "the longest side, which were thickened to about that"
        )
    if numbers.sheets > REPORTED_SHARE:
        sentences.append(
            f"{_percent(numbers.sheets)} of the area are sheets that enclose nothing and are gone"
        )
    return tuple(sentences)


def _percent(part: float) -> str:
    return f"{100.0 * part:.2g} %"


MOST_POINTS: Final = 20_000
"""Default number of points to which a surface is decimated."""

FINEST: Final = 60_000
"""Number of points to which a surface is decimated that is written as it is or decimated again."""

FIRST: Final = 2
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
    repair: whether to repair a mesh that does not bound one solid (`repair_mesh`).

    Returns
    -------
    The surface; what was done, one sentence each; and the repair, where one was made.

    Raises
    ------
    InputError, DegenerateBodyError: as `make_surface`, or, to be repaired, as `repair_mesh`; the
        extra `concave` is not installed and the mesh is larger; no decimation gives a good surface.
    """
    repaired = None
    try:
        surface, notes = _take_as_is(body, points)
    except InputError:
        if not repair:
            raise
        repaired = repair_mesh(body)
        surface, notes = repaired.surface, repaired.notes
    else:
        if repair:
            notes += ("the mesh needed no repair",)
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
