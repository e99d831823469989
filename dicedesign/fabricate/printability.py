"""Printability of a die: features that its printer cannot make, and its best orientation on the
bed.

Lengths are in millimeters.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, compress
from typing import TYPE_CHECKING

import numpy as np

from dicedesign.fabricate.finish_options import EngravingOptions
from dicedesign.fabricate.printers import Printer, PrintOptions
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.hulls.polygons import facet_inradius
from dicedesign.geometry.sphere import norms, rigid_motion, rotation_between
from dicedesign.geometry.surfaces.self_intersections import intersecting_triangles
from dicedesign.geometry.triangles import (
    Surface,
    doubled_area_vectors,
    edge_neighbors,
    find_parts,
    solid_properties,
)
from dicedesign.rest.poses import RestPoses
from dicedesign.results.print_parts import (
    FileCheck,
    Printability,
    PrintedLabel,
    PrintPose,
    SmallestFacet,
    ThinParts,
)
from dicedesign.runtime.arrays import Booleans, Floats, Integers

if TYPE_CHECKING:
    from manifold3d import CrossSection, Manifold

    from dicedesign.fabricate.label_layout import Placement

ON_BED = 1e-3
"""Height in mm up to which a triangle touches the bed: less than a hundredth of a layer."""

LOW = 2.0
"""Number of layers above the bed that need no supports: the feet of rounded edges."""

LEVEL = 1e-6
"""Tolerance of cosines of angles."""

ALMOST_DEG = 0.5
"""Tolerance of a printer's angle limit: facets designed at 45 degrees are slightly off after they
were moved."""

FOOTING = 0.2
"""Least diameter of the largest circle in a facet, over the height of the die on it, for the die to
hold to the bed: a rule of thumb."""

SURFACE = 1e-3
"""Least depth in mm below the hull of the plain die at which a triangle belongs to a pocket."""

THIN = 1e-4
"""Width in mm below which a triangle is a line to any printer. Single precision may fold it onto
its neighbors, so its intersections are not counted."""

MOST_LARGER = 3.0
"""Largest factor of the size that a warning about thin parts recommends."""


@dataclass(frozen=True, eq=False)
class PrintedSolid:
    """A die to be printed.

    Attributes
    ----------
    points: (n, 3); triangles: (t, 3) counter-clockwise seen from outside.
    hull: of a convex die without labels, else None: triangles deeper than it belong to pockets,
        which need no supports: their ledges are no longer than they are deep, and their floors are
        bridged.
    labels: k texts; normals: (k, 3) outward normals of the surface at them.
    """

    points: Floats
    triangles: Integers
    hull: ConvexHull | None
    labels: Sequence[str]
    normals: Floats

    def poses(self, downs: Floats, printer: Printer) -> list[PrintPose]:
        """Measures of the die on the bed for unit directions (d, 3) that point to the bed."""
        heights = self._heights(downs)
        hangs, areas = self.overhanging(downs, printer), self._areas
        contacts = areas @ (heights.max(axis=1) < ON_BED)
        overhangs = areas @ hangs
        supports = areas @ (hangs * (self._units @ downs.T) * heights.mean(axis=1))
        toward = self.normals @ downs.T
        spoiled = toward > min(_limit(printer), 1.0 - LEVEL)
        return [
            PrintPose(
                label=", ".join(compress(self.labels, toward[:, k] > 1.0 - LEVEL)) or None,
                normal=tuple(down.tolist()),
                contact_mm2=float(contacts[k]),
                height_mm=float(heights[:, :, k].max()),
                overhang_mm2=float(overhangs[k]),
                support_mm3=float(supports[k]),
                spoiled=tuple(compress(self.labels, spoiled[:, k])),
            )
            for k, down in enumerate(downs)
        ]

    def overhanging(self, downs: Floats, printer: Printer) -> Booleans:
        """(t, d) whether a triangle needs supports when a unit direction (d, 3) points to the bed:
        it faces down too nearly level, and belongs neither to a pocket nor to the lowest `LOW`
        layers."""
        above = self._heights(downs).max(axis=1) >= LOW * printer.layer_mm
        hangs = (self._units @ downs.T > _limit(printer)) & above
        if self.hull is not None:
            middles = self.points[self.triangles].mean(axis=1)
            hangs &= (self.hull.least_depths(middles) < SURFACE)[:, None]
        return np.asarray(hangs)

    def _heights(self, downs: Floats) -> Floats:
        """(t, 3, d) heights of the triangles' corners above the bed."""
        depths = self.points @ downs.T
        return np.asarray((depths.max(axis=0) - depths)[self.triangles])

    @cached_property
    def _areas(self) -> Floats:
        """(t,) areas of the triangles."""
        return norms(doubled_area_vectors(self.points, self.triangles)) / 2.0

    @cached_property
    def _units(self) -> Floats:
        """(t, 3) unit normals of the triangles, 0 for those without area."""
        vectors = doubled_area_vectors(self.points, self.triangles)
        doubled = 2.0 * self._areas[:, None]
        return np.asarray(vectors / np.where(doubled > 0.0, doubled, 1.0))


