"""Concave dice of small bodies, judged by the forward model, and resumed searches."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from common.bumpy import bumpy_sphere
from common.dented_cube import NORMALS, dented_hull, roof
from common.paths import public_data
from scipy.spatial.transform import Rotation
from threadpoolctl import threadpool_limits

from dicedesign import rest_poses
from dicedesign.concave import attempt
from dicedesign.concave.options import ConcaveOptions, ConcavePaperOptions
from dicedesign.concave.result import ConcaveDie, ConcaveProgress, missing, rank
from dicedesign.concave.search import checkpoint_bytes, make_concave_die
from dicedesign.errors import NoStartError
from dicedesign.geometry.meshes.reading import read_body, read_stl, stl_bytes
from dicedesign.geometry.surfaces.closed_surface import make_surface
from dicedesign.geometry.surfaces.self_intersections import intersecting_triangles
from dicedesign.geometry.triangles import Surface
from dicedesign.rest.outcomes import outcome_margins, outcome_probabilities
from dicedesign.results.result import Step
from dicedesign.runtime.arrays import Floats, Integers

HALVES = np.array([0.5, 0.5])
THIRDS = np.full(3, 1.0 / 3.0)

SMALL = bumpy_sphere(1)
"""Surface of 42 points."""


def read_back(die: ConcaveDie, target: Floats, folder: Path) -> tuple[float, float, float]:
    """Error, angle between outcomes and margin in degrees of a die's file by the forward model.

    The error is the largest |p - q|, or the total probability of all other rests."""
    (folder / "die.stl").write_bytes(stl_bytes(die.after))
    poses = rest_poses(read_body(folder / "die.stl"))
    assert poses.center_of_mass_source == "uniform solid"
    cosine = np.cos(np.radians(5.0))
    probabilities, left, own = [], poses.probabilities.copy(), []
    for direction in die.directions:
        near = poses.normals @ direction >= cosine
        own.append(np.flatnonzero(near)[np.argmax(poses.probabilities[near])])
        mine = poses.normals @ poses.normals[own[-1]] >= cosine
        probabilities.append(left[mine].sum())
        left[mine] = 0.0
    normals = poses.normals[own]
    cosines = normals @ normals.T - 2.0 * np.eye(len(own))
    margins = outcome_margins(poses, outcome_probabilities(poses, die.directions))
    error = max(np.abs(probabilities - target).max(), left.sum())
    apart, margin = np.degrees([np.arccos(cosines.max()), margins.min()]).tolist()
    return error, apart, margin


@pytest.mark.parametrize(
    ("subdivisions", "target", "angles"),
    [(2, [0.2, 0.5, 0.3], {"apart_deg": 60.0}), (1, THIRDS, {"margin_deg": 20.0})],
)
def test_the_die_meets_all_limits(
    subdivisions: int, target: list[float], angles: dict[str, float], tmp_path: Path
) -> None:
    surface = bumpy_sphere(subdivisions)
    # Symmetric bodies have ties.
    surface = surface.with_points(40.0 * surface.points @ (np.eye(3) + 0.05 * np.eye(3, k=1)))
    options = ConcaveOptions(tolerance=0.02, attempts=20, displacement=0.2, **angles)
    steps: list[Step] = []
    die = make_concave_die(surface, np.array(target), options, on_step=steps.append)
    best = die.progress.best.draft
    error, apart, margin = read_back(die, np.array(target), tmp_path)
    assert error <= 0.021
    assert apart >= options.apart_deg - 0.01
    assert margin >= options.margin_deg - 0.01
    assert best.error == pytest.approx(error, abs=1e-4)
    assert (best.apart_deg, best.margin_deg) == pytest.approx((apart, margin), abs=0.01)
    assert best.self_intersections == 0
    assert len(intersecting_triangles(die.after.points, die.after.triangles)) == 0
    moved = np.linalg.norm(die.after.points - surface.points, axis=1) / surface.diagonal
    assert best.displacement == pytest.approx(moved.mean(), rel=1e-9)
    # A close die ends the search, and the history is that of the best attempt.
    assert die.progress.attempts == best.attempt
    own = [step for step in steps if step.attempt == best.attempt]
    assert die.progress.history == tuple(own)
    assert [step.step for step in own] == list(range(len(own)))
    assert {step.stage for step in own} == {"hull", "fill"}


def test_the_die_whose_prints_are_best_is_kept() -> None:
    """Prints of all dice miss, and the last ones least."""
    judged: list[Surface] = []

    def judge(surface: Surface, center: Floats, directions: Floats, outcome_of: Integers) -> float:
        outcomes = outcome_probabilities(rest_poses(surface, center), directions, outcome_of)
        assert outcomes.error(HALVES) <= options.tolerance
        judged.append(surface)
        return 0.9 - 0.05 * len(judged)

    options = ConcaveOptions(tolerance=0.02, attempts=4, displacement=0.5)
    die = make_concave_die(SMALL, HALVES, options, judge_prints=judge)
    best = die.progress.best.draft
    assert die.progress.attempts == 4
    assert len(judged) > 1
    assert best.prints == pytest.approx(0.9 - 0.05 * len(judged))
    assert missing(best, options) == 0.0
    np.testing.assert_array_equal(die.after.points, judged[-1].points)


@pytest.mark.parametrize("limit", [{"attempts": 2}, {"attempts": 9, "seconds": 1e-9}])
def test_a_failed_search_returns_its_best_die(limit: dict[str, Any], tmp_path: Path) -> None:
    """No three directions are farther apart than 120 degrees."""
    options = ConcaveOptions(apart_deg=170.0, **limit)
    die = make_concave_die(SMALL, THIRDS, options)
    best, tried = die.progress.best.draft, die.progress.tried
    assert die.progress.attempts == (1 if "seconds" in limit else 2)
    assert missing(best, options) == min(missing(draft, options) for draft in tried) > 0.0
    error, apart, margin = read_back(die, THIRDS, tmp_path)
    assert apart < 120.0
    assert error == pytest.approx(best.error, abs=1e-4)
    assert (apart, margin) == pytest.approx((best.apart_deg, best.margin_deg), abs=0.01)


@pytest.mark.parametrize(("degrees", "rests"), [(4.9, {2}), (5.0, {1, 2}), (5.1, {1})])
def test_a_die_is_right_only_if_all_its_files_are(
    degrees: float, rests: set[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rounding decides whether two rests of the lower side, 5 degrees apart, are one outcome."""
    monkeypatch.setattr(attempt, "outcome_choices", lambda *arguments: [surface_normals])
    monkeypatch.setattr(attempt, "design_hull", lambda problem, draft, **options: draft)
    monkeypatch.setattr(attempt, "settle_draft", lambda problem, draft: draft)
    monkeypatch.setattr(
        attempt,
        "fill_by_correspondence",
        lambda held, *arguments: (held.elasticity.surface.points, 0.0),
    )
    original = dented_hull(roof(degrees))
    poses = rest_poses(original)
    target = np.array([poses.probabilities[poses.normals @ side > 0.9].sum() for side in NORMALS])
    counts, are_right = set(), set()
    for seed in range(8):
        turn = Rotation.random(random_state=seed).as_matrix()
        surface = original.with_points(original.points @ turn.T)
        surface_normals = NORMALS @ turn.T
        die = make_concave_die(surface, target, ConcaveOptions(attempts=1))
        assert die.progress.best.draft.displacement < 1e-12
        is_right = missing(die.progress.best.draft, ConcaveOptions()) == 0.0
        are_right.add(is_right)
        for size in (20.0, 30.0, 50.0):
            written = read_stl(stl_bytes(die.after.with_points(size * die.after.points))).surface
            outcomes = outcome_probabilities(rest_poses(written), die.directions)
            counts.add(int(outcomes.rest_counts[5]))
            assert outcomes.error(target) < 1e-5 or not is_right
    assert counts == rests
    assert are_right == {rests == {2}}


