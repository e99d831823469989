"""Simulated throws of one body with any number of workers, and films of throws."""

from __future__ import annotations

import numpy as np
import pytest
from common.inline_executor import Lossy
from common.kernels import compiled_only
from common.thrown import box, fits, random_body, rigid_body_with_rests
from scipy.spatial.transform import Rotation

from dicedesign.runtime.workers import local_workers
from dicedesign.throws.simulation import FRAMES_PER_SECOND, SETTLED, simulate, throw_film
from dicedesign.throws.tables import GRAVITY, Table, load_table

CARPET = load_table("carpet")

pytestmark = compiled_only


def test_without_momentum_throws_have_the_geometric_probabilities() -> None:
    body, poses = random_body(1)
    throws = simulate(body, CARPET, 4000)
    assert throws.unresolved == 0
    np.testing.assert_array_equal(throws.frequencies, throws.counts / 4000)
    assert fits(throws.counts, poses.probabilities) > 1e-3


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
