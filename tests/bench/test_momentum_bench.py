"""The bench of the momentum model: unseen dice, printed dice, times, the command."""

from __future__ import annotations

import json
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import trimesh
from common.inline_executor import Inline
from common.kernels import compiled_only
from scipy.stats import chisquare

from dicedesign.bench import momentum as momentum_bench
from dicedesign.bench.momentum import (
    RESTS,
    Extent,
    by_kind,
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
from dicedesign.runtime import executors
from dicedesign.throws.counts.throw_counts import read_throw_counts
from dicedesign.throws.momentum.momentum_model import momentum_model
from dicedesign.throws.momentum.momentum_odds import momentum_odds
from dicedesign.throws.tables import table_named

TABLE = table_named("board-game")


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> None:
    @contextmanager
    def workers(jobs: int) -> Iterator[Executor]:
        yield Inline()

    monkeypatch.setattr(executors, "local_workers", workers)


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
    found = list(throw_unseen_dice(Extent(3, 20), TABLE, "native", Inline()))
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
    kinds = dict(by_kind(found))
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
    times = model_times(dice, model, ThrownOdds.on("board-game"))
    assert times.odds > 0.0
    assert times.jacobian > 0.0


@compiled_only
def test_printed_dice(throws: Path) -> None:
    (die,) = read_throw_counts(throws, ["box"])
    model = momentum_model("board-game")
    found = judge_printed_die(die, TABLE, model, 3000, "native", Inline())
    assert (found.name, found.throws, found.drops) == ("box", 200, 3000)
    geometric, momentum, simulated = found.models
    assert [judged.model for judged in found.models] == ["geometric", "momentum", "simulated"]
    by_pair = momentum_odds(die.poses, die.body, model).reshape(3, 2).sum(axis=1)
    np.testing.assert_allclose(momentum.odds, by_pair)
    for judged in (geometric, momentum):
        test = chisquare([120, 50, 30], 200.0 * judged.odds)
        assert judged.test.statistic == pytest.approx(test.statistic)
        assert judged.test.p_value == pytest.approx(test.pvalue)
    expected = np.abs(np.array([0.6, 0.25, 0.15]) - simulated.odds).sum() / 2.0
    assert simulated.total_variation == pytest.approx(expected)
    assert simulated.odds.sum() == pytest.approx(1.0)


@compiled_only
def test_the_command_prints_a_table_or_json(
    here: None,
    throws: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(momentum_bench, "QUICK", Extent(3, 60))
    picture = tmp_path / "momentum.png"
    arguments = ["bench", "momentum", "--quick", "--throws", str(throws), "--printed", "box"]
    assert main([*arguments, "--figure", str(picture)]) == 0
    text = capsys.readouterr().out
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert f"wrote {picture}" in text
    row = next(line.split() for line in text.splitlines() if line.startswith("all "))

    assert main([*arguments, "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert (record["dice"], record["drops"], record["engine"]) == (3, 60, "native")
    everything = record["kinds"]["all"]
    assert [float(cell) for cell in row[1:4:2]] == [3.0, round(everything["worst_geometric"], 3)]
    values = [one["momentum"] for one in record["random_dice"]]
    assert everything["momentum"] == pytest.approx(np.mean(values))
    assert record["seconds"].keys() == {"odds", "jacobian"}
    (printed,) = record["printed_dice"]
    assert (printed["name"], printed["throws"]) == ("box", 200)
    assert [model["model"] for model in printed["models"]] == ["geometric", "momentum", "simulated"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--dice", "0"], "--dice: expected a whole number above 0, got 0"),
        (["--drops", "0"], "drops: expected a whole number above 0, got 0"),
        (["--engine", "hand"], "engine: expected native, mujoco, bullet, got 'hand'"),
        (["--table", "carpet"], "--table carpet: expected a table on which dice have momentum"),
        (["--table", "velvet"], "--table velvet: expected board-game"),
        (["--printed", "box"], "--printed box: expected the file of their throws beside it"),
        (["--throws", "none.csv"], "none.csv: expected a CSV file of throws"),
        (["--figure", "no/such.png"], "--figure: expected a file in a folder that exists"),
        (["--jobs", "0"], "--jobs: expected a whole number above 0, got 0"),
    ],
)
def test_bad_input_is_said_plainly(
    options: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bench", "momentum", "--quick", *options]) == 2
    assert message in capsys.readouterr().err
