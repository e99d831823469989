"""The bench of the exact method: targets, verdicts, summaries, recipes, and the command."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dicedesign.bench import exact as exact_targets
from dicedesign.bench.exact import Attempt, attempt_target, random_target, run_targets, summaries
from dicedesign.bench.measures import recipe_attempts as exact_recipes
from dicedesign.bench.measures.recipe_attempts import RecipeAttempt, attempt_recipe
from dicedesign.cli.main import main
from dicedesign.design.result import DesignResult, DesignStep
from dicedesign.errors import InputError
from dicedesign.fabricate.verdict import judge
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.recipe.design_stage import DesignedDie, make_start
from dicedesign.recipe.schema.reading import checked_recipe
from dicedesign.recipe.schema.recipe import Recipe
from dicedesign.results.status import Status
from dicedesign.search.trial import NO_DIE

PLAIN = Attempt(0, (0.4, 0.3, 0.2, 0.1), "CONVERGED", 4, 1e-15, 0.2, 0.2, 1e-3)
FAILED = replace(PLAIN, number=9, status="TIME_LIMIT", error=2e-4, seconds=10.0, descent_error=0.5)
LARGER = replace(PLAIN, number=1, target=(0.2,) * 5, seconds=0.4, descent_error=3e-3)

CUBE = convex_hull(np.array(np.meshgrid([-1.0, 1.0], [-1.0, 1.0], [-1.0, 1.0])).reshape(3, -1).T)
ROW = RecipeAttempt(
    "cubic", "exact", 6, "CONVERGED", 6, 1e-12, 2e-16, 0.02, 0.5, inradius_mm=8.66, border_deg=45.0
)
STUCK = replace(
    ROW,
    name="stuck",
    method="descent",
    status="STEP_LIMIT",
    rests=7,
    error=np.inf,
    odds_seconds=np.nan,
    inradius_mm=np.nan,
    border_deg=np.nan,
)


def test_targets_are_even_in_their_outcomes_and_seeded() -> None:
    targets = [random_target(number) for number in range(27)]
    assert [len(target) for target in targets] == 3 * list(range(4, 13))
    for target in targets:
        assert target.sum() == pytest.approx(1.0, abs=1e-15)
        assert target.min() >= 0.01
    np.testing.assert_array_equal(random_target(5), targets[5])
    assert not np.allclose(targets[5], targets[14][: len(targets[5])])
    # Dirichlet(1) over k outcomes: a share is above x with probability (1 - x)^(k - 1).
    shares = [(random_target(9 * n)[0] - 0.01) / 0.96 for n in range(2000)]
    assert np.mean(np.array(shares) > 0.3) == pytest.approx(0.7**3, abs=0.04)


def test_a_target_is_solved_exactly_and_descent_is_not_there_yet(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(exact_targets, "LEAST_SECONDS", 0.0)
    attempt = attempt_target(2, 10.0)
    assert attempt.solved
    assert attempt.status == "CONVERGED"
    assert attempt.rests == attempt.outcomes == 6
    assert attempt.descent_seconds == attempt.seconds
    assert 1e-12 < attempt.descent_error < 1.0


def test_the_solver_is_not_taken_at_its_word(monkeypatch: pytest.MonkeyPatch) -> None:
    """A cube is fair; whatever is said of it, it has neither other odds nor fewer rests."""

    def claim(directions: np.ndarray, target: np.ndarray) -> Attempt:
        step = DesignStep(0, 0.0, 0.0, {"dice": 0.0}, 0.0)
        result = DesignResult(Status.CONVERGED, CUBE, directions, {}, (step,), 1, 1, 0)
        monkeypatch.setattr(exact_targets, "random_target", lambda number: target)
        monkeypatch.setattr(exact_targets, "solve_exactly", lambda *given: result)
        monkeypatch.setattr(exact_targets, "_descent_error", lambda *given: 0.5)
        return attempt_target(0, 1.0)

    fair = claim(CUBE.normals, np.full(6, 1.0 / 6.0))
    assert fair.solved
    assert fair.descent_seconds == max(fair.seconds, exact_targets.LEAST_SECONDS)
    wrong = claim(CUBE.normals, np.array([0.25, 0.25, 0.125, 0.125, 0.125, 0.125]))
    assert not wrong.solved
    assert wrong.error == pytest.approx(1.0 / 12.0)
    fewer = claim(CUBE.normals[:5], np.full(5, 0.2))
    assert (fewer.rests, fewer.error, fewer.solved) == (6, float("inf"), False)
    twice = claim(CUBE.normals[[0, 0, 2, 3, 4, 5]], np.full(6, 1.0 / 6.0))
    assert not twice.solved


def test_the_first_target_is_warmed_up_with(monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[int] = []
    told: list[str] = []

    def attempt(number: int, seconds: float) -> Attempt:
        tried.append(number)
        return replace(PLAIN, number=number)

    monkeypatch.setattr(exact_targets, "attempt_target", attempt)
    assert [a.number for a in run_targets(3, 1.0, told.append)] == [0, 1, 2]
    assert tried == [3, 0, 1, 2]
    assert told == ["target 0", "target 1", "target 2"]


def test_summaries_by_outcomes_and_of_all() -> None:
    four, five, both = summaries([LARGER, FAILED, PLAIN])
    assert (four.outcomes, four.targets, four.solved) == (4, 2, 1)
    assert four.median_seconds == pytest.approx(5.1)
    assert four.worst_seconds == 0.2
    assert four.median_descent_error == pytest.approx(0.2505)
    assert (five.outcomes, five.targets, five.solved) == (5, 1, 1)
    assert (both.outcomes, both.targets, both.solved) == (None, 3, 2)
    assert (both.median_seconds, both.worst_seconds) == (0.4, 0.4)
    assert (both.median_descent_error, both.worst_descent_error) == (3e-3, 0.5)
    assert np.isnan(summaries([FAILED])[0].worst_seconds)


def test_the_command_prints_a_table_or_json(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked: list[tuple[int, float]] = []

    def run(count: int, seconds: float, on_target: object) -> Iterator[Attempt]:
        asked.append((count, seconds))
        return iter([PLAIN, FAILED, LARGER])

    monkeypatch.setattr(exact_targets, "run_targets", run)
    assert main(["bench", "exact"]) == 0
    header, four, five, both, unsolved = capsys.readouterr().out.splitlines()
    assert header.split()[:3] == ["outcomes", "targets", "solved"]
    assert four.split() == ["4", "2", "1", "5.100", "0.200", "2.5e-01", "5.0e-01"]
    assert five.split()[:3] == ["5", "1", "1"]
    assert both.split()[:3] == ["all", "3", "2"]
    assert "target 9 (0.4000, 0.3000, 0.2000, 0.1000), error 2.0e-04 with 4 rests" in unsolved
    assert main(["bench", "exact", "--targets", "3", "--seconds", "2", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert {"date", "machine", "python", "dicedesign", "torch"} <= set(record)
    assert [row["outcomes"] for row in record["rows"]] == [4, 5, None]
    assert [a["solved"] for a in record["targets"]] == [True, False, True]
    assert record["recipes"] == []
    assert asked == [(200, 10.0), (3, 2.0)]


def cubic(outcomes: int, method: str = "exact") -> Recipe:
    plain = {"name": "cubic", "target": {"fair": outcomes}, "start": {"repulsion": {}}}
    return checked_recipe({**plain, "method": {method: {}}, "size_mm": 30})


def claim_cube(
    monkeypatch: pytest.MonkeyPatch, directions: np.ndarray, status: Status, *errors: float
) -> None:
    """Make the design of every recipe a cube, with a step of such an error after each second."""

    def design(recipe: Recipe, start: object) -> DesignedDie:
        steps = tuple(DesignStep(i, i + 1.0, 0.0, {}, error) for i, error in enumerate(errors))
        result = DesignResult(status, CUBE, directions, {}, steps, 1, 1, 0)
        target = recipe.target.target()
        verdict = judge(CUBE, directions, target, recipe.size_mm)
        return DesignedDie(target, result, verdict, status, "")

    monkeypatch.setattr(exact_recipes, "design_die", design)


def test_a_cube_is_measured_in_closed_form(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a diagonal of 30 mm, the edge is 30 / sqrt(3) mm, and the border 45 degrees away."""
    claim_cube(monkeypatch, CUBE.normals, Status.CONVERGED, 0.1, 1e-4, 1e-13, 1e-9, 1e-15)
    exact = attempt_recipe(cubic(6), None)
    assert (exact.name, exact.method, exact.outcomes, exact.rests) == ("cubic", "exact", 6, 6)
    assert exact.inradius_mm == pytest.approx(15.0 / np.sqrt(3.0), rel=1e-12)
    assert exact.border_deg == pytest.approx(45.0, rel=1e-12)
    assert (exact.tolerance, exact.odds_seconds) == (1e-12, 3.0)
    assert exact.error < 1e-14
    assert exact.solved
    descent = attempt_recipe(cubic(6, "descent"), None)
    assert (descent.method, descent.tolerance, descent.odds_seconds) == ("descent", 1e-3, 2.0)
    assert descent.solved


