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
from scipy.spatial.transform import Rotation

from dicedesign.throws.engines import advance, throw_states, time_step
from dicedesign.throws.rigid_body import RigidBody
from dicedesign.throws.tables import GRAVITY, Table, load_table
from tests.reference.impacts import planar_impulse, turning_impulse
from tests.reference.strikes import (
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
    surface=st.tuples(st.floats(0.0, 0.95), st.floats(0.0, 2.0)),
    motion=st.tuples(st.floats(0.0, 3.0), st.floats(0.0, 200.0)),
    drag=st.sampled_from([0.0, 0.0, 3.0, 1000.0]),
    drop=st.integers(0, 2**20),
)
@settings(deadline=None, max_examples=30)
def test_energy_never_grows(
    seed: int, surface: tuple[float, float], motion: tuple[float, float], drag: float, drop: int
) -> None:
    body, _ = random_body(seed)
    table = Table("any", *surface, 0.03, *motion, drag=drag)
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


def stand_on_edge(
    body: RigidBody, table: Table, angle: float
) -> tuple[np.ndarray, Rotation, float, float]:
    """State (1, 13) of a long body on an edge along its side, leaning by an angle towards +x; its
    turn, the distance of the center of mass from the edge, and the moment of inertia about the
    side."""
    scale = table.size / 2.0
    # Turns about the body's longest side are the easiest.
    axis = int(np.argmin(body.moments))
    corner = body.vertices[0] * (np.arange(3) != axis)
    radius = float(np.linalg.norm(corner))
    up = np.array([math.sin(angle), 0.0, math.cos(angle)])
    frame = np.stack([-corner / radius, np.eye(3)[axis]])
    turn = Rotation.align_vectors([up, [0.0, 1.0, 0.0]], frame)[0]
    height = -scale * turn.apply(body.vertices)[:, 2].min()
    state = state_of(np.array([0.0, 0.0, height]), turn, np.zeros(3))
    return state, turn, radius * scale, float(body.moments[axis]) * scale**2


def turned_by(state: np.ndarray, turn: Rotation) -> np.ndarray:
    """Rotation vector (3,) in the world from a turn to a state (1, 13)."""
    after = Rotation.from_quat(state[0, 3:7], scalar_first=True)
    turned: np.ndarray = (after * turn.inv()).as_rotvec()
    return turned


@pytest.mark.parametrize(("friction", "seconds"), [(0.0, 0.06), (2.0, 0.09)])
def test_a_block_tips_about_its_edge(friction: float, seconds: float) -> None:
    """As a pendulum on its edge, or with its center of mass on a vertical line."""
    body, _ = rigid_body_with_rests(box(0.5, 0.4, 1.0))
    table, started = replace(BOARD, friction=friction, restitution=0.5, size=0.05), 0.1
    state, turn, radius, moment = stand_on_edge(body, table, started)
    advance_time(body, table, state, seconds)
    aside, angle, yaw = turned_by(state, turn)
    assert 0.2 < angle < 0.6
    np.testing.assert_allclose([aside, yaw], 0.0, atol=1e-3)
    ended = started + angle
    fallen = GRAVITY * radius * (math.cos(started) - math.cos(ended))
    moving = radius if friction > 0.0 else radius * math.sin(ended)
    spin = math.sqrt(2.0 * fallen / (moment + moving**2))
    assert np.linalg.norm(state[0, 10:]) == pytest.approx(spin, rel=MOTION_ERROR)
    way = radius * (math.sin(ended) - math.sin(started)) if friction > 0.0 else 0.0
    assert state[0, 0] == pytest.approx(way, rel=MOTION_ERROR, abs=1e-6)


def test_a_prism_rolls_on_its_edges() -> None:
    """Without restitution each edge takes the angular momentum about it that the last one had."""
    angles = 2.0 * math.pi * np.arange(SIDES) / SIDES
    rim = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    points = np.concatenate([np.column_stack([rim, np.full(SIDES, z)]) for z in (-1.2, 1.2)])
    body, _ = rigid_body_with_rests(points)
    table, edges = replace(BOARD, friction=1.0, restitution=0.0, size=0.05), 8
    state, turn, radius, moment = stand_on_edge(body, table, 0.0)
    spin = 0.6 * math.sqrt(GRAVITY / radius)
    state[0, 7], state[0, 10:] = spin * radius, turn.inv().apply([0.0, spin, 0.0])
    whole = moment + radius**2
    kept = (moment + radius**2 * math.cos(2.0 * math.pi / SIDES)) / whole
    gained = 2.0 * GRAVITY * radius * (1.0 - math.cos(math.pi / SIDES)) / whole
    for _ in range(edges):
        # It falls from one edge, lands on the next and rises on it.
        spin = math.sqrt(kept**2 * (spin**2 + gained) - gained)
    while state[0, 0] < edges * 2.0 * radius * math.sin(math.pi / SIDES):
        assert state[0, 7] > 0.0
        advance(unstopped(body), table, state, 1)
    assert np.linalg.norm(state[0, 10:]) == pytest.approx(spin, rel=MOTION_ERROR)
    rolled = edges * 2.0 * math.pi / SIDES
    np.testing.assert_allclose(turned_by(state, turn), [0.0, rolled, 0.0], atol=MOTION_ERROR)


def test_probabilities_do_not_depend_on_the_step() -> None:
    body, table = rigid_body_with_rests(random_points(3))[0], load_table("board-game")
    counts = []
    for seed, refinement in enumerate((1.0, 2.0)):
        rests = throw_states(body, table, sample_states(body, table, 1500, seed), refinement)
        counts.append(np.bincount(rests[rests >= 0], minlength=len(body.rest_heights)))
    assert alike(*counts) > 1e-3
