"""Tests of physics that any law of hard contacts must pass: impacts with friction against closed
forms and an independent integration, conservation of energy, sliding, tipping and rolling.

`python -m benchmarks thrown --part contacts` prints how far other simulators are from them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from common.kernels import compiled_only
from common.thrown import (
    BOARD,
    OCTAHEDRON,
    alike,
    box,
    random_body,
    random_points,
    rigid_body_with_rests,
    sample_states,
    turns_of,
)
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad, solve_ivp
from scipy.spatial.transform import Rotation

from dicedesign.throws.engines import advance, throw_states, time_step
from dicedesign.throws.rigid_body import RigidBody
from dicedesign.throws.tables import GRAVITY, Table, load_table
from tests.reference.impacts import planar_impulse, turning_impulse
from tests.reference.strikes import (
    STRIKES,
    Strike,
    faceted_ball,
    lean,
    needle,
    strike_natively,
    unstopped,
)

pytestmark = compiled_only

SLIPS = (0.0, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
"""In units of the approach."""

FRICTIONS = (0.0, 0.1, 0.3, 0.6, 1.0)

RESTITUTIONS = (0.0, 0.25, 0.5, 0.75, 0.95)

PLANAR_ERROR = 1e-5
"""Of an impulse whose slip keeps its line, per approach. Gravity during the first time step and
rounding of the body's shape leave less."""

TURNING_ERROR = 0.01
"""Of an impulse whose slip turns, per approach; the median is a hundredth of it."""

ENERGY_ROUNDING = 1e-12
"""Relative to the energy at release."""

SIDES = 24
"""Of a prism that rolls."""

MOTION_ERROR = 0.02
"""Of a distance, an angle or a speed on the table, relative to it. It shrinks with the step."""


def advance_time(body: RigidBody, table: Table, states: np.ndarray, seconds: float) -> None:
    """Move a body for some time, whatever its energy is."""
    step = time_step(table)
    steps = math.ceil(seconds / step)
    advance(unstopped(body), table, states, steps, steps * step / seconds)


def energies(body: RigidBody, table: Table, states: np.ndarray) -> np.ndarray:
    """(n,) of a body of mass 1."""
    spins = table.size / 2.0 * states[:, 10:]
    moving = (states[:, 7:10] ** 2).sum(axis=1) + spins**2 @ body.moments
    energy: np.ndarray = GRAVITY * states[:, 2] + 0.5 * moving
    return energy


def state_of(position: np.ndarray, turn: Rotation, velocity: np.ndarray) -> np.ndarray:
    """State (1, 13) of a body without spin."""
    return np.concatenate([position, turn.as_quat(scalar_first=True), velocity, np.zeros(3)])[None]


@pytest.mark.parametrize("engine", STRIKES)
@pytest.mark.parametrize("restitution", [0.2, 0.8])
def test_impact_without_slip_or_coupling(engine: str, restitution: float) -> None:
    if engine == "mujoco":
        pytest.importorskip("mujoco", reason="the extra 'bench' is not installed")
    body, vertex = faceted_ball()
    strike = Strike(body, vertex, lean(body, vertex, 0.0), np.zeros(2), restitution, 0.5)
    impulse = STRIKES[engine](strike)
    assert impulse[2] == pytest.approx(1.0 + restitution, abs=0.01)
    np.testing.assert_allclose(impulse[:2], 0.0, atol=1e-6)


@pytest.mark.parametrize(
    ("made", "angle"),
    [(faceted_ball, 0.0), (needle, 0.2), (needle, 0.8), (needle, -0.5), (needle, -1.2)],
)
def test_oblique_impact(made: Callable[[], tuple[RigidBody, int]], angle: float) -> None:
    """It sticks, slides or slips back as in the plane."""
    body, vertex = made()
    turn = lean(body, vertex, angle)
    for slip, friction, restitution in product(SLIPS, FRICTIONS, RESTITUTIONS):
        strike = Strike(body, vertex, turn, np.array([slip, 0.0]), restitution, friction)
        wanted = planar_impulse(strike.response, strike.velocity, restitution, friction)
        np.testing.assert_allclose(strike_natively(strike), wanted, atol=PLANAR_ERROR)