def _limit(printer: Printer) -> float:
    """Largest cosine between the normal of a surface and down that needs no supports."""
    return math.cos(math.radians(max(printer.overhang_deg - ALMOST_DEG, 0.0))) + LEVEL


def beds(poses: RestPoses) -> Floats:
    """Unit directions (d, 3) that can point to the bed of a convex die: normals of the facets that
    are large enough to hold it, or if there are none, of those that it rests on."""
    hull = poses.hull
    tall = np.ptp(hull.vertices @ hull.normals.T, axis=0)
    # The area of a facet bounds the area of its circle, which takes longer to compute.
    wide = np.pi * (FOOTING * tall / 2.0) ** 2 <= hull.areas
    large = [
        facet
        for facet in np.flatnonzero(wide).tolist()
        if 2.0 * facet_inradius(hull, facet) >= FOOTING * tall[facet]
    ]
    return hull.normals[large] if large else poses.normals


def placement_on_bed(points: Floats, down: Floats) -> Floats:
    """(4, 4) rigid motion that turns a unit direction (3,) down by the smallest rotation, and moves
    points (n, 3) onto the bed z = 0 with the middle of their box above its origin."""
    turn = rotation_between(down, np.array([0.0, 0.0, -1.0]))
    turned = points @ turn.T
    low, high = turned.min(axis=0), turned.max(axis=0)
    x, y, _ = -(low + high) / 2.0
    return rigid_motion(turn, [x, y, -low[2]])


PARALLEL_COSINE = math.cos(math.radians(15.0))
"""Cosine of the largest angle between the two sides of a stroke; wider ones are a corner."""

SAMPLES = 24
"""Least number of samples along the extent of a label; every edge of its outline has one."""

NEAR = 1e-9
"""Distance from its origin at which a ray begins, over the extent."""

BENEATH = -1e-2
"""Cosine between the normals of two facets below which one is beneath the other."""

OPPOSITE = math.cos(math.radians(45.0))
"""Cosine of the largest angle between the normal of one side of a wall and the opposite of the
other's; material between other sides is an edge, which is not weak."""

FINENESS = 0.25
"""Distance between samples, over the least thickness of a wall."""

MOST_SAMPLES = 200_000

SPOT = 8
"""Number of samples, half a wall's square, whose median is the thickness of a place: every edge is
thin where it ends. Thin parts of fewer samples are not reported."""

SEED = 20


