"""Folder of a search: resume, refusals, and varied numbers."""

from __future__ import annotations

import resource
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from common.inline_executor import Inline
from common.made_up_trial import made_up_trial

from dicedesign.errors import InputError, OutputError
from dicedesign.optimize.preferences import PREFERENCES, Preferences
from dicedesign.recipe.reading import parse_recipe
from dicedesign.recipe.recipe import Recipe
from dicedesign.search.study import JOURNAL, RECIPE, open_study, search_space, vary_recipe
from dicedesign.search.trials import run_search

pytestmark = pytest.mark.usefixtures("made_up")


def run_trials(folder: Path, recipe: Recipe, trials: int) -> list[dict[str, Any]]:
    with open_study(folder, recipe) as study:
        run_search(study, trials, Inline(), 1)
        return study.finished()


@pytest.fixture
def varied() -> Recipe:
    """Recipe in which a search varies numbers of all kinds."""
    return parse_recipe(
        {
            "name": "total",
            "target": {"sum_of_dice": [2, 3]},
            "start": {"repulsion": {}},
            "method": {"exact": {}},
        }
    )


@pytest.mark.parametrize("weight", [0.0, 0.005, 40.0])
def test_the_first_trial_is_the_recipe(tmp_path: Path, weight: float) -> None:
    recipe = parse_recipe(
        {
            "name": "first",
            "target": {"fair": 4},
            "method": {"exact": {"prefer": {"margin": weight}}},
        }
    )
    first, second = run_trials(tmp_path, recipe, 2)
    assert first["recipe"] == recipe.as_dict()
    assert second["recipe"]["method"] != first["recipe"]["method"]


def test_trials_off_target_are_finished_and_avoided(tmp_path: Path, varied: Recipe) -> None:
    with open_study(tmp_path, varied) as study:
        keys = ("status", "max_abs_error", "inradius_mm", "margin_deg")
        for row in (
            ("no_progress", 0.25, 2.0, 5.0),
            ("no_die", None, None, None),
            ("converged", 1e-15, 2.0, 5.0),
        ):
            study.tell(study.propose()[0], dict(zip(keys, row, strict=True)))
        trials = study._study.get_trials()
        assert [trial.constraints["error"] for trial in trials] == [0.25, 1.0, 0.0]
        assert [trial.values for trial in trials] == [[2.0, 5.0], [0.0, 0.0], [2.0, 5.0]]
        assert [trial.number for trial in study._study.best_trials] == [2]
        assert len(study.finished()) == 3


