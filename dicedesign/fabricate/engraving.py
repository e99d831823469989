"""Labels on their places on a die, cut into it as pockets or left standing in sunk fields, and what
fills them; with checks of what comes out, and which of its triangles belong to labels.

Lengths are in millimeters, volumes in cubic millimeters.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Final

import numpy as np
from manifold3d import CrossSection, Error, Manifold, OpType
from scipy.spatial import KDTree

from dicedesign.errors import EngravingError
from dicedesign.fabricate.finish_options import EngravingOptions
from dicedesign.fabricate.label_layout import (
    Placement,
    Reading,
    border_lines,
    die_readings,
    edge_margins,
    place_labels,
)
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.meshes.manifold import mesh_of, solid
from dicedesign.geometry.surfaces.grid_surface import distances_from_surface
from dicedesign.geometry.triangles import Surface, edge_neighbors, find_parts
from dicedesign.rest.poses import RestPoses
from dicedesign.runtime.arrays import Booleans, Floats, Integers
from dicedesign.tolerances import ENGRAVED_VOLUME_TOLERANCE

JOINED: Final = 0.02
"""Part of a raised label that may run into the border: facets that are moved a little afterwards
take their border along."""


@dataclass(frozen=True, eq=False)
class LabelCut:
    """The material that a label takes away.

    Attributes
    ----------
    where: the label, or labels, and what they are on, as messages call them.
    cutter: solid to subtract.
    volume: of that part of it that lies in the body, in mm3, where it is as it should be.
    """

    where: str
    cutter: Manifold
    volume: float


def _cuts(
    hull: ConvexHull, placements: Sequence[Placement], options: EngravingOptions
) -> list[LabelCut]:
    """Material that all labels take away from the solid with this hull."""
    depth, cuts = options.depth_mm, []
    for placement, section in cut_sections(hull, placements, options):
        # It reaches as far above the facet as below, so that no face of it lies in the facet.
        cutter = section.extrude(2 * depth).translate((0.0, 0.0, -depth))
        cutter = cutter.transform(placement.frame[:3])
        cuts.append(LabelCut(placement.where, cutter, section.area() * depth))
    return cuts


def cut_sections(
    hull: ConvexHull,
    placements: Sequence[Placement],
    options: EngravingOptions,
    joined: float = JOINED,
) -> list[tuple[Placement, CrossSection]]:
    """The plane sections that are cut into the facets of a solid with this hull, in mm, each in the
    frame of the placement beside it: labels, or fields without them where labels are raised.

    joined: part of a raised label that may run into the border.

    Raises EngravingError where more of it does, or where strokes cannot be as wide as asked for.
    """
    labels = [(placement, placement.section()) for placement in placements]
    if options.style != "raised":
        return labels
    together: dict[int, list[tuple[Placement, CrossSection]]] = {}
    for placement, section in labels:
        facet = int(np.argmax(hull.normals @ placement.frame[:3, 2]))
        together.setdefault(facet, []).append((placement, section))
    return [_field(hull, facet, on_it, options, joined) for facet, on_it in together.items()]


def _field(
    hull: ConvexHull,
    facet: int,
    labels: Sequence[tuple[Placement, CrossSection]],
    options: EngravingOptions,
    joined: float,
) -> tuple[Placement, CrossSection]:
    """A facet within its border, without its labels, in the plane of the first of them."""
    first, _ = labels[0]
    frame = first.frame
    corners = (hull.polygon(facet) - frame[:3, 3]) @ frame[:3, :2]
    field = CrossSection([corners])
    # All other planes, as a corner may be so sharp that one without a common edge is as near.
    for distance, inward in zip(*border_lines(hull, facet, frame, options), strict=True):
        # What lies nearer along the direction, as far as a facet of this body reaches.
        far, near = 4.0 * hull.diameter, distance * inward
        along = far * np.array([inward[1], -inward[0]])
        ends = [near + along, near - along]
        field -= CrossSection([np.stack([*ends, *(end - far * inward for end in ends[::-1])])])
    standing = CrossSection()
    for placement, section in labels:
        turn = frame[:3, :2].T @ placement.frame[:3, :2]
        shift = (placement.frame[:3, 3] - frame[:3, 3]) @ frame[:3, :2]
        label = section.transform(np.column_stack([turn, shift]))
        if (label - field).area() > joined * label.area():
            raise EngravingError(
                f"label {placement.where}: expected room within a border of "
                f"{options.border_mm:g} mm, got a label that reaches into it; reduce border_mm or "
                "depth_mm, or increase margin_mm or size_mm"
            )
        standing += label
    named = replace(first, text=", ".join(placement.text for placement, _ in labels))
    return named, field - standing


def engrave(
    vertices: Floats,
    triangles: Integers,
    placements: Sequence[Placement],
    options: EngravingOptions,
) -> Surface:
    """Cut labels into a solid, `options.depth_mm` deep below their facets, or what is around them.

    Parameters
    ----------
    vertices, triangles: the plain convex solid, as `solid` takes it.
    placements: labels on flat facets of it, from `place_labels`.
    options: style and depth; sizes and places are those of the placements.

    Returns
    -------
    Surface in mm that passed the checks: no boolean error, one piece, as many handles as the plain
    solid, and the volume of the plain solid less the labels to `ENGRAVED_VOLUME_TOLERANCE`.

    Raises
    ------
    InputError: the plain mesh is no solid.
    EngravingError: a check failed; the message says which, and names the labels at fault.
    """
    cuts = _cuts(convex_hull(vertices), placements, options)
    return cut_out(solid(vertices, triangles), cuts, options)


def inlay(
    vertices: Floats,
    triangles: Integers,
    placements: Sequence[Placement],
    options: EngravingOptions,
) -> Surface:
    """The bodies that fill what `engrave` takes away, up to the facets of the plain solid.

    The parameters are those of `engrave`, which is to be called first as it checks them.
    """
    cuts = _cuts(convex_hull(vertices), placements, options)
    cutters = Manifold.batch_boolean([cut.cutter for cut in cuts], OpType.Add)
    return Surface(*mesh_of(solid(vertices, triangles) ^ cutters))


def cut_out(plain: Manifold, cuts: Sequence[LabelCut], options: EngravingOptions) -> Surface:
    """Subtract cuts from a solid, all at once.

    plain: the solid; cuts: of labels; options: named in the message of an error. Returns and raises
    what `engrave` does.
    """
    body = Manifold.batch_boolean([plain, *(cut.cutter for cut in cuts)], OpType.Subtract)
    failure = _find_failed_check(plain, body, sum(cut.volume for cut in cuts))
    if not failure:
        return Surface(*mesh_of(body))
    # Pockets that break through, or meet others.
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
    """The first check that the engraved solid fails, in words, or None."""
    if body.status() != Error.NoError:
        return f"expected a boolean subtraction without error, got {body.status().name}"
    # Cavities are closed surfaces of their own.
    pieces, wanted = len(body.decompose()), len(plain.decompose())
    if pieces != wanted:
        return f"expected {'one piece' if wanted == 1 else f'{wanted} surfaces'}, got {pieces}"
    if body.genus() != plain.genus():
        return f"expected {plain.genus()} handles (genus), got {body.genus()}"
    if not body.volume() > 0:
        return f"expected a positive volume, got {body.volume():g} mm3"
    removed = plain.volume() - body.volume()
    if abs(removed - expected) > ENGRAVED_VOLUME_TOLERANCE * expected:
        return f"expected pockets of {expected:.6g} mm3, got {removed:.6g} mm3"
    return None


def place_on_facets(
    poses: RestPoses,
    main: Integers,
    hull: ConvexHull,
    labels: Sequence[str],
    options: EngravingOptions,
) -> tuple[Reading, list[Placement]]:
    """Reading of a die, and its labels on the facets of its hull or core (`core_of`), in the order
    of the reading's places.

    poses: rests of the die in mm; main: (k,) the rest of each outcome, or -1.

    Raises EngravingError where an outcome has no facet to rest on, the die cannot be read as the
    options say, or a label does not fit.
    """
    require_rests(labels, main, "a facet")
    *better, last = die_readings(hull, poses.facets[main], labels, options.read)

    def placed(reading: Reading) -> list[Placement]:
        places, whole = reading.places, reading.way != "corner"
        return place_labels(
            places,
            # Around a corner labels stand upright toward it.
            options if whole else replace(options, upright="edge"),
            poses.hull.diameter,
            [edge_margins(hull, place.facet, options) for place in places] if whole else None,
        )

    for reading in better:
        with suppress(EngravingError):
            placements = placed(reading)
            if options.style == "raised":
                cut_sections(hull, placements, options)
            return reading, placements
    return last, placed(last)


def require_rests(labels: Sequence[str], main: Integers, what: str) -> None:
    """Raise EngravingError where an outcome, by the number (k,) of its own rest or -1, has none.

    what: it is to have, in words.
    """
    if (main < 0).any():
        raise EngravingError(
            f"label {labels[int(main.argmin())]!r}: expected {what} to rest on for each label, got "
            "none for this one; finish the design first"
        )


OFF: Final = 0.1
"""Distance of the middle of a triangle from the plain surface, over the depth of labels. That of a
wall with two corners on the surface is a third of the depth away, less where the surface slopes."""

MATCHINGS: Final = 8
"""Rounds in which the plain surface is brought onto the other; three are usual."""

MATCHED: Final = 3.0
"""Corners nearer than this many times the median count as one."""


def labels_below_hull(marked: Surface, depth: float) -> Booleans:
    """(t,) which triangles of a die that is convex but for its labels belong to these: those below
    its hull, but for a hollow inside.

    depth: of labels, above 0, in the unit of the surface.
    """
    middles = marked.points[marked.triangles].mean(axis=1)
    is_below = convex_hull(marked.points).least_depths(middles) > OFF * depth
    across = edge_neighbors(marked.triangles)
    one, edge = np.nonzero(across >= 0)
    part = find_parts(one, across[one, edge], len(across))
    return is_below & np.isin(part, part[~is_below])


def labels_off_surface(marked: Surface, plain: Surface, depth: float) -> Booleans:
    """(t,) which triangles of a die with labels belong to these: those off the surface of the plain
    die, of which it is an image under an affine map near the identity.

    marked, plain: the die with labels and without; depth: of labels, above 0; all in one unit.
    """
    # The affine map that brings some corners onto most of the plain surface's.
    homogeneous = np.column_stack([marked.points, np.ones(len(marked.points))])
    points = marked.points
    for _ in range(MATCHINGS):
        apart, nearest = KDTree(points).query(plain.points)
        same = apart <= MATCHED * np.median(apart)
        matrix, *_ = np.linalg.lstsq(homogeneous[nearest[same]], plain.points[same])
        points = homogeneous @ matrix
    middles = points[marked.triangles].mean(axis=1)
    # Most triangles of a surface of many are as they were.
    apart, _ = KDTree(plain.points[plain.triangles].mean(axis=1)).query(middles)
    new = np.flatnonzero(apart > OFF * OFF * depth)
    labels = np.zeros(len(middles), dtype=bool)
    labels[new] = distances_from_surface(plain, middles[new]) > OFF * depth
    return labels
