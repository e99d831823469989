"""Filament, melted and laid down by a nozzle."""

from __future__ import annotations

from dicedesign.fabricate.printing.printer import PRINTERS, Printer

PRINTERS.register(
    Printer(
        name="fdm",
        line="filament through a nozzle of 0.4 mm",
        rank=10,
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
)
