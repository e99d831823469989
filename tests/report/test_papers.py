"""Figures for papers: their files, the sizes of figures and texts, and the table of a history."""

from __future__ import annotations

import csv
import io
import re
import xml.etree.ElementTree as ET
import zlib
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from common.drawings import is_whole, written
from common.finished import HISTORY, finished_box
from matplotlib.figure import Figure
from PIL import Image

import dicedesign as dd
from dicedesign.cli.main import main

BOX = np.array([(x, y, z) for x in (-1, 1) for y in (-1.7, 1.7) for z in (-2.3, 2.3)])


def drawn(width: float) -> dict[str, Figure]:
    """Figures of several kinds."""
    die, poses = finished_box(tolerances=None), dd.rest_poses(BOX)
    figures, solid = dd.figures, die.printed
    return {
        "probabilities": figures.probabilities(die.result, width=width),
        "history": figures.history(die.result, 1e-3, width=width),
        "gauss_map": figures.gauss_map(poses, width=width),
        "heights": figures.heights(poses, width=width),
        "paths": figures.paths(poses, width=width),
        "views": figures.views(solid.points, solid.triangles, width=width),
    }


@pytest.mark.parametrize("width", [3.3, 7.0])
def test_figures_have_their_width_and_texts_of_7_and_8_points(width: float) -> None:
    for name, figure in drawn(width).items():
        assert isinstance(figure, Figure)
        assert figure.get_figwidth() == pytest.approx(width, abs=0.01), name
        assert 1.0 < figure.get_figheight() < 9.0, name
        assert is_whole(figure), name
        ticks = [t for axes in figure.axes for t in axes.get_xticklabels() + axes.get_yticklabels()]
        sizes = {text.get_fontsize() for text in [*written(figure), *ticks]}
        assert sizes <= {7.0, 8.0}, name


def pdf_texts(data: bytes) -> set[str]:
    """Texts that a PDF shows."""
    texts = set()
    for match in re.finditer(rb"stream\r?\n(.*?)\r?\nendstream", data, re.S):
        with suppress(zlib.error):
            for shown in re.findall(rb"BT\n(.*?)ET", zlib.decompress(match[1]), re.S):
                codes = b"".join(re.findall(rb"\(((?:\\.|[^\\)])*)\)", shown, re.S))
                # One or two bytes a character, the first of two being 0.
                texts.add(codes.replace(b"\\", b"").replace(b"\0", b"").decode("latin-1"))
    return texts


def test_text_stays_text_in_pdf_and_svg(tmp_path: Path) -> None:
    figure = drawn(3.3)["probabilities"]
    for ending in ("pdf", "svg", "png"):
        figure.savefig(tmp_path / f"a.{ending}")
    expected = {"probability (%)", "achieved", "target"}
    assert expected <= pdf_texts((tmp_path / "a.pdf").read_bytes())
    tree = ET.parse(tmp_path / "a.svg").getroot()
    texts = [one.text for one in tree.iter() if one.tag.endswith("}text")]
    assert expected <= set(texts)
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.width == 990


def test_pictures_have_300_pixels_per_inch(tmp_path: Path) -> None:
    """In a PDF eight views of the same size, in three columns."""
    drawn(3.3)["views"].savefig(tmp_path / "a.pdf")
    data = (tmp_path / "a.pdf").read_bytes()
    widths = {int(text) for text in re.findall(rb"/Width (\d+)", data)}
    assert len(widths) == 1
    assert 3 * max(widths) == pytest.approx(990 - 4 * 25, abs=6)


def test_a_history_is_read_back_from_its_table() -> None:
    die = finished_box()
    rows = list(csv.DictReader(io.StringIO(die.result.history_csv())))
    assert len(rows) == len(HISTORY)
    for row, step in zip(rows, HISTORY, strict=True):
        assert int(row["step"]) == step.step
        for name in ("seconds", "energy", "max_abs_error"):
            assert float(row[name]) == getattr(step, name)
        assert float(row["dice"]) == step.terms["dice"]
        assert row["stage"] == row["attempt"] == ""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results folder of a small die."""
    out = tmp_path_factory.mktemp("run") / "few"
    recipe: dict[str, Any] = {"name": "few", "target": {"binomial": 2}, "start": {"prism": {}}}
    dd.run({**recipe, "engrave": False, "print": False, "figures": False}, out=out)
    return out


def test_the_figures_of_a_folder_are_those_of_its_result(folder: Path, tmp_path: Path) -> None:
    result = dd.read_result(folder)
    for kind, ending in (("history", ".csv"), ("probabilities", ".PDF"), ("complex", ".svg")):
        out = tmp_path / f"a{ending}"
        assert main(["figure", kind, str(folder), "--out", str(out), "--width", "5"]) == 0
    assert (tmp_path / "a.csv").read_text() == result.history_csv()
    (box,) = re.findall(rb"/MediaBox \[ ?0 0 ([0-9.]+)", (tmp_path / "a.PDF").read_bytes())
    assert float(box) == pytest.approx(5 * 72.0)
    texts = (tmp_path / "a.svg").read_text()
    assert all(f">{label}<" in texts for label in result.labels)


@pytest.mark.parametrize("ending", ["pdf", "svg", "png"])
def test_every_command_writes_every_format(tmp_path: Path, ending: str) -> None:
    np.savetxt(tmp_path / "box.xyz", BOX)
    rows = [f"{k},10" for k in range(1, 7)]
    (tmp_path / "counts.csv").write_text("\n".join(["label,count", *rows]))
    begin = {"pdf": b"%PDF", "svg": b"<?xml", "png": b"\x89PNG"}[ending]
    for name, command in (
        ("rest", ["rest", "box.xyz", "--figure"]),
        ("rolls", ["rolls", "box.xyz", "counts.csv", "--figure"]),
        ("figure", ["figure", "heights", "box.xyz", "--out"]),
    ):
        words = [str(tmp_path / word) if "." in word else word for word in command]
        out = tmp_path / f"{name}.{ending}"
        assert main([*words, str(out)]) == 0
        assert out.read_bytes().startswith(begin)
