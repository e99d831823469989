"""Powder, sintered by a laser; it carries what is printed in it."""

from __future__ import annotations

from dicedesign.fabricate.printing.printer import PRINTERS, Printer

PRINTERS.register(
    Printer(
        name="sls",
        line="nylon powder, sintered by a laser; needs no supports",
        rank=30,
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
            "wall, ridge, overhang, error: Print It 4 Me, Designing parts for 3D printing, read "
            "2026",
            "groove, raised: JLCPCB, 3D printing design guidelines, read 2026 (PA12)",
            "shrinkage: Tempus 3D, How to design for HP Multi Jet Fusion, read 2026 (accuracy of "
            "PA12 from powder, 0.3 %)",
        ),
    )
)
