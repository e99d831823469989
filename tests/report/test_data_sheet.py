"""Data sheets have their texts and pictures in place, also for a PDF reader."""

from __future__ import annotations

from dataclasses import replace
from io import BytesIO

import numpy as np
import pypdf
import pytest
from common.finished import finished_box

from dicedesign.report.data_sheet import (
    HEIGHT,
    WIDTH,
    SheetFacts,
    data_sheet,
    four_views,
    sheet_facts,
    sheet_pdf,
    wrap,
)
from dicedesign.report.raster import decode_png
from dicedesign.report.renderer import RenderMesh
from dicedesign.report.sheet import Sheet, text_width
from dicedesign.results.result import Engraved

BLANK = np.full((40, 40, 3), 128, dtype=np.uint8)

FIGURE = np.zeros((600, 1200, 3), dtype=np.uint8)


def facts(count: int) -> SheetFacts:
    rows = [[f"label {k}", f"{k}.25", f"{k}.5", "0.000"] for k in range(count)]
    return SheetFacts(
        title="a die",
        subtitle="of many outcomes",
        sections=[("Read", ["Lift it and look. " * 6]), ("Size", ["Large."])],
        header=["outcome", "asked for", "printed", "error"],
        rows=rows,
        remark="Largest error: none.",
        checksum="SHA-256 of die.stl: " + "0123456789abcdef" * 4,
    )


def draw(texts: SheetFacts, figures: tuple[np.ndarray, ...] = ()) -> Sheet:
    return data_sheet(texts, [(f"side {k}", BLANK) for k in range(4)], figures)


def bases(sheet: Sheet) -> dict[str, float]:
    """Distances of texts from the upper border."""
    return {t.get_text(): HEIGHT * (1.0 - t.get_position()[1]) for t in sheet.figure.texts}


@pytest.mark.parametrize("count", [1, 40, 400])
def test_rows_of_a_table_are_on_the_page_or_counted(count: int) -> None:
    places = bases(draw(facts(count), (FIGURE,)))
    rows = [base for text, base in places.items() if text.startswith("label ")]
    assert (np.diff(rows) > 9.5).all()
    assert rows[-1] < places["Largest error: none."] < HEIGHT - 48.0
    left_out = count - len(rows)
    assert left_out == 0 or len(rows) >= 30
    assert (f"and {left_out} more: see result.json" in places) == (left_out > 0)


def test_a_figure_is_shown_where_there_is_room() -> None:
    """Between the views and the text, which moves down for it; others only beside short tables."""
    few, many = draw(facts(2), (FIGURE, FIGURE)), draw(facts(40), (FIGURE, FIGURE))
    assert len(few.drawing.images) == 6
    assert bases(few)["Read"] > bases(draw(facts(2)))["Read"] + 300.0
    assert len(many.drawing.images) == 5
    for sheet in (few, many):
        for image in sheet.drawing.images:
            left, right, bottom, top = image.get_extent()
            assert 0.0 < left < right < WIDTH
            assert 0.0 < top < bottom < HEIGHT - 48.0


@pytest.mark.parametrize(("words", "fits"), [(420, True), (2000, False)])
def test_long_texts_end_on_the_page(words: int, fits: bool) -> None:
    texts = [("Read", ["Lift it and look. " * (words // 8)]), ("Print", ["long " * (words // 2)])]
    sheet = draw(replace(facts(5), sections=texts))
    assert max(bases(sheet).values()) < HEIGHT - 30.0
    assert ("more in result.json" in sheet.texts) == (not fits)
    assert (" ".join(sheet.texts).split().count("long") == words // 2) == fits


def test_lines_are_as_wide_as_they_may_be() -> None:
    text = "aa bb " * 30 + "c" * 120 + " end"
    lines = wrap(text, 300.0, 19)
    assert "".join(lines).replace(" ", "") == text.replace(" ", "")
    assert all(text_width(line, 19) <= 300.0 for line in lines)
    assert len(lines) < 1.4 * text_width(text, 19) / 300.0


def test_the_pdf_is_one_page_of_a4_with_text_and_the_png_the_same() -> None:
    die = finished_box()
    body = die.plain.body
    surface = RenderMesh(body.points, body.triangles, smooth=False)
    texts = sheet_facts(die, "die.stl", "ab" * 32)
    sheet = data_sheet(texts, four_views(surface, die.upward))
    data = sheet_pdf(sheet, "box")
    assert data == sheet_pdf(sheet, "box")
    reader = pypdf.PdfReader(BytesIO(data))
    assert reader.metadata.title == "box"
    (page,) = reader.pages
    size = np.array([float(page.mediabox.width), float(page.mediabox.height)])
    np.testing.assert_allclose(size / 72.0 * 25.4, [210.0, 297.0], atol=0.1)
    assert len(page.images) == 4
    text = page.extract_text()
    for expected in ("a < box", "<6>", "ab" * 32, "14.0 × 16.0 × 20.0 mm", "4.48 cm³"):
        assert expected in text
    for probabilities in die.result.probabilities:
        assert f"{100.0 * probabilities:.3f}" in text
    pixels = decode_png(sheet.png(dpi=150))
    assert pixels.shape == (1754, 1240, 3)
    assert 0.01 < (pixels.mean(axis=2) < 128).mean() < 0.3


def test_probabilities_are_those_of_the_printed_file() -> None:
    die = finished_box()
    probabilities = np.array(die.result.probabilities)[::-1]
    engraved = Engraved(tuple(probabilities), 0.0, 0.25)
    labeled = replace(die, result=replace(die.result, engraved=engraved))
    texts = sheet_facts(labeled, "die.stl", "ab")
    assert [row[2] for row in texts.rows] == [f"{100.0 * value:.3f}" for value in probabilities]
    for row in texts.rows:
        assert float(row[3]) == pytest.approx(float(row[2]) - float(row[1]), abs=0.0011)
    assert "25 %" in texts.remark
