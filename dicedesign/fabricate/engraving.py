"""Labels of a convex die, cut in as pockets or standing in sunk fields, bodies that fill them,
checks of the engraved solid, and the triangles of its labels.

Lengths are in millimeters, volumes in cubic millimeters.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from manifold3d import CrossSection, Error, Manifold, OpType
from scipy.spatial import KDTree

from dicedesign.errors import EngravingError
from dicedesign.fabricate.die import Solid
from dicedesign.fabricate.finish_options import EngravingOptions
from dicedesign.fabricate.label_layout import (
    Placement,
    edge_margins,
    place_labels,
    wall_distances,
)
from dicedesign.fabricate.label_reading import Reading, die_readings
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.meshes.body import shells_of
from dicedesign.geometry.meshes.manifold import mesh_of, solid
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.surfaces.grid_surface import distances_from_surface
from dicedesign.geometry.triangles import Surface
from dicedesign.runtime.arrays import Booleans, Floats, Integers
from dicedesign.tolerances import ENGRAVED_VOLUME_TOLERANCE

JOINED = 0.02
"""Largest share of a raised label that may overlap the border, which moves when facets are moved
slightly."""

LEAST_SINE = 1e-3
"""Sine of the largest angle between planes that count as parallel."""


@dataclass(frozen=True, eq=False)
class LabelCut:
    """Material to remove for a label.

    Attributes
    ----------
    where: label or labels and their place, in messages.
    cutter: solid to subtract.
    volume: expected volume of its part inside the body, in mm3.
    """

    where: str
    cutter: Manifold
    volume: float


def _cuts(
    plain: Surface, placements: Sequence[Placement], options: EngravingOptions
) -> list[LabelCut]:
    """Material that all labels remove from a convex solid."""
    cuts = []
    for placement, section in cut_sections(convex_hull(plain.points), placements, options):
        depth = options.depth_mm * placement.depth_share
        # The cutter extends above the facet, so that none of its faces is coplanar with it.
        cutter = placement.sink(section, depth, 2 * depth)
        cuts.append(LabelCut(placement.where, cutter, section.area() * depth))
    return cuts


def cut_sections(
    hull: ConvexHull,
    placements: Sequence[Placement],
    options: EngravingOptions,
    joined: float = JOINED,
) -> list[tuple[Placement, CrossSection]]:
    """Plane sections to cut into the facets of a solid with this hull, in mm, each with the
    placement in whose frame it is: labels, or for raised labels fields without them.

    joined: largest share of a raised label that may overlap the border.

    Raises EngravingError if more of a label overlaps, or its strokes cannot be widened.
    """
    labels = [(placement, placement.section()) for placement in placements]
    if options.style != "raised":
        return labels
    by_facet = defaultdict(list)
    for placement, section in labels:
        facet = int(np.argmax(hull.normals @ placement.normal))
        by_facet[facet].append((placement, section))
    return [_field(hull, facet, own, options, joined) for facet, own in by_facet.items()]


def _field(
    hull: ConvexHull,
    facet: int,
    labels: Sequence[tuple[Placement, CrossSection]],
    options: EngravingOptions,
    joined: float,
) -> tuple[Placement, CrossSection]:
    """Field of a facet within its border, without its labels, in the frame of the first label."""
    first, _ = labels[0]
    field = CrossSection([(hull.polygon(facet) - first.origin) @ first.plane])
    # All other planes, as at a sharp corner one without a common edge may be as near.
    for distance, inward in zip(*border_lines(hull, facet, first, options), strict=True):
        # The rectangle on the near side of the line covers the rest of the facet.
        far, near = 4.0 * hull.diameter, distance * inward
        along = far * np.array([inward[1], -inward[0]])
        ends = [near + along, near - along]
        field -= CrossSection([np.stack([*ends, *(end - far * inward for end in ends[::-1])])])
    raised = CrossSection()
    for placement, section in labels:
        turn = first.plane.T @ placement.plane
        shift = (placement.origin - first.origin) @ first.plane
        label = section.transform(np.column_stack([turn, shift]))
        if (label - field).area() > joined * label.area():
            raise EngravingError(
                f"label {placement.where}: expected room within a border of "
                f"{options.border_mm:g} mm, got a label that reaches into it; reduce border_mm or "
                "depth_mm, or increase margin_mm or size_mm"
            )
        raised += label
    named = replace(first, text=", ".join(placement.text for placement, _ in labels))
    return named, field - raised


def border_lines(
    hull: ConvexHull, facet: int, placement: Placement, options: EngravingOptions
) -> tuple[Floats, Floats]:
    """Inner lines of the border of a sunk field, one for each plane that intersects the facet's.

    placement: of a label on the facet. Returns, in its plane, distances (n,) in mm from its origin
    and unit directions (n, 2) toward the field, which is beyond the lines.
    """
    flat = -hull.normals @ placement.plane
    sines = norms(flat)
    meets = sines > LEAST_SINE
    meets[facet] = False
    cosines, sines = (hull.normals @ hull.normals[facet])[meets], sines[meets]
    widths = wall_distances(cosines, options.depth_mm, options.border_mm)
    distances = widths - hull.heights(placement.origin)[meets] / sines
    return distances, flat[meets] / sines[:, None]


def engrave(plain: Surface, placements: Sequence[Placement], options: EngravingOptions) -> Surface:
    """Cut labels into a solid, below their facets by their share of `options.depth_mm`, or the
    fields around them.

    Parameters
    ----------
    plain: the convex solid in mm.
    placements: labels on its flat facets, from `place_labels`.
    options: style and depth; sizes and places come from the placements.

    Returns
    -------
    Surface in mm that passed the checks: no boolean error, the pieces and handles of the plain
    solid, and its volume less the labels' to `ENGRAVED_VOLUME_TOLERANCE`.

    Raises
    ------
    InputError: the plain mesh is no solid.
    EngravingError: a check failed; the message says which, and names the labels at fault.
    """
    cuts = _cuts(plain, placements, options)
    return cut_out(solid(plain), cuts, options)


def inlay(plain: Surface, placements: Sequence[Placement], options: EngravingOptions) -> Surface:
    """Bodies that fill the pockets of `engrave`, up to the facets of the plain solid.

    Parameters as for `engrave`, which checks them.
    """
    cuts = _cuts(plain, placements, options)
    cutters = Manifold.batch_boolean([cut.cutter for cut in cuts], OpType.Add)
    return mesh_of(solid(plain) ^ cutters)


def cut_out(plain: Manifold, cuts: Sequence[LabelCut], options: EngravingOptions) -> Surface:
    """Subtract the cuts of labels from a solid. Returns and raises as `engrave`.

    options: for the message of an error.
    """
    body = Manifold.batch_boolean([plain, *(cut.cutter for cut in cuts)], OpType.Subtract)
    failure = _find_failed_check(plain, body, sum(cut.volume for cut in cuts))
    if not failure:
        return mesh_of(body)
    # Pockets that break through or overlap.
    at_fault = {
        cut.where for cut in cuts if _find_failed_check(plain, plain - cut.cutter, cut.volume)
    }
    for one, other in combinations(cuts, 2):
        if (one.cutter ^ other.cutter ^ plain).volume() > 0.0:
            at_fault |= {one.where, other.where}
    labels = ", ".join(cut.where for cut in cuts if cut.where in at_fault) or "some labels"
    raise EngravingError(
        f"engraved solid: {failure}; pockets meet, or break through another facet, at {labels}: "
        f"reduce depth_mm (now {options.depth_mm:g}) or increase size_mm or margin_mm"
    )


def _find_failed_check(plain: Manifold, body: Manifold, expected: float) -> str | None:
    """Description of the first failed check of an engraved solid, or None."""
    if body.status() != Error.NoError:
        return f"expected a boolean subtraction without error, got {body.status().name}"
    # Cavities are separate closed surfaces.
    pieces, expected_pieces = len(body.decompose()), len(plain.decompose())
    if pieces != expected_pieces:
        what = "one piece" if expected_pieces == 1 else f"{expected_pieces} surfaces"
        return f"expected {what}, got {pieces}"
    if body.genus() != plain.genus():
        return f"expected {plain.genus()} handles (genus), got {body.genus()}"
    removed = plain.volume() - body.volume()
    if abs(removed - expected) > ENGRAVED_VOLUME_TOLERANCE * expected:
        return f"expected pockets of {expected:.6g} mm3, got {removed:.6g} mm3"
    return None


EDGE_SHARE = 0.6
"""Least height of labels beside edges on top, over that of labels below, at which they are used."""


def place_on_facets(
    die: Solid, hull: ConvexHull, labels: Sequence[str], options: EngravingOptions
) -> tuple[Reading, list[Placement]]:
    """Choose the reading of a die, and place its labels on the facets of its hull or core
    (`core_of`), in the order of the reading's places.

    Raises EngravingError if an outcome has no facet to rest on, the die cannot be read as the
    options say, or a label does not fit.
    """
    main, poses = die.outcomes.main, die.poses
    require_rests(labels, main, "a facet")
    *better, last = (
        replace(way, places=tuple(one for one in way.places if one.text not in options.blank))
        for way in die_readings(hull, poses.facets[main], labels, options.read)
    )

    def place(reading: Reading) -> list[Placement]:
        places, size_mm = reading.places, poses.hull.diameter
        if reading.way == "corner":
            # Labels are upright toward the corner.
            return place_labels(places, replace(options, upright="edge"), size_mm)
        margins = [edge_margins(hull, each.facet, options) for each in places]
        if reading.way == "edge":
            # Parts of facets have the largest margin all around.
            margins = [
                own if each.up is None else np.full(len(each.region), own.max())
                for each, own in zip(places, margins, strict=True)
            ]
        return place_labels(places, options, size_mm, margins)

    def smallest(placements: Sequence[Placement]) -> float:
        return min((placement.height for placement in placements), default=0.0)

    for reading in better:
        with suppress(EngravingError):
            placements = place(reading)
            if options.style == "raised":
                cut_sections(hull, placements, options)
            if reading.way != "edge" or smallest(placements) >= EDGE_SHARE * smallest(place(last)):
                return reading, placements
    return last, place(last)


LEAST_SHARE = 0.65
"""Least depth of a pocket over that of the deepest, where depths keep the center of mass."""

DEPTH_ROUNDS = 20
"""Number of Newton's steps for depths; five are usual."""


