"""`dicedesign table learn`: a table with its momentum model, errors."""

from __future__ import annotations

import json
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from common.inline_executor import Inline
from common.kernels import compiled_only
from common.killed import kill_at_write
from common.thrown import random_body

from dicedesign.cli.main import main
from dicedesign.runtime import executors
from dicedesign.throws.momentum.momentum_model import momentum_model
from dicedesign.throws.momentum.momentum_odds import momentum_odds
from dicedesign.throws.tables import table_entries


@pytest.fixture(autouse=True)
def here(monkeypatch: pytest.MonkeyPatch) -> None:
    @contextmanager
    def workers(jobs: int) -> Iterator[Executor]:
        yield Inline()

    monkeypatch.setattr(executors, "local_workers", workers)


@compiled_only
def test_a_table_gets_its_model(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mine = tmp_path / "mine.json"
    entries = {**table_entries("board-game"), "name": "mine", "spin": 3.0}
    assert len(entries["posterior"]) == 32
    # A model that is none does not matter.
    mine.write_text(json.dumps({**entries, "momentum": []}))
    out = tmp_path / "new" / "learned.json"
    effort = ["--dice", "10", "--drops", "30", "--epochs", "2", "--jobs", "1"]
    assert main(["table", "learn", str(mine), *effort, "--out", str(out)]) == 0
    told, noted = capsys.readouterr()
    assert noted == f"note: wrote {out}\n"
    fitted, held_out = (line.split() for line in told.splitlines()[2:4])
    assert (fitted[2], held_out[2]) == ("9", "1")
    assert 0.0 < float(fitted[5]) < 0.5
    found = table_entries(str(out))
    assert {key: found[key] for key in entries} == entries
    model = momentum_model(str(out))
    body, poses = random_body(3)
    odds = momentum_odds(poses, body, model)
    assert odds.sum() == pytest.approx(1.0)
    assert np.abs(odds - poses.probabilities).max() > 0.01


@compiled_only
def test_the_table_is_written_here_by_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    effort = ["--dice", "10", "--drops", "20", "--epochs", "1"]
    assert main(["table", "learn", "hard-wood", *effort]) == 0
    assert momentum_model("hard-wood.json") is not None


@compiled_only
def test_a_table_learned_in_spite_of_kills_is_the_same(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """While an evaluation is kept."""
    whole, parts = tmp_path / "a" / "mine.json", tmp_path / "b" / "mine.json"
    learn = ["table", "learn", "board-game", "--dice", "10", "--drops", "20", "--epochs", "3"]
    assert main([*learn, "--out", str(whole)]) == 0
    command = [*learn, "--out", str(parts)]
    kill_at_write(command, 10)
    assert not parts.exists()
    capsys.readouterr()
    checkpoint = parts.with_name("mine.checkpoint.npz")
    assert main([*learn[:-1], "2", *command[-2:], "--seed", "1"]) == 2
    assert capsys.readouterr().err == (
        f"dicedesign: {checkpoint}: expected a checkpoint of this seed, got one of another; remove "
        "it to begin anew, or choose another with --out\n"
    )
    assert main(command) == 0
    assert capsys.readouterr().err.startswith(f"note: goes on from {checkpoint}\n")
    assert parts.read_bytes() == whole.read_bytes()
    assert not checkpoint.exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["board-game", "--dice", "0"], "dice: expected a whole number of at least 10, got 0"),
        (["board-game", "--drops", "0"], "drops: expected a whole number of at least 4, got 0"),
        (["board-game", "--epochs", "0"], "epochs: expected a whole number above 0, got 0"),
        (["board-game", "--seed", "-1"], "seed: expected a whole number of at least 0, got -1"),
        (["board-game", "--jobs", "0"], "--jobs: expected a whole number above 0, got 0"),
        (["board-game", "--out", "a.txt"], "--out: expected a path that ends in .json, got a.txt"),
        (["carpet"], "table carpet: expected one without drag"),
        (["velvet"], "table velvet: expected board-game, hard-wood"),
    ],
)
def test_bad_input(capsys: pytest.CaptureFixture[str], arguments: list[str], message: str) -> None:
    assert main(["table", "learn", *arguments]) == 2
    assert message in capsys.readouterr().err
