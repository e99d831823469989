"""Files of a run in every format, with the probabilities of the die, and its data sheet."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import pypdf
import pytest
import yaml
from PIL import Image

from dicedesign.fabricate import file_formats
from dicedesign.fabricate.file_formats import FILE_FORMATS, Contents
from dicedesign.recipe.pipeline import run
from dicedesign.recipe.reading import parse_recipe
from dicedesign.results.folder import read_result

FORMATS = ["3mf", "obj", "glb", "ply", "off"]

COIN = {
    "name": "coin",
    "target": {"probabilities": ["1/2", "1/3", "1/6"], "labels": ["heads", "tails", "edge"]},
    "seed": 3,
    "size_mm": 40.0,
}

QUICK = {"figures": False, "report": False, "clock": False}


@pytest.fixture(scope="module")
def coin(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("coin")
    run({**COIN, **QUICK, "files": FORMATS}, folder)
    return folder


def test_the_result_lists_every_file_with_its_checksum(coin: Path) -> None:
    result = read_result(coin)
    names = {path.name for path in coin.iterdir()} - {"result.json"}
    assert {f"die.{name}" for name in ["stl", *FORMATS]} < names
    assert set(result.files.values()) == {*names, "result.json"}
    assert (result.files["die"], result.files["die_plain"]) == ("die.stl", "die_plain.stl")
    for name in names:
        assert result.sha256[name] == hashlib.sha256((coin / name).read_bytes()).hexdigest()


def test_metadata_are_those_of_the_result(coin: Path) -> None:
    result = read_result(coin)
    data = (coin / "die.glb").read_bytes()
    scene = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    facts = scene["asset"]["extras"]
    labels = result.labels
    assert json.loads(facts["Target"]) == dict(zip(labels, result.target, strict=True))
    probabilities = json.loads(facts["Probabilities"])
    assert probabilities == dict(zip(labels, result.engraved.probabilities, strict=True))
    assert facts["Recipe"] == (coin / "recipe.yaml").read_text()
    assert facts["Checksum"].endswith(result.sha256["die.stl"])
    assert [material["name"] for material in scene["materials"]] == ["die", "labels"]


def test_files_of_an_earlier_recipe_are_removed(tmp_path: Path) -> None:
    entries = {**COIN, **QUICK, "engrave": False}
    run({**entries, "files": ["obj", "stl"], "data_sheet": True}, tmp_path)
    files = {path.name for path in tmp_path.iterdir()}
    assert files >= {"die_plain.obj", "data_sheet.pdf", "data_sheet.png"}
    result = run(entries, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == set(result.files.values())
    assert set(result.files) == {"die_plain", "recipe", "result"}


def test_a_file_with_other_probabilities_is_discarded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def dent(contents: Contents) -> bytes:
        (part,) = contents.parts
        points = part.points.copy()
        points[0] *= 1.0 + 1e-6
        return file_formats.obj(replace(contents, parts=[replace(part, points=points)]))

    known = FILE_FORMATS["obj"]
    FILE_FORMATS.unregister("obj")
    FILE_FORMATS.register(replace(known, write=dent))
    try:
        result = run({**COIN, **QUICK, "engrave": False, "files": "obj"}, tmp_path / "coin")
    finally:
        FILE_FORMATS.unregister("obj")
        FILE_FORMATS.register(known)
    assert not result.converged
    assert re.search(r"die_plain.obj: expected the probabilities .* take another", result.message)
    assert {path.name for path in (tmp_path / "coin").iterdir()} >= {"die_plain.stl", "result.json"}
    assert not (tmp_path / "coin" / "die_plain.obj").exists()


@pytest.mark.parametrize(
    ("files", "expected"),
    [
        ([], ["stl"]),
        ("obj", ["stl", "obj"]),
        (["obj", "stl", "obj", False], ["stl", "obj", "off"]),  # YAML reads a bare off as false.
    ],
)
def test_stl_is_always_among_the_formats(files: object, expected: list[str]) -> None:
    recipe = parse_recipe({**COIN, "files": files})
    assert recipe.files == expected
    assert yaml.safe_load(yaml.safe_dump(recipe.as_dict()))["files"] == expected


def test_a_data_sheet_describes_the_die_in_its_folder(tmp_path: Path) -> None:
    first, second = (
        run({**COIN, **QUICK, "data_sheet": True, "figures": figures}, tmp_path / f"{figures}")
        for figures in (True, False)
    )
    for result in (first, second):
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
    # Figures are on the sheet if they were drawn.
    pages = [pypdf.PdfReader(r.folder / "data_sheet.pdf").pages[0] for r in (first, second)]
    assert len(pages[0].images) == len(pages[1].images) + 1
