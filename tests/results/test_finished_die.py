"""Dice that finished runs left."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dicedesign.errors import InputError
from dicedesign.results.finished_die import finished_die

FACETS = [
    {"label": "a", "normal": [1.0, 0.0, 0.0]},
    {"label": None, "normal": [0.0, 1.0, 0.0]},
    {"label": None, "outcome": "b", "normal": [0.0, 0.0, 1.0]},
    {"label": "b", "outcome": "b", "normal": [0.0, 0.0, -1.0]},
    {"label": None, "outcome": None, "normal": [-1.0, 0.0, 0.0]},
]
RESULT = {
    "status": "converged",
    "labels": ["a", "b"],
    "target": [0.25, 0.75],
    "files": {"die": "die.stl", "die_plain": "die_plain.stl"},
    "center_of_mass": [0.5, 0.0, 1.0],
    "facets": FACETS,
}


def written(folder: Path, result: Any) -> Path:
    (folder / "result.json").write_text(json.dumps(result))
    return folder


def test_a_die(tmp_path: Path) -> None:
    """Of a concave die, all facets that show an outcome count, whichever is labelled."""
    die = finished_die(written(tmp_path, RESULT))
    assert (die.status, die.labels, die.shown) == ("converged", ("a", "b"), ("a", "b", "b"))
    assert die.mesh == tmp_path / "die_plain.stl"
    assert die.target.tolist() == [0.25, 0.75]
    assert die.center_of_mass.tolist() == [0.5, 0.0, 1.0]
    np.testing.assert_array_equal(die.normals, [[1, 0, 0], [0, 0, 1], [0, 0, -1]])


def test_a_die_none_of_whose_facets_is_labelled(tmp_path: Path) -> None:
    die = finished_die(written(tmp_path, {**RESULT, "facets": []}))
    assert (die.shown, die.normals.shape) == ((), (0, 3))


@pytest.mark.parametrize("missing", RESULT)
def test_what_is_missing_is_named(tmp_path: Path, missing: str) -> None:
    folder = written(tmp_path, {key: value for key, value in RESULT.items() if key != missing})
    message = f"result.json: expected status, labels, .* got KeyError: '{missing}'; name a folder"
    with pytest.raises(InputError, match=message):
        finished_die(folder)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"target": [0.5, 0.25]}, "labels and target do not fit"),
        ({"target": [0.0, 1.0]}, "labels and target do not fit"),
        ({"target": [float("nan"), 1.0]}, "2 finite numbers came as"),
        ({"target": [1.0]}, "2 finite numbers came as"),
        ({"target": "ab"}, "ValueError"),
        ({"labels": ["a", "a"]}, "labels and target do not fit"),
        ({"labels": ["a", "c"]}, "facets have labels that the die has not"),
        ({"labels": 2}, "TypeError"),
        ({"files": {"die": "die.stl"}}, "KeyError: 'die_plain'"),
        ({"files": {"die_plain": 1}}, "TypeError"),
        ({"files": []}, "TypeError"),
        ({"center_of_mass": [0.0, 0.0]}, "3 finite numbers came as"),
        ({"center_of_mass": [0.0, 0.0, float("inf")]}, "3 finite numbers came as"),
        ({"center_of_mass": 1.0}, "TypeError"),
        ({"facets": [{"label": "a"}]}, "KeyError: 'normal'"),
        ({"facets": [{"normal": [1, 0, 0]}]}, "KeyError: 'label'"),
        ({"facets": [{"label": "a", "normal": [1, 0, None]}]}, "TypeError"),
        ({"facets": ["a"]}, "AttributeError"),
    ],
)
def test_wrong_kinds(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=f"of a finished die, got .*{message}"):
        finished_die(written(tmp_path, {**RESULT, **changes}))


@pytest.mark.parametrize("text", [None, "{", "[1]", "3", '"a"', "\x80"])
def test_files_that_are_no_result(tmp_path: Path, text: str | None) -> None:
    if text is not None:
        (tmp_path / "result.json").write_text(text, encoding="latin-1")
    with pytest.raises(InputError, match="name a folder that `dicedesign run` left, or a mesh"):
        finished_die(tmp_path)