def even_depths(
    placements: Sequence[Placement], depth: float, center: Floats
) -> list[Placement] | None:
    """Choose depths of pockets that leave a solid's center of mass where it is, and so its hull and
    its symmetry; of all such depths those nearest to one depth for all.

    placements: of engraved labels; depth: of the deepest, in mm; center: (3,) center of mass of the
    solid without labels. Returns None if a pocket had to be shallower than `LEAST_SHARE`.
    """
    # A pocket of area a and depth d has the moment a (d p - d d n / 2), where p is the middle of
    # its section and n the normal.
    areas, middles = [], []
    for placement in placements:
        pocket = mesh_of(placement.section().extrude(1.0))
        areas.append(pocket.volume)
        middles.append(placement.frame[:3] @ [*pocket.centroid[:2], 0.0, 1.0] - center)
    area, middle = np.array(areas)[:, None], np.array(middles)
    normal = np.array([placement.normal for placement in placements])
    most, depths = depth, np.full(len(areas), depth)
    for _ in range(DEPTH_ROUNDS):
        # Newton's step, to the solution nearest to one depth for all.
        slopes = area * (middle - depths[:, None] * normal)
        curved = 0.5 * (area * depths[:, None] ** 2 * normal).sum(axis=0)
        change, *_ = np.linalg.lstsq(slopes.T, -curved - most * slopes.sum(axis=0))
        depths = most + change
        if depths.min() < LEAST_SHARE * depths.max():
            return None
        most *= depth / depths.max()
    shares = zip(placements, (depths / depth).tolist(), strict=True)
    return [replace(placement, depth_share=share) for placement, share in shares]


