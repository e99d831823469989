"""The HTML report of a concave die."""

from __future__ import annotations

from typing import Any

import pytest
from common.parsed_html import parsed

from dicedesign.report.pages.concave_page import concave_report_html

TITLES = {
    "rests": "How the die lies after each outcome",
    "before_after": "Before and after",
    "odds": "Odds before and after",
    "hull": "The die within its convex hull",
    "displacement": "How far the surface was moved",
    "crossings": "Where the surface meets itself",
    "energy": "Energy over time",
}


@pytest.fixture
def summary() -> dict[str, Any]:
    return {
        "name": "two < three",
        "status": "converged",
        "message": "all odds are within 0.005 & nothing crosses",
        "labels": ["heads", "<tails>"],
        "target": [0.5, 0.5],
        "probabilities_before": [0.125, 0.25],
        "probabilities": [0.4975, 0.5],
        "rest_counts": [3, 17],
        "elsewhere_before": 0.625,
        "elsewhere": 0.0025,
        "max_abs_error": 0.0025,
        "displacement": {"mean": 0.0312, "largest": 0.115},
        "hull": {"vertices_before": 430, "vertices_after": 363, "gap": 3.2e-6},
        "surface": {"vertices": 3301, "triangles": 6598},
        "quality": ["No two triangles <cross>.", "No triangle is inverted."],
        "notes": ["7 vertices were welded"],
        "stages": [
            {"name": "start", "seconds": 0.5, "peak_mb": 301.2},
            {"name": "hull design", "seconds": 2.25, "peak_mb": None},
        ],
        "peak_since": "start",
        "files": {"die_plain": "die_plain.stl"},
    }


@pytest.fixture
def images() -> dict[str, bytes]:
    return {key: b"\x89PNG" + key.encode() for key in TITLES}


def test_report_is_well_formed_and_complete(summary: dict[str, Any], images: dict[str, bytes]):
    page = parsed(concave_report_html(summary, images))
    assert len(page.sources) == len(set(page.sources)) == 7
    cells = page.cells
    at = cells.index("heads")
    assert cells[at : at + 15] == [
        *("heads", "0.50000", "0.12500", "0.49750", "3"),
        *("<tails>", "0.50000", "0.25000", "0.50000", "17"),
        *("elsewhere", "-", "0.62500", "0.00250", "-"),
    ]
    measures = dict(zip(cells[at + 15 :: 2], cells[at + 16 :: 2], strict=False))
    assert measures["mean displacement"] == "3.12 % of the diagonal"
    assert measures["largest displacement"] == "11.5 % of the diagonal"
    assert measures["vertices of its hull before"] == "430"
    assert measures["vertices of its hull after"] == "363"
    assert measures["gap to the designed hull"] == "3.2e-06 of the diagonal"
    assert measures["vertices of the surface"] == "3301"
    assert measures["triangles of the surface"] == "6598"
    at = cells.index("start")
    assert cells[at : at + 6] == ["start", "0.50", "301.2", "hull design", "2.25", "-"]
    for text in (
        "converged: all odds are within 0.005 & nothing crosses",
        "No two triangles <cross>.",
        "7 vertices were welded",
        "die_plain: die_plain.stl",
        "Largest difference from the target: 0.0025.",
        "held from its start to the end of the stage,",
        "100 % infill",
        "Thrown it has others; the command dicedesign throw shows by how much.",
        *TITLES.values(),
    ):
        assert text in page.text


def test_report_needs_nothing_else_and_escapes(summary: dict[str, Any], images: dict[str, bytes]):
    text = concave_report_html(summary, images)
    for part in ("http:", "https:", "<script", "<link", "<tails>", "<cross>"):
        assert part not in text
    assert "<title>two &lt; three</title>" in text
    assert all(source.startswith("data:image/png;base64,") for source in parsed(text).sources)
    assert text == concave_report_html(summary, images)


def test_sections_are_in_a_readers_order(summary: dict[str, Any], images: dict[str, bytes]):
    text = parsed(concave_report_html(summary, images)).text
    order = [*TITLES.values(), "Quality of the surface", "Measures", "Notes", "Stages", "Files"]
    places = [text.index(title) for title in order]
    assert places == sorted(places)


@pytest.mark.parametrize("missing", list(TITLES))
def test_absent_images_leave_their_section_out(
    summary: dict[str, Any], images: dict[str, bytes], missing: str
):
    del images[missing]
    page = parsed(concave_report_html(summary, images))
    assert len(page.sources) == 6
    # The table of odds stands by itself.
    assert "elsewhere" in page.cells
    assert TITLES[missing] not in page.text


def test_without_notes_there_is_no_such_section(summary: dict[str, Any]):
    summary["notes"] = []
    assert "Notes" not in parsed(concave_report_html(summary, {})).text


def test_marks_are_explained_where_there_are_some(summary: dict[str, Any]):
    assert "cut into the side that is up" not in concave_report_html(summary, {})
    summary["files"]["die"] = "die.stl"
    assert "cut into the side that is up" in concave_report_html(summary, {})