def test_a_killed_search_resumes_with_equal_results(tmp_path: Path, varied: Recipe) -> None:
    """The journal is cut in the first trial, in a random one, and in one that depends on earlier
    ones."""
    whole = run_trials(tmp_path / "whole", varied, 12)
    lines = (tmp_path / "whole" / JOURNAL).read_bytes().splitlines(keepends=True)
    starts = [place for place, line in enumerate(lines) if b'"op_code":4,' in line]
    assert len(starts) == 12
    first, last = range(starts[1] + 1), range(starts[10], starts[11] + 1)
    ends = [*first[:4], first[-4], starts[4] + 3, *last[:4], *last[-5:]]
    for end in ends:
        folder = tmp_path / str(end)
        folder.mkdir()
        (folder / RECIPE).write_bytes((tmp_path / "whole" / RECIPE).read_bytes())
        half = lines[end][: len(lines[end]) // 2]
        (folder / JOURNAL).write_bytes(b"".join([*lines[:end], half]))
        # Killed again soon after.
        with open_study(folder, varied) as study:
            study.propose()
        assert run_trials(folder, varied, 12) == whole


def test_unfinished_parallel_trials_are_retried(tmp_path: Path, varied: Recipe) -> None:
    """Unfinished trials are proposed again, unchanged."""
    with open_study(tmp_path, varied) as study:
        proposed = dict(study.propose() for _ in range(14))
        for number in (9, 0, 3, 2, 1, 4, 6, 7, 8, 11, 10):
            study.tell(number, made_up_trial(proposed[number]))
    with open_study(tmp_path, varied) as study:
        again = dict(study.propose() for _ in range(3))
        assert again == {number: proposed[number] for number in (5, 12, 13)}
        number, _ = study.propose()
        assert number == 14
        for number, entries in again.items():
            study.tell(number, made_up_trial(entries))
        assert [trial["number"] for trial in study.finished()] == list(range(14))
        assert {trial["number"]: trial["recipe"] for trial in study.finished()} == proposed


def test_another_recipe_is_refused(tmp_path: Path, recipe: Recipe) -> None:
    run_trials(tmp_path, recipe, 1)
    other = recipe.model_copy(update={"seed": 4})
    message = r"got one of another, whose seed is 3 instead of 4; choose another folder with --out"
    with pytest.raises(InputError, match=message), open_study(tmp_path, other):
        pass
    assert len(run_trials(tmp_path, recipe, 1)) == 1


@pytest.mark.parametrize("content", ["not a journal\n", '{"op_code": 0}\n', '{"op_code": 99}\n'])
def test_a_spoiled_journal_is_refused(tmp_path: Path, recipe: Recipe, content: str) -> None:
    (tmp_path / JOURNAL).write_text(content)
    run_trials(tmp_path / "other", recipe, 1)
    (tmp_path / "other" / RECIPE).rename(tmp_path / RECIPE)
    message = "expected the journal of a search"
    with pytest.raises(InputError, match=message), open_study(tmp_path, recipe):
        pass


def test_a_search_resumes_after_a_full_disk(tmp_path: Path, recipe: Recipe) -> None:
    """The file size is limited for a while, so that a line may be incomplete."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    message = "trials.journal: expected a file that can be written, got 'File too large'; make room"
    first = run_trials(tmp_path, recipe, 2)
    with open_study(tmp_path, recipe) as study:
        number, _ = study.propose()
        size = (tmp_path / JOURNAL).stat().st_size + 10
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
        try:
            with pytest.raises(OutputError, match=message):
                study.tell(number, {})
            with pytest.raises(OutputError, match=message):
                study.propose()
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    finished = run_trials(tmp_path, recipe, 3)
    assert finished[:2] == first
    assert finished[2]["number"] == 2


def test_two_searches_do_not_share_a_folder(tmp_path: Path, recipe: Recipe) -> None:
    with open_study(tmp_path, recipe) as study:
        with (
            pytest.raises(InputError, match="expected a folder that no other process uses"),
            open_study(tmp_path, recipe),
        ):
            pass
        run_search(study, 1, Inline(), 1)
    assert len(run_trials(tmp_path, recipe, 1)) == 1


def test_without_optuna_the_extra_is_named(
    tmp_path: Path, recipe: Recipe, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "optuna", None)
    message = r"expected the optional extra 'search', .*pip install 'dicedesign\[search\]'"
    with pytest.raises(InputError, match=message), open_study(tmp_path / "new", recipe):
        pass
    assert not (tmp_path / "new").exists()


def make_recipe(**entries: Any) -> Recipe:
    return parse_recipe({"name": "die", "target": {"binomial": 3}, "seed": 7, **entries})


ASSIGNED = [f"assignment.{label}" for label in "0123"]


@pytest.mark.parametrize(
    ("entries", "assigned"),
    [
        ({"start": {"prism": {}}, "method": "paper"}, ASSIGNED),
        ({"start": {"repulsion": {}}, "assignment": list("2031"), "method": "exact"}, ASSIGNED),
        ({"start": {"prism": {}}, "target": {"fair": 4}, "method": "paper"}, []),
        ({"start": {"prism": {}}, "symmetry": "C2v", "method": "exact"}, []),
        ({"start": {"search": {}}, "method": "exact"}, []),
    ],
)
def test_assignments_are_varied_if_that_has_an_effect(
    entries: dict[str, Any], assigned: list[str]
) -> None:
    recipe = make_recipe(**entries)
    space = search_space(recipe)
    names = [f"prefer.{name}" for name in PREFERENCES.names]
    assert set(space) == {*assigned, *(names if entries["method"] == "exact" else [])}
    own = {name: entry.own for name, entry in space.items()}
    assert all(entry.low <= entry.own <= entry.high for entry in space.values())
    expected = recipe.as_dict()
    if assigned:
        expected["assignment"] = expected["assignment"] if "assignment" in entries else list("0123")
    assert vary_recipe(recipe, 0, own).as_dict() == expected


def test_each_trial_has_its_own_seed_and_assignment() -> None:
    recipe, rng = make_recipe(start={"prism": {}}, method={"paper": {}}), np.random.default_rng(0)
    assignments = set()
    for number in range(200):
        values = {name: rng.random() for name in ASSIGNED}
        varied = vary_recipe(recipe, number, values)
        assert varied.seed == 7 + number
        assert varied.assignment is not None
        numbers = [values[f"assignment.{label}"] for label in varied.assignment]
        assert numbers == sorted(values.values())
        assignments.add(tuple(varied.assignment))
        assert varied.target == recipe.target
        assert varied.start == recipe.start
    assert len(assignments) == 24


def test_weights_of_preferences_are_on_or_off() -> None:
    prefer = {"circles": 25.0, "margin": 0.5, "areas": 1e-9}
    recipe = make_recipe(start={"search": {}}, method={"exact": {"prefer": prefer}})
    space = search_space(recipe)
    assert {entry.low for entry in space.values()} == {1e-5}
    assert {entry.high for name, entry in space.items() if name != "prefer.circles"} == {10.0}
    assert all(entry.logarithmic for entry in space.values())
    assert space["prefer.circles"].high == 25.0

    values = {name: entry.own for name, entry in space.items()}
    own = vary_recipe(recipe, 0, values).method.exact
    assert own is not None
    assert own.prefer == Preferences(circles=25.0, margin=0.5, areas=1e-9)

    values |= {"prefer.roundness": 0.01, "prefer.areas": 0.0099, "prefer.margin": 1e-5}
    changed = vary_recipe(recipe, 3, values).method.exact
    assert changed is not None
    assert changed.prefer == Preferences(circles=25.0, roundness=0.01)