def test_a_recipe_is_not_solved_by_its_odds_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    claim_cube(monkeypatch, CUBE.normals, Status.TOO_SMALL, 1e-13)
    small = attempt_recipe(cubic(6), None)
    assert (small.status, small.solved) == ("TOO_SMALL", False)
    assert small.error < 1e-14
    claim_cube(monkeypatch, CUBE.normals[:5], Status.CONVERGED, 0.1)
    fewer = attempt_recipe(cubic(5), None)
    assert (fewer.outcomes, fewer.rests, fewer.error, fewer.solved) == (5, 6, np.inf, False)
    assert np.isnan([fewer.odds_seconds, fewer.inradius_mm, fewer.border_deg]).all()


def test_a_start_that_leads_nowhere_is_a_row_too() -> None:
    """A prism with flat caps rests on them too, so it has two rests too many."""
    plain = {"name": "nowhere", "target": {"fair": 4}, "start": {"prism": {"cap": 0.0}}}
    recipe = checked_recipe({**plain, "method": {"exact": {"starts": 1}}})
    attempt = attempt_recipe(recipe, make_start(recipe))
    assert (attempt.status, attempt.rests, attempt.error) == (NO_DIE, 0, np.inf)
    assert not attempt.solved


def test_a_start_that_does_not_suit_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def design(*given: object) -> DesignedDie:
        raise InputError("target: expected 4 outcomes")

    monkeypatch.setattr(exact_recipes, "design_die", design)
    with pytest.raises(InputError, match="expected 4 outcomes"):
        attempt_recipe(cubic(6), None)


