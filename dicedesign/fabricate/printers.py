"""What kinds of printers can make, and what they print with."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final

from dicedesign.errors import InputError
from dicedesign.runtime.registry import Extension, Registry

_SLICER: Final = "Prusa Research, filament profiles of PrusaSlicer 2.5, 2022"


@dataclass(frozen=True)
class Material:
    """A material.

    Attributes
    ----------
    title: how people write it.
    density_g_cm3: of the printed solid.
    source: of the density: author, title, year.
    """

    title: str
    density_g_cm3: float
    source: str


MATERIALS: Final = MappingProxyType(
    {
        "pla": Material("PLA", 1.24, _SLICER),
        "petg": Material("PETG", 1.27, _SLICER),
        "abs": Material("ABS", 1.04, _SLICER),
        "asa": Material("ASA", 1.07, _SLICER),
        "pc": Material("PC", 1.22, _SLICER),
        "resin": Material("resin", 1.15, "the middle of what makers of resins give, 1.1 to 1.2"),
        "pa12": Material("PA12", 0.93, "EOS, material data sheet PA 2200, 2010"),
    }
)
"""All materials by name."""


STANDARD_NOZZLE: Final = 0.4
"""Diameter in mm of the nozzle that the limits of printers with a nozzle are given for."""


@dataclass(frozen=True, kw_only=True)
class Printer(Extension):
    """A kind of printer. Lengths are in millimetres.

    Attributes
    ----------
    spot_mm: the finest that it draws: width of the nozzle, the pixel or the laser's spot.
    has_nozzle: whether that is a nozzle, which its owner may change.
    layer_mm: usual height of a layer.
    wall_mm: least thickness of a wall.
    groove_mm: least width of what is engraved; groove_depth_mm: its least depth.
    ridge_mm: least width of what stands between two grooves.
    raised_mm: least width of what is raised.
    overhang_deg: surfaces that look down and are nearer than this to level need supports; 0 where
        none do.
    dimensional_error_mm: by how much a dimension of a die's size is off at most, either way.
    shrinkage: linear, left after the printer's own compensation, as a share.
    materials: names of those it takes, the usual one first, see `MATERIALS`.
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
    shrinkage: float
    materials: tuple[str, ...]
    sources: tuple[str, ...]

    def with_nozzle(self, diameter: float) -> Printer:
        """The same with a nozzle of another diameter, above 0: what it draws is as much wider and
        its layers as much higher. Raises InputError where it has none."""
        if not self.has_nozzle:
            raise InputError(
                f"nozzle_mm: expected a printer with a nozzle, got {self.name}, which has none; "
                "leave nozzle_mm out"
            )
        ratio = diameter / STANDARD_NOZZLE
        names = ("spot_mm", "layer_mm", "wall_mm", "groove_mm", "ridge_mm", "raised_mm")
        return replace(self, **{name: ratio * getattr(self, name) for name in names})


FDM: Final = Printer(
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
    shrinkage=0.002,
    materials=("pla", "petg", "abs", "asa", "pc"),
    sources=(
        "wall, overhang, error: Print It 4 Me, Designing parts for 3D printing, read 2026",
        "groove, raised: Smith3D, 3D printing design guide, read 2026",
        "ridge: one line of the nozzle, the thinnest wall that slicers draw",
        "shrinkage: Novalab3D, Dimensional accuracy and shrinkage in FDM engineering "
        "filaments, 2026 (PLA, 0.1 to 0.2 %)",
    ),
)


SLA: Final = Printer(
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
    shrinkage=0.002,
    materials=("resin",),
    sources=(
        "spot, layer: Prusa Research, profile of the Original Prusa SL1 in PrusaSlicer 2.5, "
        "2022 (2560 pixels over 121 mm; layers of 0.05 mm)",
        "wall, groove, ridge, overhang: Formlabs, Form 2 design guide, 2017 (supported walls)",
        "raised: Micro Workshops, 3D printing design guide, read 2026",
        "error: Print It 4 Me, Designing parts for 3D printing, read 2026",
        "shrinkage: Layer X, 3D printing tolerances and dimensional accuracy, 2026 (after "
        "printing, 0.1 to 0.2 %)",
    ),
)


SLS: Final = Printer(
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
    shrinkage=0.003,
    materials=("pa12",),
    sources=(
        "spot, layer: Formlabs, Fuse 1 technical specifications, 2021",
        "wall, ridge, overhang, error: Print It 4 Me, Designing parts for 3D printing, read 2026",
        "groove, raised: JLCPCB, 3D printing design guidelines, read 2026 (PA12)",
        "shrinkage: Tempus 3D, How to design for HP Multi Jet Fusion, read 2026 (accuracy of "
        "PA12 from powder, 0.3 %)",
    ),
)

PRINTERS: Final = Registry(
    "printer",
    Printer,
    builtin=tuple(f"dicedesign.fabricate.printers:{name}" for name in ("FDM", "SLA", "SLS")),
    group="dicedesign.printers",
)
"""All kinds of printers, the most common first."""
