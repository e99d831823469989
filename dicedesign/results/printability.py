"""What a printer makes of a die: a part of `Result`.

Lengths are in millimetres.
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["FileCheck", "PrintPose", "Printability", "PrintedLabel", "SmallestFacet", "ThinParts"]


@dataclass(frozen=True)
class SmallestFacet:
    """The facet of a convex die with the smallest largest circle: its area, and the radius of that
    circle."""

    area_mm2: float
    inradius_mm: float


@dataclass(frozen=True)
class PrintedLabel:
    """The finest parts of a label.

    Attributes
    ----------
    text: the label.
    stroke_mm: width of its thinnest stroke, None where no two sides of one are parallel.
    ridge_mm: least width of what stands between two strokes, or None where nothing does.
    wall_mm: least distance of the floor of its pocket from a facet beneath, or of the pocket from
        another; None where it has no pocket.
    """

    text: str
    stroke_mm: float | None
    ridge_mm: float | None
    wall_mm: float | None


@dataclass(frozen=True)
class PrintPose:
    """A die as it lies on the print bed.

    Attributes
    ----------
    label: that lies on the bed, or None.
    normal: (3,) unit direction of the body that points to the bed.
    contact_mm2: area on the bed.
    height_mm: of the die above it.
    overhang_mm2: area that looks down so nearly level that it needs supports; support_mm3: volume
        beneath it, at most that of the supports.
    spoiled: labels that touch the bed or supports.
    """

    label: str | None
    normal: tuple[float, ...]
    contact_mm2: float
    height_mm: float
    overhang_mm2: float
    support_mm3: float
    spoiled: tuple[str, ...]


@dataclass(frozen=True)
class FileCheck:
    """The solid as its file holds it, in single precision.

    Attributes
    ----------
    open_edges: edges that do not lie between two triangles which run along it in opposite
        directions.
    pieces: closed parts that face outward; cavities: those that face inward.
    self_intersections: pairs of triangles that meet and should not, but for lines.
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
        """Whether it is the surface of one solid, without a flaw."""
        flaws = self.open_edges + self.self_intersections + self.flat_triangles
        return flaws == 0 and self.pieces == 1 and self.volume_mm3 > 0.0


@dataclass(frozen=True)
class ThinParts:
    """Parts of a die that are thinner than its printer makes walls.

    Attributes
    ----------
    wall_mm: least thickness of what it makes.
    share: of the surface that bounds such parts.
    least_mm: thickness of the thinnest; place: (3,) the middle of it, in the coordinates of
        die_plain.stl.
    """

    wall_mm: float
    share: float
    least_mm: float
    place: tuple[float, ...]


@dataclass(frozen=True)
class Printability:
    """How a die is printed, and what will be hard.

    Attributes
    ----------
    printer, material: names; spot_mm, layer_mm: width of its nozzle, pixel or spot, and height of
        its layers; density_g_cm3: of the material.
    weight_g: of the die, solid but for cavities, with what fills its labels.
    bounding_box_mm: (3,) extents along the axes of the file.
    file: the check of die.stl, or of die_plain.stl where there are no labels.
    smallest_facet: None of a die that is not convex.
    thin: parts of a die that keeps the shape of a surface, before labels are cut in; None where
        there are none, and of other dice.
    labels: of a die that has them on its facets.
    poses: the die on each facet that it can rest on, the most probable first.
    best: the pose to print it in; placement: 4 rows of 4, the rigid motion from the file to the bed
        z = 0, about whose origin it then lies.
    warnings: what this printer will not make, one sentence each.
    """

    printer: str
    spot_mm: float
    layer_mm: float
    material: str
    density_g_cm3: float
    weight_g: float
    bounding_box_mm: tuple[float, ...]
    file: FileCheck
    smallest_facet: SmallestFacet | None
    thin: ThinParts | None
    labels: tuple[PrintedLabel, ...]
    poses: tuple[PrintPose, ...]
    best: PrintPose
    placement: tuple[tuple[float, ...], ...]
    warnings: tuple[str, ...]
