"""Simulated throws of one body with any number of workers, and films of throws."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from common.inline_executor import Lossy
from common.kernels import compiled_only
from common.thrown import box, random_body, random_points, rigid_body_with_rests
from scipy.spatial.transform import Rotation

from dicedesign.runtime.workers import local_workers
from dicedesign.throws.rigid_body import PAPER_DIRECTIONS
from dicedesign.throws.simulation import FRAMES_PER_SECOND, SETTLED, simulate, throw_film
from dicedesign.throws.tables import GRAVITY, Table, load_table

BOARD, CARPET = load_table("board-game"), load_table("carpet")


@compiled_only
def test_results_do_not_depend_on_the_workers() -> None:
    body, _ = random_body(1)
    alone = simulate(body, CARPET, 1100, 5)
    with local_workers(2) as workers:
        together = simulate(body, CARPET, 1100, 5, workers=workers)
    np.testing.assert_array_equal(together.outcomes, alone.outcomes)
    with ThreadPoolExecutor(3) as workers:
        together = simulate(body, CARPET, 1100, 5, workers=workers)
    np.testing.assert_array_equal(together.outcomes, alone.outcomes)
    assert not np.array_equal(simulate(body, CARPET, 1100, 6).outcomes, alone.outcomes)


@compiled_only
def test_tasks_of_lost_workers_run_again() -> None:
    body, _ = random_body(1)
    lossy = Lossy(lambda count: count in (1, 2, 3))
    np.testing.assert_array_equal(
        simulate(body, CARPET, 600, workers=lossy).outcomes, simulate(body, CARPET, 600).outcomes
    )


@compiled_only
def test_the_papers_orientations() -> None:
    body, poses = random_body(1)
    throws = simulate(body, CARPET, PAPER_DIRECTIONS, orientations="icosahedron")
    assert throws.frequencies.sum() == pytest.approx(1.0)
    # A grid scatters less than random orientations.
    errors = throws.frequencies - poses.probabilities
    chance = np.sqrt(poses.probabilities * (1.0 - poses.probabilities) / PAPER_DIRECTIONS)
    assert np.sqrt((errors**2).mean()) < 0.7 * np.sqrt((chance**2).mean())


TABLE = Table("test", restitution=0.5, friction=0.3, height=0.1, speed=0.2, spin=10.0)


@compiled_only
def test_the_flight_of_a_cube() -> None:
    body, _ = rigid_body_with_rests(box(1, 1, 1))
    film = throw_film(body, TABLE)
    # Until its lowest corner may touch the table.
    flight = int(np.sqrt(2 * (TABLE.height - TABLE.size) / GRAVITY) * FRAMES_PER_SECOND)
    times = film.seconds[: flight + 1]
    np.testing.assert_allclose(times, np.arange(flight + 1) / FRAMES_PER_SECOND)
    way = film.positions[: flight + 1] - film.positions[0]
    np.testing.assert_allclose(way[:, 0], TABLE.speed * times, atol=1e-12)
    np.testing.assert_allclose(way[:, 1], 0.0, atol=1e-12)
    np.testing.assert_allclose(way[:, 2], -GRAVITY / 2 * times**2, atol=1e-12)
    # All moments of a cube are equal, so its axis is constant.
    turns = Rotation.from_matrix(film.rotations[: flight + 1])
    turned = (turns[0].inv() * turns).as_rotvec()
    np.testing.assert_allclose(np.linalg.norm(turned, axis=1), TABLE.spin * times, atol=1e-9)
    assert np.linalg.matrix_rank(turned, tol=1e-9) == 1


@compiled_only
@pytest.mark.parametrize("seed", range(2))
def test_a_film_ends_at_a_rest_on_the_table(seed: int) -> None:
    body, poses = random_body(seed)
    film = throw_film(body, TABLE, seed)
    points, radius = random_points(seed), TABLE.size / 2
    first, last = (film.place_points(points, poses.center_of_mass, frame) for frame in (0, -1))
    assert first[:, 2].min() == pytest.approx(TABLE.height)
    for frame in range(len(film.seconds)):
        placed = film.place_points(points, poses.center_of_mass, frame)
        assert placed[:, 2].min() > -0.01 * radius
    assert film.rest >= 0
    assert abs(last[:, 2].min()) < 0.01 * radius
    down = -poses.normals[film.rest] @ body.axes @ film.rotations[-1].T
    assert down[2] == pytest.approx(1.0, abs=2e-4)
    speed = np.linalg.norm(film.positions[-1] - film.positions[-2]) * FRAMES_PER_SECOND
    assert speed < 3.0 * SETTLED * np.sqrt(GRAVITY * radius)
    # Points are only moved, turned and scaled.
    scale = TABLE.size / (2 * body.radius)
    for placed in (first, last):
        gram = (placed - placed[0]) @ (placed - placed[0]).T
        np.testing.assert_allclose(
            gram, scale**2 * (points - points[0]) @ (points - points[0]).T, atol=1e-12
        )
        volumes = [np.linalg.det(np.diff(p[:4], axis=0)) for p in (placed, points)]
        assert volumes[0] == pytest.approx(scale**3 * volumes[1])