def test_slip_that_turns() -> None:
    """Of random bodies on random vertices, against integration over the normal impulse."""
    rng, errors = np.random.default_rng(1), []
    for number in range(40):
        body, _ = random_body(1 + number % 4)
        turn = Rotation.random(random_state=rng.integers(1000))
        vertex = int(np.argmin(turn.apply(body.vertices)[:, 2]))
        slip = rng.normal(size=2) * rng.choice([0.1, 1.0, 4.0])
        strike = Strike(body, vertex, turn, slip, rng.uniform(0.0, 0.95), rng.uniform(0.0, 1.0))
        wanted = turning_impulse(
            strike.response, strike.velocity, strike.restitution, strike.friction
        )
        errors.append(np.linalg.norm(strike_natively(strike) - wanted))
    assert max(errors) < TURNING_ERROR
    assert np.median(errors) < 0.01 * TURNING_ERROR


@given(
    seed=st.integers(0, 6),
    restitution=st.floats(0.0, 0.95),
    friction=st.floats(0.0, 2.0),
    speed=st.floats(0.0, 3.0),
    spin=st.floats(0.0, 200.0),
    drag=st.sampled_from([0.0, 0.0, 3.0, 1000.0]),
    drop=st.integers(0, 2**20),
)
@settings(deadline=None, max_examples=50)
def test_energy_never_grows(
    seed: int,
    restitution: float,
    friction: float,
    speed: float,
    spin: float,
    drag: float,
    drop: int,
) -> None:
    body, _ = random_body(seed)
    table = Table("any", restitution, friction, height=0.03, speed=speed, spin=spin, drag=drag)
    state = sample_states(body, table, 1, drop)
    before = energies(body, table, state)[0]
    rounding = ENERGY_ROUNDING * before
    for _ in range(400):
        advance(unstopped(body), table, state, 1)
        after = energies(body, table, state)[0]
        assert after <= before + rounding
        before = after
    heights = state[0, 2] + table.size / 2.0 * (turns_of(state)[0] @ body.vertices.T)[2]
    assert heights.min() > -0.01 * table.size


def test_energy_where_friction_hardly_stops_a_slip() -> None:
    """The slip of a rod almost stops, and would turn at once: friction kept constant for a part of
    the impact would add a quarter to the energy or more."""
    octahedron, _ = rigid_body_with_rests(OCTAHEDRON)
    end = np.array([-0.68, 0.17, -0.715])
    rod = replace(
        octahedron,
        vertices=np.linspace(1.0, -1.0, 6)[:, None] * end / np.linalg.norm(end),
        moments=np.array([0.143, 0.1425, 0.0013]),
    )
    turn = Rotation.from_quat([-0.34, 0.76, -0.35, -0.43], scalar_first=True)
    vertex = int(np.argmin(turn.apply(rod.vertices)[:, 2]))
    response = Strike(rod, vertex, turn, np.zeros(2), 0.95, 0.0).response
    force = -np.linalg.solve(response[:2, :2], response[:2, 2])
    heading = Rotation.from_rotvec([0.0, 0.0, 3e-6]).apply([*-force, 0.0])[:2]
    strike = Strike(
        rod,
        vertex,
        turn,
        6e-4 * heading / np.linalg.norm(heading),
        restitution=0.95,
        friction=(1.0 + 2e-6) * float(np.linalg.norm(force)),
    )
    impulse = strike_natively(strike)
    assert impulse @ (strike.velocity + 0.5 * strike.response @ impulse) <= 0.0


