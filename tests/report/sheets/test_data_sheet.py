"""Data sheets: what is on the page, where, and whether a PDF reader finds it."""

from __future__ import annotations

from dataclasses import replace
from io import BytesIO
from itertools import pairwise

import numpy as np
import pypdf
import pytest
from common.finished import finished_box
from PIL import Image

from dicedesign.report.charts.paper import text_width
from dicedesign.report.render.renderer import Surface
from dicedesign.report.sheets.data_sheet import VIEW, VIEWS, draw_data_sheet, wrapped
from dicedesign.report.sheets.facts import SheetFacts, sheet_facts
from dicedesign.report.sheets.pages import FINE, HEIGHT, WIDTH, PdfPage, PngPage
from dicedesign.report.sheets.views import CORNERS, four_views
from dicedesign.results.result import Engraved

BLANK = np.full((FINE * VIEW, FINE * VIEW, 3), 128, dtype=np.uint8)

VIEWS_SHOWN = [(f"side {k}", BLANK) for k in range(VIEWS)]


class Recorded:
    """A page that remembers what is drawn, as boxes (left, top, right, bottom)."""

    def __init__(self) -> None:
        self.texts: dict[str, tuple[float, float]] = {}
        self.written: list[str] = []
        self.boxes: list[tuple[float, ...]] = []

    def box(self, left: float, top: float, right: float, bottom: float, color: str) -> None:
        self.boxes.append((left, top, right, bottom))

    def text(self, text: str, left: float, base: float, **more) -> None:
        self.texts[text] = (left, base)
        self.written.append(text)
        self.boxes.append((left, base, left, base))

    def picture(self, picture: np.ndarray, left: float, top: float) -> None:
        height, width = (length / FINE for length in picture.shape[:2])
        self.boxes.append((left, top, left + width, top + height))


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


def drawn(count: int, figures=()) -> Recorded:
    page = Recorded()
    draw_data_sheet(page, facts(count), VIEWS_SHOWN, figures)
    return page


@pytest.mark.parametrize("count", [1, 20, 36, 40])
def test_every_row_of_a_table_is_on_the_page(count: int) -> None:
    page = drawn(count)
    bases = [page.texts[f"label {k}"][1] for k in range(count)]
    assert (np.diff(bases) > 20.0).all()
    assert bases[-1] < page.texts["Largest error: none."][1] < HEIGHT - 100.0
    assert not any("more" in text for text in page.texts)


@pytest.mark.parametrize("count", [60, 400])
def test_a_long_table_tells_how_much_is_left_out(count: int) -> None:
    page = drawn(count)
    shown = sum(text.startswith("label ") for text in page.texts)
    assert 40 <= shown < count
    assert f"and {count - shown} more: see result.json" in page.texts


@pytest.mark.parametrize("count", [3, 36, 400])
def test_nothing_leaves_the_page(count: int) -> None:
    figure = np.zeros((900, 1500, 3), dtype=np.uint8)
    for left, top, right, bottom in drawn(count, [figure]).boxes:
        assert 0.0 <= left <= right <= WIDTH
        assert 0.0 <= top <= bottom <= HEIGHT - 60.0


def test_a_figure_is_shown_where_there_is_room() -> None:
    """Between the views and the text, which moves down for it."""
    figure = np.zeros((600, 1200, 3), dtype=np.uint8)
    few, many = drawn(5, [figure]), drawn(40, [figure])
    assert len(few.boxes) == len(drawn(5).boxes) + 1
    assert few.texts["Read"][1] > drawn(5).texts["Read"][1] + 300.0
    assert many.boxes == drawn(40).boxes


@pytest.mark.parametrize(("words", "fits"), [(100, True), (300, True), (420, True), (2000, False)])
def test_long_texts_end_on_the_page(words: int, fits: bool) -> None:
    sections = [
        ("Read", ["Lift it and look. " * (words // 8)]),
        ("Print", ["long " * (words // 2)]),
    ]
    page = Recorded()
    figure = np.zeros((600, 1200, 3), dtype=np.uint8)
    draw_data_sheet(page, replace(facts(5), sections=sections), VIEWS_SHOWN, [figure])
    assert max(bottom for *_, bottom in page.boxes) < HEIGHT - 60.0
    assert ("more in result.json" in page.texts) == (not fits)
    assert "Print" in page.texts or not fits
    shown = " ".join(page.written).split().count("long")
    assert (shown == words // 2) == fits


def test_lines_are_as_wide_as_they_may_be() -> None:
    text = "aa bb " * 30 + "c" * 120 + " end"
    lines = list(wrapped(text, 300.0, 19))
    assert "".join(lines).replace(" ", "") == text.replace(" ", "")
    assert len(lines) > 8
    assert all(text_width(line, 19) <= 300.0 for line in lines)
    wide = [text_width(f"{a} {b.split()[0]}", 19) for a, b in pairwise(lines)]
    assert min(wide) > 300.0


def content(page, die) -> bytes:
    found = sheet_facts(die, "die.stl", "ab" * 32)
    body = die.plain.body
    surface = Surface(body.points, body.triangles, smooth=False)
    draw_data_sheet(page, found, four_views(surface, die.upward, FINE * VIEW))
    return page.content()


def test_the_pdf_is_one_page_of_a4_with_text() -> None:
    die = finished_box()
    data = content(PdfPage("box"), die)
    assert data == content(PdfPage("box"), die)
    reader = pypdf.PdfReader(BytesIO(data))
    assert reader.metadata.title == "box"
    (page,) = reader.pages
    size = np.array([float(page.mediabox.width), float(page.mediabox.height)])
    np.testing.assert_allclose(size / 72.0 * 25.4, [210.0, 297.0], atol=0.1)
    assert len(page.images) == VIEWS // 2  # Opposite sides of a box look alike.
    text = page.extract_text()
    result = die.result
    for expected in ("a < box", "<6>", "ab" * 32, "14.0 × 16.0 × 20.0 mm", "4.48 cm³"):
        assert expected in text
    for odds in result.probabilities:
        assert f"{100.0 * odds:.3f}" in text


def test_the_png_has_the_same_sheet() -> None:
    data = content(PngPage(), finished_box())
    image = Image.open(BytesIO(data))
    assert image.size == (WIDTH, HEIGHT)
    dark = (np.asarray(image.convert("L")) < 128).mean()
    assert 0.01 < dark < 0.3
    assert data == content(PngPage(), finished_box())


def test_odds_are_those_of_the_printed_file() -> None:
    die = finished_box()
    odds = np.array(die.result.probabilities)[::-1]
    labelled = replace(die.result, engraved=Engraved(tuple(odds), 0.0, 0.25))
    found = sheet_facts(replace(die, result=labelled), "die.stl", "ab")
    assert [row[2] for row in found.rows] == [f"{100.0 * value:.3f}" for value in odds]
    for row in found.rows:
        assert float(row[3]) == pytest.approx(float(row[2]) - float(row[1]), abs=0.0011)
    assert "25 %" in found.remark


def test_all_of_a_convex_die_is_seen_from_four_sides() -> None:
    """Every direction is at most 71 degrees from one of the four."""
    sides = np.array(CORNERS) / np.sqrt(3.0)
    directions = np.random.default_rng(0).normal(size=(5000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    assert (directions @ sides.T).max(axis=1).min() > np.cos(np.radians(71.0))
