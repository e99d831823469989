"""Shapes, texts and pictures on paper."""

from __future__ import annotations

import numpy as np
import pytest
from common.drawings import painted

from dicedesign.report.charts.paper import BODY, Paper, text_width

RED = "#ff0000"


def drawn(**texts: object) -> Paper:
    paper = Paper(200, 100)
    paper.box(20.0, 30.0, 60.0, 80.0, RED)
    paper.text("text", (150.0, 50.0), **texts)
    return paper


def test_a_png_repeats_and_has_no_metadata() -> None:
    data = drawn().png()
    assert data == drawn().png()
    assert b"tEXt" not in data
    assert b"tIME" not in data
    assert [int.from_bytes(data[k : k + 4], "big") for k in (16, 20)] == [200, 100]


def test_areas_of_shapes() -> None:
    paper = Paper(200.0, 200.0)
    paper.box(10.0, 10.0, 50.0, 30.0, RED)
    assert painted(paper, RED).sum() == 800
    assert painted(paper, RED)[10:30, 10:50].all()
    paper = Paper(200.0, 200.0)
    paper.disc((100.0, 100.0), 40.0, RED)
    assert painted(paper, RED).sum() == pytest.approx(np.pi * 40.0**2, rel=0.03)
    paper = Paper(200.0, 200.0)
    paper.polygon([(20, 20), (180, 20), (20, 180)], RED)
    assert painted(paper, RED).sum() == pytest.approx(160.0**2 / 2.0, rel=0.03)
    paper = Paper(200.0, 200.0)
    paper.line([(20, 100), (180, 100)], RED, 6.0)
    rows, columns = np.nonzero(painted(paper, RED))
    assert np.ptp(rows) + 1 == pytest.approx(6, abs=1)
    assert np.ptp(columns) + 1 == pytest.approx(160, abs=2)


def test_dashes_cover_a_part_of_their_line() -> None:
    whole, dashed = Paper(400, 50), Paper(400, 50)
    for paper in (whole, dashed):
        paper.line([(20, 25), (200, 25), (380, 25)], RED, 4.0, dashed=paper is dashed)
    share = painted(dashed, RED).sum() / painted(whole, RED).sum()
    assert share == pytest.approx(5.0 / 8.0, abs=0.06)


def test_what_is_half_clear_lets_the_ground_through() -> None:
    paper = Paper(50, 50)
    paper.box(0, 0, 50, 50, "#000000", 0.5)
    assert paper.pixels()[25, 25].tolist() == pytest.approx([127, 127, 127], abs=1)


@pytest.mark.parametrize(
    ("anchor", "left", "middle"), [("lm", 150, 50), ("mm", None, 50), ("ra", None, None)]
)
def test_texts_lie_at_their_anchor(anchor: str, left: float | None, middle: float | None) -> None:
    rows, columns = np.nonzero((drawn(anchor=anchor).pixels()[:, 80:] < 200).any(axis=2))
    width = text_width("text", BODY)
    assert np.ptp(columns) == pytest.approx(width, abs=5)
    if left is not None:
        assert columns.min() + 80 == pytest.approx(left, abs=3)
    if middle is not None:
        assert (rows.min() + rows.max()) / 2 == pytest.approx(middle, abs=4)
    if anchor == "ra":
        assert columns.max() + 80 <= 151
        assert rows.min() >= 50


def test_a_turned_text_is_tall_and_reads_upward() -> None:
    paper = Paper(60, 200)
    paper.text("iiiiiiM", (30, 100), turned=True)
    rows, columns = np.nonzero((paper.pixels() < 128).any(axis=2))
    assert np.ptp(rows) > 2 * np.ptp(columns)
    # The wide letter comes last, which is on top.
    ink = (paper.pixels() < 128).any(axis=2).sum(axis=1)
    assert ink[: rows.min() + 20].sum() > ink[rows.max() - 20 :].sum()


def test_a_halo_is_white_on_a_dark_ground() -> None:
    paper = Paper(100, 100)
    paper.box(0, 0, 100, 100, "#444444")
    paper.text("8", (50, 50), halo=True)
    assert (paper.pixels() > 250).all(axis=2).any()


def test_pictures_are_pasted_pixel_for_pixel() -> None:
    noise = np.random.default_rng(0).integers(0, 255, (30, 40, 3)).astype(np.uint8)
    paper = Paper(100, 100)
    paper.picture(noise, 10, 20)
    np.testing.assert_array_equal(paper.pixels()[20:50, 10:50], noise)
    assert (paper.pixels()[:20] == 255).all()
