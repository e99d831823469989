"""`dicedesign sweep`: dice of all combinations of values."""

from __future__ import annotations

import csv
import shutil
from pathlib import Path

import pytest
from common.inline_executor import Inline

from dicedesign.cli.main import main
from dicedesign.recipe.reading import read_recipe
from dicedesign.search.sweep import combine, make_dice


def sweep(recipe: Path, folder: Path, *settings: str) -> int:
    words = ["sweep", str(recipe), "--out", str(folder), "--jobs", "1"]
    return main([*words, *(word for each in settings for word in ("--set", each))])


def rows(folder: Path) -> list[dict[str, str]]:
    with (folder / "sweep.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_all_combinations_are_dice_and_made_once(
    recipe_path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "sweep"
    settings = ("seed=3,4", "size_mm=20,25", "figures=false", "report=false", "clock=false")
    assert sweep(recipe_path, folder, *settings) == 0
    made = rows(folder)
    assert [(row["seed"], row["size_mm"]) for row in made] == [
        ("3", "20"), ("3", "25"), ("4", "20"), ("4", "25")
    ]  # fmt: skip
    page = (folder / "index.html").read_text()
    for row in made:
        assert row["status"] == "converged"
        assert float(row["max_abs_error"]) < 1e-8
        assert f'alt="{row["folder"]}"' in page
        words = ["run", str(recipe_path), "--no-figures", "--out", str(tmp_path / "one")]
        for key in ("seed", "size_mm"):
            words += ["--set", f"{key}={row[key]}"]
        assert main(words) == 0
        one, swept = (each / "die_plain.stl" for each in (tmp_path / "one", folder / row["folder"]))
        assert one.read_bytes() == swept.read_bytes()
    # Only what is missing is made again.
    times = [(folder / row["folder"] / "result.json").stat().st_mtime_ns for row in made]
    shutil.rmtree(folder / made[1]["folder"])
    capsys.readouterr()
    assert sweep(recipe_path, folder, *settings) == 0
    assert "3 dice were already in" in capsys.readouterr().err
    again = [(folder / row["folder"] / "result.json").stat().st_mtime_ns for row in rows(folder)]
    assert [one == other for one, other in zip(times, again, strict=True)] == [
        True,
        False,
        True,
        True,
    ]


def test_a_die_that_fails_is_a_row(recipe_path: Path, tmp_path: Path) -> None:
    settings = ("size_mm=30,4", "engrave={}", "figures=false", "report=false")
    assert sweep(recipe_path, tmp_path / "sweep", *settings) == 1
    fine, failed = rows(tmp_path / "sweep")
    assert (fine["status"], failed["status"]) == ("converged", "failed")
    assert "use size_mm = " in failed["message"]


@pytest.mark.parametrize(
    ("setting", "fault"),
    [
        ("size_mm=20,wide", "size_mm: expected a number, got 'wide'"),
        ("sizes=20,30", "sizes: unknown key"),
        ("size_mm", "--set size_mm: expected a key of its own and its values"),
        ("size_mm=", "--set size_mm=: expected a key of its own and its values"),
        ("size_mm=20,20.0", "--set: expected combinations that differ"),
    ],
)
def test_settings_are_checked_before_work(
    setting: str,
    fault: str,
    recipe_path: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert sweep(recipe_path, tmp_path / "sweep", "seed=1,2", setting) == 2
    assert fault in capsys.readouterr().err
    assert not (tmp_path / "sweep").exists()


def test_commas_in_brackets_and_quotes(recipe_path: Path) -> None:
    settings = ["target.labels=[a,'b,c',d,e],[1,2,3,4]", "seed=1,2"]
    combinations = list(combine(recipe_path, settings).values())
    assert [recipe.target.target().labels for _, recipe in combinations] == [
        ("a", "b,c", "d", "e"), ("a", "b,c", "d", "e"), tuple("1234"), tuple("1234")
    ]  # fmt: skip
    assert [varied["seed"] for varied, _ in combinations] == [1, 2] * 2


def test_an_interrupt_keeps_finished_dice(
    recipe_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    combinations = combine(recipe_path, ["seed=1,2,3", "figures=false", "report=false"])
    made = []

    def on_die() -> None:
        made.append(None)
        if len(made) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        make_dice(tmp_path, combinations, Inline(), 1, on_die)
    folders = sorted(path.parent.name for path in tmp_path.glob("*/result.json"))
    assert folders == sorted(combinations)[:2]
    for name in folders:
        assert read_recipe(tmp_path / name / "recipe.yaml") == combinations[name][1]
