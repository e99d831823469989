"""Sheets: pictures pixel for pixel, files that repeat, and letters of any kind."""

from __future__ import annotations

import numpy as np

from dicedesign.report.palette import rgb
from dicedesign.report.render.pictures import decoded, encoded, trim
from dicedesign.report.sheet import Sheet, picture_grid


def test_a_png_repeats_and_has_no_metadata() -> None:
    def draw() -> Sheet:
        sheet = Sheet(200, 100)
        sheet.text("text", (150.0, 50.0), halo=True)
        sheet.text("$no formula \u4e09", (100.0, 20.0))
        return sheet

    data = draw().png()
    assert data == draw().png()
    assert b"tEXt" not in data
    assert b"tIME" not in data
    assert decoded(data).shape == (100, 200, 3)
    np.testing.assert_array_equal(decoded(encoded(decoded(data))), draw().pixels())


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


def test_trimming_removes_the_rows_that_are_white_in_all() -> None:
    one, other = np.full((2, 100, 30, 3), 255, dtype=np.uint8)
    one[40, 3], other[50, 7, 1] = 0, 254
    cut = trim([one, other])
    assert [picture.shape for picture in cut] == [(27, 30, 3)] * 2
    np.testing.assert_array_equal(cut[0], one[32:59])
    white = np.full((9, 9, 3), 255, dtype=np.uint8)
    assert trim([white])[0].shape == (9, 9, 3)
    np.testing.assert_allclose(rgb(["#ff8000"]), [[1.0, 128 / 255, 0.0]])
