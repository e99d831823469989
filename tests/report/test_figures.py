"""Sheets pixel for pixel, figures of finished dice, and what notebooks show."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from common.drawings import pixels, words
from common.finished import finished_box, page_text
from common.parsed_html import parse_page
from common.paths import ROOT

import dicedesign as dd
from dicedesign.palette import outcome_colors
from dicedesign.report.figures import FIGURES, Figure, figure_files
from dicedesign.report.paper import DPI
from dicedesign.report.raster import decode_png, encode_png
from dicedesign.report.sheet import Sheet, figure_bytes, picture_grid


def test_files_repeat_and_have_no_metadata() -> None:
    def draw() -> Sheet:
        sheet = Sheet(200.0, 100.0)
        sheet.write("$no formula \u4e09", (100.0, 20.0), color="red")
        return sheet

    for ending in (".pdf", ".svg"):
        assert figure_bytes(draw(), ending) == figure_bytes(draw(), ending)
    data = figure_bytes(draw(), ".PNG")
    assert data == figure_bytes(draw(), ".png")
    assert b"tEXt" not in data
    assert b"tIME" not in data
    assert decode_png(data).shape == (417, 834, 3)
    np.testing.assert_array_equal(decode_png(encode_png(decode_png(data))), pixels(draw()))


def test_pictures_of_a_grid_are_drawn_pixel_for_pixel() -> None:
    rng = np.random.default_rng(2)
    heights = [40, 40, 90, 90]
    noise = [rng.integers(0, 255, (h, 60, 3)).astype(np.uint8) for h in heights]
    # Three gaps of 25 pixels.
    sheet = picture_grid(noise, ["a", "b", "c", ""], 2, 195 / DPI, above=12.0, below=24.0)
    drawn = pixels(sheet)
    for picture, left in zip(noise, (25, 110, 25, 110), strict=True):
        (top,) = np.flatnonzero((drawn[:, left : left + 60] == picture[0]).all(axis=(1, 2)))
        np.testing.assert_array_equal(drawn[top : top + len(picture), left : left + 60], picture)
    assert (drawn[-100:] == 255).all()
    assert words(sheet) == ["a", "b", "c"]


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


# Notebooks.


def cells(html: str) -> list[str]:
    """Text of all cells of a table."""
    return [unescape(cell) for cell in re.findall(r"<td[^>]*>([^<]*)</td>", html)]


def test_poses_show_their_hull_and_probabilities() -> None:
    box = np.array([[x, y, z] for x in (0, 1) for y in (0, 2) for z in (0, 3)])
    poses = dd.rest_poses(box)
    html = poses._repr_html_()
    shown = [float(cell.rstrip("%")) / 100 for cell in cells(html)[1::3]]
    np.testing.assert_allclose(shown, poses.probabilities, atol=1e-6)
    assert re.findall(r"border-left: 1em solid (#\w+)", html) == outcome_colors(6)
    assert "<iframe" in html
    assert "6 rests" in repr(poses)


def test_a_result_without_files_shows_its_table_alone() -> None:
    target = {"fair": 3, "labels": ["<b>", "two", "three"]}
    die = dd.design(target)
    html = die.result._repr_html_()
    assert cells(html)[::3] == ["<b>", "two", "three"]
    assert cells(html)[1::3] == ["33.3333%"] * 3
    assert len(die.result.facets) == 6
    assert "<iframe" not in html
    assert "<iframe" in die._repr_html_()
    assert replace(die.result, folder=Path("nowhere"))._repr_html_() == html


def test_the_example_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    notebook = json.loads((ROOT / "examples" / "first_die.ipynb").read_text())
    code = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
    exec(compile("\n".join(code), "first_die", "exec"), {})
    assert (tmp_path / "total_of_2d4.stl").is_file()