@pytest.mark.parametrize("friction", [0.1, 0.4])
def test_a_block_slides_to_a_stop(friction: float) -> None:
    """After speed^2 / (2 mu g), straight ahead, and stays there."""
    body, _ = rigid_body_with_rests(box(1.0, 0.9, 0.2))
    table = replace(BOARD, friction=friction, restitution=0.3, size=0.05)
    speed = 0.5
    height = -table.size / 2.0 * body.vertices.min(axis=0)
    flat = Rotation.align_vectors([[0.0, 0.0, 1.0]], [np.eye(3)[np.argmin(height)]])[0]
    heading = np.array([math.cos(0.7), math.sin(0.7), 0.0])
    state = state_of(np.array([0.0, 0.0, height.min()]), flat, speed * heading)
    for _ in range(2):
        advance_time(body, table, state, 1.2 * speed / (friction * GRAVITY))
        distance = speed**2 / (2.0 * friction * GRAVITY)
        np.testing.assert_allclose(
            state[0, :2], distance * heading[:2], rtol=MOTION_ERROR, atol=1e-4
        )
        np.testing.assert_allclose(state[0, 7:10], 0.0, atol=0.01)
        turn = Rotation.from_quat(state[0, 3:7], scalar_first=True)
        assert (turn * flat.inv()).magnitude() < 0.01


@pytest.mark.parametrize("friction", [0.0, 2.0])
def test_a_block_tips_about_its_edge(friction: float) -> None:
    """As a pendulum on its edge, or with its center of mass on a vertical line."""
    body, _ = rigid_body_with_rests(box(0.5, 0.4, 1.0))
    table = replace(BOARD, friction=friction, restitution=0.5, size=0.05)
    vertices, moments = body.vertices * table.size / 2.0, body.moments * (table.size / 2.0) ** 2
    # Turns about the body's longest side are the easiest; the edge is along it.
    axis = int(np.argmin(moments))
    corner = vertices[0] * (np.arange(3) != axis)
    radius = float(np.linalg.norm(corner))
    started, ended = 0.1, 0.5

    def speed(angle: float) -> float:
        fallen = GRAVITY * radius * (math.cos(started) - math.cos(angle))
        moving = radius**2 if friction > 0.0 else (radius * math.sin(angle)) ** 2
        return math.sqrt(2.0 * fallen / (moments[axis] + moving))

    # The speed grows like a root: substitute angle = started + x^2.
    seconds = quad(lambda x: 2.0 * x / speed(started + x**2), 0.0, math.sqrt(ended - started))[0]
    up = np.array([-math.sin(started), 0.0, math.cos(started)])
    frame = np.stack([-corner / radius, np.eye(3)[axis]])
    upright = Rotation.align_vectors([up, [0.0, 1.0, 0.0]], frame)[0]
    height = -upright.apply(vertices)[:, 2].min()
    state = state_of(np.array([0.0, 0.0, height]), upright, np.zeros(3))
    advance_time(body, table, state, seconds)
    turned = Rotation.from_quat(state[0, 3:7], scalar_first=True) * upright.inv()
    assert turned.magnitude() == pytest.approx(ended - started, rel=MOTION_ERROR)
    np.testing.assert_allclose(np.abs(turned.as_rotvec()[[0, 2]]), 0.0, atol=1e-3)


