"""The suite of stiff and extreme bodies, and the bench's own verdicts."""

from __future__ import annotations

import json
import os
import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dicedesign.bench import stability
from dicedesign.bench.bodies import solids, stiff
from dicedesign.bench.bodies.problem import Problem, turned
from dicedesign.bench.bodies.solids import ARCHIMEDEAN
from dicedesign.bench.bodies.stability_suite import stability_cases
from dicedesign.bench.measures.processes import CrashError, HangError, Watchdog
from dicedesign.bench.reference.measurement import measure
from dicedesign.bench.stability import OK, Row, run_case, run_stability, verdict
from dicedesign.cli.main import main
from dicedesign.geometry.hulls import hull
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes import center_of_mass
from dicedesign.geometry.solid import solid_properties
from dicedesign.rest.basins import Basins, find_basins

CASES = stability_cases()


def test_every_quick_case_is_ok() -> None:
    rows = list(run_stability(quick=True))
    assert len(rows) > 250
    assert [row for row in rows if row.verdict != OK] == []


def test_names_are_unique() -> None:
    assert len({case.name for case in CASES}) == len(CASES)


@pytest.mark.parametrize(
    "start",
    [
        "tetrahedron", "dual of snub dodecahedron", "prism 3", "prism 64", "antiprism 64",
        "bipyramid 64", "icosphere 5", "box 1 x 2 x 3", "roof 1e-14", "bulge 1e-15", "dent 1e-15",
        "box needle 1e6", "box plate 1e-6", "glancing crossing 1e-14",
        "uniform box needle 1e6", "random plate 1e-6", "center 1e-13 from a facet",
        "center 1e-13 from an edge", "center 1e-13 from a corner", "foot 1e-13 inside an edge",
        "random body at 1e-9", "random body at 1e9", "random body 1e7 sizes away",
        "Conway-Guy 19-facet unistable", "weighted sphere", "lens", "basin beyond a hemisphere",
        "random hull 1e5", "globe 1e5", "prism 5000", "corner opposite a rest",
        "lattice body", "duplicate points", "collinear and coplanar extras",
        "unreferenced vertices", "1e6 interior points",
    ],
)  # fmt: skip
def test_the_suite_has(start: str) -> None:
    assert any(case.name.startswith(start) for case in CASES)


@pytest.mark.parametrize("name", ARCHIMEDEAN)
def test_archimedean_solids_have_equal_edges_and_corners_on_a_sphere(name: str) -> None:
    points = ARCHIMEDEAN[name]
    radii = np.sqrt((points**2).sum(-1))
    np.testing.assert_allclose(radii, radii[0], rtol=1e-14)
    problem = solids.archimedean(name)
    assert problem.shares is not None
    assert problem.shares.sum() == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize("power", [-3, -9, -13])
def test_the_glancing_crossing_is_as_glancing_as_it_says(power: int) -> None:
    problem = stiff.glancing(10.0**power)
    before = stiff.glancing(-(10.0**power))
    for one in (problem, before):
        assert verdict(measure(one)) == OK
    opened = measure(problem).probabilities
    closed = measure(before).probabilities
    # A corner becomes a maximum: the odds are continuous there.
    np.testing.assert_allclose(opened, closed, rtol=0, atol=10.0 * 10.0**power + 1e-14)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"excess": 2e-12}, "sum of probabilities off by 2.0e-12"),
        ({"excess": float("nan")}, "sum of probabilities off by nan"),
        ({"errors": {"oracle": 2e-12}}, r"error 2.0e-12 \(oracle\) above 1.0e-12"),
        ({"errors": {"oracle": float("nan")}}, r"error nan \(oracle\)"),
        ({"outside": 1e-9}, "point outside of the hull by 1.0e-09"),
        ({"rests": 5}, "5 rests instead of 4"),
        ({"errors": {"oracle": 2e-12}, "condition": 1e3}, "^ok$"),
    ],
)
def test_verdicts(change: dict, text: str) -> None:
    found = measure(solids.platonic("tetrahedron"))
    assert verdict(found, 4) == OK
    with pytest.raises(AssertionError, match=text):
        raise AssertionError(verdict(replace(found, **change), 4))


def test_a_wrong_closed_form_is_noticed() -> None:
    problem = solids.platonic("cube")
    wrong = replace(problem, shares=np.array([0.2, 0.2, 0.15, 0.15, 0.15, 0.15]))
    assert verdict(measure(wrong)).startswith("error 3.3e-02 (closed form)")


