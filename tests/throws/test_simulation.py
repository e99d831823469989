"""Rigid bodies, states at release, simulated throws and films, against closed forms and another
library."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
import trimesh
from common.inline_executor import Lossy
from common.kernels import compiled_only
from common.thrown import (
    BOARD,
    box,
    fits,
    random_body,
    random_points,
    rigid_body_with_rests,
    sample_states,
    turns_of,
)
from scipy.spatial.transform import Rotation
from scipy.stats import kstest

from dicedesign.geometry.sphere import unit_vectors
from dicedesign.runtime.workers import local_workers
from dicedesign.throws.rigid_body import release_states, rigid_body
from dicedesign.throws.simulation import FRAMES_PER_SECOND, SETTLED, simulate, throw_film
from dicedesign.throws.tables import GRAVITY, Table, load_table


def test_a_box() -> None:
    a, b, c = 1.0, 1.3, 1.7
    body, _ = rigid_body_with_rests(box(c, a, b))
    squared = a * a + b * b + c * c
    assert body.radius == pytest.approx(np.sqrt(squared))
    expected = np.array([a * a + b * b, a * a + c * c, b * b + c * c]) / 3.0 / squared
    np.testing.assert_allclose(body.moments, expected, rtol=1e-13)
    # The most probable rest is on the largest side, and tips most easily over its long edges.
    np.testing.assert_allclose(body.rest_heights * body.radius, [a, a, b, b, c, c])
    over = np.hypot([a, a, b, b, c, c], [b, b, a, a, a, a])
    np.testing.assert_allclose(body.barriers * body.radius, over, rtol=1e-13)


def test_a_hollow_body() -> None:
    """A cavity changes the inertia, not the hull."""
    outer, inner = trimesh.creation.box((2.0, 2.0, 2.0)), trimesh.creation.box((1.0, 1.0, 1.0))
    inner.invert()
    body = rigid_body(trimesh.util.concatenate([outer, inner]))
    # m s^2 / 6 of each cube, with masses 8 and 1 of 7.
    np.testing.assert_allclose(body.moments, (8 * 4 - 1) / 6 / 7 / 3, rtol=1e-12)
    assert len(body.vertices) == 8


def test_a_needle_of_points_has_inertia() -> None:
    """Its volume is too little for a mesh to be closed around it."""
    needle = np.array([*product((-1.0, 1.0), (-1e-6, 1e-6), (-1e-6, 1e-6))])
    tensor = rigid_body(needle).inertia
    expected = np.diag([2e-12, 1.0 + 1e-12, 1.0 + 1e-12]) / 3.0
    # To the rounding of the largest moment.
    np.testing.assert_allclose(tensor, expected, rtol=0, atol=1e-16)


@pytest.mark.parametrize("seed", range(2))
def test_against_another_library(seed: int) -> None:
    points = random_points(seed)
    body, poses = rigid_body_with_rests(points)
    mesh = trimesh.Trimesh(points).convex_hull
    tensor = mesh.moment_inertia / mesh.volume
    np.testing.assert_allclose(body.inertia, tensor, rtol=0, atol=1e-12 * np.abs(tensor).max())
    assert np.linalg.det(body.axes) == pytest.approx(1.0)
    assert (np.diff(body.moments) >= 0.0).all()
    arms = poses.hull.vertices - mesh.center_mass
    np.testing.assert_allclose(body.vertices @ body.axes.T * body.radius, arms, atol=1e-12)
    assert np.linalg.norm(body.vertices, axis=1).max() == pytest.approx(1.0)


SPREAD = replace(BOARD, height=(0.05, 0.2), speed=(0.0, 0.6), spin=(5.0, 25.0))


@pytest.mark.parametrize("aimed", [False, True])
def test_ranges_are_drawn_evenly_and_independently(aimed: bool) -> None:
    body, count = random_body(2)[0], 4000
    down = unit_vectors(np.random.default_rng(1).normal(size=(count, 3)))
    states = release_states(body, SPREAD, count, np.random.default_rng(5), down if aimed else None)
    turns = turns_of(states)
    if aimed:
        np.testing.assert_allclose(-turns[:, 2] @ body.axes.T, down, atol=1e-14)
    # Heights of the lowest points, speeds and spins.
    lowest = (turns[:, 2] @ body.vertices.T).min(axis=1) * SPREAD.size / 2.0
    motions = (np.linalg.norm(states[:, i : i + 3], axis=1) for i in (7, 10))
    drawn = np.stack([states[:, 2] + lowest, *motions])
    for values, (low, high) in zip(drawn, (SPREAD.height, SPREAD.speed, SPREAD.spin), strict=True):
        assert kstest(values, "uniform", (low, high - low)).pvalue > 1e-3
    # They are independent of the orientation, too.
    known = np.concatenate([drawn, states[:, 3:7].T])
    correlations = np.corrcoef(known) - np.eye(len(known))
    assert np.abs(correlations[:3]).max() < 4.0 / np.sqrt(count)


def test_orientations_are_uniform() -> None:
    """Rotation matrices have mean 0, and each entry the variance 1/3; one number is no range."""
    states = sample_states(random_body(2)[0], BOARD, 20_000)
    turns = turns_of(states)
    assert np.abs(turns.mean(axis=0)).max() < 4.0 * np.sqrt(1.0 / 3.0 / 20_000)
    np.testing.assert_allclose((turns**2).mean(axis=0), 1.0 / 3.0, atol=0.01)
    np.testing.assert_allclose(states[:, 7:10], np.tile([BOARD.speed, 0.0, 0.0], (20_000, 1)))
    np.testing.assert_allclose(np.linalg.norm(states[:, 10:], axis=1), BOARD.spin)


# Simulated throws.


CARPET = load_table("carpet")


@compiled_only
def test_without_momentum_throws_have_the_geometric_probabilities() -> None:
    body, poses = random_body(1)
    throws = simulate(body, CARPET, 4000)
    assert throws.unresolved == 0
    np.testing.assert_array_equal(throws.frequencies, throws.counts / 4000)
    assert fits(throws.counts, poses.probabilities) > 1e-3


@compiled_only
def test_results_do_not_depend_on_the_workers() -> None:
    """Nor on tasks whose workers are lost."""
    body, _ = random_body(1)
    alone = simulate(body, CARPET, 1100, 5)
    with local_workers(2) as workers:
        together = simulate(body, CARPET, 1100, 5, workers=workers)
    np.testing.assert_array_equal(together.outcomes, alone.outcomes)
    lossy = Lossy(lambda count: count in (1, 2, 3))
    again = simulate(body, CARPET, 1100, 5, workers=lossy)
    np.testing.assert_array_equal(again.outcomes, alone.outcomes)
    assert not np.array_equal(simulate(body, CARPET, 1100, 6).outcomes, alone.outcomes)


@compiled_only
def test_the_film_of_a_cube() -> None:
    """A flight about a fixed axis, since all moments are equal, which ends at a rest."""
    table = Table("test", restitution=0.5, friction=0.3, height=0.1, speed=0.2, spin=10.0)
    points = box(1, 1, 1)
    body, poses = rigid_body_with_rests(points)
    film = throw_film(body, table)
    # Until its lowest corner may touch the table.
    flight = int(np.sqrt(2 * (table.height - table.size) / GRAVITY) * FRAMES_PER_SECOND) + 1
    times = np.arange(flight) / FRAMES_PER_SECOND
    np.testing.assert_allclose(film.seconds[:flight], times)
    way = np.stack([table.speed * times, 0.0 * times, -GRAVITY / 2 * times**2], axis=1)
    np.testing.assert_allclose(film.positions[:flight], film.positions[0] + way, atol=1e-12)
    turns = Rotation.from_matrix(film.rotations[:flight])
    turned = (turns[0].inv() * turns).as_rotvec()
    np.testing.assert_allclose(np.linalg.norm(turned, axis=1), table.spin * times, atol=1e-9)
    assert np.linalg.matrix_rank(turned, tol=1e-9) == 1

    frames, radius = range(len(film.seconds)), table.size / 2
    placed = np.array([film.place_points(points, poses.center_of_mass, i) for i in frames])
    lowest = placed[..., 2].min(axis=1)
    assert lowest[0] == pytest.approx(table.height)
    assert lowest.min() > -0.01 * radius
    assert abs(lowest[-1]) < 0.01 * radius
    down = -poses.normals[film.rest] @ body.axes @ film.rotations[-1].T
    assert down[2] == pytest.approx(1.0, abs=2e-4)
    speed = np.linalg.norm(film.positions[-1] - film.positions[-2]) * FRAMES_PER_SECOND
    assert speed < 3.0 * SETTLED * np.sqrt(GRAVITY * radius)
    # Points are only moved, turned and scaled, not reflected.
    moved = np.linalg.lstsq(points, placed[-1] - film.positions[-1])[0] * np.sqrt(3) / radius
    np.testing.assert_allclose(moved @ moved.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(moved) > 0.0
