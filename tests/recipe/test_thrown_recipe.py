"""Recipes for a table, from file to folder."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from common.kernels import compiled_only

from dicedesign.cli.main import main
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.rest.poses import rest_poses
from dicedesign.throws.momentum_probabilities import throw_probabilities
from dicedesign.throws.tables import HANDS, mixture_tables

pytestmark = compiled_only

RECIPE = """\
name: coin
target: {fair: 5}
start: {prism: {}}
symmetry: D5h
method:
  exact:
    probabilities: thrown
    refine: {drops: 500, rounds: 2, verdict: 1000, within: 0.1}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("thrown")
    (folder / "recipe.yaml").write_text(RECIPE)
    assert main(["run", str(folder / "recipe.yaml"), "--out", str(folder / "out")]) == 0
    return folder / "out"


def test_a_result_has_the_probabilities_on_the_table(folder: Path) -> None:
    result = json.loads((folder / "result.json").read_text())
    thrown = result["thrown"]
    assert list(thrown) == ["table", "momentum", "rounds", "simulated", "by_table"]
    simulated = thrown["simulated"]
    assert (simulated["drops"], simulated["unresolved"]) == (1000, 0)
    assert sum(simulated["counts"]) == 1000
    np.testing.assert_allclose(simulated["frequencies"], np.array(simulated["counts"]) / 1000)
    for (low, high), frequency in zip(
        simulated["intervals"], simulated["frequencies"], strict=True
    ):
        assert low < frequency < high
    deviation = 0.5 * np.abs(np.array(simulated["frequencies"]) - 0.2).sum()
    assert simulated["total_variation"] == pytest.approx(deviation)
    # By symmetry it needs no rounds.
    assert thrown["rounds"] == []
    by_table = thrown["by_table"]
    assert len(by_table["values"]) == len(mixture_tables("board-game"))
    assert by_table["often"] == pytest.approx(np.quantile(by_table["values"], 0.9))
    assert by_table["worst"] == max(by_table["values"])
    assert by_table["often"] < 1.5 * by_table["chance_often"]
    assert "Thrown 1,000 times, the die has your probabilities" in result["message"]


def test_the_die_is_thrown_at_its_printed_size(folder: Path) -> None:
    body = read_body(folder / "die.stl")
    poses = rest_poses(body)
    radius = np.linalg.norm(poses.hull.vertices - poses.center_of_mass, axis=1).max()
    result = json.loads((folder / "result.json").read_text())
    assert result["thrown"]["table"]["size"] == pytest.approx(2e-3 * radius, rel=1e-5)
    probabilities = np.sort(throw_probabilities(body, poses))
    np.testing.assert_allclose(probabilities, np.sort(result["thrown"]["momentum"]), atol=1e-5)


def test_figures_and_report_are_written(folder: Path) -> None:
    files = json.loads((folder / "result.json").read_text())["files"]
    for kind, name in (("table", "table.png"), ("hands", "hands.png"), ("throw", "throw.gif")):
        assert files[kind] == name
        assert (folder / name).stat().st_size > 5000
    assert not (folder / "rounds.png").exists()
    page = (folder / "report.html").read_text()
    assert "On the table" in page
    assert "by an unknown hand" in page


def test_a_die_off_target_on_the_table(
    tmp_path: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    again = tmp_path / "recipe.yaml"
    again.write_text(RECIPE.replace("within: 0.1", "within: 1e-9") + "engrave: false\n")
    assert main(["run", str(again), "--out", str(tmp_path / "out"), "--no-figures"]) == 1
    out = capsys.readouterr().out
    assert "off_table: simulated throws are off by more than the tolerance" in out
    assert "Thrown 1,000 times, the die does not have your probabilities: off by a total" in out
    assert out.splitlines()[2].split() == ["label", "target", "set", "down", "model", "thrown"]


def test_a_design_by_the_model_alone_has_no_simulation(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recipe = tmp_path / "recipe.yaml"
    recipe.write_text(
        "name: loaded\ntarget: {probabilities: [1/8, 1/8, 1/4, 1/4, 1/4]}\nsymmetry: C2v\n"
        "method: {exact: {probabilities: thrown}}\nengrave: false\n"
    )
    assert main(["run", str(recipe), "--out", str(tmp_path / "out"), "--no-figures"]) == 0
    result = json.loads((tmp_path / "out" / "result.json").read_text())
    assert "simulated" not in result["thrown"]
    np.testing.assert_allclose(result["thrown"]["momentum"], result["target"], atol=1e-6)
    assert result["design"]["max_abs_error"] < 1e-11
    assert np.abs(np.array(result["probabilities"]) - result["target"]).max() > 0.002


def test_a_throw_distribution_with_a_table(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recipe = tmp_path / "recipe.yaml"
    recipe.write_text(
        "name: held\ntarget: {fair: 3}\nstart: {prism: {}}\nsymmetry: D3h\nengrave: false\n"
        "method: {exact: {probabilities: thrown, hand: cup, refine: {drops: 200, rounds: 1, "
        "verdict: 300, "
        "within: 0.2}}}\nfigures: false\n"
    )
    assert main(["run", str(recipe), "--out", str(tmp_path / "out")]) == 0
    result = json.loads((tmp_path / "out" / "result.json").read_text())
    table, cup = result["thrown"]["table"], HANDS["cup"]
    assert table["name"] == "board-game:cup"
    assert (table["height"], table["speed"], table["spin"]) == (
        list(cup.height),
        list(cup.speed),
        list(cup.spin),
    )
    page = (tmp_path / "out" / "report.html").read_text()
    assert "throws out of a cup, in which it falls from 5 to 12 cm above the table" in page
    assert "Throw it out of a cup: let it fall" in page
    # A die larger than the smallest drop height.
    recipe.write_text(recipe.read_text() + "size_mm: 60\n")
    assert main(["run", str(recipe), "--out", str(tmp_path / "out")]) == 2
    assert "no larger than the least drop height of 0.05 m" in capsys.readouterr().err
