"""The runs of the soak: their recipes, and what the check of a folder sees."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dicedesign.bench.endurance.commands import Ended
from dicedesign.bench.endurance.runs import _results, broken_recipe, random_recipe
from dicedesign.errors import DiceError
from dicedesign.recipe.run import run
from dicedesign.recipe.schema.reading import checked_recipe, read_recipe
from dicedesign.results.reading import read_result
from dicedesign.results.record import Result

DONE = Ended(0, "", "", 1.0, hung=False)


def test_recipes_are_sound_or_broken_as_they_are_meant(tmp_path: Path) -> None:
    methods = set()
    for number in range(60):
        recipe = checked_recipe(random_recipe(np.random.default_rng(number)))
        methods.add((recipe.method.name, recipe.method.thrown, recipe.start.name))
        path = tmp_path / "broken.yaml"
        path.write_bytes(broken_recipe(np.random.default_rng(number)))
        if b"nowhere" not in path.read_bytes():
            with pytest.raises(DiceError):
                read_recipe(path)
    assert len(methods) == 4


def test_what_is_wrong_with_results_is_seen(tmp_path: Path) -> None:
    recipe = {"name": "die", "target": {"fair": 3}, "start": {"prism": {}}, "engrave": False}
    run(recipe | {"figures": False, "report": False, "clock": False}, tmp_path)

    def kinds(ended: Ended = DONE) -> list[str]:
        return [fault.kind for fault in _results(tmp_path, ended)]

    result, die = tmp_path / "result.json", tmp_path / "die_plain.stl"
    text, data = result.read_bytes(), die.read_bytes()
    assert kinds() == []
    assert kinds(replace(DONE, code=1)) == ["wrong"]
    (tmp_path / ".lock").touch()
    assert kinds() == ["lost"]
    (tmp_path / ".lock").unlink()
    die.write_bytes(data[:-50])
    assert kinds() == ["lost"]
    die.write_bytes(data)
    result.write_bytes(text[:-50])
    assert kinds() == ["lost"]
    odds = (0.3, 0.3, 0.4)
    result.write_text(replace(read_back(result, text), probabilities=odds).json_text())
    assert kinds() == ["wrong"]
    result.write_text(replace(read_back(result, text), target=odds).json_text())
    assert kinds() == ["wrong"]
    result.unlink()
    assert kinds() == ["lost"]


def read_back(path: Path, text: bytes) -> Result:
    path.write_bytes(text)
    return read_result(path.parent)
