"""Labels that cannot be made end with one line and exit 2."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from dicedesign.cli.main import main

SVG = '<svg xmlns="http://www.w3.org/2000/svg">{}</svg>'

BAD: list[tuple[dict[str, Any], list[str], str]] = [
    (
        {},
        ["骰", "2", "3", "4"],
        "label '骰': expected characters of the font DejaVu Sans Bold, got",
    ),
    ({"font": "No Such Font"}, [], "engrave.font: expected the family of an installed font"),
    ({"font": "none.ttf"}, [], "none.ttf: no such file"),
    ({"font": "broken.otf"}, [], "broken.otf: expected a TTF or OTF font with outlines"),
    ({"content": "pips"}, ["1", "2", "3", "X"], "label 'X': expected a whole number from 1 to 20"),
    ({"icons": {"3": "none.svg"}}, [], "none.svg: no such file; check the path"),
    ({"icons": {"3": "empty.svg"}}, [], "expected at least one filled path or shape, got none"),
    ({"icons": {"3": "script.svg"}}, [], "expected no scripts"),
    ({"icons": {"3": "text.svg"}}, [], "expected paths and shapes only, got <text>"),
    ({"icons": {"3": "broken.svg"}}, [], "expected an SVG file, got no XML"),
    ({"depth_mm": -0.6}, [], "engrave: depth_mm: expected a number above 0, got -0.6"),
    ({"min_height_mm": 40, "max_height_mm": 50}, [], "expected room on facet "),
    ({"depth_mm": 30, "margin_mm": 0, "min_height_mm": 0.01}, [], "on facet "),
    ({"stroke_mm": 6}, ["8", "2", "3", "4"], "label '8' on facet "),
]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "broken.otf").write_bytes(b"OTTO no font")
    for name, content in {
        "empty": "",
        "script": "<script>1</script><circle r='1'/>",
        "text": "<text>3</text>",
        "broken": "<circle",
    }.items():
        (tmp_path / f"{name}.svg").write_text(SVG.format(content))
    return tmp_path


@pytest.mark.parametrize(("options", "labels", "message"), BAD, ids=[m[:40] for *_, m in BAD])
def test_one_line_names_the_place_the_numbers_and_the_remedy(
    folder: Path,
    options: dict[str, Any],
    labels: list[str],
    message: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    recipe = {
        "name": "bad",
        "target": {"fair": 4, "labels": labels or ["1", "2", "3", "4"]},
        "engrave": options,
        "figures": False,
        "report": False,
    }
    (folder / "bad.yaml").write_text(yaml.safe_dump(recipe))
    assert main(["run", "bad.yaml", "--out", "out"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    (line,) = captured.err.strip().splitlines()
    assert line.startswith("dicedesign: ")
    assert message in line
    assert "; " in line  # before a remedy
    assert not (folder / "out" / "die.stl").exists()
