"""Dice for a table and for a mixture of tables, from recipe to folder."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from common.inline_executor import Inline
from common.kernels import compiled_only

from dicedesign.cli.main import main
from dicedesign.errors import InputError
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.optimize.options import MOST_ROUNDS
from dicedesign.recipe.pipeline import Callbacks, Work, run, run_stages
from dicedesign.recipe.reading import parse_recipe
from dicedesign.recipe.thrown import VERDICT_ROUND, throw_seed
from dicedesign.rest.poses import rest_poses
from dicedesign.results.folder import read_result
from dicedesign.results.parts import RoundOfThrows, Status
from dicedesign.throws import simulation as die_on_table
from dicedesign.throws.momentum_model import momentum_model
from dicedesign.throws.momentum_probabilities import momentum_probabilities, throw_probabilities
from dicedesign.throws.rigid_body import RigidBody, rigid_body
from dicedesign.throws.simulation import Throws
from dicedesign.throws.tables import HANDS, Table, mixture_tables

pytestmark = compiled_only


# One table of the package.


def test_a_result_has_the_probabilities_on_the_table(table_die: Path) -> None:
    """The die is thrown at its printed size."""
    result = read_result(table_die)
    thrown, target = result.thrown, np.array(result.target)
    simulated, by_table = thrown.simulated, thrown.by_table
    assert sum(simulated.counts) + simulated.unresolved == simulated.drops == 1000
    np.testing.assert_allclose(simulated.frequencies, np.array(simulated.counts) / 1000)
    low, high = np.transpose(simulated.intervals)
    assert ((low < simulated.frequencies) & (simulated.frequencies < high)).all()
    deviation = 0.5 * np.abs(np.array(simulated.frequencies) - target).sum()
    assert simulated.total_variation == pytest.approx(deviation)
    assert len(by_table.values) == len(mixture_tables("board-game"))
    assert by_table.often == pytest.approx(np.quantile(by_table.values, 0.9))
    assert by_table.worst == max(by_table.values)
    body = read_body(table_die / "die.stl")
    poses = rest_poses(body)
    radius = np.linalg.norm(poses.hull.vertices - poses.center_of_mass, axis=1).max()
    assert thrown.table["size"] == pytest.approx(2e-3 * radius, rel=1e-5)
    probabilities = np.sort(throw_probabilities(body, poses))
    np.testing.assert_allclose(probabilities, np.sort(thrown.momentum), atol=1e-4)
    assert {"table", "hands", "throw"} <= set(result.files)
    assert "On the table" in (table_die / "report.html").read_text()


PRISM = {
    "name": "held",
    "target": {"fair": 3},
    "start": {"prism": {}},
    "symmetry": "D3h",
    **dict.fromkeys(("engrave", "figures", "print"), False),
}


def refine(within: float, **options: Any) -> dict[str, Any]:
    """Method with few throws."""
    throws = {"drops": 200, "rounds": 1, "verdict": 300, "within": within}
    return {"exact": {"probabilities": "thrown", "refine": throws, **options}}


def test_a_throw_distribution_with_a_table(tmp_path: Path) -> None:
    result = run({**PRISM, "method": refine(0.2, hand="cup")}, tmp_path / "out")
    table, cup = result.thrown.table, HANDS["cup"]
    assert table["name"] == "board-game:cup"
    for name in ("height", "speed", "spin"):
        assert table[name] == list(getattr(cup, name))
    assert "out of a cup" in (tmp_path / "out" / "report.html").read_text()
    with pytest.raises(InputError, match=r"drop height of 0.05 m"):
        run({**PRISM, "method": refine(0.2, hand="cup"), "size_mm": 60}, tmp_path / "out")


def test_a_die_off_target_on_the_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recipe = tmp_path / "recipe.yaml"
    recipe.write_text(json.dumps({**PRISM, "method": refine(1e-9), "report": False}))
    assert main(["run", str(recipe), "--out", str(tmp_path / "out")]) == 1
    assert "off_table" in capsys.readouterr().out


def test_a_design_by_the_model_alone_has_no_simulation() -> None:
    target = {"probabilities": [1 / 8, 1 / 8, 1 / 4, 1 / 4, 1 / 4]}
    method = {"exact": {"probabilities": "thrown"}}
    entries = {"name": "loaded", "target": target, "symmetry": "C2v", "method": method}
    work = Work(parse_recipe({**entries, "engrave": False}))
    run_stages(work, last="throws")
    result = work.result()
    assert result.thrown.simulated is None
    np.testing.assert_allclose(result.thrown.momentum, result.target, atol=1e-6)
    assert result.design.max_abs_error < 1e-11
    assert np.abs(np.array(result.probabilities) - result.target).max() > 0.002


# A mixture of tables in a file.

MIXTURE = [
    {"restitution": e, "friction": mu, "height": [0.1, 0.12], "speed": 0.3, "spin": 15.0}
    for e in (0.6, 0.7)
    for mu in (0.2, 0.3)
]


@pytest.fixture
def mixed(tmp_path: Path) -> dict[str, Any]:
    """Recipe of a die with few throws onto each of four tables."""
    table = {**MIXTURE[0], "name": "fitted", "height": 0.11, "mixture": MIXTURE}
    path = tmp_path / "fitted.json"
    path.write_text(json.dumps(table))
    throws = {"drops": 300, "rounds": 3, "verdict": 300, "within": 0.3}
    exact = {"probabilities": "thrown", "prefer": {"circles": 1.0}, "refine": throws}
    return {
        "name": "mixed",
        "target": {"probabilities": [k / 16.0 for k in (1, 4, 6, 4, 1)]},
        "seed": 2,
        "size_mm": 25.0,
        "method": {"exact": {**exact, "table": str(path)}},
        **dict.fromkeys(("engrave", "figures", "report", "clock"), False),
    }


def test_rounds_throw_onto_all_tables(
    mixed: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """All series of throws, including the verdict, have different seeds."""
    thrown: list[tuple[Sequence[Table], int]] = []
    simulate = die_on_table.simulate

    def record(
        body: RigidBody, tables: Sequence[Table], drops: int, seed: int, **options: Any
    ) -> Throws:
        thrown.append((tables, seed))
        return simulate(body, tables, drops, seed, **options)

    monkeypatch.setattr(die_on_table, "simulate", record)
    rounds: list[RoundOfThrows] = []
    parts: list[tuple[int, int, str]] = []
    callbacks = Callbacks(on_round=rounds.append, on_part=lambda *part: parts.append(part))
    work = Work(parse_recipe(mixed), callbacks=callbacks)
    run_stages(work, last="throws")
    assert work.status is Status.CONVERGED
    wanted = [(one["restitution"], one["friction"]) for one in MIXTURE]
    for tables, _ in thrown:
        assert [(one.restitution, one.friction) for one in tables] == wanted
    assert len({seed for _, seed in thrown}) == len(thrown)
    assert [r.deviation for r in rounds] == [r.deviation for r in work.die.rounds]
    # The last part is the whole verdict.
    assert all(0 <= done <= whole for done, whole, _ in parts)
    assert parts[-1] == (300, 300, "throws")
    section = work.result().thrown
    assert section.simulated.drops == 300
    assert len(section.by_table.values) == 4
    assert [entry.is_kept for entry in section.rounds].count(True) == 1


def test_each_series_of_throws_of_each_recipe_has_its_own_seed() -> None:
    series = [*range(MOST_ROUNDS), VERDICT_ROUND]
    seeds = [throw_seed(seed, number) for seed in range(5) for number in series]
    assert len(set(seeds)) == len(seeds)


def test_a_forecast_is_for_all_tables_of_a_mixture(tmp_path: Path) -> None:
    """One of eight is lively."""
    lively, dead = ({**MIXTURE[0], "restitution": e} for e in (0.8, 0.1))
    table = {**lively, "name": "two", "mixture": [lively, *[dead] * 7]}
    path = tmp_path / "two.json"
    path.write_text(json.dumps(table))
    target, method = {"probabilities": [0.47, 0.31, 0.22]}, {"exact": {"table": str(path)}}
    recipe = {**PRISM, "target": target, "symmetry": "none", "method": method}
    work = Work(parse_recipe(recipe))
    run_stages(work, last="check")
    body, poses = work.final.body, work.final.poses
    thrown = rigid_body(body, poses)
    path.write_text(json.dumps({**table, "size": 2e-3 * thrown.radius}))
    run_stages(work, after="check", last="forecast")
    outcome, by_table = np.argmax(poses.normals @ work.die.directions.T, axis=1), []
    for one in mixture_tables(str(path)):
        rests = momentum_probabilities(poses, thrown, momentum_model(str(path)).near(one))
        by_table.append(np.bincount(outcome, rests, 3))
    mean, wanted = np.mean(by_table, axis=0), work.target.probabilities
    assert np.abs(mean - by_table[0]).max() > 0.01
    np.testing.assert_allclose(work.forecast.probabilities, mean, atol=1e-9)
    variation = 0.5 * np.abs(mean - wanted).sum()
    assert work.forecast.total_variation == pytest.approx(variation, abs=1e-9)
    off = 0.5 * np.abs(np.array(by_table) - wanted).sum(axis=1)
    assert work.forecast.nine_in_ten == pytest.approx(np.quantile(off, 0.9), abs=1e-9)
    assert np.ptp(off) > 0.005


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_an_interrupted_run_is_resumed_with_the_same_die_and_repeats_no_throws(
    mixed: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, folder = tmp_path / "mixed.yaml", tmp_path / "out"
    path.write_text(json.dumps(mixed))
    thrown: list[tuple[int, int]] = []
    throw_task, interrupt_after = die_on_table.throw_task, [0]

    def record(body: RigidBody, tables: Any, numbers: Any, seed: int, *others: Any) -> Any:
        if len(thrown) == interrupt_after[0]:
            raise KeyboardInterrupt
        outcomes = throw_task(body, tables, numbers, seed, *others)
        thrown.append((int(numbers[0]), seed))
        return outcomes

    monkeypatch.setattr(die_on_table, "throw_task", record)
    monkeypatch.setattr(die_on_table, "throwing_threads", lambda: nullcontext(Inline()))
    monkeypatch.setattr("dicedesign.recipe.thrown.throwing_threads", lambda: nullcontext(Inline()))
    # In the second series of throws.
    interrupt_after[0] = 4
    assert main(["run", str(path), "--out", str(folder)]) == 130
    assert list(contents(folder)) == ["checkpoint.npz"]
    with pytest.raises(InputError, match="checkpoint of this recipe"):
        run(path, folder, changes=["seed=3"], resume=True)
    with monkeypatch.context() as patch:
        patch.setattr("dicedesign.recipe.pipeline.CONTACT_LAW", "springs")
        with pytest.raises(InputError, match="checkpoint of this contact law"):
            run(path, folder, resume=True)
    interrupt_after[0] = -1
    run(path, folder, resume=True)
    assert len(thrown) > 4
    assert len(set(thrown)) == len(thrown)
    run(path, tmp_path / "whole")
    assert contents(folder) == contents(tmp_path / "whole")