def test_a_broken_symmetry_is_noticed() -> None:
    symmetries = (np.diag([-1.0, -1.0, 1.0]),)
    problem = Problem(solids.box(1, 2, 3).points, np.array([0.1, 0, 0]), symmetries=symmetries)
    assert "(symmetry)" in verdict(measure(problem))


@pytest.mark.parametrize("case", ["random body", "mesh"])
def test_a_wrong_center_of_a_uniform_body_is_noticed(
    monkeypatch: pytest.MonkeyPatch, case: str
) -> None:
    problem = stiff.random_body(0)
    if case == "mesh":
        dented = convex_hull(problem.points)
        points = np.concatenate([dented.vertices, 0.5 * dented.centroid[None]])
        a, b, c = dented.triangles[0]
        inner = [[a, b, len(points) - 1], [b, c, len(points) - 1], [c, a, len(points) - 1]]
        triangles = np.concatenate([dented.triangles[1:], inner])
        problem = Problem(points, triangles=triangles)
    assert verdict(measure(problem)) == OK

    def wrong(points: np.ndarray, triangles: np.ndarray) -> tuple[float, np.ndarray]:
        volume, centroid = solid_properties(points, triangles)
        return volume, centroid + 1e-10

    monkeypatch.setattr("dicedesign.kernels.ops.compiled", None)
    monkeypatch.setattr(center_of_mass if case == "mesh" else hull, "solid_properties", wrong)
    assert "(oracle)" in verdict(measure(problem))


def test_each_side_of_a_tied_body_is_held_against_the_oracle(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    problem = stiff.off_balance(0.0, corner=False)
    found = measure(problem)
    assert found.tied
    assert verdict(found) == OK

    def one_wrong(*arguments: Any) -> tuple[Basins, ...]:
        first, *others = find_basins(*arguments)
        return replace(first, areas=np.roll(first.areas, 1)), *others

    monkeypatch.setattr("dicedesign.bench.reference.measurement.find_basins", one_wrong)
    assert "(oracle)" in verdict(measure(problem))


def test_turning_moves_the_center_too() -> None:
    problem = turned(Problem(solids.box(1, 2, 3).points, np.array([0.1, 0.2, 0.3])), 7)
    assert problem.center is not None
    distances = np.sort(((problem.points - problem.center) ** 2).sum(-1))
    expected = np.sort(((solids.box(1, 2, 3).points - [0.1, 0.2, 0.3]) ** 2).sum(-1))
    np.testing.assert_allclose(distances, expected, rtol=1e-14)


def misbehave(how: str) -> int:
    if how == "hang":
        time.sleep(100.0)
    if how == "raise":
        raise ValueError("on purpose")
    if how == "die":
        os._exit(3)
    return len(how)


def test_the_watchdog_reports_and_goes_on() -> None:
    with Watchdog(misbehave) as dog:
        assert dog.call("fine", 30.0) == 4
        with pytest.raises(HangError, match=r"no answer in 0\.2 s"):
            dog.call("hang", 0.2)
        with pytest.raises(CrashError, match="ValueError: on purpose"):
            dog.call("raise", 30.0)
        with pytest.raises(CrashError, match="the process ended with code 3"):
            dog.call("die", 30.0)
        assert dog.call("again", 30.0) == 5


def test_the_command_prints_a_table_or_json(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    hung = Row("needle", excess=float("nan"), verdict="hang: no answer in 60 s")
    rows = [run_case(("cube", 0)), hung]
    monkeypatch.setattr(
        stability, "run_stability", lambda **options: iter(rows[: options["largest"]])
    )
    assert main(["bench", "stability", "--largest", "1"]) == 0
    table = capsys.readouterr().out.splitlines()
    assert table[0].split()[:4] == ["case", "facets", "rests", "sum"]
    assert table[1].split()[:3] == ["cube", "6", "6"]
    assert table[-1] == "1 cases, 1 ok, 0 not"
    assert main(["bench", "stability", "--largest", "2", "--json"]) == 1
    record = json.loads(capsys.readouterr().out)
    assert {"date", "machine", "python", "dicedesign", "mpmath"} <= set(record)
    given = record["rows"]
    assert [row["verdict"] for row in given] == [OK, "hang: no answer in 60 s"]
    assert given[1]["error"] is None
    # JSON has no word for what is not a number.
    assert given[1]["excess"] is None


def test_a_negative_size_is_an_error_in_words(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "stability", "--largest", "-1"]) == 2
    assert "--largest: expected at least 0, got -1" in capsys.readouterr().err
