"""`dicedesign search` from the command line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from common.inline_executor import Inline
from common.kernels import usual_notes
from common.processes import kill_at_write

from dicedesign.cli.main import main
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.reading import stl_bytes
from dicedesign.recipe.reading import read_recipe
from dicedesign.runtime import workers
from dicedesign.search.study import open_study


def test_a_search_and_a_run_of_its_best_recipe(
    tmp_path: Path,
    recipe_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["search", str(recipe_path), "--trials", "3", "--jobs", "2"]) == 0
    captured = capsys.readouterr()
    assert captured.err == usual_notes()
    lines = captured.out.splitlines()
    assert lines[0] == "four: 3 of 3 trials converged"
    assert lines[1].split()[:3] == ["rank", "trial", "radius"]
    assert len(lines) == 6
    folder = tmp_path / "outputs" / "four_search"
    assert lines[-1].startswith("files in outputs/four_search: leaderboard.html, ")

    board = json.loads((folder / "leaderboard.json").read_text())["leaderboard"]
    for line, entry in zip(lines[2:-1], board, strict=True):
        rank, number, radius, margin, *_ = line.split()
        assert (int(rank), int(number)) == (entry["rank"], entry["number"])
        assert float(radius) == pytest.approx(entry["inradius_mm"], abs=5e-4)
        assert float(margin) == pytest.approx(entry["margin_deg"], abs=5e-4)

    assert main(["run", str(folder / "best.yaml"), "--out", "die"]) == 0
    with open_study(folder, read_recipe(recipe_path)) as study:
        trials = {trial["number"]: trial for trial in study.finished()}
    assert len(trials) == 3
    die = convex_hull(np.array(trials[board[0]["number"]]["vertices"]))
    assert (tmp_path / "die" / "die_plain.stl").read_bytes() == stl_bytes(die.surface)


def test_a_killed_search_ends_with_the_same_leaderboard(tmp_path: Path, recipe_path: Path) -> None:
    """The kills come before the first file of the leaderboard, and between two of its files."""
    search = ["search", str(recipe_path), "--trials", "2", "--jobs", "1", "--out"]
    contents = []
    for name, kills in (("whole", ()), ("killed", (2, 3))):
        folder = tmp_path / name
        for count in kills:
            kill_at_write([*search, str(folder)], count)
            assert not (folder / "leaderboard.json").exists()
        assert main([*search, str(folder)]) == 0
        board = json.loads((folder / "leaderboard.json").read_text())
        for entry in board["leaderboard"]:
            assert entry.pop("seconds") > 0.0
        recipes = {path.name: path.read_bytes() for path in folder.glob("*.yaml")}
        contents.append((board, recipes, {path.name for path in folder.iterdir()}))
    assert contents[0] == contents[1]


def test_no_die_in_reach(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(workers, "local_workers", lambda jobs: Inline())
    path = tmp_path / "far.yaml"
    path.write_text(
        "name: far\ntarget: {binomial: 2}\nstart: {prism: {}}\n"
        "method: {paper: {step: line_search, finish: none, steps: 1}}\n"
    )
    assert main(["search", str(path), "--trials", "2", "--jobs", "1", "--out", str(tmp_path)]) == 1
    captured = capsys.readouterr()
    assert captured.out.splitlines()[0] == "far: 0 of 2 trials converged"
    assert len(captured.out.splitlines()) == 2
    assert captured.err == usual_notes()
    assert json.loads((tmp_path / "leaderboard.json").read_text())["leaderboard"] == []
    assert not (tmp_path / "best.yaml").exists()
