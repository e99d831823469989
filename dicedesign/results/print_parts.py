"""Sections of a `Result` about printing.

Lengths are in millimeters, angles in degrees, unless a docstring says otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass

from dicedesign.results.parts import Numbers


@dataclass(frozen=True)
class SmallestFacet:
    """Area and inradius of the facet with the smallest inradius of a convex die."""

    area_mm2: float
    inradius_mm: float


@dataclass(frozen=True)
class PrintedLabel:
    """Finest details of a label.

    Attributes
    ----------
    text: the label.
    stroke_mm: width of its thinnest stroke, None without parallel sides.
    ridge_mm: smallest width of a ridge between two strokes, or None.
    wall_mm: thinnest wall between its pocket and a facet or another pocket; None without a pocket.
    """

    text: str
    stroke_mm: float | None
    ridge_mm: float | None
    wall_mm: float | None


@dataclass(frozen=True)
class PrintPose:
    """Orientation of a die on the print bed.

    Attributes
    ----------
    label: label on the bed, or None.
    normal: (3,) unit direction of the body that points to the bed.
    contact_mm2: contact area on the bed.
    height_mm: height of the die above it.
    overhang_mm2: area of overhangs that need supports; support_mm3: volume below them, an upper
        bound of the supports.
    spoiled: labels that touch the bed or supports.
    """

    label: str | None
    normal: Numbers
    contact_mm2: float
    height_mm: float
    overhang_mm2: float
    support_mm3: float
    spoiled: tuple[str, ...]


@dataclass(frozen=True)
class FileCheck:
    """Check of the solid in its file, in single precision.

    Attributes
    ----------
    open_edges: edges without two oppositely oriented triangles.
    pieces: closed parts that face outward; cavities: those that face inward.
    self_intersections: pairs of intersecting triangles.
    flat_triangles: triangles without area.
    volume_mm3: without its cavities.
    """

    open_edges: int
    pieces: int
    cavities: int
    self_intersections: int
    flat_triangles: int
    volume_mm3: float

    @property
    def is_solid(self) -> bool:
        """Whether it is a flawless surface of one solid."""
        flaws = self.open_edges + self.self_intersections + self.flat_triangles
        return flaws == 0 and self.pieces == 1 and self.volume_mm3 > 0.0


@dataclass(frozen=True)
class ThinParts:
    """Parts of a die below the minimum wall thickness of its printer.

    Attributes
    ----------
    wall_mm: minimum wall thickness.
    share: share of the surface on thin parts.
    least_mm: smallest thickness; place: (3,) where, in the coordinates of die_plain.stl.
    """

    wall_mm: float
    share: float
    least_mm: float
    place: Numbers


@dataclass(frozen=True)
class Printability:
    """Printability of a die.

    Attributes
    ----------
    printer, material: names; spot_mm, layer_mm: width of its nozzle, pixel or spot, and height of
        its layers; density_g_cm3: of the material.
    weight_g: weight of the die with inlays, solid except for cavities.
    bounding_box_mm: (3,) extents along the axes of the file.
    file: check of die.stl, or of die_plain.stl without labels.
    smallest_facet: None for a concave die.
    thin: thin parts of a concave die without its labels, or None.
    labels: labels on facets.
    poses: the die on each resting facet, the most probable first.
    best: best pose for printing; placement: 4 rows of 4, the rigid motion from the file to the bed
        z = 0, centered at the origin.
    warnings: features below the printer's limits, one sentence each.
    """

    printer: str
    spot_mm: float
    layer_mm: float
    material: str
    density_g_cm3: float
    weight_g: float
    bounding_box_mm: Numbers
    file: FileCheck
    smallest_facet: SmallestFacet | None
    thin: ThinParts | None
    labels: tuple[PrintedLabel, ...]
    poses: tuple[PrintPose, ...]
    best: PrintPose
    placement: tuple[Numbers, ...]
    warnings: tuple[str, ...]
