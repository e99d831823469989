"""The bench of the exact method: targets, verdicts, summaries, recipes, and the command."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from common.benches import run_bench

from dicedesign.bench.benches.exact import Extent, RecipeRow, attempt_recipe, summaries
from dicedesign.bench.measures.designs.random_targets import (
    Attempt,
    attempt_target,
    checked,
    random_target,
)
from dicedesign.bench.measures.recipes import begun, designed
from dicedesign.bench.measures.recipes import checked as checked_die
from dicedesign.cli.main import main
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.recipe.schema.reading import checked_recipe
from dicedesign.results.record import Result

PLAIN = Attempt(0, (0.4, 0.3, 0.2, 0.1), "converged", 4, 1e-15, 0.2, 1, 0.5, 1e-3)
FAILED = replace(PLAIN, number=9, status="time_limit", error=2e-4, seconds=10.0, paper_error=0.5)
LARGER = replace(PLAIN, number=1, target=(0.2,) * 5, seconds=0.4, paper_error=3e-3)

CUBE = convex_hull(np.array(np.meshgrid([-1.0, 1.0], [-1.0, 1.0], [-1.0, 1.0])).reshape(3, -1).T)


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


def test_a_target_is_solved_exactly_and_the_paper_s_method_comes_near() -> None:
    attempt = attempt_target(2, 10.0)
    assert attempt.solved
    assert attempt.status == "converged"
    assert attempt.rests == attempt.outcomes == 6
    assert attempt.starts >= 1
    assert 1e-12 < attempt.paper_error < 0.1


def test_the_solver_is_not_taken_at_its_word() -> None:
    """A cube is fair; whatever is said of it, it has neither other odds nor fewer rests."""
    rests, error = checked(CUBE.vertices, CUBE.normals, np.full(6, 1.0 / 6.0))
    assert (rests, error < 1e-14) == (6, True)
    odds = np.array([0.25, 0.25, 0.125, 0.125, 0.125, 0.125])
    assert checked(CUBE.vertices, CUBE.normals, odds) == (6, pytest.approx(1.0 / 12.0))
    assert checked(CUBE.vertices, CUBE.normals[:5], np.full(5, 0.2)) == (6, np.inf)
    twice = CUBE.normals[[0, 0, 2, 3, 4, 5]]
    assert checked(CUBE.vertices, twice, np.full(6, 1.0 / 6.0)) == (6, np.inf)


def test_summaries_by_outcomes_and_of_all() -> None:
    four, five, both = summaries([LARGER, FAILED, PLAIN])
    assert (four.outcomes, four.targets, four.solved) == (4, 2, 1)
    assert four.line().split()[:7] == ["4", "2", "1", "5.100", "0.200", "2.5e-01", "5.0e-01"]
    assert (five.outcomes, five.targets, five.solved) == (5, 1, 1)
    assert both.line().split()[:3] == ["all", "3", "2"]
    assert (both.median_seconds, both.worst_seconds) == (0.4, 0.4)
    assert (both.median_paper_error, both.worst_paper_error) == (3e-3, 0.5)
    assert np.isnan(summaries([FAILED])[0].worst_seconds)


@pytest.fixture(scope="module")
def prism() -> Result:
    """A fair d5."""
    work = begun(recipe())
    designed(work)
    return checked_die(work)


def recipe(**changes: object):
    plain = {"name": "five", "target": {"fair": 5}}
    return checked_recipe({**plain, "engrave": False, "method": "exact", **changes})


def test_a_die_is_measured(prism: Result) -> None:
    row = RecipeRow.of(recipe(), 1.5, prism)
    assert (row.name, row.method, row.outcomes, row.rests) == ("five", "exact", 5, 5)
    assert (row.verdict, row.solved, row.seconds) == ("solved", True, 1.5)
    assert row.error <= row.tolerance == 1e-12
    assert row.odds_seconds >= 0.0
    # Its largest distance is 30 mm.
    assert 0.0 < row.inradius_mm < 15.0
    assert 0.0 < row.border_deg < 90.0
    assert row.line().split()[:4] == ["five", "exact", "solved", "5"]


def test_a_recipe_is_not_solved_by_its_odds_alone(prism: Result) -> None:
    small = RecipeRow.of(recipe(), 1.0, replace(prism, status="too_small"))
    assert (small.verdict, small.status, small.solved) == ("too small", "too_small", False)
    assert small.error < 1e-12
    stray = replace(prism, facets=(*prism.facets, replace(prism.facets[0], label=None)))
    row = RecipeRow.of(recipe(), 1.0, stray)
    assert (row.rests, row.error, row.solved) == (6, np.inf, False)
    assert row.line().split()[-5:] == ["-", *row.line().split()[-4:-2], "-", "-"]


def test_a_start_that_leads_nowhere_is_a_row_too() -> None:
    """A prism with flat caps rests on them too, so it has two rests too many."""
    nowhere = recipe(
        target={"fair": 4}, start={"prism": {"cap": 0.0}}, method={"exact": {"starts": 1}}
    )
    row = attempt_recipe(begun(nowhere))
    assert (row.verdict, row.rests, row.error, row.solved) == ("no die", 0, np.inf, False)


def test_a_start_that_does_not_suit_is_an_error() -> None:
    with pytest.raises(InputError):
        attempt_recipe(begun(recipe(target={"fair": 9}, start={"hendecahedron": "bisymmetric"})))


def test_a_recipe_is_solved_through_the_command(
    capsys: pytest.CaptureFixture[str], repository: Path
) -> None:
    folder = repository / "recipes"
    path, concave = folder / "fair_d5.yaml", folder / "fair_d3_duck.yaml"
    assert run_bench("exact", path, concave, "--json", extent=Extent(1, 10.0)) == 0
    printed = capsys.readouterr()
    assert printed.err == "note: 1 recipes of concave or thrown dice are left out\n"
    record = json.loads(printed.out)
    assert [target["number"] for target in record["targets"]] == [0]
    (attempt,) = record["recipes"]
    assert (attempt["name"], attempt["method"], attempt["status"]) == (
        "fair_d5",
        "exact",
        "converged",
    )
    assert attempt["solved"]
    assert attempt["outcomes"] == attempt["rests"] == 5
    assert attempt["error"] <= attempt["tolerance"] == 1e-12
    assert 0.0 <= attempt["odds_seconds"] <= attempt["seconds"]
    # A prism of two triangles and three rectangles, whose largest distance is 30 mm.
    assert 0.0 < attempt["inradius_mm"] < 15.0
    assert 0.0 < attempt["border_deg"] < 90.0


def test_bad_recipes_are_errors_before_anything_runs(
    capsys: pytest.CaptureFixture[str], repository: Path, tmp_path: Path
) -> None:
    good, none, mesh = repository / "recipes" / "fair_d5.yaml", tmp_path / "none", tmp_path / "mesh"
    assert main(["bench", "exact", str(good), str(none)]) == 2
    assert f"{none}: no such file" in capsys.readouterr().err
    mesh.write_text("{name: mesh, target: {fair: 4}, start: {mesh: {path: gone.stl}}}")
    assert main(["bench", "exact", str(good), str(mesh)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert "gone.stl" in err
