"""`dicedesign sweep`: dice of all combinations of values, ranked, made once."""

from __future__ import annotations

import csv
import json
import math
import re
import shutil
from concurrent.futures import Executor
from contextlib import nullcontext
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
import yaml
from common.inline_executor import Inline, Lossy
from common.parsed_html import parse_page
from common.processes import kill_at_write

from dicedesign.cli.main import main
from dicedesign.fabricate.finish_options import EngravingOptions
from dicedesign.report import colored_die
from dicedesign.results.folder import read_result
from dicedesign.runtime import workers
from dicedesign.sweep.dice import MAX_FOLDER_NAME, combine
from dicedesign.sweep.dice_set import set_recipes
from dicedesign.sweep.ranking import _read_parts, pareto_front, rank_rows

SETTINGS = ("--seeds=2", "--set=size_mm=20,25")


def sweep(recipe: Path, folder: Path, *options: str, executor: Executor | None = None) -> int:
    """Exit code of a sweep in this process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(workers, "local_workers", lambda jobs: nullcontext(executor or Inline()))
        # Pictures are drawn at once.
        patch.setattr(colored_die, "MIN_PIXELS", 40)
        return main(["sweep", str(recipe), "--out", str(folder), *options])


def rows_of(folder: Path) -> list[dict[str, str]]:
    with (folder / "sweep.csv").open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="session")
def swept(recipe_path: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a sweep over two seeds and two sizes."""
    folder = tmp_path_factory.mktemp("swept") / "new"
    assert sweep(recipe_path, folder, *SETTINGS) == 0
    return folder


@pytest.fixture
def copied(swept: Path, tmp_path: Path) -> Path:
    """Copy of that folder."""
    return Path(shutil.copytree(swept, tmp_path / "copied"))


def test_all_combinations_are_ranked_dice(recipe_path: Path, swept: Path, tmp_path: Path) -> None:
    """They are regular tetrahedra, whose measures have closed forms."""
    rows = rows_of(swept)
    assert {(row["seed"], row["size_mm"]) for row in rows} == {
        (seed, size) for seed in "01" for size in ("20", "25")
    }
    assert [row["rank"] for row in rows] == list("1234")
    assert [row["size_mm"] for row in rows] == ["25", "25", "20", "20"]
    for row in rows:
        assert row["status"] == "converged"
        assert float(row["max_abs_error"]) < 1e-7
        radius = float(row["size_mm"]) / (2.0 * math.sqrt(3.0))
        assert float(row["inradius_mm"]) == pytest.approx(radius, rel=1e-5)
        margin = math.degrees(math.acos(-1.0 / 3.0)) / 2.0
        assert float(row["margin_deg"]) == pytest.approx(margin, rel=1e-5)
        assert float(row["asymmetry"]) == pytest.approx(0.0, abs=1e-5)
    changes = [f"--set={key}={rows[0][key]}" for key in ("seed", "size_mm")]
    assert main(["run", str(recipe_path), *changes, "--out", str(tmp_path / "one")]) == 0
    plain = (swept / rows[0]["folder"] / "die_plain.stl").read_bytes()
    assert plain == (tmp_path / "one" / "die_plain.stl").read_bytes()


def test_the_page_shows_the_dice_and_their_folders(swept: Path) -> None:
    text = (swept / "index.html").read_text()
    page = parse_page(text)
    assert len(page.sources) == 4
    assert all(source.startswith("data:image/webp;base64,") for source in page.sources)
    assert not re.search(r"https?:|<(?:script|link|iframe)", text)
    assert "4 of 4 dice converged" in page.text
    places = [text.index(f'<a href="{row["folder"]}/"') for row in rows_of(swept)]
    assert places == sorted(places)


