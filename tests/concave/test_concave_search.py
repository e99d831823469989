"""Concave dice made of small bodies, judged by the forward model, and how a search goes on."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from common.bumpy import bent_capsule, bumpy_sphere
from common.paths import public_data
from common.slow_machine import slow_machine

from dicedesign import rest_poses
from dicedesign.concave.checkpoint import checkpoint_bytes
from dicedesign.concave.fill.paper_options import ConcavePaperOptions
from dicedesign.concave.options import ConcaveOptions
from dicedesign.concave.result import ConcaveDie, ConcaveProgress, ConcaveStep
from dicedesign.concave.search import make_concave_die
from dicedesign.errors import InputError, NoStartError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.geometry.meshes.stl import stl_bytes
from dicedesign.geometry.surfaces.closed_surface import make_surface
from dicedesign.geometry.surfaces.self_intersections import intersecting_triangles
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.rest.outcomes import outcome_odds
from dicedesign.runtime.arrays import Floats, Integers

HALVES = np.array([0.5, 0.5])


@cache
def bumpy() -> Surface:
    """Sheared: symmetric bodies have ties."""
    surface = bumpy_sphere()
    shear = np.array([[1.0, 0.05, -0.03], [0.0, 1.0, 0.07], [0.0, 0.0, 1.0]])
    return surface.moved(40.0 * surface.points @ shear)


@cache
def small() -> Surface:
    """Of 42 points."""
    return bumpy_sphere(1)


def odds_of(points: Floats, triangles: Integers, die: ConcaveDie) -> tuple[Floats, float]:
    """(k,) those of rests within five degrees of each outcome's likeliest, and all others'."""

    class Mesh:
        vertices, faces = points, triangles

    poses = rest_poses(Mesh())
    assert poses.center_of_mass_source == "uniform solid"
    cosine = np.cos(np.radians(5.0))
    odds, left = [], poses.probabilities.copy()
    for direction in die.directions:
        near = poses.normals @ direction >= cosine
        own = np.flatnonzero(near)[np.argmax(poses.probabilities[near])]
        mine = poses.normals @ poses.normals[own] >= cosine
        odds.append(left[mine].sum())
        left[mine] = 0.0
    return np.array(odds), float(left.sum())


@pytest.mark.parametrize(
    ("surface", "target"),
    [
        (bumpy(), [0.5, 0.5]),
        (bumpy(), [1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0]),
        (bent_capsule(18, 10), [0.6, 0.4]),
    ],
)
def test_the_odds_of_the_solid_are_the_wanted_ones(surface: Surface, target: list[float]) -> None:
    options = ConcaveOptions(tolerance=0.02, attempts=20, displacement=0.2, seconds=1e9)
    steps: list[ConcaveStep] = []
    die = make_concave_die(surface, np.array(target), options, on_step=steps.append)
    best = die.progress.best
    assert best is not None
    odds, elsewhere = odds_of(die.after.points, die.after.triangles, die)
    assert np.abs(odds - target).max() <= 0.02
    assert elsewhere <= 0.02
    assert max(np.abs(odds - target).max(), elsewhere) == pytest.approx(best.error, abs=1e-4)
    rounded = die.after.points.astype(np.float32).astype(np.float64)
    odds, elsewhere = odds_of(rounded, die.after.triangles, die)
    assert max(np.abs(odds - target).max(), elsewhere) <= 0.021
    assert best.intersections == 0
    assert best.gap < 1e-12
    # What is told of the die is what it is.
    assert die.before is surface
    assert die.after.triangles is surface.triangles
    found = convex_hull(die.after.points)
    assert die.hull_corners == (len(convex_hull(surface.points).vertices), len(found.vertices))
    scale = 1e-9 * surface.diagonal
    np.testing.assert_allclose(
        np.sort(found.vertices, axis=0), np.sort(die.hull.vertices, axis=0), atol=scale
    )
    moved = np.linalg.norm(die.after.points - surface.points, axis=1) / surface.diagonal
    assert best.displacement == pytest.approx(moved.mean(), rel=1e-9)
    # The history is that of the best attempt.
    own = [step for step in steps if step.attempt == best.attempt]
    assert die.progress.history == tuple(own)
    assert {step.stage for step in own} == {"hull", "fill"}
    assert [step.attempt for step in steps] == sorted(step.attempt for step in steps)
    assert steps[0].attempt == 1
    assert own[-1].error == best.error


def without_seconds(progress: ConcaveProgress) -> bytes:
    """All of it but the time that it took."""
    steps = tuple(replace(step, seconds=0.0) for step in progress.history)
    return checkpoint_bytes(replace(progress, seconds=0.0, history=steps), {})


@cache
def uninterrupted() -> tuple[ConcaveDie, tuple[ConcaveProgress, ...]]:
    """Four attempts, none of them good enough to end the search, and how far each came."""
    attempts: list[ConcaveProgress] = []
    options = ConcaveOptions(attempts=4, displacement=1e-6, seconds=1e9)
    die = make_concave_die(small(), HALVES, options, seed=3, on_attempt=attempts.append)
    return die, tuple(attempts)


def test_attempts_are_told_and_the_best_is_kept() -> None:
    die, attempts = uninterrupted()
    assert [progress.attempts for progress in attempts] == [1, 2, 3, 4]
    assert attempts[-1] is die.progress
    found = [progress.best for progress in attempts if progress.best is not None]
    assert found
    ranks = [(best.error > 0.005, best.intersections, best.displacement) for best in found]
    assert ranks == sorted(ranks, reverse=True)
    assert all(best.attempt <= 4 for best in found)


def test_the_same_seed_makes_the_same_die() -> None:
    die, attempts = uninterrupted()
    again: list[ConcaveProgress] = []
    options = ConcaveOptions(attempts=4, displacement=1e-6, seconds=1e9)
    second = make_concave_die(small(), HALVES, options, seed=3, on_attempt=again.append)
    assert list(map(without_seconds, again)) == list(map(without_seconds, attempts))
    assert second.after.points.tobytes() == die.after.points.tobytes()
    assert second.hull.vertices.tobytes() == die.hull.vertices.tobytes()


@pytest.mark.parametrize("done", [1, 4])
def test_a_resumed_search_ends_like_an_uninterrupted_one(done: int) -> None:
    die, attempts = uninterrupted()
    options = ConcaveOptions(attempts=4, displacement=1e-6, seconds=1e9)
    told: list[ConcaveProgress] = []
    resumed = make_concave_die(
        small(), HALVES, options, seed=3, resume=attempts[done - 1], on_attempt=told.append
    )
    assert list(map(without_seconds, told)) == list(map(without_seconds, attempts[done:]))
    assert resumed.after.points.tobytes() == die.after.points.tobytes()
    assert resumed.progress.seconds >= attempts[done - 1].seconds


def test_one_that_is_good_enough_ends_the_search() -> None:
    options = ConcaveOptions(attempts=9, displacement=0.5, seconds=1e9)
    die = make_concave_die(small(), HALVES, options, seed=3)
    best = die.progress.best
    assert best is not None
    assert die.progress.attempts == best.attempt


def test_unit_and_place_do_not_matter() -> None:
    """The powers of two are exact; where a body lies is rounded."""
    options = ConcaveOptions(attempts=1, seconds=1e9)
    first = make_concave_die(small(), HALVES, options)
    large = small().moved(1024.0 * small().points)
    second = make_concave_die(large, HALVES, options)
    np.testing.assert_array_equal(second.after.points, 1024.0 * first.after.points)


def test_where_nothing_comes_about() -> None:
    """Outcomes that are nowhere near each other's odds, on a body of few corners."""
    target = np.array([0.97, 0.01, 0.01, 0.01])
    text = (
        "start: expected a surface whose hull leads to the target, but none of 1 attempts did; "
        "allow more with method.concave.attempts"
    )
    attempts: list[ConcaveProgress] = []
    with pytest.raises(NoStartError, match=text):
        make_concave_die(small(), target, ConcaveOptions(attempts=1), on_attempt=attempts.append)
    assert [progress.best for progress in attempts] == [None]


