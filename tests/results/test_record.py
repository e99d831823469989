"""Results are written and read back."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dicedesign.errors import InputError
from dicedesign.results.folder import read_result
from dicedesign.results.parts import (
    Draft,
    Search,
    SimulatedThrows,
    Status,
    TableResult,
    TradeOff,
)
from dicedesign.results.print_parts import FileCheck
from dicedesign.results.result import (
    Balance,
    Designed,
    Engraved,
    FacetOfDie,
    Result,
    StageTime,
    Step,
)


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
    design=Designed(0.0, starts=1),
    notes=("reversed 1 triangles",),
    engraved=Engraved((0.26, 0.74), 0.0, 0.01, balance=Balance("shape", (0.3, 0.7), (0.05,), 0.1)),
    search=Search(
        4, 2.5, 2, TradeOff(0.005, 45.0, 10.0, 0.03, (Draft(2, 1.5, 0.001, 0.02, 50.0, 12.0, 3),))
    ),
    thrown=TableResult(
        {"name": "carpet", "friction": 0.2},
        (0.3, 0.7),
        (),
        SimulatedThrows(
            "native", 1, 4, 0, (1, 3), (0.25, 0.75), ((0.0, 0.8), (0.2, 1.0)), 0.0, (0.0, 0.4), 0.2
        ),
    ),
    files={"die_plain": "die_plain.stl"},
    stages=(StageTime("start", 0.1),),
)


def write_result(folder: Path, content: Any) -> Path:
    (folder / "result.json").write_text(json.dumps(content))
    return folder


def plain() -> dict[str, Any]:
    return json.loads(RESULT.json_text())


def test_a_result_is_read_back(tmp_path: Path) -> None:
    result = read_result(write_result(tmp_path, plain()))
    assert result == RESULT
    assert result.converged
    assert result.folder == tmp_path
    assert result.plain_file == tmp_path / "die_plain.stl"


def test_missing_values_have_no_key() -> None:
    keys = set(plain())
    assert {"name", "facets", "history", "thrown", "notes"} <= keys
    assert not keys & {"concave", "inside", "infill", "folder"}
    assert set(plain()["design"]) == {"max_abs_error", "starts"}
    assert "stretch" not in plain()["engraved"]["balance"]
    # The label of a facet may be None.
    assert plain()["facets"][3]["label"] is None


def test_flaws_of_a_draft_exceed_the_rounding_of_files() -> None:
    wanted = TradeOff(0.005, 45.0, 10.0, 0.03, ())
    good = Draft(1, None, 0.005, 0.02, 45.0, 10.0, 0)
    assert list(wanted.flaws(good)) == []
    assert list(wanted.flaws(replace(good, apart_deg=44.99, margin_deg=9.99))) == []
    for change, flaw in (
        ({"error": 0.0051}, Status.OFF_TARGET),
        ({"self_intersections": 1}, Status.SELF_INTERSECTING),
        ({"apart_deg": 44.9}, Status.TOO_NEAR),
        ({"margin_deg": 9.9}, Status.TIPPY),
        ({"prints": 0.031}, Status.FRAGILE),
    ):
        assert list(wanted.flaws(replace(good, **change))) == [flaw]
    assert len(list(wanted.flaws(Draft(1, None, 0.5, 0.0, 0.0, 0.0, 9)))) == 4


def test_a_result_without_clock_has_no_times() -> None:
    result = RESULT.without_clock()
    assert result.search is not None
    assert result.search.seconds is None
    assert [draft.seconds for draft in result.search.trade_off.drafts] == [None]
    slower = replace(RESULT, stages=(StageTime("start", 9.0),))
    assert slower != RESULT
    assert slower.without_clock() == result


def test_each_facet_of_an_outcome_has_its_normal() -> None:
    assert [label for label, _ in RESULT.outcome_normals] == ["a", "b", "b"]
    normals = np.array([normal for _, normal in RESULT.outcome_normals])
    np.testing.assert_array_equal(normals, [[1, 0, 0], [0, 0, 1], [0, 0, -1]])


@pytest.mark.parametrize("missing", ["status", "facets", "design"])
def test_missing_keys_are_named(tmp_path: Path, missing: str) -> None:
    content = plain()
    del content[missing]
    with pytest.raises(InputError, match=f"result.json: expected .* got {missing}: .*; name a fol"):
        read_result(write_result(tmp_path, content))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"target": [0.5, 0.25]}, "do not sum to 1"),
        ({"target": [0.0, 1.0]}, "not positive"),
        ({"target": [float("nan"), 1.0]}, "not positive"),
        ({"target": [1.0]}, "not as many"),
        ({"target": "ab"}, "target"),
        ({"labels": ["a", "a"]}, "not all different"),
        ({"labels": ["a", "c"]}, "unknown labels"),
        ({"labels": 2}, "labels"),
        ({"files": {"die": "die.stl"}}, "no file of the die"),
        ({"files": {"die_plain": 1}}, "files.die_plain"),
        ({"center_of_mass": [0.0, 0.0]}, "three finite numbers"),
        ({"center_of_mass": [0.0, 0.0, float("inf")]}, "three finite numbers"),
        ({"facets": [{"label": "a"}]}, "facets.0.outcome"),
        ({"facets": ["a"]}, "facets.0"),
    ],
)
def test_wrong_values_are_refused(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=f"of a finished run, got .*{message}"):
        read_result(write_result(tmp_path, {**plain(), **changes}))


@pytest.mark.parametrize("text", [None, "{", "[1]", "3", '"a"', "\x80", "[" * 100_000])
def test_other_files_are_refused(tmp_path: Path, text: str | None) -> None:
    if text is not None:
        (tmp_path / "result.json").write_text(text, encoding="latin-1")
    with pytest.raises(InputError, match="name a folder written by `dicedesign run`"):
        read_result(tmp_path)


def test_a_solid_has_one_piece_and_no_flaw_of_any_kind() -> None:
    solid = FileCheck(
        open_edges=0,
        pieces=1,
        cavities=2,
        self_intersections=0,
        flat_triangles=0,
        volume_mm3=3.0,
    )
    assert solid.is_solid
    flaws = ("open_edges", "self_intersections", "flat_triangles")
    for first, second in product(flaws, flaws):
        assert not replace(solid, **{first: 2, second: 2}).is_solid
        assert not replace(solid, **{first: 1}).is_solid
    for pieces, volume in ((0, 3.0), (2, 3.0), (1, 0.0), (1, -3.0)):
        assert not replace(solid, pieces=pieces, volume_mm3=volume).is_solid
