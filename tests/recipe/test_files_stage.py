"""Files of a run in every format, with the probabilities of the die."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pygltflib import GLTF2

from dicedesign.fabricate import file_formats
from dicedesign.fabricate.file_formats import FILE_FORMATS, Contents
from dicedesign.recipe.pipeline import run
from dicedesign.recipe.reading import parse_recipe
from dicedesign.results.folder import read_result

FORMATS = [kind.name for kind in FILE_FORMATS]

COIN = {
    "name": "coin",
    "target": {"probabilities": ["1/2", "1/3", "1/6"], "labels": ["heads", "tails", "edge"]},
    "seed": 3,
    "size_mm": 40.0,
    **dict.fromkeys(("figures", "report", "clock"), False),
}


def test_files_carry_the_result_and_those_of_an_earlier_run_are_removed(tmp_path: Path) -> None:
    run({**COIN, "files": FORMATS}, tmp_path)
    result = read_result(tmp_path)
    names = {path.name for path in tmp_path.iterdir()} - {"result.json"}
    assert {f"die.{name}" for name in FORMATS} < names
    assert set(result.files.values()) == {*names, "result.json"}
    for name in names:
        assert result.sha256[name] == hashlib.sha256((tmp_path / name).read_bytes()).hexdigest()
    facts = GLTF2().load(str(tmp_path / "die.glb")).asset.extras
    for name, values in (("Target", result.target), ("Probabilities", result.probabilities)):
        read = json.loads(facts[name])
        assert list(read) == list(result.labels)
        np.testing.assert_allclose(list(read.values()), values, atol=1e-6)
    assert facts["Recipe"] == (tmp_path / "recipe.yaml").read_text()
    assert facts["Checksum"].endswith(result.sha256["die.stl"])
    plain = run({**COIN, "engrave": False}, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == set(plain.files.values())
    assert set(plain.files) == {"die_plain", "recipe", "result"}


def test_a_file_with_other_probabilities_is_discarded(tmp_path: Path) -> None:
    def dent(contents: Contents) -> bytes:
        (part,) = contents.parts
        points = part.points.copy()
        points[0] *= 1.0 + 1e-6
        return file_formats.obj(replace(contents, parts=[replace(part, points=points)]))

    known = FILE_FORMATS["obj"]
    FILE_FORMATS.unregister("obj")
    FILE_FORMATS.register(replace(known, write=dent))
    try:
        result = run({**COIN, "engrave": False, "files": "obj"}, tmp_path / "coin")
    finally:
        FILE_FORMATS.unregister("obj")
        FILE_FORMATS.register(known)
    assert not result.converged
    assert "die_plain.obj" in result.message
    assert {path.name for path in (tmp_path / "coin").iterdir()} >= {"die_plain.stl", "result.json"}
    assert not (tmp_path / "coin" / "die_plain.obj").exists()


@pytest.mark.parametrize(
    ("files", "expected"),
    [
        ([], ["stl"]),
        ("obj", ["stl", "obj"]),
        (["obj", "stl", "obj"], ["stl", "obj"]),
    ],
)
def test_stl_is_always_among_the_formats(files: object, expected: list[str]) -> None:
    assert parse_recipe({**COIN, "files": files}).files == expected
