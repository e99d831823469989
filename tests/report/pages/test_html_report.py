"""The HTML report."""

from __future__ import annotations

from typing import Any

import pytest
from common.parsed_html import parsed

from dicedesign.report.charts.png import png_bytes
from dicedesign.report.figures.bars import bars_figure
from dicedesign.report.pages.die_page import report_html

TITLES = {
    "bars": "Target and achieved odds",
    "convergence": "Error against run time",
    "gauss_map": "Where the die ends up",
    "views": "The die from several sides",
    "labels": "Every label",
}


@pytest.fixture
def result() -> dict[str, Any]:
    facet = {"normal": [0.0, 0.0, 1.0], "polygon_area_mm2": 12.345, "inradius_mm": 3.2}
    return {
        "name": "two < three",
        "status": "converged",
        "message": "all odds are within 1e-4 of their targets",
        "target": [0.5, 0.5],
        "labels": ["heads", "<tails>"],
        "probabilities": [0.4999, 0.5],
        "max_abs_error": 1e-4,
        "engraved_max_abs_error": 3e-4,
        "energy": {"odds": 1e-9, "smoothness & size": 0.25},
        "center_of_mass": [-1e-17, 1.5, -2.0],
        "facets": [
            {**facet, "label": "heads", "probability": 0.4999, "margin_deg": 12.5},
            {**facet, "label": "<tails>", "probability": 0.5, "margin_deg": 10.0},
            {**facet, "label": None, "probability": 0.0001, "margin_deg": None},
        ],
        "unstable_facets": 4,
        "history": [{"step": 0, "seconds": 0.0, "energy": 1.0, "max_abs_error": 1e-4}],
        "stages": [
            {"name": "start", "seconds": 0.5, "peak_mb": 301.2},
            {"name": "design", "seconds": 2.25, "peak_mb": None},
        ],
        "peak_since": "stage",
        "files": {"solid": "out/die.stl"},
    }


@pytest.fixture
def images() -> dict[str, bytes]:
    return dict.fromkeys(TITLES, b"\x89PNG")


def test_report_is_well_formed_and_complete(result, images):
    page = parsed(report_html(result, images))
    assert len(page.sources) == 5
    assert {"heads", "<tails>", "-", "0.49990", "0.50000", "12.5", "3.2"} <= set(page.cells)
    assert {"start", "0.50", "smoothness & size", "0.25"} <= set(page.cells)
    for text in (
        "converged",
        result["message"],
        "0.0003 with the labels cut in",
        "solid: out/die.stl",
    ):
        assert text in page.text
    assert "100 % infill" in page.text
    assert "the face down" in page.text
    assert "its other 4" in page.text
    assert "(0.000, 1.500, -2.000) mm" in page.text
    assert all(title in page.text for title in TITLES.values())


def test_report_needs_nothing_else(result, images):
    text = report_html(result, images)
    assert "http:" not in text  # embedded pictures are base64, which has no colon
    assert "https:" not in text
    assert "<script" not in text
    assert "<link" not in text
    assert all(source.startswith("data:image/png;base64,") for source in parsed(text).sources)
    assert 'name="viewport"' in text


def test_report_escapes(result, images):
    text = report_html(result, images)
    assert "<tails>" not in text
    assert "&lt;tails&gt;" in text
    assert "<title>two &lt; three</title>" in text


@pytest.mark.parametrize(
    ("since", "text"),
    [
        ("stage", "held during the stage,"),
        ("start", "held from its start to the end of the stage,"),
    ],
)
def test_stages_are_listed_with_seconds_and_memory(result, images, since, text):
    result["peak_since"] = since
    page = parsed(report_html(result, images))
    at = page.cells.index("start")
    assert page.cells[at : at + 6] == ["start", "0.50", "301.2", "design", "2.25", "-"]
    assert text in page.text


@pytest.mark.parametrize("missing", list(TITLES))
def test_absent_images_leave_their_section_out(result, images, missing):
    del images[missing]
    page = parsed(report_html(result, images))
    assert len(page.sources) == 4
    assert TITLES[missing] not in page.text


def test_report_embeds_a_real_figure(result):
    image = png_bytes(bars_figure(["a"], result["target"][:1], result["target"][:1]))
    assert len(report_html(result, {"bars": image})) > len(image)
