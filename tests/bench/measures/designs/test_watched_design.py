"""A watched design: every method shows its steps, and what is wrong is noticed."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch
from common.slow_machine import slow_machine

from dicedesign.bench.bodies.problem import DesignProblem
from dicedesign.bench.bodies.stiff_designs import design_cases
from dicedesign.bench.measures.designs.watched_design import step_faults, watch_design
from dicedesign.bench.measures.designs.watched_methods import METHODS
from dicedesign.geometry.solid import solid_properties
from dicedesign.gradient.rest_odds import evaluate_rests
from dicedesign.optimize.energy.clusters import cluster
from dicedesign.optimize.result import DesignResult, DesignStep
from dicedesign.results.status import Status


def problem(name: str) -> DesignProblem:
    (case,) = (case for case in design_cases() if case.name == f"design: {name}")
    built = case.build()
    assert isinstance(built, DesignProblem)
    return built


def test_a_start_that_does_not_suit_is_refused_with_a_reason() -> None:
    watched = watch_design(problem("facets 1e-8 apart in angle, exact"))
    assert (watched.result, watched.measurement, watched.steps) == (None, None, 0)
    assert watched.faults == ()
    assert "one rest for each of 7 outcomes and no other, got 6 rests" in watched.ending


@pytest.mark.parametrize("method", METHODS)
def test_every_method_shows_every_step(method: str) -> None:
    """The steps are those of the result's history, and each die is whole."""
    design = replace(problem("symmetric prism"), method=method, perturbation=1e-3, tolerance=1e-3)
    dice, steps = [], []
    result = METHODS[method](design, lambda *die: dice.append(die), steps.append)
    assert tuple(steps) == result.history
    assert len(dice) == len(steps) > 1
    for (rests, derivatives), step in zip(dice, steps, strict=True):
        assert step_faults(rests, derivatives, step.terms) == []
    last = dice[-1][0]
    of_rest = cluster(last.hull.normals[last.paths.rests], result.directions).of_rest
    odds = np.bincount(of_rest, last.odds, len(design.target))
    assert np.abs(odds - design.target).max() == pytest.approx(steps[-1].error, abs=1e-12)


def test_no_method_looks_at_the_clock() -> None:
    """Ends are the same on a machine on which everything takes a fortnight."""
    for name in ("leans 1e-9 beyond tipping", "needle 2:1, exact", "symmetric prism, paper"):
        design = replace(problem(name), steps=20)
        swift = watch_design(design)
        with slow_machine():
            slow = watch_design(design)
        assert (slow.ending, slow.steps) == (swift.ending, swift.steps)


def test_a_result_that_is_not_what_it_says_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    design = problem("leans 1e-3 short of tipping")
    search = METHODS["line search"]

    def lies(*arguments: Any) -> DesignResult:
        return replace(search(*arguments), error=1e-5)

    def stops(design: DesignProblem, *looks: Any) -> DesignResult:
        return replace(search(replace(design, steps=0), *looks), status=Status.CONVERGED)

    def breaks(design: DesignProblem, on_die: Any, on_step: Any) -> DesignResult:
        def on_broken_step(step: DesignStep) -> None:
            on_step(replace(step, energy=np.nan) if step.step == 2 else step)

        return search(design, on_die, on_broken_step)

    for method, expected in (
        (lies, "error recorded as 1.000e-05 is "),
        (stops, "converged with an error of "),
        (breaks, "whole energy nan at step 2"),
    ):
        monkeypatch.setattr(
            "dicedesign.bench.measures.designs.watched_design.METHODS", {"line search": method}
        )
        assert watch_design(design).faults[0].startswith(expected)


def test_what_is_wrong_with_a_step_is_noticed() -> None:
    rests = evaluate_rests(torch.tensor(problem("needle 2:1").start.points))
    hull, third = rests.hull, torch.full((3,), 1.0 / 3.0, dtype=torch.float64)
    whole = {"hull": hull, "center": rests.center, "probabilities": third}
    inverted = replace(hull, vertices=-hull.vertices)
    volume = solid_properties(hull.vertices, hull.triangles)[0]
    for change, energy, slope, expected in (
        ({}, 1.0, 1.0, []),
        ({}, np.nan, 1.0, ["dice energy nan"]),
        ({}, 1.0, np.inf, ["derivatives not finite"]),
        ({"center": rests.center + 9.0}, 1.0, 1.0, ["center of mass lost"]),
        ({"hull": inverted}, 1.0, 1.0, [f"volume {-volume:.1e}", "center of mass lost"]),
        ({"probabilities": 1.5 * third}, 1.0, 1.0, ["probabilities sum to 1 + 5.0e-01"]),
        ({"probabilities": third * torch.nan}, 1.0, 1.0, ["probabilities sum to 1 + nan"]),
    ):
        die = SimpleNamespace(**(whole | change))
        assert step_faults(die, np.array([slope]), {"dice": energy}) == expected
