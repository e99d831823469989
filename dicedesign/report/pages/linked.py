"""The part of a report where 3D view, facets and Gauss map of a die are linked."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape
from typing import Final

from dicedesign.report.figures.figure import FIGURES
from dicedesign.report.figures.gauss_map import MAP_SIZE
from dicedesign.report.live.live_die import LiveDie, viewer_file
from dicedesign.report.live.three import three_script
from dicedesign.report.pages.html_parts import (
    LinkedRow,
    PageScript,
    figure_section,
    number,
    table_section,
)
from dicedesign.results.result import Result

__all__ = ["MAP", "linked_sections", "page_script"]

MAP: Final = "gauss_map"
"""Name of the figure that is shown here."""

_TURNING: Final = (
    "Drag the die, or use the arrow keys, to turn it; + and −, or the wheel after a click, bring "
    "it nearer. "
)

_LINKED: Final = "What is pointed at here or in the table is shown in both"

_MAPPED: Final = "What is pointed at here, in the table or on the map below is shown in all three"

_FACET: Final = ": the facet that the die rests on."

_STANDING: Final = (
    "Point at a row of the table, and the die stands so. Coloured is what touches the table then."
)


def linked_sections(result: Result, image: bytes | None, live: LiveDie | None) -> Iterator[str]:
    """3D view, table of facets and Gauss map, as far as they are there.

    image: PNG of the map, or None; live: the die, or None for a page that does not move.
    """
    yield '<div class="linked">'
    if live is not None and live.solid is not None:
        yield _view(live, image is not None)
    yield _rests(result, live) if result.concave is not None else _facets(result, live)
    if image is not None:
        figure = FIGURES[MAP]
        overlay = "" if live is None else _overlay(live)
        yield figure_section(figure.title, image, figure.caption, overlay)
    yield "</div>"


def page_script(live: LiveDie) -> PageScript:
    """What the page of a die runs."""
    text, style = viewer_file("viewer.js"), viewer_file("viewer.css")
    three = three_script()
    if live.solid is None or three is None:
        return PageScript(text, style)
    return PageScript(text, style, {"solid": live.solid, "three": three.encode()}, (three,))


def _view(live: LiveDie, has_map: bool) -> str:
    stands = " data-stands" if live.stands else ""
    center = _vector(live.center.tolist())
    meaning = _STANDING if live.stands else (_MAPPED if has_map else _LINKED) + _FACET
    note = f'<p class="note">{escape(_TURNING + meaning)}</p>'
    return (
        f'<section class="view" id="view" data-center="{center}"{stands} hidden>'
        '<h2>The die</h2><canvas tabindex="0" role="img" aria-label="The die, to be turned with '
        f'the arrow keys"></canvas><output></output>{note}</section>'
    )


def _overlay(live: LiveDie) -> str:
    """Invisible basins over the map."""
    width, height = MAP_SIZE
    paths = "".join(
        f'<path data-facet="{facet}" d="{path}"></path>' for facet, path in enumerate(live.outlines)
    )
    return f'<svg viewBox="0 0 {width:g} {height:g}" aria-hidden="true">{paths}</svg>'


def _facets(result: Result, live: LiveDie | None) -> str:
    targets = dict(zip(result.labels, result.target, strict=True))
    rows = [
        [
            facet.label or "-",
            f"{facet.probability:.5f}",
            f"{targets[facet.label]:.5f}" if facet.label else "-",
            number(facet.polygon_area_mm2, 4),
            number(facet.inradius_mm, 3),
            number(facet.margin_deg, 3),
        ]
        for facet in result.facets
    ]
    odds = "probability" if result.thrown is None else "without momentum"
    header = ["outcome", odds, "target", "area (mm²)", "inscribed radius (mm)", "margin (°)"]
    x, y, z = (f"{round(value, 3) + 0.0:.3f}" for value in result.center_of_mass)
    note = (
        "Facets that the die can rest on; it cannot rest on its other "
        f"{result.unstable_facets}. The margin is the angle by which the die must be tipped to "
        f"leave the facet. Center of mass: ({x}, {y}, {z}) mm."
    )
    return table_section("Facets", header, rows, _with_reason(note, live), _links(result, live))


def _rests(result: Result, live: LiveDie | None) -> str:
    rows = [
        [facet.outcome or "-", f"{facet.probability:.5f}", number(facet.margin_deg, 3)]
        for facet in result.facets
    ]
    note = (
        "Every way that the die can lie, by the outcome that it counts for. The margin is the "
        "angle by which the die must be tipped to leave it."
    )
    header = ["outcome", "probability", "margin (°)"]
    return table_section("Rests", header, rows, _with_reason(note, live), _links(result, live))


def _with_reason(note: str, live: LiveDie | None) -> str:
    return note if live is None or not live.left_out else f"{note} {live.left_out}"


def _links(result: Result, live: LiveDie | None) -> list[LinkedRow]:
    if live is None:
        return []
    links = []
    for rest, facet in enumerate(result.facets):
        data = {"facet": str(rest), "down": _vector(facet.normal)}
        data["height"] = f"{live.heights[rest]:.6g}"
        upward = live.upward[rest]
        if upward is not None:
            data["up"] = _vector(upward.tolist())
        links.append(LinkedRow(data, live.colors[rest]))
    return links


def _vector(values: Sequence[float]) -> str:
    return " ".join(f"{value:.6g}" for value in values)
