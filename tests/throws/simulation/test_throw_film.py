"""Films of throws: flight in closed form, and where a body lies that has come to rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from common.kernels import compiled_only
from common.thrown import box, random_body, random_points, thrown
from scipy.spatial.transform import Rotation

from dicedesign.errors import InputError
from dicedesign.kernels import ops as kernels
from dicedesign.throws.engines import DEEPEST, GRAVITY, contact_of
from dicedesign.throws.film import FRAMES_PER_SECOND, SETTLED, throw_film
from dicedesign.throws.tables import Table, table_named

TABLE = Table("test", restitution=0.5, friction=0.3, height=0.1, speed=0.2, spin=10.0)


@compiled_only
def test_a_cube_flies_as_it_should() -> None:
    body, _ = thrown(box(1, 1, 1))
    film = throw_film(body, TABLE)
    # Until its lowest corner, wherever that is, may touch the table.
    flight = int(np.sqrt(2 * (TABLE.height - TABLE.size) / GRAVITY) * FRAMES_PER_SECOND)
    times = film.seconds[: flight + 1]
    np.testing.assert_allclose(times, np.arange(flight + 1) / FRAMES_PER_SECOND)
    way = film.positions[: flight + 1] - film.positions[0]
    np.testing.assert_allclose(way[:, 0], TABLE.speed * times, atol=1e-12)
    np.testing.assert_allclose(way[:, 1], 0.0, atol=1e-12)
    step = contact_of(TABLE).step
    np.testing.assert_allclose(way[:, 2], -GRAVITY / 2 * times * (times + step), atol=1e-5)
    # All axes through a cube's center have the same moment, so it keeps its axis.
    turns = Rotation.from_matrix(film.rotations[: flight + 1])
    turned = (turns[0].inv() * turns).as_rotvec()
    np.testing.assert_allclose(np.linalg.norm(turned, axis=1), TABLE.spin * times, atol=1e-9)
    assert np.linalg.matrix_rank(turned, tol=1e-9) == 1


@compiled_only
@pytest.mark.parametrize("seed", range(6))
def test_the_body_falls_on_the_table_and_lies_on_a_rest(seed: int) -> None:
    body, poses = random_body(seed)
    film = throw_film(body, TABLE, seed)
    points, radius = random_points(seed), TABLE.size / 2
    first, last = (film.placed(points, poses.center_of_mass, frame) for frame in (0, -1))
    assert first[:, 2].min() == pytest.approx(TABLE.height)
    for frame in range(len(film.seconds)):
        placed = film.placed(points, poses.center_of_mass, frame)
        assert placed[:, 2].min() > -1.5 * DEEPEST * radius
    assert film.rest >= 0
    assert abs(last[:, 2].min()) < 0.01 * radius
    down = -poses.normals[film.rest] @ body.axes @ film.rotations[-1].T
    assert down[2] == pytest.approx(1.0, abs=2e-4)
    speed = np.linalg.norm(film.positions[-1] - film.positions[-2]) * FRAMES_PER_SECOND
    assert speed < 3.0 * SETTLED * np.sqrt(GRAVITY * radius)
    # It is only moved, turned and scaled.
    scale = TABLE.size / (2 * body.radius)
    for placed in (first, last):
        gram = (placed - placed[0]) @ (placed - placed[0]).T
        np.testing.assert_allclose(
            gram, scale**2 * (points - points[0]) @ (points - points[0]).T, atol=1e-12
        )
        volumes = [np.linalg.det(np.diff(p[:4], axis=0)) for p in (placed, points)]
        assert volumes[0] == pytest.approx(scale**3 * volumes[1])


@compiled_only
def test_the_length_is_typical() -> None:
    body, _ = random_body(1)
    lengths = [throw_film(body, TABLE, seed).seconds[-1] for seed in range(12)]
    assert max(lengths) < 1.7 * min(lengths)


@compiled_only
def test_a_seed_makes_the_film() -> None:
    body, _ = random_body(2)
    one, again, other = (throw_film(body, TABLE, seed) for seed in (5, 5, 6))
    np.testing.assert_array_equal(one.positions, again.positions)
    np.testing.assert_array_equal(one.quaternions, again.quaternions)
    assert one.rest == again.rest
    assert len(one.positions) != len(other.positions) or (one.positions != other.positions).any()


@compiled_only
def test_a_die_that_is_set_down_only_sinks() -> None:
    body, poses = random_body(3)
    film = throw_film(body, table_named("carpet"))
    first = film.placed(random_points(3), poses.center_of_mass, 0)
    assert first[:, 2].min() == pytest.approx(0.0, abs=1e-12)
    assert np.diff(film.positions[:, 2]).max() < 1e-6
    assert film.rest >= 0


@compiled_only
def test_a_throw_that_never_ends_is_given_up() -> None:
    body, _ = thrown(box(1, 1, 1))
    slippery = replace(TABLE, friction=0.0)
    film = throw_film(body, slippery)
    assert film.rest == -1
    assert film.seconds[-1] == pytest.approx(contact_of(slippery).seconds, abs=0.02)
    assert film.positions[-1, 0] == pytest.approx(slippery.speed * film.seconds[-1])


def test_without_kernels_there_is_no_film(monkeypatch: pytest.MonkeyPatch) -> None:
    body, _ = thrown(box(1, 1, 1))
    monkeypatch.setattr(kernels, "compiled", None)
    with pytest.raises(InputError, match="expected the compiled kernels"):
        throw_film(body, TABLE)
