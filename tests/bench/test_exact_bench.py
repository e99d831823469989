"""The bench of the exact method: its targets, its verdicts, its summaries, and the command."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from dicedesign.bench import exact_targets
from dicedesign.bench.exact_targets import (
    LEAST_SECONDS,
    Attempt,
    attempt_target,
    random_target,
    run_targets,
    summaries,
)
from dicedesign.cli import main
from dicedesign.design.result import DesignResult, DesignStep
from dicedesign.design.stopping import Status
from dicedesign.geometry.hull import convex_hull

PLAIN = Attempt(0, (0.4, 0.3, 0.2, 0.1), "CONVERGED", 4, 1e-15, 0.2, 0.2, 1e-3)
FAILED = replace(PLAIN, number=9, status="TIME_LIMIT", error=2e-4, seconds=10.0, descent_error=0.5)
LARGER = replace(PLAIN, number=1, target=(0.2,) * 5, seconds=0.4, descent_error=3e-3)


def test_targets_are_even_in_their_outcomes_and_seeded() -> None:
    targets = [random_target(number) for number in range(27)]
    assert [len(target) for target in targets] == 3 * list(range(4, 13))
    for target in targets:
        assert target.sum() == pytest.approx(1.0, abs=1e-15)
        assert target.min() >= 0.01
    np.testing.assert_array_equal(random_target(5), targets[5])
    assert not np.allclose(targets[5], targets[14][: len(targets[5])])
    # Dirichlet(1) over k outcomes: a share is above x with probability (1 - x)^(k - 1).
    shares = [(random_target(9 * n)[0] - 0.01) / 0.96 for n in range(2000)]
    assert np.mean(np.array(shares) > 0.3) == pytest.approx(0.7**3, abs=0.04)


def test_a_target_is_solved_exactly_and_descent_is_not_there_yet() -> None:
    attempt = attempt_target(2, 10.0)
    assert attempt.solved
    assert attempt.status == "CONVERGED"
    assert attempt.rests == attempt.outcomes == 6
    assert attempt.descent_seconds == max(attempt.seconds, LEAST_SECONDS)
    assert 1e-12 < attempt.descent_error < 1.0


def test_the_solver_is_not_taken_at_its_word(monkeypatch: pytest.MonkeyPatch) -> None:
    """A cube is fair; whatever is said of it, it has neither other odds nor fewer rests."""
    corners = np.array(np.meshgrid([-1.0, 1.0], [-1.0, 1.0], [-1.0, 1.0])).reshape(3, -1).T
    hull = convex_hull(corners)

    def claim(directions: np.ndarray, target: np.ndarray) -> Attempt:
        step = DesignStep(0, 0.0, 0.0, {"dice": 0.0}, 0.0)
        result = DesignResult(Status.CONVERGED, hull, directions, {}, (step,), 1, 1, 0)
        monkeypatch.setattr(exact_targets, "random_target", lambda number: target)
        monkeypatch.setattr(exact_targets, "solve_exactly", lambda *given: result)
        monkeypatch.setattr(exact_targets, "_descent_error", lambda *given: 0.5)
        return attempt_target(0, 1.0)

    assert claim(hull.normals, np.full(6, 1.0 / 6.0)).solved
    wrong = claim(hull.normals, np.array([0.25, 0.25, 0.125, 0.125, 0.125, 0.125]))
    assert not wrong.solved
    assert wrong.error == pytest.approx(1.0 / 12.0)
    fewer = claim(hull.normals[:5], np.full(5, 0.2))
    assert (fewer.rests, fewer.error, fewer.solved) == (6, float("inf"), False)
    twice = claim(hull.normals[[0, 0, 2, 3, 4, 5]], np.full(6, 1.0 / 6.0))
    assert not twice.solved


def test_the_first_target_is_warmed_up_with(monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[int] = []
    told: list[str] = []

    def attempt(number: int, seconds: float) -> Attempt:
        tried.append(number)
        return replace(PLAIN, number=number)

    monkeypatch.setattr(exact_targets, "attempt_target", attempt)
    assert [a.number for a in run_targets(3, 1.0, told.append)] == [0, 1, 2]
    assert tried == [3, 0, 1, 2]
    assert told == ["target 0", "target 1", "target 2"]


def test_summaries_by_outcomes_and_of_all() -> None:
    four, five, both = summaries([LARGER, FAILED, PLAIN])
    assert (four.outcomes, four.targets, four.solved) == (4, 2, 1)
    assert four.median_seconds == pytest.approx(5.1)
    assert four.worst_seconds == 0.2
    assert four.median_descent_error == pytest.approx(0.2505)
    assert (five.outcomes, five.targets, five.solved) == (5, 1, 1)
    assert (both.outcomes, both.targets, both.solved) == (None, 3, 2)
    assert (both.median_seconds, both.worst_seconds) == (0.4, 0.4)
    assert (both.median_descent_error, both.worst_descent_error) == (3e-3, 0.5)
    assert np.isnan(summaries([FAILED])[0].worst_seconds)


def test_the_command_prints_a_table_or_json(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked: list[tuple[int, float]] = []

    def run(count: int, seconds: float, on_target: object) -> Iterator[Attempt]:
        asked.append((count, seconds))
        return iter([PLAIN, FAILED, LARGER])

    monkeypatch.setattr(exact_targets, "run_targets", run)
    assert main(["bench", "exact"]) == 0
    header, four, five, both, unsolved = capsys.readouterr().out.splitlines()
    assert header.split()[:3] == ["outcomes", "targets", "solved"]
    assert four.split() == ["4", "2", "1", "5.100", "0.200", "2.5e-01", "5.0e-01"]
    assert five.split()[:3] == ["5", "1", "1"]
    assert both.split()[:3] == ["all", "3", "2"]
    assert "target 9 (0.4000, 0.3000, 0.2000, 0.1000), error 2.0e-04 with 4 rests" in unsolved
    assert main(["bench", "exact", "--targets", "3", "--seconds", "2", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert {"date", "machine", "python", "dicedesign", "torch"} <= set(record)
    assert [row["outcomes"] for row in record["rows"]] == [4, 5, None]
    assert [a["solved"] for a in record["targets"]] == [True, False, True]
    assert asked == [(200, 10.0), (3, 2.0)]


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--targets", "0"], "--targets: expected at least 1, got 0"),
        (["--seconds", "0"], "--seconds: expected a positive number, got 0"),
    ],
)
def test_bad_limits_are_errors_in_words(
    words: list[str], text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bench", "exact", *words]) == 2
    assert text in capsys.readouterr().err
