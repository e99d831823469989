"""Kinds of printers with their limits and materials, and the options of printing."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Annotated

from pydantic import Field

from dicedesign.errors import InputError
from dicedesign.runtime.registry import Extension, Options, Registry
from dicedesign.tolerances import MOST_MM

_SLICER = "Prusa Research, filament profiles of PrusaSlicer 2.5, 2022"


@dataclass(frozen=True)
class Material:
    """Material of a print.

    Attributes
    ----------
    title: name in reports.
    density_g_cm3: of the printed solid.
    source: of the density: author, title, year.
    """

    title: str
    density_g_cm3: float
    source: str


MATERIALS = MappingProxyType(
    {
        "pla": Material("PLA", 1.24, _SLICER),
        "petg": Material("PETG", 1.27, _SLICER),
        "abs": Material("ABS", 1.04, _SLICER),
        "asa": Material("ASA", 1.07, _SLICER),
        "pc": Material("PC", 1.22, _SLICER),
        "resin": Material("resin", 1.15, "middle of the manufacturers' figures, 1.1 to 1.2"),
        "pa12": Material("PA12", 0.93, "EOS, material data sheet PA 2200, 2010"),
    }
)
"""All materials by name."""


STANDARD_NOZZLE = 0.4
"""Diameter in mm of the nozzle for which printers' limits are given."""


@dataclass(frozen=True, kw_only=True)
class Printer(Extension):
    """Kind of printer. Lengths are in millimeters.

    Attributes
    ----------
    spot_mm: width of the nozzle, the pixel or the laser's spot.
    has_nozzle: whether it has a nozzle, which can be changed.
    layer_mm: usual height of a layer.
    wall_mm: least thickness of a wall.
    groove_mm: least width of engraved strokes; groove_depth_mm: least depth of engraved strokes.
    ridge_mm: least width of a ridge between two grooves.
    raised_mm: least width of raised strokes.
    overhang_deg: angle to level below which surfaces that face down need supports; 0 for a printer
        without supports.
    dimensional_error_mm: largest error of a dimension of a die's size, either way.
    roughness_mm: standard deviation of the surface beside its layers.
    shrinkage: linear, after the printer's own compensation, as a share.
    bed_width_mm: width of its print bed. bed_depth_mm: depth of its print bed.
    materials: names from `MATERIALS`, the usual one first.
    sources: of these numbers: author, title, year.
    """

    spot_mm: float
    has_nozzle: bool
    layer_mm: float
    wall_mm: float
    groove_mm: float
    groove_depth_mm: float
    ridge_mm: float
    raised_mm: float
    overhang_deg: float
    dimensional_error_mm: float
    roughness_mm: float
    shrinkage: float
    bed_width_mm: float
    bed_depth_mm: float
    materials: tuple[str, ...]
    sources: tuple[str, ...]

    @property
    def letter_mm(self) -> float:
        """Least height of capital letters: an E has three strokes and two ridges between them."""
        return 3.0 * self.groove_mm + 2.0 * self.ridge_mm

    def with_nozzle(self, diameter: float) -> Printer:
        """Printer with a nozzle of another diameter above 0, with which widths and layers scale.
        Raises InputError if it has no nozzle."""
        if not self.has_nozzle:
            raise InputError(
                f"nozzle_mm: expected a printer with a nozzle, got {self.name}, which has none; "
                "leave nozzle_mm out"
            )
        ratio = diameter / STANDARD_NOZZLE
        names = ("spot_mm", "layer_mm", "wall_mm", "groove_mm", "ridge_mm", "raised_mm")
        return replace(self, **{name: ratio * getattr(self, name) for name in names})