def test_a_prism_rolls_on_its_edges() -> None:
    """Without restitution each edge takes the angular momentum about it that the last one had."""
    angles = 2.0 * math.pi * np.arange(SIDES) / SIDES
    rim = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    points = np.concatenate([np.column_stack([rim, np.full(SIDES, z)]) for z in (-0.6, 0.6)])
    body, _ = rigid_body_with_rests(points)
    table = replace(BOARD, friction=1.0, restitution=0.0, size=0.05)
    scale = table.size / 2.0
    vertices = body.vertices * scale
    axis = next(i for i in range(3) if len(np.unique(np.abs(vertices[:, i]).round(9))) == 1)
    radius = float(np.linalg.norm(np.delete(vertices[0], axis)))
    moment = body.moments[axis] * scale**2
    kept = (moment + radius**2 * math.cos(2.0 * math.pi / SIDES)) / (moment + radius**2)
    corner = vertices[0] * (np.arange(3) != axis)
    upright = Rotation.align_vectors(
        [[0.0, 0.0, -1.0], [0.0, 1.0, 0.0]], [corner / radius, np.eye(3)[axis]]
    )[0]
    spin = 0.6 * math.sqrt(GRAVITY / radius)
    state = state_of(np.array([0.0, 0.0, radius]), upright, np.array([spin * radius, 0.0, 0.0]))
    state[0, 10:] = spin * np.eye(3)[axis]

    # Upright on one edge after the other: the angle from edge to edge at the pendulum's speed.
    def swing(_time: float, y: np.ndarray) -> list[float]:
        return [y[1], GRAVITY * radius * math.sin(y[0]) / (moment + radius**2)]

    def lands(_time: float, y: np.ndarray) -> float:
        return float(y[0] - math.pi / SIDES)

    lands.terminal = True  # type: ignore[attr-defined]
    seconds, pendulum, edges = 0.0, np.array([0.0, spin]), 8
    for _ in range(edges):
        done = solve_ivp(swing, (0.0, 10.0), pendulum, events=lands, rtol=1e-9, atol=1e-12)
        seconds += float(done.t[-1])
        pendulum = np.array([-math.pi / SIDES, kept * done.y[1, -1]])
    half = solve_ivp(
        swing,
        (0.0, 10.0),
        pendulum,
        events=lambda _time, y: float(y[0]),
        rtol=1e-9,
        atol=1e-12,
        max_step=1e-3,
    )
    seconds += float(half.t_events[0][0])
    advance_time(body, table, state, seconds)
    rolled = edges * 2.0 * math.pi / SIDES
    assert state[0, 0] / radius == pytest.approx(
        edges * 2.0 * math.sin(math.pi / SIDES), rel=MOTION_ERROR
    )
    assert np.linalg.norm(state[0, 10:]) == pytest.approx(half.y_events[0][0, 1], rel=MOTION_ERROR)
    turned = Rotation.from_quat(state[0, 3:7], scalar_first=True) * upright.inv()
    assert turned.magnitude() == pytest.approx(rolled, rel=MOTION_ERROR)


def test_turned_about_the_vertical_or_scaled() -> None:
    """A turned throw stays a turned one, and a larger body moves as the square root of its size
    faster, until rounding has grown."""
    body, table = random_body(3)[0], load_table("hard-wood")
    states, seconds = sample_states(body, table, 40), 0.14
    first = states.copy()
    advance_time(body, table, first, seconds)

    yaw = Rotation.from_rotvec([0.0, 0.0, 1.1])
    turned = states.copy()
    turned[:, :3], turned[:, 7:10] = yaw.apply(states[:, :3]), yaw.apply(states[:, 7:10])
    turns = Rotation.from_quat(states[:, 3:7], scalar_first=True)
    turned[:, 3:7] = (yaw * turns).as_quat(scalar_first=True)
    advance_time(body, table, turned, seconds)
    assert (np.abs(first[:, 10:] - states[:, 10:]).max(axis=1) > 1.0).mean() > 0.9
    error = np.abs(turned[:, 10:] - first[:, 10:]).max(axis=1) / np.abs(first[:, 10:]).max()
    assert np.quantile(error, 0.9) < 1e-6

    factor = 9.0
    larger = replace(table, size=factor * table.size, height=1.0)
    scaled = states.copy()
    scaled[:, :3] *= factor
    scaled[:, 7:10] *= math.sqrt(factor)
    scaled[:, 10:] /= math.sqrt(factor)
    advance_time(body, larger, scaled, math.sqrt(factor) * seconds)
    back = scaled[:, 10:] * math.sqrt(factor)
    error = np.abs(back - first[:, 10:]).max(axis=1) / np.abs(first[:, 10:]).max()
    assert np.quantile(error, 0.9) < 1e-6


def test_probabilities_do_not_depend_on_the_step() -> None:
    body, table = rigid_body_with_rests(random_points(3))[0], load_table("board-game")
    counts = []
    for seed, refinement in enumerate((1.0, 2.0)):
        rests = throw_states(body, table, sample_states(body, table, 1500, seed), refinement)
        counts.append(np.bincount(rests[rests >= 0], minlength=len(body.rest_heights)))
    assert alike(*counts) > 1e-3
