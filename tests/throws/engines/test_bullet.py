"""Bullet: what it is told of a die, and its odds beside those of the package's own engine."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest
from common.kernels import compiled_only
from common.thrown import (
    BOARD,
    OCTAHEDRON,
    alike,
    box,
    fits,
    random_body,
    thrown,
    turn_down,
)

from dicedesign.errors import InputError
from dicedesign.throws import bullet_engine
from dicedesign.throws.bullet_engine import STEP, throw_states
from dicedesign.throws.release import released
from dicedesign.throws.rigid_body import RigidBody
from dicedesign.throws.simulation import simulate
from dicedesign.throws.tables import Table, table_named

CARPET = table_named("carpet")
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


@pytest.fixture
def bullet() -> None:
    pytest.importorskip("pybullet", reason="the extra 'bullet' is not installed")


def let_go(body: RigidBody, table: Table, drops: int) -> np.ndarray:
    return released(body, table, np.arange(drops), "uniform", np.random.default_rng(0))


@pytest.mark.usefixtures("bullet")
@pytest.mark.parametrize("restitution", [0.0, 0.3, 0.5, 0.8])
def test_a_ball_bounces(restitution: float) -> None:
    """An octahedron that falls straight onto a vertex comes up to the square of that, of the
    height."""
    body, _ = thrown(OCTAHEDRON)
    with bullet_engine._scene(body, replace(BOARD, restitution=restitution), STEP) as scene:
        scene.release(
            np.array([0.0, 0.0, 9.0]), turn_down(body.vertices[0]), np.zeros(3), np.zeros(3)
        )
        energies = []
        for _ in range(int(5.0 / STEP)):
            scene.advance(1, None)
            energies.append(scene.state()[1] - 1.0)
    assert energies[100] == pytest.approx(8.0, rel=0.01)
    assert energies[-1] == pytest.approx(8.0 * restitution**2, rel=0.02, abs=1e-3)


@pytest.mark.usefixtures("bullet")
@pytest.mark.parametrize("restitution", [0.5, 0.8])
@pytest.mark.parametrize("refinement", [1.0, 4.0])
def test_a_slow_bounce_keeps_its_restitution(restitution: float, refinement: float) -> None:
    """From half a radius, with finer steps as well. Of points that count as touching before they
    do, Bullet lets only part of the speed bounce."""
    body, _ = thrown(OCTAHEDRON)
    step = STEP / refinement
    with bullet_engine._scene(body, replace(BOARD, restitution=restitution), step) as scene:
        scene.release(
            np.array([0.0, 0.0, 1.5]), turn_down(body.vertices[0]), np.zeros(3), np.zeros(3)
        )
        scene.advance(round(1.3 / step), None)
        bounced = scene.state()[1] - 1.0
    assert bounced == pytest.approx(0.5 * restitution**2, rel=0.06)


@pytest.mark.usefixtures("bullet")
@pytest.mark.parametrize("friction", [0.0, 0.1, 0.3])
@pytest.mark.parametrize("degrees", [0.0, 30.0])
def test_a_cube_slides(friction: float, degrees: float) -> None:
    """In units in which gravity is 1 it loses as much speed in a unit of time as friction is."""
    body, _ = thrown(box(1.0, 1.0, 1.0))
    table = replace(BOARD, friction=friction, restitution=0.0)
    direction = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees)), 0.0])
    with bullet_engine._scene(body, table, STEP) as scene:
        turn = turn_down(body.rest_normals[0])
        scene.release(np.array([0.0, 0.0, body.rest_heights[0]]), turn, direction, np.zeros(3))
        scene.advance(round(1.0 / STEP), None)
        assert scene.state()[2] == pytest.approx(1.0 - friction, abs=0.01)


@pytest.mark.usefixtures("bullet")
def test_the_inertia_is_the_bodys() -> None:
    """Spin about the axis of the middle moment turns over, with the energy that the moments give;
    those of the hull's box would be others."""
    body, _ = random_body(2)
    high = np.array([0.0, 0.0, 1e4])
    spin = np.array([0.02, 2.0, 0.02])
    with bullet_engine._scene(body, BOARD, STEP / 16.0) as scene:
        scene.release(high, UPRIGHT, np.zeros(3), spin)
        momentum = body.moments * spin
        for _ in range(4):
            scene.advance(4000, None)
            turn, about = scene.turn(), scene.spin()
            np.testing.assert_allclose(
                turn @ (body.moments * about), momentum, atol=0.02 * np.linalg.norm(momentum)
            )
            assert about**2 @ body.moments == pytest.approx(spin**2 @ body.moments, rel=0.02)


@pytest.mark.usefixtures("bullet")
def test_drag_slows_every_axis_by_its_moment() -> None:
    """The torque over the angular velocity is the drag times the mean moment."""
    body, _ = random_body(2)
    kept = np.array([0.9, 0.8, 0.7])
    spin = np.array([1e-3, 2e-3, 3e-3])
    with bullet_engine._scene(body, BOARD, STEP) as scene:
        scene.release(np.array([0.0, 0.0, 1e4]), UPRIGHT, np.zeros(3), spin)
        scene.advance(10, kept)
        np.testing.assert_allclose(scene.spin(), spin * kept**10, rtol=1e-3)


@compiled_only
@pytest.mark.usefixtures("bullet")
def test_frequencies() -> None:
    """Contacts are hard here and soft there, which a box hardly feels."""
    body, _ = thrown(box(1.0, 1.15, 1.3))
    ours = simulate(body, BOARD, 2000, 1).counts
    theirs = simulate(body, BOARD, 150, 2, engine="bullet")
    assert theirs.unresolved == 0
    # Opposite sides together.
    assert alike(ours.reshape(3, 2).sum(axis=1), theirs.counts.reshape(3, 2).sum(axis=1)) > 1e-3


@pytest.mark.usefixtures("bullet")
def test_without_momentum_odds_are_the_geometric_ones() -> None:
    body, poses = thrown(OCTAHEDRON * [1.0, 1.1, 1.2] + [0.0, 0.0, 0.1])
    throws = simulate(body, CARPET, 100, 3, engine="bullet")
    assert throws.unresolved == 0
    assert fits(throws.counts, poses.probabilities) > 1e-3


@pytest.mark.usefixtures("bullet")
def test_each_drop_is_its_own() -> None:
    """Nothing is left of those before it."""
    body, _ = random_body(3)
    states = let_go(body, BOARD, 12)
    together = throw_states(body, BOARD, states)
    alone = [int(throw_states(body, BOARD, state[None])[0]) for state in states]
    assert together.tolist() == alone


@pytest.mark.usefixtures("bullet")
def test_a_body_at_a_stand(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where its energy proves nothing, the facet that it stands on is its rest."""
    body, _ = thrown(box(1.0, 1.1, 1.2))
    states = let_go(body, BOARD, 6)
    rests = throw_states(body, BOARD, states)
    monkeypatch.setattr(bullet_engine, "final_rest", lambda *_: -1)
    np.testing.assert_array_equal(throw_states(body, BOARD, states), rests)
    with bullet_engine._scene(body, BOARD, STEP) as scene:
        for degrees, rest in ((0.5, 0), (1.5, -1), (45.0, -1)):
            tilt = np.tan(np.radians(degrees)) * body.rest_normals[2]
            assert scene._standing(body.rest_normals[0] + tilt) == rest


def test_without_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pybullet", None)
    body, _ = random_body(1)
    with pytest.raises(InputError, match=r"engine bullet: expected the optional extra 'bullet'"):
        throw_states(body, BOARD, let_go(body, BOARD, 1))
