"""The report of a die made from a surface that is not convex: one HTML file, needing no other."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any, Final

from dicedesign.report.pages.html_parts import (
    figure_section,
    list_section,
    number,
    page,
    stages_section,
    table_section,
)
from dicedesign.report.pages.throws_section import ROLLING

__all__ = ["concave_report_html"]

_FIGURES: Final = {
    "rests": (
        "How the die lies after each outcome",
        "Above, the die on a table, with the outcome and its probability; below, its underside, as "
        "seen when the die is tipped backward. Coloured are the facets of its convex hull that it "
        "rests on, in the colour of their outcome.",
    ),
    "before_after": (
        "Before and after",
        "The surface as it came, above, and as it was made into a die, below; all views have the "
        "same scale.",
    ),
    "odds": (
        "Odds before and after",
        "Probability that the body comes to rest on each outcome, and on any other side "
        "(elsewhere), before and after it was made into a die.",
    ),
    "hull": (
        "The die within its convex hull",
        "A body rolls like its convex hull, which touches the table. Coloured are the facets that "
        "the die rests on, by outcome; those on the far side are paler.",
    ),
    "displacement": (
        "How far the surface was moved",
        "Distance of each point of the surface from where it was before, relative to the diagonal "
        "of the box that held the surface.",
    ),
    "crossings": (
        "Where the surface meets itself",
        "In red the triangles that meet and should not.",
    ),
    "energy": (
        "Energy over time",
        "Each stage lowers an energy of its own. The error, the largest difference of a "
        "probability from its target, is drawn where it was computed.",
    ),
}

_PRINTING: Final = (
    "Print the STL file in millimetres with 100 % infill, so that the density is uniform: the odds "
    "hold for a solid of one material. Let it cool, and remove supports without rounding the "
    "places that it rests on. The outcome of a throw is the side that the die lies on: compare it "
    f"with the pictures at the top. {ROLLING}"
)

_MARKED: Final = (
    " In die.stl the label of each outcome is cut into the side that is up then; die_plain.stl "
    "has none."
)


def concave_report_html(summary: Mapping[str, Any], images: Mapping[str, bytes]) -> str:
    """The report as HTML.

    Parameters
    ----------
    summary: the design's result in its JSON form. Keys "name", "status", "message", "labels" (k,),
        "target" (k,), "probabilities_before" and "probabilities" (k,), "rest_counts" (k,) rests
        that count as each outcome, "elsewhere_before" and "elsewhere" the probability of all other
        rests, "max_abs_error" the largest |p - q|, "displacement" with "mean" and "largest"
        relative to the diagonal before, "hull" with "vertices_before", "vertices_after" and "gap",
        the largest distance between the hull of the surface and the designed one relative to the
        diagonal, "surface" with "vertices" and "triangles", "quality" and "notes" (sentences),
        "stages" (each with "name", "seconds" and "peak_mb", a number or None), "peak_since"
        ("stage" or "start", what "peak_mb" counts from) and "files" (kind to path).
    images: PNG bytes of "rests", "before_after", "odds", "hull", "displacement" and "energy";
        figures that are absent are left out.

    Returns
    -------
    str, a whole document; the same for the same arguments.
    """
    verdict = f"<strong>{escape(summary['status'])}</strong>: {escape(summary['message'])}"
    parts = [f"<h1>{escape(summary['name'])}</h1>", f'<p class="verdict">{verdict}</p>']
    for key, (title, caption) in _FIGURES.items():
        if key in images:
            parts.append(figure_section(title, images[key], caption))
        if key == "odds":
            parts.append(_odds(summary))
    parts.append(list_section("Quality of the surface", summary["quality"]))
    parts.append(_measures(summary))
    if summary["notes"]:
        parts.append(list_section("Notes", summary["notes"]))
    parts.append(stages_section(summary["stages"], summary["peak_since"]))
    files = [f"{kind}: {file}" for kind, file in summary["files"].items()]
    parts.append(list_section("Files", files))
    reading = _PRINTING + (_MARKED if "die" in summary["files"] else "")
    parts.append(
        f"<section><h2>How to print and read the die</h2><p>{escape(reading)}</p></section>"
    )
    return page(summary["name"], parts)


def _odds(summary: Mapping[str, Any]) -> str:
    rows = [
        [label, f"{target:.5f}", f"{before:.5f}", f"{after:.5f}", str(rests)]
        for label, target, before, after, rests in zip(
            summary["labels"],
            summary["target"],
            summary["probabilities_before"],
            summary["probabilities"],
            summary["rest_counts"],
            strict=True,
        )
    ]
    before, after = summary["elsewhere_before"], summary["elsewhere"]
    rows.append(["elsewhere", "-", f"{before:.5f}", f"{after:.5f}", "-"])
    header = ["outcome", "target", "before", "after", "rests"]
    note = (
        f"Largest difference from the target: {number(summary['max_abs_error'], 3)}. Rests on "
        "facets that lie almost in one plane count as one outcome; elsewhere are all that belong "
        "to none."
    )
    return table_section("Odds", header, rows, note)


def _measures(summary: Mapping[str, Any]) -> str:
    moved, hull, surface = summary["displacement"], summary["hull"], summary["surface"]
    rows = [
        ["mean displacement", f"{100.0 * moved['mean']:.3g} % of the diagonal"],
        ["largest displacement", f"{100.0 * moved['largest']:.3g} % of the diagonal"],
        ["vertices of the surface", str(surface["vertices"])],
        ["triangles of the surface", str(surface["triangles"])],
        ["vertices of its hull before", str(hull["vertices_before"])],
        ["vertices of its hull after", str(hull["vertices_after"])],
        ["gap to the designed hull", f"{number(hull['gap'], 2)} of the diagonal"],
    ]
    return table_section("Measures", ["measure", "value"], rows)
