"""The part of a report that is about what a printer makes of its die."""

from __future__ import annotations

from collections.abc import Iterator

from dicedesign.fabricate.printers import MATERIALS
from dicedesign.report.pages.html_parts import number, table_section
from dicedesign.results.parts import Printability, PrintPose

__all__ = ["printability_sections"]


def printability_sections(found: Printability) -> Iterator[str]:
    """What the printer makes of a die, its labels and the ways to lay it on the bed."""
    x, y, z = (f"{extent:.1f}" for extent in found.bounding_box_mm)
    file = found.file
    rows = [
        [
            "printer",
            f"{found.printer.upper()}, {found.spot_mm:g} mm, layers of {found.layer_mm:g} mm",
        ],
        ["weight", f"{number(found.weight_g, 3)} g of {_material(found)}, solid"],
        ["extent in the file", f"{x} × {y} × {z} mm"],
        ["height as it is best printed", f"{found.best.height_mm:.1f} mm"],
        ["on the bed then", _bed(found.best)],
        ["needs supports then", _supports(found.best)],
        ["labels on the bed or on supports", ", ".join(found.best.spoiled) or "none"],
        [
            "file",
            f"one closed solid without a flaw{', with a cavity' if file.cavities else ''}"
            if file.is_solid
            else f"{file.open_edges} open edges, {file.pieces} pieces, {file.self_intersections} "
            f"pairs of triangles that meet, {file.flat_triangles} without area",
        ],
    ]
    if found.smallest_facet is not None:
        facet = found.smallest_facet
        rows.append(
            [
                "smallest facet",
                f"{facet.area_mm2:.1f} mm², a circle of radius {facet.inradius_mm:.2f} mm",
            ]
        )
    if found.thin is not None:
        thin = found.thin
        x, y, z = (f"{coordinate:.1f}" for coordinate in thin.place)
        rows.append(
            [
                f"thinner than {thin.wall_mm:g} mm",
                f"{100.0 * thin.share:.2g} % of the surface, least {thin.least_mm:.2g} mm at "
                f"({x}, {y}, {z})",
            ]
        )
    note = (
        "Limits are those of design guides for this kind of printer; yours may do better or worse."
    )
    yield table_section("Printing", ["", ""], rows, note)
    if found.labels:
        yield table_section(
            "Labels in print (mm)",
            ["label", "thinnest stroke", "between strokes", "wall beneath"],
            [
                [
                    label.text,
                    *(
                        number(width, 2)
                        for width in (label.stroke_mm, label.ridge_mm, label.wall_mm)
                    ),
                ]
                for label in found.labels
            ],
        )
    if found.smallest_facet is not None:
        yield table_section(
            "Printed as it rests",
            [
                "on the bed",
                "on the bed (mm²)",
                "height (mm)",
                "overhang (mm²)",
                "beneath it (mm³)",
                "labels spoiled",
            ],
            [
                [
                    pose.label or "-",
                    f"{pose.contact_mm2:.1f}",
                    f"{pose.height_mm:.1f}",
                    f"{pose.overhang_mm2:.1f}",
                    f"{pose.support_mm3:.0f}",
                    ", ".join(pose.spoiled) or "-",
                ]
                for pose in found.poses
            ],
        )


def _printer(found: Printability) -> str:
    return f"{found.printer.upper()}, {found.spot_mm:g} mm, layers of {found.layer_mm:g} mm"


def _material(found: Printability) -> str:
    return f"{MATERIALS[found.material].title}, {found.density_g_cm3:g} g/cm³"


def _bed(pose: PrintPose) -> str:
    where = "a facet without label" if pose.label is None else f"the facet of {pose.label}"
    return f"{where}, {pose.contact_mm2:.1f} mm²"


def _supports(pose: PrintPose) -> str:
    if round(pose.overhang_mm2, 1) == 0.0:
        return "nothing"
    return f"{pose.overhang_mm2:.1f} mm², {pose.support_mm3:.0f} mm³ beneath"