FDM = Printer(
    name="fdm",
    line="filament through a nozzle of 0.4 mm",
    spot_mm=0.4,
    has_nozzle=True,
    layer_mm=0.2,
    wall_mm=0.8,
    groove_mm=0.4,
    groove_depth_mm=0.4,
    ridge_mm=0.4,
    raised_mm=0.8,
    overhang_deg=45.0,
    dimensional_error_mm=0.2,
    roughness_mm=0.02,
    shrinkage=0.002,
    bed_width_mm=180.0,
    bed_depth_mm=180.0,
    materials=("pla", "petg", "abs", "asa", "pc"),
    sources=(
        "wall, overhang, error: Print It 4 Me, Designing parts for 3D printing, read 2026",
        "groove, raised: Smith3D, 3D printing design guide, read 2026",
        "ridge: one line of the nozzle, the thinnest wall that slicers draw",
        "roughness: a guess, three times the Ra of 0.007 to 0.008 mm across strands in Scientific "
        "Reports, s41598-025-26253-0, figure 14, 2025, as blobs and seams stand out",
        "shrinkage: Novalab3D, Dimensional accuracy and shrinkage in FDM engineering "
        "filaments, 2026 (PLA, 0.1 to 0.2 %)",
        "bed: Prusa Research, profile of the Original Prusa MINI in PrusaSlicer 2.5, 2022",
    ),
)


SLA = Printer(
    name="sla",
    line="resin, cured by a laser or a screen of pixels of 0.05 mm",
    spot_mm=0.05,
    has_nozzle=False,
    layer_mm=0.05,
    wall_mm=0.4,
    groove_mm=0.4,
    groove_depth_mm=0.4,
    ridge_mm=0.4,
    raised_mm=0.4,
    overhang_deg=19.0,
    dimensional_error_mm=0.1,
    roughness_mm=0.003,
    shrinkage=0.002,
    bed_width_mm=118.0,
    bed_depth_mm=66.0,
    materials=("resin",),
    sources=(
        "spot, layer, bed: Prusa Research, profile of the Original Prusa SL1 in PrusaSlicer 2.5, "
        "2022 (2560 pixels over 121 mm; layers of 0.05 mm)",
        "wall, groove, ridge, overhang: Formlabs, Form 2 design guide, 2017 (supported walls)",
        "raised: Micro Workshops, 3D printing design guide, read 2026",
        "error: Print It 4 Me, Designing parts for 3D printing, read 2026",
        "roughness: Yigu, roughness of 3D printed light-cured surfaces, read 2026 (Ra of 0.001 to "
        "0.003 mm)",
        "shrinkage: Layer X, 3D printing tolerances and dimensional accuracy, 2026 (after "
        "printing, 0.1 to 0.2 %)",
    ),
)


SLS = Printer(
    name="sls",
    line="nylon powder, sintered by a laser; needs no supports",
    spot_mm=0.2,
    has_nozzle=False,
    layer_mm=0.11,
    wall_mm=0.7,
    groove_mm=0.5,
    groove_depth_mm=0.5,
    ridge_mm=0.7,
    raised_mm=0.5,
    overhang_deg=0.0,
    dimensional_error_mm=0.3,
    roughness_mm=0.02,
    shrinkage=0.003,
    bed_width_mm=165.0,
    bed_depth_mm=165.0,
    materials=("pa12",),
    sources=(
        "spot, layer, bed: Formlabs, Fuse 1 technical specifications, 2021",
        "wall, ridge, overhang, error: Print It 4 Me, Designing parts for 3D printing, read 2026",
        "groove, raised: JLCPCB, 3D printing design guidelines, read 2026 (PA12)",
        "roughness: a guess, that of filament",
        "shrinkage: Tempus 3D, How to design for HP Multi Jet Fusion, read 2026 (accuracy of "
        "PA12 from powder, 0.3 %)",
    ),
)

PRINTERS = Registry(
    "printer",
    Printer,
    builtin=(FDM, SLA, SLS),
    group="dicedesign.printers",
)
"""All kinds of printers, the most common first."""


LengthBelow = Annotated[float, Field(ge=0.0, lt=MOST_MM)]
"""Standard deviation in mm, less than the largest die."""