def test_the_command_runs_recipes_after_the_targets(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], repository: Path
) -> None:
    paths = [str(repository / "recipes" / f"{name}.yaml") for name in ("fair_d5", "fair_d3")]
    asked: list[str] = []

    def run(count: int, seconds: float, on_target: object) -> Iterator[Attempt]:
        asked.append("targets")
        return iter([PLAIN])

    def attempt(recipe: Recipe, start: object) -> RecipeAttempt:
        asked.append(recipe.name)
        return {"fair_d5": ROW, "fair_d3": STUCK}[recipe.name]

    monkeypatch.setattr(exact_targets, "run_targets", run)
    monkeypatch.setattr(exact_recipes, "attempt_recipe", attempt)
    assert main(["bench", "exact", *paths]) == 0
    assert asked == ["targets", "fair_d5", "fair_d3"]
    *_, everything, empty, header, solved, stuck = capsys.readouterr().out.splitlines()
    assert everything.split()[0] == "all"
    assert empty == ""
    assert header.split()[:4] == ["recipe", "method", "verdict", "outcomes"]
    numbers = ["6", "6", "2.0e-16", "0.020", "0.500", "8.66", "45.0"]
    assert solved.split() == ["cubic", "exact", "solved", *numbers]
    assert stuck.split()[:4] == ["stuck", "descent", "step", "limit"]
    assert stuck.split()[4:] == ["6", "7", "-", "-", "0.500", "-", "-"]
    assert main(["bench", "exact", "--json", *paths]) == 0
    first, second = json.loads(capsys.readouterr().out)["recipes"]
    assert (first["name"], first["solved"], first["border_deg"]) == ("cubic", True, 45.0)
    asked.clear()
    others = [
        str(repository / "recipes" / f"{name}.yaml") for name in ("fair_d3_duck", "2d6_table")
    ]
    assert main(["bench", "exact", *others, paths[0]]) == 0
    assert asked == ["targets", "fair_d5"]
    assert capsys.readouterr().err == "note: 2 recipes of concave or thrown dice are left out\n"
    assert (second["solved"], second["error"], second["odds_seconds"]) == (False, None, None)


def test_a_recipe_is_solved_through_the_command(
    capsys: pytest.CaptureFixture[str], repository: Path
) -> None:
    path = repository / "recipes" / "fair_d5.yaml"
    assert main(["bench", "exact", "--targets", "1", "--json", str(path)]) == 0
    record = json.loads(capsys.readouterr().out)
    assert [target["number"] for target in record["targets"]] == [0]
    (attempt,) = record["recipes"]
    assert (attempt["name"], attempt["method"], attempt["status"]) == (
        "fair_d5",
        "exact",
        "CONVERGED",
    )
    assert attempt["solved"]
    assert attempt["outcomes"] == attempt["rests"] == 5
    assert attempt["error"] <= attempt["tolerance"] == 1e-12
    assert 0.0 <= attempt["odds_seconds"] <= attempt["seconds"]
    # A prism of two triangles and three rectangles, whose largest distance is 30 mm.
    assert 0.0 < attempt["inradius_mm"] < 15.0
    assert 0.0 < attempt["border_deg"] < 90.0


def test_bad_recipes_are_errors_before_anything_runs(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    repository: Path,
    tmp_path: Path,
) -> None:
    def run(*given: object) -> Iterator[Attempt]:
        raise AssertionError

    monkeypatch.setattr(exact_targets, "run_targets", run)
    good, none, mesh = repository / "recipes" / "fair_d5.yaml", tmp_path / "none", tmp_path / "mesh"
    assert main(["bench", "exact", str(good), str(none)]) == 2
    assert f"{none}: expected a readable recipe file" in capsys.readouterr().err
    mesh.write_text("{name: mesh, target: {fair: 4}, start: {mesh: {path: gone.stl}}}")
    assert main(["bench", "exact", str(good), str(mesh)]) == 2
    assert "gone.stl" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--targets", "0"], "--targets: expected at least 1, got 0"),
        (["--seconds", "0"], "--seconds: expected a positive number, got 0"),
    ],
)
def test_bad_limits_are_errors_in_words(
    words: list[str], text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bench", "exact", *words]) == 2
    assert text in capsys.readouterr().err
