"""Resin, cured by light."""

from __future__ import annotations

from dicedesign.fabricate.printing.printer import PRINTERS, Printer

PRINTERS.register(
    Printer(
        name="sla",
        line="resin, cured by a laser or a screen of pixels of 0.05 mm",
        rank=20,
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
)