def require_rests(labels: Sequence[str], main: Integers, what: str) -> None:
    """Raise EngravingError if an outcome has no rest.

    main: (k,) the rest of each outcome, or -1; what: is missing, in words.
    """
    if (main < 0).any():
        raise EngravingError(
            f"label {labels[int(main.argmin())]!r}: expected {what} to rest on for each label, got "
            "none for this one; finish the design first"
        )


OFF = 0.1
"""Least distance of the middle of a label's triangle from the plain surface, over the depth of
labels. The middle of a wall triangle is a third of the depth away, less on a slope."""


LARGE_FACETS = 100
"""Number of facets, the largest, that are compared first."""


def labels_below_hull(marked: Surface, depth: float) -> Booleans:
    """(t,) whether a triangle of a convex die belongs to a label: it is below the hull and not in a
    hollow inside.

    depth: of labels, above 0, in the unit of the surface.
    """
    middles = marked.points[marked.triangles].mean(axis=1)
    hull = convex_hull(marked.points)
    # Most triangles of rounded edges are on the hull, as their corners are.
    corners = set(map(tuple, hull.vertices.tolist()))
    is_corner = np.array([tuple(point) in corners for point in marked.points.tolist()])
    is_below: Booleans = np.logical_not(is_corner[marked.triangles].all(axis=1))
    # Few facets are large, and rule most of the others out.
    normals = hull.normals[np.argsort(-hull.areas)[:LARGE_FACETS]]
    near = (hull.vertices @ normals.T).max(axis=0) - middles[is_below] @ normals.T
    is_below[is_below] = near.min(axis=1) > OFF * depth
    is_below[is_below] = hull.least_depths(middles[is_below]) > OFF * depth
    shells = shells_of(marked.triangles)
    return is_below & np.isin(shells, shells[~is_below])


def labels_off_surface(marked: Surface, plain: Surface, depth: float) -> Booleans:
    """(t,) whether a triangle of an engraved solid belongs to a label: it is off the surface of the
    plain one.

    depth: of labels, above 0, in the unit of both surfaces.
    """
    middles = marked.points[marked.triangles].mean(axis=1)
    # Most triangles are unchanged, which a query of middles shows faster.
    distances, _ = KDTree(plain.points[plain.triangles].mean(axis=1)).query(middles)
    labels = distances > OFF * OFF * depth
    labels[labels] = distances_from_surface(plain, middles[labels]) > OFF * depth
    return labels
