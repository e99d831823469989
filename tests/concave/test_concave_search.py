"""Concave dice made of small bodies, judged by the forward model, and how a search goes on."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from common.bumpy import bumpy_sphere
from common.paths import public_data
from threadpoolctl import threadpool_limits

from dicedesign import rest_poses
from dicedesign.concave import attempt
from dicedesign.concave.hull_problem import Elasticity
from dicedesign.concave.options import ConcaveOptions, ConcavePaperOptions
from dicedesign.concave.result import (
    ConcaveDie,
    ConcaveProgress,
    ConcaveStep,
    FillResult,
    FillStatus,
    missing,
    rank,
)
from dicedesign.concave.search import checkpoint_bytes, make_concave_die
from dicedesign.errors import NoStartError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.meshes.reading import read_body, stl_bytes
from dicedesign.geometry.surfaces.closed_surface import make_surface
from dicedesign.geometry.surfaces.self_intersections import intersecting_triangles
from dicedesign.geometry.triangles import Surface
from dicedesign.rest.outcomes import outcome_margins, outcome_probabilities
from dicedesign.runtime.arrays import Floats

HALVES = np.array([0.5, 0.5])


@cache
def bumpy() -> Surface:
    """Sheared: symmetric bodies have ties."""
    surface = bumpy_sphere()
    shear = np.array([[1.0, 0.05, -0.03], [0.0, 1.0, 0.07], [0.0, 0.0, 1.0]])
    return surface.with_points(40.0 * surface.points @ shear)


@cache
def small() -> Surface:
    """Of 42 points."""
    return bumpy_sphere(1)


@dataclass(frozen=True)
class Found:
    """What the forward model says of a die whose file was read back.

    Attributes
    ----------
    error: the largest |p - q|, or the probabilities of all rests beside the outcomes' together.
    apart, margin: least angles between outcomes and of tipping, in degrees.
    """

    error: float
    apart: float
    margin: float


def read_back(die: ConcaveDie, target: Floats, folder: Path) -> Found:
    (folder / "die.stl").write_bytes(stl_bytes(die.after.points, die.after.triangles))
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
    return Found(
        max(np.abs(probabilities - target).max(), left.sum()),
        float(np.degrees(np.arccos(cosines.max()))),
        float(
            np.degrees(outcome_margins(poses, outcome_probabilities(poses, die.directions)).min())
        ),
    )


@pytest.mark.parametrize(
    ("surface", "target", "angles"),
    [
        (bumpy(), [0.2, 0.5, 0.3], {"apart_deg": 60.0}),
        (small(), [1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0], {"margin_deg": 20.0}),
    ],
)
def test_the_solid_is_as_wanted(
    surface: Surface, target: list[float], angles: dict[str, float], tmp_path: Path
) -> None:
    options = ConcaveOptions(tolerance=0.02, attempts=20, displacement=0.2, **angles)
    steps: list[ConcaveStep] = []
    die = make_concave_die(surface, np.array(target), options, on_step=steps.append)
    best = die.progress.best
    assert best is not None
    found = read_back(die, np.array(target), tmp_path)
    assert found.error <= 0.021
    assert found.apart >= options.apart_deg - 0.01
    assert found.margin >= options.margin_deg - 0.01
    assert best.error <= 0.02
    assert (best.error, best.apart_deg, best.margin_deg) == (
        pytest.approx(found.error, abs=1e-4),
        pytest.approx(found.apart, abs=0.01),
        pytest.approx(found.margin, abs=0.01),
    )
    assert best.self_intersections == 0
    # What is told of the die is what it is.
    assert die.before is surface
    assert die.after.triangles is surface.triangles
    hull = convex_hull(die.after.points)
    assert die.hull_corners == (len(convex_hull(surface.points).vertices), len(hull.vertices))
    scale = 1e-9 * surface.diagonal
    np.testing.assert_allclose(
        np.sort(hull.vertices, axis=0), np.sort(die.hull.vertices, axis=0), atol=scale
    )
    moved = np.linalg.norm(die.after.points - surface.points, axis=1) / surface.diagonal
    assert best.displacement == pytest.approx(moved.mean(), rel=1e-9)
    # The history is that of the best attempt.
    own = [step for step in steps if step.attempt == best.attempt]
    assert die.progress.history == tuple(own)
    assert {step.stage for step in own} == {"hull", "fill"}
    assert [step.attempt for step in steps] == sorted(step.attempt for step in steps)
    assert steps[0].attempt == 1


@pytest.mark.parametrize("limit", [{"attempts": 2}, {"attempts": 9, "seconds": 1e-9}])
def test_where_none_is_as_wanted_it_is_the_best_that_was_found(
    limit: dict[str, Any], tmp_path: Path
) -> None:
    """No three directions are farther apart than 120 degrees."""
    target = np.full(3, 1.0 / 3.0)
    options = ConcaveOptions(apart_deg=170.0, **limit)
    die = make_concave_die(small(), target, options)
    best, tried = die.progress.best, die.progress.tried
    assert best is not None
    assert die.progress.attempts == (1 if "seconds" in limit else 2)
    assert missing(best, options) == min(missing(attempt, options) for attempt in tried) > 0.0
    found = read_back(die, target, tmp_path)
    assert found.apart < 120.0
    assert found.error == pytest.approx(best.error, abs=1e-4)
    assert found.apart == pytest.approx(best.apart_deg, abs=0.01)
    assert found.margin == pytest.approx(best.margin_deg, abs=0.01)


def without_seconds(progress: ConcaveProgress) -> bytes:
    """All of it but the time that it took."""
    steps = tuple(replace(step, seconds=0.0) for step in progress.history)
    tried = tuple(replace(attempt, seconds=0.0) for attempt in progress.tried)
    return checkpoint_bytes(replace(progress, seconds=0.0, history=steps, tried=tried), {})


@cache
def uninterrupted() -> tuple[ConcaveDie, tuple[ConcaveProgress, ...]]:
    """Three attempts, none of them good enough to end the search, and how far each came."""
    attempts: list[ConcaveProgress] = []
    options = ConcaveOptions(attempts=3, displacement=1e-6)
    die = make_concave_die(small(), HALVES, options, seed=3, on_attempt=attempts.append)
    return die, tuple(attempts)


def test_attempts_are_told_and_the_best_is_kept() -> None:
    die, attempts = uninterrupted()
    assert [progress.attempts for progress in attempts] == [1, 2, 3]
    assert attempts[-1] is die.progress
    found = [progress.best for progress in attempts if progress.best is not None]
    assert found
    ranks = [rank(best, ConcaveOptions()) for best in found]
    assert ranks == sorted(ranks, reverse=True)
    tried = {draft.attempt: draft for draft in die.progress.tried}
    assert sorted(tried) == [attempt.attempt for attempt in die.progress.tried]
    for best in found:
        told = tried[best.attempt]
        for name in ("error", "displacement", "apart_deg", "margin_deg", "self_intersections"):
            assert getattr(told, name) == getattr(best, name)
    assert 0.0 < sum(draft.seconds or 0.0 for draft in tried.values()) <= die.progress.seconds


@pytest.mark.parametrize("done", [0, 1])
def test_a_resumed_search_ends_like_an_uninterrupted_one(done: int) -> None:
    """And a second one from the start, with any number of threads."""
    die, attempts = uninterrupted()
    options = ConcaveOptions(attempts=3, displacement=1e-6)
    told: list[ConcaveProgress] = []
    resume = attempts[done - 1] if done else None
    with threadpool_limits(2):
        resumed = make_concave_die(
            small(), HALVES, options, seed=3, resume=resume, on_attempt=told.append
        )
    assert list(map(without_seconds, told)) == list(map(without_seconds, attempts[done:]))
    assert resumed.after.points.tobytes() == die.after.points.tobytes()


def test_one_that_is_good_enough_ends_the_search() -> None:
    options = ConcaveOptions(attempts=9, displacement=0.5)
    die = make_concave_die(small(), HALVES, options, seed=3)
    best = die.progress.best
    assert best is not None
    assert die.progress.attempts == best.attempt


def test_where_nothing_comes_about(monkeypatch: pytest.MonkeyPatch) -> None:
    """No hull is filled."""

    def stuck(elasticity: Elasticity, hull: ConvexHull, *rest: object) -> FillResult:
        return FillResult(elasticity.surface.points, 0.0, FillStatus.NO_PROGRESS)

    monkeypatch.setattr(attempt, "fill_by_correspondence", stuck)
    text = (
        "start: expected a surface whose hull leads to the target, but none of 1 attempts did; "
        "allow more with method.concave.attempts"
    )
    attempts: list[ConcaveProgress] = []
    with pytest.raises(NoStartError, match=text):
        make_concave_die(small(), HALVES, ConcaveOptions(attempts=1), on_attempt=attempts.append)
    assert [(progress.best, progress.tried) for progress in attempts] == [(None, ())]
    assert {step.stage for step in attempts[0].history} == {"hull"}


@pytest.mark.skipif(
    find_spec("clarabel") is None, reason="the optional extra 'concave' is not installed"
)
def test_the_ways_of_the_paper(tmp_path: Path) -> None:
    paper = ConcavePaperOptions(steps=40)
    options = ConcaveOptions(attempts=1, tolerance=0.02, hull="paper", fill="paper", paper=paper)
    steps: list[ConcaveStep] = []
    die = make_concave_die(small(), HALVES, options, on_step=steps.append)
    assert {step.stage for step in steps} == {"hull", "fill", "balance"}
    best = die.progress.best
    assert best is not None
    assert best.error < 0.1
    assert read_back(die, HALVES, tmp_path).error == pytest.approx(best.error, abs=1e-4)


def test_spot_becomes_a_fair_three_sided_die(tmp_path: Path) -> None:
    surface, notes = make_surface(read_body(public_data("models/spot.obj")))
    assert notes == ()
    target = np.full(3, 1.0 / 3.0)
    die = make_concave_die(surface, target, ConcaveOptions(displacement=0.05))
    found = read_back(die, target, tmp_path)
    assert found.error <= 0.005
    assert found.apart >= 45.0
    assert found.margin >= 10.0
    assert len(intersecting_triangles(die.after.points, die.after.triangles)) == 0
    assert die.progress.best is not None
    assert die.progress.best.displacement <= 0.05
