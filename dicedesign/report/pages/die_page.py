"""The report of a design: one HTML file that needs nothing else."""

from __future__ import annotations

import json
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
    text_section,
)
from dicedesign.report.pages.throws_section import ROLLING, table_sections, throwing_advice
from dicedesign.results.record import Result

__all__ = ["die_page", "report_html"]

_FIGURES: Final = (
    (
        "bars",
        "Target and achieved odds",
        "Probability that the die comes to rest on the facet with each label.",
    ),
    (
        "convergence",
        "Error against run time",
        "Largest difference of a probability from its target, and the energy, after each step.",
    ),
    (
        "gauss_map",
        "Where the die ends up",
        "Every point is a direction of the die that points down when it is let go; its colour "
        "tells on which facet the die comes to rest if it rolls there without momentum.",
    ),
    ("views", "The die from several sides", "All views have the same scale."),
    ("labels", "Every label", "Each labelled facet seen straight from outside."),
)

_PRINTING: Final = (
    "Print the STL file in millimetres with 100 % infill, so that the density is uniform: the odds "
    "hold for a solid of one material. Let it cool, and remove supports without rounding edges. "
    "The outcome of a throw is the label on the facet that the die rests on, i.e. the face down: "
    "lift the die and read its underside."
)


def die_page(result: Result, images: Mapping[str, bytes]) -> str:
    """The page of a finished die as HTML."""
    return report_html(json.loads(result.json_text()), images)


def report_html(result: Mapping[str, Any], images: Mapping[str, bytes]) -> str:
    """The report as HTML.

    Parameters
    ----------
    result: the design's result in its JSON form. Keys "name", "status", "message", "target" (k,),
        "labels" (k,), "energy" (term to value), perhaps "engraved_max_abs_error",
        "center_of_mass" (3,) in mm, "facets" (each with "label" or None, "probability",
        "polygon_area_mm2", "inradius_mm" and "margin_deg"), "unstable_facets", "stages" (each with
        "name", "seconds" and "peak_mb", a number or None), "peak_since" ("stage" or "start", what
        "peak_mb" counts from) and "files" (kind to path). For a die that is to be thrown also
        "thrown", see `dicedesign.report.pages.throws_section`; its probabilities are those without
        momentum.
    images: PNG bytes of "bars" (not shown for a die that is to be thrown), "convergence",
        "gauss_map", "views" and "labels", and those of
        `dicedesign.report.pages.throws_section`; sections of those that are absent are left out.

    Returns
    -------
    str, a whole document; the same for the same arguments.
    """
    verdict = f"<strong>{escape(result['status'])}</strong>: {escape(result['message'])}"
    thrown = result.get("thrown")
    if thrown is None and "engraved_max_abs_error" in result:
        verdict += f"; {number(result['engraved_max_abs_error'], 3)} with the labels cut in"
    parts = [
        f"<h1>{escape(result['name'])}</h1>",
        f'<p class="verdict">{verdict}</p>',
    ]
    if thrown is not None:
        parts += table_sections(result, images)
    parts += [
        figure_section(title, images[key], caption)
        for key, title, caption in _FIGURES
        if key in images and (thrown is None or key != "bars")
    ]
    parts += [_facets(result), _details(result)]
    advice = ROLLING if thrown is None else throwing_advice(thrown["table"])
    parts.append(text_section("How to print and read the die", [f"{_PRINTING} {advice}"]))
    return page(result["name"], parts)


def _facets(result: Mapping[str, Any]) -> str:
    targets = dict(zip(result["labels"], result["target"], strict=True))
    rows = []
    for facet in result["facets"]:
        label = facet["label"]
        rows.append(
            [
                "-" if label is None else label,
                f"{facet['probability']:.5f}",
                "-" if label is None else f"{targets[label]:.5f}",
                number(facet["polygon_area_mm2"], 4),
                number(facet["inradius_mm"], 3),
                number(facet["margin_deg"], 3),
            ]
        )
    odds = "without momentum" if "thrown" in result else "probability"
    header = ["label", odds, "target", "area (mm²)", "inscribed radius (mm)", "margin (°)"]
    x, y, z = (f"{round(value, 3) + 0.0:.3f}" for value in result["center_of_mass"])
    note = (
        "Facets that the die can rest on; it cannot rest on its other "
        f"{result['unstable_facets']}. The margin is the angle by which the die must be tipped to "
        "leave the facet. "
        f"Center of mass: ({x}, {y}, {z}) mm."
    )
    return table_section("Facets", header, rows, note)


def _details(result: Mapping[str, Any]) -> str:
    terms = [[term, number(value, 4)] for term, value in result["energy"].items()]
    files = [f"{kind}: {file}" for kind, file in result["files"].items()]
    return "\n".join(
        [
            stages_section(result["stages"], result["peak_since"]),
            table_section("Energy", ["term", "value"], terms),
            list_section("Files", files),
        ]
    )