@cache
def first_as_wanted() -> int:
    """Number of the first attempt that led to a die as wanted."""
    _, attempts = uninterrupted()
    return next(
        progress.attempts
        for progress in attempts
        if progress.best is not None
        and progress.best.error <= 0.005
        and progress.best.intersections == 0
    )


@pytest.mark.parametrize("limit", [{"seconds": 1e-9}, {"enough": 1}])
def test_limits_are_only_on_the_way_to_a_nearer_die(limit: dict[str, Any]) -> None:
    options = ConcaveOptions(attempts=4, displacement=1e-6, **limit)
    made = make_concave_die(small(), HALVES, options, seed=3)
    assert made.progress.attempts == first_as_wanted()


def test_attempts_are_made_until_they_are_enough_also_on_a_slow_machine() -> None:
    told: list[ConcaveProgress] = []
    enough = first_as_wanted() + 1
    options = ConcaveOptions(attempts=4, displacement=1e-6, enough=enough)
    with slow_machine():
        make_concave_die(small(), HALVES, options, seed=3, on_attempt=told.append)
    usual = uninterrupted()[1][:enough]
    assert list(map(without_seconds, told)) == list(map(without_seconds, usual))
    assert told[-1].seconds > 1e6


def test_more_outcomes_than_the_hull_carries() -> None:
    most = 2 * len(convex_hull(small().points).vertices) - 4
    with pytest.raises(InputError, match=f"expected at most {most} outcomes for a hull of"):
        make_concave_die(small(), np.full(most + 1, 1.0 / (most + 1)), ConcaveOptions())