def without_seconds(progress: ConcaveProgress) -> bytes:
    """Checkpoint without run times."""
    steps = tuple(replace(step, seconds=0.0) for step in progress.history)
    tried = tuple(replace(draft, seconds=0.0) for draft in progress.tried)
    best = progress.best and replace(progress.best, draft=replace(progress.best.draft, seconds=0.0))
    timeless = replace(progress, seconds=0.0, best=best, history=steps, tried=tried)
    return checkpoint_bytes(timeless, {})


@cache
def uninterrupted_search() -> tuple[ConcaveDie, tuple[ConcaveProgress, ...]]:
    """Die of three attempts, none of which ends the search, and the state after each."""
    attempts: list[ConcaveProgress] = []
    options = ConcaveOptions(attempts=3, displacement=1e-6)
    die = make_concave_die(SMALL, HALVES, options, seed=3, on_attempt=attempts.append)
    return die, tuple(attempts)


def test_the_best_attempt_is_kept() -> None:
    die, attempts = uninterrupted_search()
    assert [progress.attempts for progress in attempts] == [1, 2, 3]
    assert attempts[-1] is die.progress
    best = [progress.best.draft for progress in attempts if progress.best is not None]
    assert best
    ranks = [rank(draft, ConcaveOptions()) for draft in best]
    assert ranks == sorted(ranks, reverse=True)
    assert ranks[-1] == min(rank(draft, ConcaveOptions()) for draft in die.progress.tried)