@dataclass(frozen=True)
class PrintErrors(Options):
    """Standard deviations of print errors, each normal and independent.

    Defaults are of an ordinary desktop printer for filament: ±0.2 mm between two faces, as two
    standard deviations of the difference of two planes, and shrinkage of 0.2 % that slicers do not
    compensate. Resin has about half of that distance. Density drift, bubbles and the
    length over which offsets are alike are guesses, as no source specifies them; roughness is a
    printer's own.

    Raises InputError for a value out of its range.
    Source: Layer X, 3D printing tolerances and dimensional accuracy, 2026, with ±0.2 to ±0.3 mm for
    filament, ±0.1 mm for resin, and a further 0.1 to 0.2 % of shrinkage.
    """

    dimensional_mm: LengthBelow = 0.07
    """Offset of the plane of each facet along its normal, or of a curved surface, where it is alike
    over `correlation_mm`; at least 0, below 1000."""
    shrinkage: Annotated[float, Field(ge=0.0, lt=0.2)] = 0.002
    """Relative length along each axis of the printer; at least 0, below 0.2."""
    density_gradient: Annotated[float, Field(ge=0.0, lt=0.5)] = 0.01
    """Relative change of the density from the bottom of the print to its top; at least 0, below
    0.5."""
    bubble_mm3: Annotated[float, Field(ge=0.0, lt=MOST_MM**3)] = 1.0
    """Volume of a bubble somewhere in the print; at least 0, below 1e9."""
    roughness_mm: LengthBelow = 0.02
    """Offset of each point of a curved surface along its normal; at least 0, below 1000."""
    correlation_mm: Annotated[float, Field(gt=0.0, lt=MOST_MM)] = 3.0
    """Length over which the offsets of a curved surface are alike; above 0, below 1000."""


THINNEST = 0.05
"""Least thickness of walls in mm, below any printer's."""


@dataclass(frozen=True)
class PrintOptions(Options):
    """Options of `print`: printer, material, infill and errors.

    Raises InputError for a value that is unknown or out of its range.
    """

    printer: str = "fdm"
    """"fdm" for filament, "sla" for resin, "sls" for powder; `print: sla` is short for it."""
    nozzle_mm: Annotated[float, Field(gt=0.0, le=2.0)] | None = None
    """Diameter of the nozzle, above 0 and at most 2; None for the usual 0.4."""
    material: str | None = None
    """Material of the die: "pla", "petg", "abs", "asa" or "pc" for fdm, "resin" for sla, "pa12" for
    sls; None for the first of the printer's."""
    density_g_cm3: Annotated[float, Field(gt=0.0, le=25.0)] | None = None
    """Density of the printed material, above 0 and at most 25, more than any metal; None for the
    material's."""
    oriented: bool = False
    """Whether to write die_oriented.stl, in the best orientation on the print bed."""
    infill: Annotated[float, Field(ge=0.0, le=1.0)] = 1.0
    """Infill of the inside, from 0, hollow, to 1, solid, for which the die is designed."""
    walls_mm: Annotated[float, Field(ge=THINNEST, le=MOST_MM)] = 1.2
    """Thickness of the solid walls around the infill, floor and ceiling included, from
    `THINNEST` to `MOST_MM`."""
    errors: PrintErrors | None = None
    """Standard deviations of print errors, see `PrintErrors`; None for the printer's."""

    def __post_init__(self) -> None:
        super().__post_init__()
        printer = PRINTERS[self.printer]
        if self.nozzle_mm is not None:
            printer.with_nozzle(self.nozzle_mm)  # raises if it has none
        if self.material is not None and self.material not in printer.materials:
            raise InputError(
                f"material: expected {', '.join(printer.materials)} for {self.printer}, got "
                f"{self.material!r}; take one of them, or leave it out and give density_g_cm3"
            )

    @property
    def selected_printer(self) -> Printer:
        """The printer, with its nozzle."""
        printer = PRINTERS[self.printer]
        return printer if self.nozzle_mm is None else printer.with_nozzle(self.nozzle_mm)

    @property
    def expected_errors(self) -> PrintErrors:
        """Print errors of the options, or the printer's."""
        printer = self.selected_printer
        # Twice the standard deviation of the difference of two planes.
        plane = printer.dimensional_error_mm / math.sqrt(8.0)
        return self.errors or PrintErrors(
            dimensional_mm=plane, shrinkage=printer.shrinkage, roughness_mm=printer.roughness_mm
        )

    @property
    def substance(self) -> str:
        """Name of the material."""
        return self.material or self.selected_printer.materials[0]

    @property
    def density(self) -> float:
        """Density of the printed material, in g/cm3."""
        return self.density_g_cm3 or MATERIALS[self.substance].density_g_cm3
