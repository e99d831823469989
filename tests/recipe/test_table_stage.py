"""Dice that are thrown onto changed tables while they are designed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from dicedesign.design.preferences.weights import Preferences
from dicedesign.design.refinement import RefineOptions
from dicedesign.design.result import DesignResult
from dicedesign.design.solvers.exact import ExactOptions, solve_exactly
from dicedesign.design.starts.search import shapes_near
from dicedesign.gradient.rest_odds import evaluate_rests
from dicedesign.gradient.restitution_sensitivity import Swing
from dicedesign.gradient.thrown_odds import ThrownOdds
from dicedesign.recipe import on_table as table_stage
from dicedesign.recipe.on_table import first_swing, refined
from dicedesign.results.status import Status
from dicedesign.throws.release import drop_weights
from dicedesign.throws.rigid_body import RigidBody
from dicedesign.throws.simulation.simulation import Throws
from dicedesign.throws.tables import Table

TARGET = np.array([1, 4, 6, 4, 1]) / 16.0
OPTIONS = ExactOptions(odds="thrown", prefer=Preferences(circles=1.0), seconds=20.0)


def solved(options: ExactOptions, swing: Swing | None) -> DesignResult:
    return solve_exactly(shapes_near(TARGET, 0), TARGET, options, swing=swing)


@pytest.fixture(scope="module")
def die() -> DesignResult:
    return solved(OPTIONS, first_swing(OPTIONS, TARGET))


def changes_of(die: DesignResult) -> float:
    """Sum of the changes of a die's odds, by the momentum model, on both tables."""
    rests = evaluate_rests(torch.as_tensor(die.hull.vertices))
    thrown = ThrownOdds.on("board-game")
    return sum(
        float(np.abs(thrown.at(change).odds(rests) - thrown.odds(rests)).sum())
        for change in (0.2, -0.2)
    )


def test_a_robust_die_has_the_same_odds_and_changes_less(die: DesignResult) -> None:
    swing = first_swing(OPTIONS, TARGET)
    robust = solved(replace(OPTIONS, prefer=Preferences(circles=1.0, robustness=1.0)), swing)
    for one in (die, robust):
        assert one.status is Status.CONVERGED
        assert one.history[-1].error < 1e-12
    assert changes_of(robust) < 0.6 * changes_of(die)


@pytest.mark.parametrize("restitution", [0.5, 0.9])
def test_rounds_throw_onto_the_tables_of_robust_dice(
    die: DesignResult, monkeypatch: pytest.MonkeyPatch, restitution: float
) -> None:
    seen: list[tuple[float, int]] = []

    def throw(body: RigidBody, table: Table, drops: int, seed: int, **_: object) -> Throws:
        seen.append((table.restitution, seed))
        outcomes = np.random.default_rng(seed).choice(5, size=drops)
        return Throws(table, "native", seed, outcomes, drop_weights(drops, "uniform"), 5)

    named = table_stage.table_named
    monkeypatch.setattr(
        table_stage,
        "table_named",
        lambda name: replace(named(name), restitution=restitution),
    )
    monkeypatch.setattr(table_stage, "simulate", throw)
    told = []

    def design(one: DesignResult, odds: np.ndarray, bias: np.ndarray | None) -> DesignResult:
        told.append(bias)
        return one

    _, rounds = refined(
        die,
        TARGET,
        RefineOptions(drops=300, rounds=3),
        "board-game",
        size_mm=25.0,
        seed=2,
        group=None,
        center_of_mass=None,
        robust=True,
        design=design,
        on_round=None,
    )
    livelier = min(1.2 * restitution, 0.95)
    tables = [restitution, livelier, 0.8 * restitution, restitution, restitution]
    assert [value for value, _ in seen] == pytest.approx(tables)
    assert len({seed for _, seed in seen}) == len(seen)
    assert [len(one.changed) for one in rounds] == [2, 0, 0]
    # Against what the model of each table expects of the die.
    assert told[0] is not None
    assert np.abs(told[0][0] - told[0][1]).max() > 1e-3


@pytest.mark.parametrize("table", ["carpet", "paper"])
def test_where_nothing_bounces_nothing_swings(table: str) -> None:
    swing = first_swing(replace(OPTIONS, table=table), TARGET)
    assert swing is not None
    assert not swing.is_known
