"""Designs of dice for a mixture of tables."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from common.inline_executor import Inline
from common.processes import kill_at_write

from dicedesign.cli.main import main
from dicedesign.errors import InputError
from dicedesign.recipe.pipeline import Callbacks, Work, run, run_stages
from dicedesign.recipe.reading import parse_recipe
from dicedesign.results.parts import RoundOfThrows, Status
from dicedesign.throws import simulation as die_on_table
from dicedesign.throws.rigid_body import RigidBody
from dicedesign.throws.simulation import Throws
from dicedesign.throws.tables import Table

TARGET = np.array([1, 4, 6, 4, 1]) / 16.0


MIXED = {
    "name": "mixed",
    "target": {"probabilities": TARGET.tolist()},
    "seed": 2,
    "size_mm": 25.0,
    "engrave": False,
    "method": {
        "exact": {
            "probabilities": "thrown",
            "prefer": {"circles": 1.0},
            "refine": {"drops": 300, "rounds": 3, "verdict": 300, "within": 0.3},
        }
    },
}


MIXTURE = [
    {"restitution": e, "friction": mu, "height": [0.1, 0.12], "speed": 0.3, "spin": 15.0}
    for e in (0.6, 0.7)
    for mu in (0.2, 0.3)
]


@pytest.fixture
def fitted_table(tmp_path: Path) -> str:
    """Table with a mixture of four."""
    path = tmp_path / "fitted.json"
    entries = {
        "name": "fitted",
        "restitution": 0.65,
        "friction": 0.25,
        "height": 0.11,
        "speed": 0.3,
        "spin": 15.0,
        "mixture": MIXTURE,
    }
    path.write_text(json.dumps(entries))
    return str(path)


def test_rounds_throw_onto_all_tables(fitted_table: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """All series of throws, including the verdict, have different seeds."""
    thrown: list[tuple[Sequence[Table], int, int]] = []
    simulate = die_on_table.simulate

    def record(
        body: RigidBody, tables: Sequence[Table], drops: int, seed: int, **options: Any
    ) -> Throws:
        thrown.append((tables, drops, seed))
        return simulate(body, tables, drops, seed, **options)

    monkeypatch.setattr(die_on_table, "simulate", record)
    rounds: list[RoundOfThrows] = []
    parts: list[tuple[int, int, str]] = []
    exact = {**MIXED["method"]["exact"], "table": fitted_table}
    work = Work(
        parse_recipe({**MIXED, "method": {"exact": exact}}),
        callbacks=Callbacks(on_round=rounds.append, on_part=lambda *part: parts.append(part)),
    )
    run_stages(work, last="throws")
    assert work.status is Status.CONVERGED
    wanted = [(one["restitution"], one["friction"]) for one in MIXTURE]
    assert all([(one.restitution, one.friction) for one in row[0]] == wanted for row in thrown)
    assert len({seed for *_, seed in thrown}) == len(thrown)
    assert [r.drops for r in rounds] == [r.drops for r in work.die.rounds]
    assert [r.deviation for r in rounds] == [r.deviation for r in work.die.rounds]
    # The last part is the whole verdict.
    assert {unit for *_, unit in parts} == {"symmetries", "throws"}
    assert all(0 <= done <= whole for done, whole, _ in parts)
    assert parts[-1][0] == parts[-1][1] == 300
    section = work.result().thrown
    assert section.simulated.drops == 300
    assert len(section.by_table.values) == 4
    assert section.by_table.often <= section.by_table.worst
    assert [entry.is_kept for entry in section.rounds].count(True) == 1


# Interrupted and resumed.


@pytest.fixture
def recipe_path(fitted_table: str, tmp_path: Path) -> Path:
    """Recipe of a die for a table with few throws."""
    exact = {**MIXED["method"]["exact"], "table": fitted_table}
    path = tmp_path / "mixed.yaml"
    recipe = {**MIXED, "method": {"exact": exact}, "figures": False, "report": False}
    path.write_text(json.dumps({**recipe, "clock": False}))
    return path


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_a_run_killed_in_its_verdict_is_resumed_with_the_same_die(
    recipe_path: Path, tmp_path: Path
) -> None:
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    run(recipe_path, whole)
    kill_at_write(["run", str(recipe_path), "--out", str(parts)], 8)
    assert "checkpoint.npz" in contents(parts)
    assert "result.json" not in contents(parts)
    run(recipe_path, parts, resume=True)
    assert contents(parts) == contents(whole)


def test_a_resumed_run_repeats_no_throws(
    recipe_path: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    thrown: list[tuple[str, int]] = []
    throw_task = die_on_table.throw_task

    def record(body: RigidBody, tables: Any, numbers: Any, seed: int, *others: Any) -> Any:
        # In the second series of throws.
        if len(thrown) == 4:
            raise KeyboardInterrupt
        outcomes = throw_task(body, tables, numbers, seed, *others)
        thrown.append((int(numbers[0]), seed))
        return outcomes

    monkeypatch.setattr(die_on_table, "throw_task", record)
    monkeypatch.setattr(die_on_table, "throwing_threads", lambda: nullcontext(Inline()))
    monkeypatch.setattr("dicedesign.recipe.thrown.throwing_threads", lambda: nullcontext(Inline()))
    folder = tmp_path / "out"
    assert main(["run", str(recipe_path), "--out", str(folder)]) == 130
    error = capsys.readouterr().err
    assert error.startswith("dicedesign: interrupted; the results so far are in ")
    assert error.endswith("checkpoint.npz; run it again with --resume to go on\n")
    assert list(contents(folder)) == ["checkpoint.npz"]
    with pytest.raises(InputError, match="of this recipe, got one of another; run without --resu"):
        run(recipe_path, folder, changes=["seed=3"], resume=True)
    with monkeypatch.context() as patch:
        patch.setattr("dicedesign.recipe.pipeline.CONTACT_LAW", "springs")
        with pytest.raises(InputError, match="of this contact law, got one of another; run with"):
            run(recipe_path, folder, resume=True)
    before = list(thrown)

    def record_all(body: RigidBody, tables: Any, numbers: Any, seed: int, *others: Any) -> Any:
        thrown.append((int(numbers[0]), seed))
        return throw_task(body, tables, numbers, seed, *others)

    monkeypatch.setattr(die_on_table, "throw_task", record_all)
    run(recipe_path, folder, resume=True)
    after = thrown[len(before) :]
    assert after
    assert not set(before) & set(after)
    assert "checkpoint.npz" not in contents(folder)