def test_only_missing_dice_are_made(
    recipe_path: Path, copied: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = (copied / "sweep.csv").read_bytes()
    lossy = Lossy(lambda *_: False)
    assert sweep(recipe_path, copied, *SETTINGS, executor=lossy) == 0
    captured = capsys.readouterr()
    assert captured.err == f"note: 4 dice were already in {copied}\n"
    best = rows_of(copied)[0]["folder"]
    assert f"\nbest die: {copied / best}\n" in captured.out
    assert lossy.submitted == []

    first, second, third, fourth = (row["folder"] for row in rows_of(copied))
    shutil.rmtree(copied / first)
    # A die of another recipe is made again.
    shutil.rmtree(copied / second)
    shutil.copytree(copied / fourth, copied / second)
    # So is one of which a file is gone.
    (copied / third / "die_plain.stl").unlink()
    # And one whose process was killed while it wrote the last files.
    result = json.loads((copied / fourth / "result.json").read_text())
    sums = {name: [each] for name, each in result["sha256"].items()}
    (copied / fourth / ".unfinished.json").write_text(json.dumps({"sha256": sums}))
    assert sweep(recipe_path, copied, *SETTINGS, executor=lossy) == 0
    made = [name for _, recipes, _ in lossy.submitted for name in recipes]
    assert sorted(made) == sorted([first, second, third, fourth])
    assert (copied / "sweep.csv").read_bytes() == table
    assert not (copied / fourth / ".unfinished.json").exists()


def test_dice_of_an_earlier_recipe_are_made_again(
    recipe_path: Path, copied: Path, tmp_path: Path
) -> None:
    """Their files, which nobody has changed, are replaced."""
    changed, labels = tmp_path / "four.yaml", "target: {fair: 4, labels: [a, b, c, d]}"
    changed.write_text(recipe_path.read_text().replace("target: {fair: 4}", labels))
    lossy = Lossy(lambda *_: False)
    assert sweep(changed, copied, *SETTINGS, executor=lossy) == 0
    names = [row["folder"] for row in rows_of(copied)]
    assert len(lossy.submitted) == len(names) == 4
    for name in names:
        result = json.loads((copied / name / "result.json").read_text())
        assert result["labels"] == list("abcd")


def test_a_die_that_misses_its_target_is_the_last_row(recipe_path: Path, tmp_path: Path) -> None:
    paper = "{paper: {step: line_search, finish: none, steps: 1}}"
    changes = ("target={binomial: 3}", "start={prism: {sides: 4}}", f"method={paper},exact")
    assert sweep(recipe_path, tmp_path, *(f"--set={change}" for change in changes)) == 1
    assert [(row["rank"], row["status"], row["method"]) for row in rows_of(tmp_path)] == [
        ("1", "converged", "exact"),
        ("", "step_limit", str(yaml.safe_load(paper))),
    ]


def test_nothing_but_failures(recipe_path: Path, tmp_path: Path) -> None:
    flat = ("target={fair: 3}", "start={prism: {cap: 0.0}}", "method={exact: {starts: 2}}")
    changes = [f"--set={change}" for change in flat]
    assert sweep(recipe_path, tmp_path, *changes, "--seeds=2") == 1
    assert [row["status"] for row in rows_of(tmp_path)] == ["failed"] * 2
    assert all("expected" in row["message"] for row in rows_of(tmp_path))
    assert "0 of 2 dice converged" in (tmp_path / "index.html").read_text()


def test_an_interrupt_keeps_finished_dice(
    recipe_path: Path, copied: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupt(count: int, *_: object) -> bool:
        if count == 2:
            raise KeyboardInterrupt
        return False

    first, second = (row["folder"] for row in rows_of(copied)[:2])
    for name in (first, second):
        shutil.rmtree(copied / name)
    assert sweep(recipe_path, copied, *SETTINGS, executor=Lossy(interrupt)) == 130
    assert "repeat the command to make the other dice" in capsys.readouterr().err
    assert sum((copied / name / "result.json").exists() for name in (first, second)) == 1


@pytest.mark.parametrize(("losses", "code"), [(3, 0), (4, 1)])
def test_a_die_of_a_lost_worker_is_made_again(
    recipe_path: Path, copied: Path, losses: int, code: int
) -> None:
    """It runs alone, three times at most."""
    best = rows_of(copied)[0]["folder"]
    shutil.rmtree(copied / best)
    lossy = Lossy(lambda count, *_: count <= losses)
    assert sweep(recipe_path, copied, *SETTINGS, executor=lossy) == code
    assert len(lossy.submitted) == 4
    row = next(row for row in rows_of(copied) if row["folder"] == best)
    assert row["status"] == ("failed" if code else "converged")


def test_a_killed_sweep_goes_on(recipe_path: Path, copied: Path) -> None:
    """It is killed between two files of a die."""
    table, best = (copied / "sweep.csv").read_bytes(), copied / rows_of(copied)[0]["folder"]
    shutil.rmtree(best)
    kill_at_write(["sweep", str(recipe_path), "--out", str(copied), *SETTINGS], 3)
    assert {path.suffix for path in best.iterdir()} >= {".stl", ".part"}
    assert not (best / "result.json").exists()
    assert sweep(recipe_path, copied, *SETTINGS) == 0
    assert (copied / "sweep.csv").read_bytes() == table
    assert not list(best.glob(".*.part"))


@pytest.mark.parametrize(
    "damages",
    [
        [("result.json", b""), ("result.json", b'{"sha256": {"a": '), ("die_plain.stl", b"")],
        [("result.json", b"[" * 100_000), ("result.json", b'{"sha256": 1}'), ("recipe.yaml", b"[")],
    ],
)
def test_a_damaged_die_is_a_row_with_an_error(
    recipe_path: Path, copied: Path, damages: list[tuple[str, bytes]]
) -> None:
    """The fourth die is ranked, and what is damaged stays for the user to look at."""
    damaged = [row["folder"] for row in rows_of(copied)[1:]]
    for folder, (name, damage) in zip(damaged, damages, strict=True):
        (copied / folder / name).write_bytes(damage)
    assert sweep(recipe_path, copied, *SETTINGS) == 1
    rows = {row["folder"]: row for row in rows_of(copied)}
    assert [row["status"] for row in rows.values()] == ["converged"] + ["failed"] * 3
    for folder, (name, damage) in zip(damaged, damages, strict=True):
        assert rows[folder]["status"] == "failed"
        assert name in rows[folder]["message"]
        assert (copied / folder / name).read_bytes() == damage
        shutil.rmtree(copied / folder)
    assert sweep(recipe_path, copied, *SETTINGS) == 0


def test_commas_in_brackets_and_quotes(recipe_path: Path) -> None:
    dice = combine(recipe_path, ["target.labels=[a,'b,c',d,e],[1,2,3,4]"], 2)
    assert [die.recipe.target.target().labels for die in dice.values()] == [
        ("a", "b,c", "d", "e"), ("a", "b,c", "d", "e"), tuple("1234"), tuple("1234")
    ]  # fmt: skip
    assert [die.varied["seed"] for die in dice.values()] == [0, 1] * 2
    assert len({die.recipe.name for die in dice.values()}) == len(dice) == 4


def test_long_names_of_folders_are_cut(recipe_path: Path) -> None:
    """They differ nevertheless."""
    labels = ["x" * 20, "y" * 20, "z" * 20]
    choices = ",".join(f"[{','.join(labels)},{last}]" for last in "abc")
    first, *others = combine(recipe_path, [f"target.labels={choices}"])
    assert len(first) == MAX_FOLDER_NAME
    assert len({first, *others}) == 3
    (name,) = set_recipes([":".join(map(str, range(1, 26)))], {})
    assert len(name) == MAX_FOLDER_NAME


def test_labels_of_a_concave_die_are_off_its_plain_surface(concave_die: Path) -> None:
    result, depth = read_result(concave_die), EngravingOptions().depth_mm
    (die,) = _read_parts(result, depth)
    assert die.labels is not None
    plain = trimesh.load(result.plain_file)
    middles = die.points[die.triangles].mean(axis=1)
    _, distances, _ = trimesh.proximity.closest_point_naive(plain, middles)
    assert die.labels[distances > 0.9 * depth].all()
    assert not die.labels[distances < 1e-3 * depth].any()
    assert 0 < die.labels.sum() < len(die.labels)


def make_rows(seed: int) -> list[dict[str, Any]]:
    """Rows with random measures and ties, some of them not converged."""
    rng = np.random.default_rng(seed)
    rows = []
    for number in range(60):
        status = str(rng.choice(["converged", "no_progress", "failed"], p=[0.7, 0.2, 0.1]))
        radius, margin, error = (rng.integers(1, 12, size=3) / (4.0, 1.0, 1e14)).tolist()
        measures = {"inradius_mm": radius, "margin_deg": margin, "max_abs_error": error}
        if status == "failed":
            measures = dict.fromkeys(measures)
        rows.append({"number": number, "status": status, "on_front": None, **measures})
    return rows


@pytest.mark.parametrize("seed", range(2))
def test_the_order_and_the_front_against_brute_force(seed: int) -> None:
    rows = make_rows(seed)
    ranked = rank_rows(rows)
    assert sorted(row["number"] for row in ranked) == list(range(60))
    solved = [row for row in ranked if row["status"] == "converged"]
    assert ranked[: len(solved)] == solved
    assert [row["rank"] for row in solved] == list(range(1, len(solved) + 1))
    points = [(row["inradius_mm"], row["margin_deg"]) for row in solved]
    for (first, second), (one, other) in zip(
        combinations(solved, 2), combinations(points, 2), strict=True
    ):
        assert one[0] * one[1] >= other[0] * other[1]
        assert not (other[0] > one[0] and other[1] > one[1])
        if one[0] * one[1] == other[0] * other[1]:
            ties = [(row["max_abs_error"], row["number"]) for row in (first, second)]
            assert ties == sorted(ties)
    for row, (radius, margin) in zip(solved, points, strict=True):
        beaten = any(r >= radius and m >= margin and (r, m) != (radius, margin) for r, m in points)
        assert row["on_front"] == (not beaten)
    assert pareto_front(np.ones((2, 3))).tolist() == [True, True]


def test_a_die_without_a_facet_for_each_label_comes_last() -> None:
    """Its measures, of which it has none, count as 0."""
    measures = {"none": (None, None), "small": (0.5, 0.5), "narrow": (0.25, 0.75)}
    rows: list[dict[str, Any]] = [
        {"name": name, "inradius_mm": radius, "margin_deg": margin}
        for name, (radius, margin) in measures.items()
    ]
    ranked = rank_rows([{**row, "status": "converged", "max_abs_error": 0.0} for row in rows])
    assert [(row["name"], row["on_front"]) for row in ranked] == [
        ("small", True),
        ("narrow", True),
        ("none", False),
    ]