@pytest.mark.parametrize(
    ("options", "stages"),
    [
        ({"hull": "paper", "paper": ConcavePaperOptions(steps=150)}, {"hull", "fill"}),
        pytest.param(
            {"hull": "paper", "fill": "paper", "paper": ConcavePaperOptions(steps=150)},
            {"hull", "fill", "balance"},
            marks=pytest.mark.skipif(
                find_spec("clarabel") is None,
                reason="the optional extra 'concave' is not installed",
            ),
        ),
    ],
)
def test_the_ways_of_the_paper(options: dict[str, Any], stages: set[str]) -> None:
    wanted = ConcaveOptions(attempts=1, tolerance=0.02, seconds=1e9, **options)
    steps: list[ConcaveStep] = []
    die = make_concave_die(small(), HALVES, wanted, on_step=steps.append)
    assert {step.stage for step in steps} == stages
    best = die.progress.best
    assert best is not None
    assert best.gap < (1e-9 if wanted.fill == "correspondence" else 0.02)
    assert best.error < 0.05
    odds, elsewhere = odds_of(die.after.points, die.after.triangles, die)
    assert max(np.abs(odds - 0.5).max(), elsewhere) == pytest.approx(best.error, abs=1e-4)


def test_spot_becomes_a_fair_three_sided_die(tmp_path: Path) -> None:
    surface, notes = make_surface(read_body(public_data("models/spot.obj")))
    assert notes == ()
    target = np.full(3, 1.0 / 3.0)
    die = make_concave_die(surface, target, ConcaveOptions())
    (tmp_path / "die.stl").write_bytes(stl_bytes(die.after.points, die.after.triangles))
    poses = rest_poses(read_body(tmp_path / "die.stl"))
    assert poses.center_of_mass_source == "uniform solid"
    odds = outcome_odds(poses, die.directions)
    assert odds.error(target) <= 0.005
    assert len(intersecting_triangles(die.after.points, die.after.triangles)) == 0
    assert die.progress.best is not None
    assert die.progress.best.gap <= 1e-4
    assert die.progress.best.displacement <= 0.05