def least_details(
    printer: Printer, engraving: EngravingOptions | None
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Least widths in mm that a printer makes, of strokes and of the ridges between them, each with
    its side for `narrowest_stroke`."""
    if engraving is not None and engraving.style == "raised":
        return (printer.raised_mm, -1.0), (printer.groove_mm, 1.0)
    return (printer.groove_mm, -1.0), (printer.ridge_mm, 1.0)


def narrowest_stroke(section: CrossSection, side: float = -1.0) -> float | None:
    """Least width of the strokes of a plane section.

    Rays from points of the outline go straight inward to the other side. The length of a ray is a
    width if the two sides are parallel to 15 degrees, which excludes corners and ends, and if the
    sides that are no farther apart are together twice as long, which excludes joints.

    side: -1 for strokes, 1 for the ridges between them. Returns None if there is no such ray.
    Source: the stroke width transform of Epshtein, Ofek and Wexler, CVPR 2010, on outlines.
    """
    contours = section.to_polygons()
    if not contours:
        return None
    starts = np.concatenate(contours)
    edges = np.concatenate([np.roll(contour, -1, axis=0) - contour for contour in contours])
    lengths = norms(edges)
    extent = float(np.ptp(starts, axis=0).max())
    counts = np.ceil(lengths * SAMPLES / extent).astype(np.int64)
    edge = np.arange(len(edges)).repeat(counts)
    number = np.arange(len(edge)) - (np.cumsum(counts) - counts).repeat(counts)
    points = starts[edge] + ((number + 0.5) / counts[edge])[:, None] * edges[edge]
    normals = np.column_stack([edges[:, 1], -edges[:, 0]])[edge] / lengths[edge, None]
    places, normals = (np.pad(vectors, ((0, 0), (0, 1))) for vectors in (points, normals))
    prism = section.extrude(2.0).translate((0.0, 0.0, -1.0))
    ends = side * extent * np.array([NEAR, 2.0])
    ray, _, widths = _opposite_sides(prism, places, normals, ends, PARALLEL_COSINE)
    order = np.argsort(widths, kind="stable")
    widths = widths[order]
    long = np.cumsum((lengths / counts)[edge[ray[order]]]) >= 2.0 * widths
    return float(widths[long.argmax()]) if long.any() else None


def _opposite_sides(
    body: Manifold, starts: Floats, normals: Floats, ends: Floats, cosine: float
) -> tuple[Integers, Floats, Floats]:
    """Points where rays from points (n, 3) of a surface meet its opposite side: the numbers (r,) of
    these rays, the places (r, 3), and their distances (r,) from the points.

    normals: (n, 3) outward at the points; ends: (2,) of a ray, as distances along these; cosine:
    least one between a normal and the opposite of the other side's.
    """
    rays, places = [], []
    begins, stops = (starts + end * normals for end in ends)
    for ray, (normal, begin, stop) in enumerate(zip(normals, begins, stops, strict=True)):
        hits = body.ray_cast(begin, stop)
        if hits and np.dot(hits[0].normal, normal) < -cosine:
            rays.append(ray)
            places.append(hits[0].position)
    met = np.reshape(places, (-1, 3))
    numbers = np.array(rays, dtype=np.int64)
    return numbers, met, norms(met - starts[numbers])


def walls_under(
    placements: Sequence[Placement], depth: float, hull: ConvexHull
) -> tuple[float, ...]:
    """Thickness of a convex die under each label: the least distance from the floor of its pocket
    to a facet beneath, which faces the other way, or from the pocket to another one.

    Both are exact: in a convex solid the distance from the facets is a concave function, least at a
    corner of the floor, and the distance of two pockets is the least between their triangles.

    placements: k labels on facets of the die; depth: of pockets with a share of 1, above 0; hull:
    of the die in mm. Returns k numbers, 0 where a pocket meets another one or breaks through.
    """
    pockets, walls, reaches = [], list[float](), list[float]()
    for placement in placements:
        section, own = placement.section(), depth * placement.depth_share
        pockets.append(placement.sink(section, own, own))
        rim = np.concatenate(section.to_polygons()) @ placement.plane.T + placement.origin
        beneath = hull.normals @ placement.normal < BENEATH
        room = hull.depths(rim - own * placement.normal)[:, beneath]
        walls.append(max(float(room.min(initial=hull.diameter)), 0.0))
        reaches.append(float(norms(rim - placement.origin).max()) + own)
    middles = [placement.origin for placement in placements]
    # The nearest first, so that those after them need not be searched for far.
    pairs = combinations(range(len(pockets)), 2)
    for one, other in sorted(pairs, key=lambda pair: math.dist(*(middles[at] for at in pair))):
        apart = math.dist(middles[one], middles[other]) - reaches[one] - reaches[other]
        if apart >= max(walls[one], walls[other]):
            continue
        gap = float(pockets[one].min_gap(pockets[other], max(walls[one], walls[other])))
        walls[one], walls[other] = min(walls[one], gap), min(walls[other], gap)
    return tuple(walls)


def thin_parts(surface: Surface, wall: float) -> ThinParts | None:
    """Find parts thinner than a wall, by inward rays from points sampled uniformly on a surface.

    surface: closed, of positive volume; wall: least thickness, above 0. Returns None if nothing is
    thinner. Raises InputError if the surface bounds no solid.
    """
    # Convex dice need neither.
    from scipy.spatial import cKDTree

    from dicedesign.geometry.meshes.manifold import solid

    body = solid(surface)
    doubled = doubled_area_vectors(surface.points, surface.triangles)
    lengths = norms(doubled)
    area = float(lengths.sum()) / 2.0
    count = min(int(area / (FINENESS * wall) ** 2) + 1, MOST_SAMPLES)
    random = np.random.default_rng(SEED)
    chosen = random.choice(len(lengths), count, p=lengths / lengths.sum())
    weights = random.dirichlet(np.ones(3), count)
    starts = np.einsum("nkx,nk->nx", surface.points[surface.triangles[chosen]], weights)
    normals = doubled[chosen] / lengths[chosen, None]
    # Rays begin inside, so that they do not meet the triangle that they start from.
    ends = wall * np.array([-1e-6, -1.0])
    rays, exits, thicknesses = _opposite_sides(body, starts, normals, ends, OPPOSITE)
    if len(rays) < SPOT:
        return None
    places = (starts[rays] + exits) / 2.0
    _, near = cKDTree(places).query(places, SPOT)
    medians = np.median(thicknesses[near], axis=1)
    thinnest = int(medians.argmin())
    return ThinParts(
        wall_mm=wall,
        share=len(rays) / count,
        least_mm=float(medians[thinnest]),
        place=tuple(places[thinnest].tolist()),
    )


def check_file(points: Floats, triangles: Integers) -> FileCheck:
    """Count the flaws of a file that was read back with equal positions joined: points (n, 3) and
    triangles (t, 3), t at least 1."""
    neighbors = edge_neighbors(triangles)
    one, edge = np.nonzero(neighbors >= 0)
    parts = find_parts(one, neighbors[one, edge], len(triangles))
    meeting = intersecting_triangles(points, triangles)
    corners = points[triangles]
    longest = norms(corners - np.roll(corners, 1, axis=1)).max(axis=1)
    widths = norms(doubled_area_vectors(points, triangles)) / longest
    volumes = [
        solid_properties(points, triangles[parts == part])[0] for part in range(parts.max() + 1)
    ]
    return FileCheck(
        open_edges=neighbors.size - len(edge),
        pieces=sum(volume > 0.0 for volume in volumes),
        cavities=sum(volume <= 0.0 for volume in volumes),
        self_intersections=int((widths[meeting] >= THIN).all(axis=1).sum()),
        flat_triangles=int((widths == 0.0).sum()),
        volume_mm3=sum(volumes),
    )


def printability(
    die: PrintedSolid,
    rests: RestPoses,
    designed: ConvexHull | None,
    shape: Surface | None,
    placements: Sequence[Placement],
    options: PrintOptions,
    engraving: EngravingOptions | None,
    filling_mm3: float,
) -> Printability:
    """Printability of a die: weak labels, walls, weight, best orientation.

    Parameters
    ----------
    die: with the points and triangles of its file.
    rests: of the file.
    designed: hull of a convex die before its edges were rounded, else None.
    shape: surface of a concave die without its labels if it bounds a solid, else None.
    placements: of labels on facets.
    options: of printing; engraving: of labels, None for a die without any.
    filling_mm3: volume of bodies of another color that fill the labels.
    """
    printer = options.selected_printer
    # The fewest labels spoiled, then the least area to support, then the largest area on the bed,
    # to a tenth of a mm2.
    best = min(
        die.poses(rests.normals if designed is None else beds(rests), printer),
        key=lambda pose: (
            len(pose.spoiled),
            round(pose.overhang_mm2, 1),
            -round(pose.contact_mm2, 1),
        ),
    )
    smallest = None
    if designed is not None:
        radii = [facet_inradius(designed, facet) for facet in range(len(designed.normals))]
        least = int(np.argmin(radii))
        smallest = SmallestFacet(float(designed.areas[least]), radii[least])
    check = check_file(die.points, die.triangles)
    thin = None if shape is None else thin_parts(shape, printer.wall_mm)
    walls: Sequence[float | None] = [None] * len(placements)
    if engraving is not None and engraving.style != "raised":
        walls = walls_under(placements, engraving.depth_mm, rests.hull)
    labels = []
    for placement, wall in zip(placements, walls, strict=True):
        section = placement.section()
        stroke, gap = narrowest_stroke(section), narrowest_stroke(section, 1.0)
        labels.append(PrintedLabel(placement.text, stroke, gap, wall))
    facts = Printability(
        printer=printer.name,
        spot_mm=printer.spot_mm,
        layer_mm=printer.layer_mm,
        material=options.substance,
        density_g_cm3=options.density,
        weight_g=1e-3 * options.density * (check.volume_mm3 + filling_mm3),
        bounding_box_mm=tuple(np.ptp(die.points, axis=0).tolist()),
        file=check,
        smallest_facet=smallest,
        thin=thin,
        labels=tuple(labels),
        poses=tuple(die.poses(rests.normals, printer)),
        best=best,
        placement=tuple(map(tuple, placement_on_bed(die.points, np.array(best.normal)).tolist())),
        warnings=(),
    )
    return replace(facts, warnings=tuple(_warnings(facts, printer, engraving)))


def _warnings(
    facts: Printability, printer: Printer, engraving: EngravingOptions | None
) -> Iterator[str]:
    """Yield a sentence with a remedy for each feature that the printer cannot make."""
    called, thin, labels, check = printer.name, facts.thin, facts.labels, facts.file
    if printer.has_nozzle:
        called += f" with a nozzle of {printer.spot_mm:.2g} mm"
    if thin is not None:
        x, y, z = (f"{coordinate:.1f}" for coordinate in thin.place)
        factor = thin.wall_mm / thin.least_mm
        larger = f"raise size_mm by a factor of {factor:.2g}, or " if factor < MOST_LARGER else ""
        yield (
            f"parts under {100.0 * thin.share:.2g} % of the surface are thinner than the "
            f"{thin.wall_mm:.2g} mm that {called} makes, the thinnest {thin.least_mm:.2g} mm "
            f"at ({x}, {y}, {z}) of die_plain.stl: {larger}thicken the model there"
        )
    (stroke, _), (ridge, _) = least_details(printer, engraving)
    larger = (
        "shorten the label, make the die larger (size_mm, or --size-mm of design), or raise "
        "engrave.min_height_mm in a recipe"
    )
    deeper = (
        "make the die larger (size_mm, or --size-mm of design), or reduce engrave.depth_mm in a "
        "recipe"
    )
    for what, name, least, remedy in (
        ("the strokes", "stroke_mm", stroke, larger),
        ("the ridges between the strokes", "ridge_mm", ridge, larger),
        ("the walls under the pocket", "wall_mm", printer.wall_mm, deeper),
    ):
        widths = [(getattr(label, name), label.text) for label in labels]
        fine = [(width, text) for width, text in widths if width is not None and width < least]
        if fine:
            width, text = min(fine)
            others = f" (and {len(fine) - 1} more)" if len(fine) > 1 else ""
            yield (
                f"{what} of label {text}{others} measure {width:.2g} mm, {called} makes "
                f"{least:.2g} mm or more: {remedy}"
            )
    if labels and engraving is not None and engraving.depth_mm < printer.groove_depth_mm:
        yield (
            f"labels are {engraving.depth_mm:.2g} mm deep, {called} shows them from "
            f"{printer.groove_depth_mm:.2g} mm on: raise engrave.depth_mm"
        )
    if check.cavities and not printer.has_nozzle:
        # A ball opposite to the labels of a convex die, or the cavity of a concave one.
        remedy = (
            "engrave.balance: shape, or drain it with inside.drain_mm"
            if facts.smallest_facet is not None
            else "fdm, or no method.concave.hollow"
        )
        yield (
            f"the hidden hollow stays full of the material of {printer.name}, which changes the "
            f"probabilities: take {remedy}"
        )
    if not check.is_solid:
        yield (
            f"the file is no watertight solid: {check.open_edges} open edges, {check.pieces} "
            f"pieces, {check.self_intersections} pairs of triangles that meet, "
            f"{check.flat_triangles} without area; let the program of the printer repair it"
        )
