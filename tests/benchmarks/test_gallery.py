"""The gallery holds what the pages show, and its bench can make all of it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from common.paths import PAGES, ROOT
from PIL import Image

from benchmarks import gallery
from benchmarks.frame import main

OTHER_BENCHES = "bench_"
"""Prefix of pictures that other benches make."""


def test_pages_show_what_the_bench_makes() -> None:
    text = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    shown = set(re.findall(r"outputs/gallery/(\w+)\.png\)", text))
    assert {path.stem for path in gallery.GALLERY.iterdir() if path.suffix == ".png"} == shown
    assert {name for name in shown if not name.startswith(OTHER_BENCHES)} == set(gallery.PICTURES)
    assert set(gallery.QUICK) <= set(gallery.PICTURES)
    assert gallery.GALLERY == ROOT / "outputs" / "gallery"


def test_pictures_are_shrunk_and_in_their_cells() -> None:
    pictures = [
        Image.new("RGBA", (80, 40), (255, 0, 0, 255)),
        Image.new("RGBA", (10, 60), (0, 0, 255, 255)),
        Image.new("RGBA", (20, 20), (0, 0, 0, 0)),
    ]
    sheet = np.asarray(gallery.lay_out(pictures, 2, 20, 30, gap=4))
    assert sheet.shape == (64, 44, 3)
    red = (sheet == (255, 0, 0)).all(axis=2)
    blue = (sheet == (0, 0, 255)).all(axis=2)
    assert np.argwhere(red).min(axis=0).tolist() == [10, 0]
    assert np.argwhere(red).max(axis=0).tolist() == [19, 19]
    assert blue.sum() == 5 * 30
    # A transparent picture is white, as everything else.
    assert (sheet[~(red | blue)] == 255).all()


def test_without_a_browser_pages_are_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr(gallery, "missing_browser", lambda: "playwright")
    assert main(["gallery", "page", "--out", str(tmp_path)]) == 2
    assert "playwright" in capsys.readouterr().err
    assert main(["gallery", "pages", "--out", str(tmp_path)]) == 2
    assert list(tmp_path.iterdir()) == []
