"""The data sheet that a run leaves."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

import pypdf
from PIL import Image

from dicedesign.recipe.pipeline import run

COIN = {
    "name": "coin",
    "target": {"probabilities": ["1/2", "1/3", "1/6"], "labels": ["heads", "tails", "edge"]},
    "seed": 3,
    "size_mm": 40.0,
    "report": False,
    "clock": False,
}


def test_the_sheet_tells_of_the_die_beside_it(tmp_path: Path) -> None:
    first, second = (
        run({**COIN, "data_sheet": True, "figures": figures}, tmp_path / f"{figures}")
        for figures in (True, False)
    )
    for result in (first, second):
        assert result.folder is not None
        reader = pypdf.PdfReader(result.folder / "data_sheet.pdf")
        (page,) = reader.pages
        text = page.extract_text()
        assert result.sha256["die.stl"] in text
        for label, probabilities in zip(result.labels, result.engraved.probabilities, strict=True):
            assert label in text
            assert f"{100.0 * probabilities:.3f}" in text
        picture = Image.open(BytesIO((result.folder / "data_sheet.png").read_bytes()))
        assert picture.size == (1240, 1754)
        assert {"data_sheet.pdf", "data_sheet.png"} < set(result.files.values())
    # The pictures of the labels are on the sheet where they were drawn.
    pages = [pypdf.PdfReader(r.folder / "data_sheet.pdf").pages[0] for r in (first, second)]
    assert len(pages[0].images) == len(pages[1].images) + 1


def test_a_sheet_that_is_not_asked_for_any_more_is_removed(tmp_path: Path) -> None:
    quick = {**COIN, "figures": False, "engrave": False}
    run({**quick, "data_sheet": True}, tmp_path)
    assert (tmp_path / "data_sheet.pdf").exists()
    run(quick, tmp_path)
    assert not list(tmp_path.glob("data_sheet*"))
