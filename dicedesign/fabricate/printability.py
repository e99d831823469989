"""How a die is printed: what its printer will not make, and how it lies best on the bed.

Lengths are in millimetres.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.fabricate.print_options import PrintOptions
from dicedesign.fabricate.print_orientation import (
    PrintedSolid,
    beds,
    placement_on_bed,
)
from dicedesign.fabricate.printers import Printer
from dicedesign.geometry.hulls.polygons import facet_inradius
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.surfaces.self_intersections import intersecting_triangles
from dicedesign.geometry.triangles import (
    connected_parts,
    doubled_area_vectors,
    edge_neighbors,
    solid_properties,
)
from dicedesign.results.parts import FileCheck, Printability, PrintedLabel, SmallestFacet, ThinParts
from dicedesign.runtime.arrays import Floats

if TYPE_CHECKING:
    from dicedesign.fabricate.label_layout import Placement
    from dicedesign.geometry.hulls.hull import ConvexHull
    from dicedesign.geometry.triangles import Surface
    from dicedesign.rest.poses import RestPoses

THIN: Final = 1e-4
"""Width in mm below which a triangle is a line to any printer. Single precision may fold it onto
its neighbors, and what it meets is not counted."""


def checked_file(body: Body) -> FileCheck:
    """The flaws of a file of triangles that was read back, its equal positions joined.

    body: with triangles, at least one.
    """
    points, triangles = body.points, body.triangles
    assert triangles is not None
    neighbors = edge_neighbors(triangles)
    inner = neighbors >= 0
    parts = connected_parts(
        np.arange(len(triangles)).repeat(3)[inner.ravel()], neighbors[inner], len(triangles)
    )
    meeting = intersecting_triangles(points, triangles)
    corners = points[triangles]
    longest = norms(corners - np.roll(corners, 1, axis=1)).max(axis=1)
    widths = norms(doubled_area_vectors(points, triangles)) / longest
    volumes = [
        solid_properties(points, triangles[parts == part])[0] for part in range(parts.max() + 1)
    ]
    return FileCheck(
        open_edges=int((~inner).sum()),
        pieces=sum(volume > 0.0 for volume in volumes),
        cavities=sum(volume <= 0.0 for volume in volumes),
        self_intersections=int((widths[meeting] >= THIN).all(axis=1).sum()),
        flat_triangles=int((widths == 0.0).sum()),
        volume_mm3=sum(volumes),
    )


MOST_LARGER: Final = 3.0
"""Factor by which a die is made larger for the sake of its thin parts."""


@dataclass(frozen=True, eq=False)
class PrintedDie:
    """A die and its labels, as they are to be printed.

    Attributes
    ----------
    body: the file that is printed, read back.
    poses: its rests.
    designed: the hull before edges were rounded, of a convex die; None of one that keeps the shape
        of a surface.
    shape: such a surface without its labels, where it bounds a solid; None of a convex die.
    labels: k texts; normals: (k, 3) outward where they are.
    placements: of the labels that lie on facets.
    depth: of labels in mm; raised: whether they stand in sunk fields.
    filling_mm3: volume of bodies of another color that fill the labels.
    """

    body: Body
    poses: RestPoses
    designed: ConvexHull | None
    shape: Surface | None
    labels: Sequence[str]
    normals: Floats
    placements: Sequence[Placement] = ()
    depth: float = 0.0
    raised: bool = False
    filling_mm3: float = 0.0

    @property
    def solid(self) -> PrintedSolid:
        """What lies on the bed."""
        assert self.body.triangles is not None
        hull = None if self.designed is None else self.poses.hull
        return PrintedSolid(self.body.points, self.body.triangles, hull, self.labels, self.normals)


def printability(die: PrintedDie, options: PrintOptions) -> Printability:
    """How a die is printed with the printer of some options."""
    printer = options.chosen
    solid = die.solid
    directions = beds(die.poses.hull, die.poses.facets, die.designed is not None)
    # The fewest labels spoiled, then the least area to support, then the largest on the bed.
    # Hundredths of mm2 decide nothing.
    best = min(
        solid.poses(directions, printer),
        key=lambda pose: (
            len(pose.spoiled),
            round(pose.overhang_mm2, 1),
            -round(pose.contact_mm2, 1),
        ),
    )
    placement = placement_on_bed(die.body.points, np.array(best.normal))
    check, labels, thin = checked_file(die.body), _labels(die), None
    if die.shape is not None:
        # Brings a library of solids along, which no convex die needs here.
        from dicedesign.fabricate.fine_parts import thin_parts

        thin = thin_parts(die.shape, printer.wall_mm)
    return Printability(
        printer=printer.name,
        spot_mm=printer.spot_mm,
        layer_mm=printer.layer_mm,
        material=options.substance,
        density_g_cm3=options.density,
        weight_g=1e-3 * options.density * (check.volume_mm3 + die.filling_mm3),
        bounding_box_mm=tuple(np.ptp(die.body.points, axis=0).tolist()),
        file=check,
        smallest_facet=_smallest_facet(die.designed),
        thin=thin,
        labels=labels,
        poses=tuple(solid.poses(die.poses.normals, printer)),
        best=best,
        placement=tuple(map(tuple, placement.tolist())),
        warnings=tuple(_warnings(die, printer, thin, labels, check)),
    )


def _smallest_facet(hull: ConvexHull | None) -> SmallestFacet | None:
    if hull is None:
        return None
    radii = [facet_inradius(hull, facet) for facet in range(len(hull.normals))]
    least = int(np.argmin(radii))
    return SmallestFacet(float(hull.areas[least]), radii[least])


def _labels(die: PrintedDie) -> tuple[PrintedLabel, ...]:
    """The finest parts of labels that lie on facets."""
    if not die.placements:
        return ()
    # Nothing else here needs what draws labels.
    from dicedesign.fabricate.fine_parts import narrowest_gap, narrowest_stroke, walls_under

    walls: Sequence[float | None] = [None] * len(die.placements)
    if not die.raised:
        walls = walls_under(die.placements, die.depth, die.poses.hull)
    labels = []
    for placement, wall in zip(die.placements, walls, strict=True):
        contours = placement.section().to_polygons()
        stroke, gap = narrowest_stroke(contours), narrowest_gap(contours)
        labels.append(PrintedLabel(placement.text, stroke, gap, wall))
    return tuple(labels)


def _warnings(
    die: PrintedDie,
    printer: Printer,
    thin: ThinParts | None,
    labels: Sequence[PrintedLabel],
    check: FileCheck,
) -> Iterator[str]:
    """What the printer will not make, one sentence each with what would help."""
    called = printer.name
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
    strokes, ridges = (
        (printer.raised_mm, printer.groove_mm)
        if die.raised
        else (printer.groove_mm, printer.ridge_mm)
    )
    larger = "raise size_mm or engrave.min_height_mm, or shorten the label"
    deeper = "reduce engrave.depth_mm or raise size_mm"
    for what, widths, least, remedy in (
        ("the strokes", [label.stroke_mm for label in labels], strokes, larger),
        ("the ridges between the strokes", [label.ridge_mm for label in labels], ridges, larger),
        ("the walls under the pocket", [each.wall_mm for each in labels], printer.wall_mm, deeper),
    ):
        fine = [
            (width, label.text)
            for width, label in zip(widths, labels, strict=True)
            if width is not None and width < least
        ]
        if fine:
            width, text = min(fine)
            others = f" (and {len(fine) - 1} more)" if len(fine) > 1 else ""
            yield (
                f"{what} of label {text}{others} measure {width:.2g} mm, {called} makes "
                f"{least:.2g} mm or more: {remedy}"
            )
    if labels and die.depth < printer.groove_depth_mm:
        yield (
            f"labels are {die.depth:.2g} mm deep, {called} shows them from "
            f"{printer.groove_depth_mm:.2g} mm on: raise engrave.depth_mm"
        )
    if check.cavities and not printer.has_nozzle:
        # A ball opposite to the labels of a convex die, or the cavity of one that keeps a shape.
        remedy = (
            "engrave.balance: shape, or drain it with inside.drain_mm"
            if die.shape is None
            else "fdm, or no method.concave.hollow"
        )
        yield (
            f"the hidden hollow stays full of what {printer.name} prints with, and the odds are "
            f"others: take {remedy}"
        )
    if not check.is_solid:
        yield (
            f"the file is no sound solid: {check.open_edges} open edges, {check.pieces} pieces, "
            f"{check.self_intersections} pairs of triangles that meet, {check.flat_triangles} "
            "without area; let the program of the printer repair it"
        )
