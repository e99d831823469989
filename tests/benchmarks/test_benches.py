"""Benches run in the shortest form that measures anything, and judge what they measure."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from common.kernels import compiled_only
from common.paths import ROOT

from benchmarks import accuracy, concave, frame, gradients, speed, stability, thrown
from benchmarks.frame import NoAnswer, Report, Watched, main, time_in_turn
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.body import make_body
from dicedesign.geometry.surfaces.closed_surface import make_surface
from tests.reference.measurement import OK
from tests.reference.random_hulls import random_hull


def run(capsys: pytest.CaptureFixture[str], *arguments: object) -> dict[str, list[dict]]:
    """JSON output of a bench, which must succeed."""
    assert main([*map(str, arguments), "--json"]) == 0
    record: dict[str, list[dict]] = json.loads(capsys.readouterr().out)
    return record


def test_tables_have_a_heading_and_a_cell_for_each_value(
    capsys: pytest.CaptureFixture[str],
) -> None:
    report = Report(show=True)
    row = report.table("sizes", "name 8s | error 8.1e | part 6.1%")
    row("cube", 1.3e-3, 0.5)
    row("needle", None, float("inf"))
    assert capsys.readouterr().out.splitlines() == [
        "",
        "name        error   part",
        "cube      1.3e-03  50.0%",
        "needle          -      -",
    ]
    assert report.record["sizes"][0] == {"name": "cube", "error": 1.3e-3, "part": 0.5}


def test_bad_input_has_exit_code_2(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert main(["exact", str(tmp_path / "none.yaml"), "--part", "recipes"]) == 2
    assert "none.yaml" in capsys.readouterr().err


def test_a_hanging_call_is_stopped_and_the_next_one_answered() -> None:
    with Watched() as process:
        with pytest.raises(NoAnswer):
            process.call(0.2, time.sleep, 60.0)
        assert process.call(30.0, abs, -2) == 2
        with pytest.raises(ZeroDivisionError):
            process.call(30.0, divmod, 1, 0)


def test_slower_work_takes_longer() -> None:
    quick, slow = time_in_turn([lambda: sum(range(100)), lambda: sum(range(100_000))], 0.0)
    assert 20.0 * quick < slow


@pytest.mark.full
def test_exact(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    recipe = ROOT / "recipes" / "fair_d3.yaml"
    targets = run(capsys, "exact", "--part", "targets", "--targets", 2)
    assert targets["targets"][-1]["solved"] == 2
    recipes = run(capsys, "exact", recipe, "--part", "recipes", "--out", tmp_path)
    assert recipes["recipes"][0]["status"] == "converged"
    assert (tmp_path / "exact.json").exists()


def test_designs_over_seeds(capsys: pytest.CaptureFixture[str]) -> None:
    recipe = ROOT / "recipes" / "paper" / "binomial_2.yaml"
    given = ("design", recipe, "--part", "seeds", "--seeds", 1, "--fresh", 0)
    plain, exact = run(capsys, *given)["seeds"]
    assert plain["good"] == exact["good"] == 1
    assert exact["median error"] < 1e-12 < plain["median error"]


def test_gradients_and_a_wrong_one(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = random_hull(1)[1]
    assert gradients.compare(problem, seed=0, with_center=True).is_right
    cube = gradients.compare(next(gradients.polygon_bodies())[1], seed=0)
    assert cube.is_right
    assert "half-spaces" in cube.errors
    right = gradients.derivative
    monkeypatch.setattr(gradients, "derivative", lambda motion: 2 * right(motion))
    assert not gradients.compare(problem, seed=0, with_center=True).is_right


def test_stability_and_a_wrong_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    assert stability.run_case("platonic cube", 2).verdict == OK
    assert stability.run_case("design: loaded box, exact", 0).ending.startswith("converged")
    real = stability.measure
    monkeypatch.setattr(stability, "measure", lambda problem: replace(real(problem), excess=1e-6))
    assert stability.run_case("platonic cube", 0).verdict == "sum of probabilities off by 1.0e-06"


def test_accuracy_and_speed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(accuracy, "RUN_SECONDS", 0.01)
    (body,) = accuracy.built_in_bodies(1)["20 random points"]
    answers = {one.method: one for one in accuracy.ask(accuracy.Subject.of(body), 0.01)}
    exact, single = answers["this model, float64"], answers["this model, float32"]
    angles = answers["solid angles of facets"]
    assert exact.error is not None
    assert single.error is not None
    assert angles.error is not None
    assert exact.error < 1e-15 < single.error < 1e-6 < 1e-3 < angles.error
    monkeypatch.setattr(speed, "MOST_TRIMESH", 0)
    hull, query, *_ = speed.measure(body.points, 2, 0.0, Watched())
    assert 0.0 < hull < 0.1
    assert 0.1 < query < 100.0


def test_models_are_closed_and_the_same_each_time() -> None:
    names = concave.model_names(len(concave.KINDS) + 1)
    assert all(map(concave.is_model, names))
    assert not concave.is_model("blobs_0")
    for name in names:
        first, again = (concave.random_model(name) for _ in range(2))
        np.testing.assert_array_equal(first.points, again.points)
        assert 1500 <= len(first.points) <= 4000
        assert 0.0 < first.volume < 5.0 / 6.0 * convex_hull(first.points).surface.volume
        assert make_surface(make_body(first.points, first.triangles))


def test_a_concave_die_is_not_as_wanted_for_a_reason() -> None:
    measures = {"|p - q|": 0.1, "elsewhere": 0.0, "meet": 2, "apart": 50.0, "margin": 5.0, "s": 1.0}
    assert list(concave.shortfalls(measures, 0.005)) == [
        "probabilities off by 1.0e-01",
        "2 pairs of triangles meet",
        "an outcome tips over at 5.0 degrees",
    ]


@compiled_only
def test_equal_probabilities_are_within_chance() -> None:
    value, chance, limit = thrown.against(np.array([50, 52, 0]), np.array([49, 51, 1]))
    assert value < chance < limit
    assert thrown.against(np.array([90, 10, 0]), np.array([10, 90, 0]))[0] == pytest.approx(0.8)


def test_all_of_them_in_short_form(monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[list[str]] = []
    monkeypatch.setattr(frame, "main", lambda words: given.append(words) or len(given) == 2)
    monkeypatch.chdir(ROOT)
    assert main(["all", "--quick"]) == 1
    assert {words[0] for words in given} == set(frame.BENCHES)
    for words in given:
        assert frame.parser_of(words[0]).parse_args(words).quick
