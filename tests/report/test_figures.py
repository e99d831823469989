"""Sheets pixel for pixel, figures of finished dice, and one more from outside the package."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from common.finished import finished_box, page_text
from common.parsed_html import parse_page

from dicedesign.report.figures import FIGURES, Figure, figure_files
from dicedesign.report.raster import decode_png, encode_png
from dicedesign.report.sheet import Sheet, picture_grid


def test_a_png_repeats_and_has_no_metadata() -> None:
    def draw() -> Sheet:
        sheet = Sheet(200, 100)
        sheet.text("$no formula \u4e09", (100.0, 20.0), color="red")
        return sheet

    data = draw().png()
    assert data == draw().png()
    assert b"tEXt" not in data
    assert b"tIME" not in data
    assert decode_png(data).shape == (100, 200, 3)
    np.testing.assert_array_equal(decode_png(encode_png(decode_png(data))), draw().pixels())


def test_pictures_of_a_grid_are_drawn_pixel_for_pixel() -> None:
    rng = np.random.default_rng(2)
    heights = [40, 40, 90, 90]
    noise = [rng.integers(0, 255, (h, 60, 3)).astype(np.uint8) for h in heights]
    sheet = picture_grid(noise, ["a", "b", "c", ""], 2, above=30, below=45)
    pixels = sheet.pixels()
    for picture, left in zip(noise, (24, 108, 24, 108), strict=True):
        (top,) = np.flatnonzero((pixels[:, left : left + 60] == picture[0]).all(axis=(1, 2)))
        np.testing.assert_array_equal(pixels[top : top + len(picture), left : left + 60], picture)
    assert (pixels[-45:] == 255).all()
    assert sheet.texts == ["a", "b", "c"]


@pytest.fixture
def toy() -> Iterator[Figure]:
    figure = Figure(
        name="toy",
        line="a toy",
        title="A toy & its title",
        caption="What it shows.",
        wanted=lambda die: len(die.result.labels) == 6,
        draw=lambda die: b"GIF89a" + die.result.name.encode(),
        suffix=".gif",
    )
    yield FIGURES.register(figure)
    FIGURES.unregister("toy")


def test_a_figure_from_outside_is_drawn_and_shown(toy: Figure) -> None:
    die = finished_box()
    files = figure_files(die, lambda *_: None)
    assert files["toy"] == b"GIF89aa < box"
    page = parse_page(page_text(die, files))
    places = [page.text.index(FIGURES[name].title) for name in ("bars", "toy", "convergence")]
    assert places == sorted(places)
    assert "What it shows." in page.text
    assert any(source.startswith("data:image/gif;") for source in page.sources)


def test_a_convex_die_has_its_figures() -> None:
    parts: list[tuple[int, int, str]] = []
    files = figure_files(finished_box(), lambda *part: parts.append(part))
    assert list(files) == ["bars", "convergence", "gauss_map", "views"]
    assert parts == [(number, 4, "figures") for number in range(4)]
    assert all(data.startswith(b"\x89PNG") for data in files.values())
