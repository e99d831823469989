"""The bench of the momentum model: unseen dice, printed dice, times, the command."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from common.benches import run_bench
from common.inline_executor import Inline
from common.kernels import compiled_only
from scipy.stats import chisquare

from dicedesign.bench.benches.momentum import Extent, by_kind
from dicedesign.bench.measures.throws.momentum_judging import (
    RESTS,
    judge_printed_die,
    model_times,
    throw_unseen_dice,
)
from dicedesign.cli.main import main
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.gradient.thrown_odds import ThrownOdds
from dicedesign.learning.random_dice import random_die
from dicedesign.learning.random_throws import Deviation
from dicedesign.rest.poses import rest_poses
from dicedesign.throws.counts.throw_counts import read_throw_counts
from dicedesign.throws.momentum.momentum_model import momentum_model
from dicedesign.throws.momentum.momentum_odds import momentum_odds
from dicedesign.throws.tables import table_named

TABLE = table_named("board-game")


@pytest.fixture
def throws(tmp_path: Path) -> Path:
    """Counts of a box, and of another that nobody asks for."""
    mesh = tmp_path / "box.obj"
    trimesh.creation.box((1.0, 1.1, 1.25)).export(mesh)
    odds = rest_poses(read_body(mesh)).probabilities
    rows = [
        f"{die},box.obj,{name},{count},{p}"
        for die in ("box", "other")
        for name, count, p in zip("ABCDEF", (60, 60, 24, 26, 14, 16), odds, strict=True)
    ]
    path = tmp_path / "throws.csv"
    path.write_text("die,mesh,outcome,throws,geometric\n" + "\n".join(rows) + "\n")
    return path


@compiled_only
def test_unseen_dice_have_7_to_13_rests() -> None:
    found = list(throw_unseen_dice(3, 20, TABLE, "native", Inline()))
    assert [one.number for one in found] == [0, 1, 2]
    for one in found:
        assert RESTS[0] <= len(one.counts) <= RESTS[1]
        assert one.counts.sum() + one.unresolved == 20


def test_kinds_are_summed_up_by_themselves() -> None:
    found = [
        Deviation("pebble", 7, 100, 0.2, 0.1, 0.01),
        Deviation("designed", 8, 100, 0.4, 0.0, 0.03),
        Deviation("pebble", 9, 100, 0.1, 0.3, 0.02),
    ]
    kinds = {row.kind: row for row in by_kind(found)}
    assert list(kinds) == ["all", "pebble", "designed"]
    assert kinds["all"].geometric == pytest.approx(0.7 / 3.0)
    assert (kinds["all"].worst_geometric, kinds["all"].worst_momentum) == (0.4, 0.3)
    assert kinds["pebble"].momentum == pytest.approx(0.2)
    assert kinds["pebble"].noise_floor == pytest.approx(0.015)
    assert kinds["designed"].dice == 1


def test_times_are_positive() -> None:
    dice = [random_die(number, 5, (4, 6)) for number in range(2)]
    model = momentum_model("board-game")
    assert model is not None
    odds, jacobian = model_times(dice, model, ThrownOdds.on("board-game"))
    assert 0.0 < odds < jacobian


@compiled_only
def test_printed_dice(throws: Path) -> None:
    (die,) = read_throw_counts(throws, ["box"])
    model = momentum_model("board-game")
    rows = judge_printed_die(die, TABLE, model, 3000, "native", Inline())
    assert {(row.die, row.throws, row.drops) for row in rows} == {("box", 200, 3000)}
    geometric, momentum, simulated = rows
    assert [row.model for row in rows] == ["geometric", "momentum", "simulated"]
    by_pair = momentum_odds(die.poses, die.body, model).reshape(3, 2).sum(axis=1)
    np.testing.assert_allclose(momentum.odds, by_pair)
    for judged in (geometric, momentum):
        test = chisquare([120, 50, 30], 200.0 * np.array(judged.odds))
        assert judged.chi_square == pytest.approx(test.statistic)
        assert judged.p_value == pytest.approx(test.pvalue)
    expected = np.abs(np.array([0.6, 0.25, 0.15]) - np.array(simulated.odds)).sum() / 2.0
    assert simulated.total_variation == pytest.approx(expected)
    assert sum(simulated.odds) == pytest.approx(1.0)


@compiled_only
def test_the_command_prints_tables_and_json(
    throws: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    picture, extent = tmp_path / "momentum.png", Extent(3, 60)
    arguments = ["momentum", "--throws", throws, "--printed", "box", "--out", tmp_path]
    assert run_bench(*arguments, "--figure", picture, extent=extent) == 0
    text = capsys.readouterr().out
    assert picture.read_bytes().startswith(b"\x89PNG")
    record = json.loads((tmp_path / "momentum.json").read_text())
    assert (record["dice"], record["drops"], record["engine"]) == (3, 60, "native")
    everything = record["kinds"]["all"]
    row = next(line.split() for line in text.splitlines() if line.startswith("all "))
    assert [float(cell) for cell in row[1:4:2]] == [3.0, round(everything["worst_geometric"], 3)]
    values = [one["momentum"] for one in record["random_dice"]]
    assert everything["momentum"] == pytest.approx(np.mean(values))
    assert record["seconds"].keys() == {"odds", "jacobian"}
    printed = record["printed_dice"]
    assert [(one["die"], one["throws"]) for one in printed] == [("box", 200)] * 3
    assert "box" in text


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--engine", "hand"], "engine: expected native, mujoco, bullet, got 'hand'"),
        (["--table", "carpet"], "--table carpet: expected a table on which dice have momentum"),
        (["--table", "velvet"], "table velvet: expected board-game"),
        (["--printed", "box"], "--printed box: expected the file of their throws beside it"),
        (["--throws", "none.csv"], "none.csv: no such file"),
        (["--jobs", "0"], "--jobs: expected a whole number above 0, got 0"),
    ],
)
def test_bad_input_is_said_plainly(
    options: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bench", "momentum", "--quick", *options]) == 2
    assert message in capsys.readouterr().err