@pytest.mark.parametrize("done", [0, 1])
def test_a_resumed_search_ends_like_an_uninterrupted_one(done: int) -> None:
    """Also with more threads."""
    die, attempts = uninterrupted_search()
    options = ConcaveOptions(attempts=3, displacement=1e-6)
    states: list[ConcaveProgress] = []
    resume = attempts[done - 1] if done else None
    with threadpool_limits(2):
        resumed = make_concave_die(
            SMALL, HALVES, options, seed=3, resume=resume, on_attempt=states.append
        )
    assert list(map(without_seconds, states)) == list(map(without_seconds, attempts[done:]))
    assert resumed.after.points.tobytes() == die.after.points.tobytes()


@pytest.mark.parametrize(("prints", "attempts"), [(0.25, 2), (0.26, 3)])
def test_enough_attempts_end_a_search(prints: float, attempts: int) -> None:
    """Half as many more if prints are off by more than half of what is allowed."""
    options = ConcaveOptions(attempts=9, displacement=1e-6, enough=2, prints_within=0.5)
    die = make_concave_die(
        SMALL,
        HALVES,
        options,
        seed=3,
        resume=uninterrupted_search()[1][1],
        judge_prints=lambda *_: prints,
    )
    assert die.progress.attempts == attempts


def test_a_search_without_a_filled_hull(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(attempt, "fill_by_correspondence", lambda *arguments: None)
    text = "none of 1 attempts did; allow more with method.concave.attempts"
    attempts: list[ConcaveProgress] = []
    with pytest.raises(NoStartError, match=text):
        make_concave_die(SMALL, HALVES, ConcaveOptions(attempts=1), on_attempt=attempts.append)
    assert [(progress.best, progress.tried) for progress in attempts] == [(None, ())]
    assert {step.stage for step in attempts[0].history} == {"hull"}


@pytest.mark.skipif(
    find_spec("clarabel") is None, reason="the optional extra 'concave' is not installed"
)
@pytest.mark.full
def test_the_paper_s_hull_and_fill(tmp_path: Path) -> None:
    paper = ConcavePaperOptions(steps=40)
    options = ConcaveOptions(attempts=1, tolerance=0.02, hull="paper", fill="paper", paper=paper)
    steps: list[Step] = []
    die = make_concave_die(SMALL, HALVES, options, on_step=steps.append)
    assert {step.stage for step in steps} == {"hull", "fill", "balance"}
    error = die.progress.best.draft.error
    assert error < 0.1
    assert read_back(die, HALVES, tmp_path)[0] == pytest.approx(error, abs=1e-4)


@pytest.mark.full
def test_spot_becomes_a_fair_three_sided_die(tmp_path: Path) -> None:
    surface, notes = make_surface(read_body(public_data("models/spot.obj")))
    assert notes == ()
    die = make_concave_die(surface, THIRDS, ConcaveOptions(displacement=0.05))
    error, apart, margin = read_back(die, THIRDS, tmp_path)
    assert error <= 0.005
    assert apart >= 45.0
    assert margin >= 10.0
    assert len(intersecting_triangles(die.after.points, die.after.triangles)) == 0
    assert die.progress.best.draft.displacement <= 0.05
