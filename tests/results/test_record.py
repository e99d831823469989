"""The result of a run, written and read back."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dicedesign.errors import InputError
from dicedesign.results.reading import read_result
from dicedesign.results.record import FacetOfDie, Result, StageTime, Step
from dicedesign.results.throws import SimulatedThrows, ThrownOdds


def facet(label: str | None, outcome: str | None, normal: tuple[float, ...]) -> FacetOfDie:
    return FacetOfDie(label, outcome, normal, 0.2, 10.0, 1.0, 30.0, 25.0)


RESULT = Result(
    name="coin",
    status="converged",
    message="reached the tolerance",
    labels=("a", "b"),
    target=(0.25, 0.75),
    probabilities=(0.25, 0.75),
    elsewhere=0.0,
    max_abs_error=0.0,
    design_max_abs_error=0.0,
    center_of_mass=(0.5, 0.0, 1.0),
    facets=(
        facet("a", "a", (1.0, 0.0, 0.0)),
        facet(None, "b", (0.0, 0.0, 1.0)),
        facet("b", "b", (0.0, 0.0, -1.0)),
        facet(None, None, (-1.0, 0.0, 0.0)),
    ),
    unstable_facets=3,
    rest_counts=(1, 2),
    least_angle_deg=90.0,
    least_margin_deg=20.0,
    asymmetry=0.1,
    history=(
        Step(0, 0.0, 1.0, 0.5, {"dice": 1.0}),
        Step(1, 0.5, 0.0, None, stage="hull", attempt=2),
    ),
    notes=("reversed 1 triangles",),
    thrown=ThrownOdds(
        {"name": "carpet", "friction": 0.2},
        (0.3, 0.7),
        (),
        SimulatedThrows(
            "native", 1, 4, 0, (1, 3), (0.25, 0.75), ((0.0, 0.8), (0.2, 1.0)), 0.0, (0.0, 0.4), 0.2
        ),
    ),
    files={"die_plain": "die_plain.stl"},
    stages=(StageTime("start", 0.1, None),),
)


def written(folder: Path, content: Any) -> Path:
    (folder / "result.json").write_text(json.dumps(content))
    return folder


def plain() -> dict[str, Any]:
    return json.loads(RESULT.json_text())


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    result = read_result(written(tmp_path, plain()))
    assert result == RESULT
    assert result.converged
    assert result.folder == tmp_path
    assert result.plain_file == tmp_path / "die_plain.stl"


def test_what_is_not_known_has_no_key() -> None:
    keys = set(plain())
    assert {"name", "facets", "history", "thrown", "notes"} <= keys
    assert not keys & {"engraved_probabilities", "displacement", "energy", "folder"}
    # Of a facet "nothing" is an answer.
    assert plain()["facets"][3]["label"] is None


def test_every_facet_of_an_outcome_shows_it() -> None:
    assert [label for label, _ in RESULT.shown] == ["a", "b", "b"]
    normals = np.array([normal for _, normal in RESULT.shown])
    np.testing.assert_array_equal(normals, [[1, 0, 0], [0, 0, 1], [0, 0, -1]])


@pytest.mark.parametrize("missing", ["status", "labels", "target", "facets", "center_of_mass"])
def test_what_is_missing_is_named(tmp_path: Path, missing: str) -> None:
    content = plain()
    del content[missing]
    with pytest.raises(InputError, match=f"result.json: expected .* got {missing}: .*; name a fol"):
        read_result(written(tmp_path, content))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"target": [0.5, 0.25]}, "do not sum to 1"),
        ({"target": [0.0, 1.0]}, "not positive"),
        ({"target": [float("nan"), 1.0]}, "not positive"),
        ({"target": [1.0]}, "not as many"),
        ({"target": "ab"}, "target"),
        ({"labels": ["a", "a"]}, "not all different"),
        ({"labels": ["a", "c"]}, "labels that the die has not"),
        ({"labels": 2}, "labels"),
        ({"files": {"die": "die.stl"}}, "no file of the die"),
        ({"files": {"die_plain": 1}}, "files.die_plain"),
        ({"center_of_mass": [0.0, 0.0]}, "three finite numbers"),
        ({"center_of_mass": [0.0, 0.0, float("inf")]}, "three finite numbers"),
        ({"facets": [{"label": "a"}]}, "facets.0.outcome"),
        ({"facets": ["a"]}, "facets.0"),
    ],
)
def test_wrong_kinds(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=f"of a finished run, got .*{message}"):
        read_result(written(tmp_path, {**plain(), **changes}))


@pytest.mark.parametrize("text", [None, "{", "[1]", "3", '"a"', "\x80", "[" * 100_000])
def test_files_that_are_no_result(tmp_path: Path, text: str | None) -> None:
    if text is not None:
        (tmp_path / "result.json").write_text(text, encoding="latin-1")
    with pytest.raises(InputError, match="name a folder that `dicedesign run` left"):
        read_result(tmp_path)
