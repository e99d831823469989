"""Impulses of an impact at one point under Coulomb friction and with energetic restitution: closed
form for slip along a line, integration for slip that turns.

The slip s and the normal velocity v of the point change with the normal impulse p by ds/dp = B +
A f and dv/dp = c + B f, for friction f per normal impulse and the response K = [[A, B], [B, c]] of
the point's velocity to an impulse. Sources: Keller, Impact with friction, Journal of Applied
Mechanics 53, 1986; Stronge, Rigid body collisions with friction, Proceedings of the Royal Society A
431, 1990.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

ODE_TOLERANCE = 1e-10
"""Relative and absolute, of velocities in units of the approach."""

SLIP_END = 1e-7
"""Slip, in units of the approach, below which a point no longer slips."""

DIRECTIONS = 720
"""Of slip, among which those are sought in which it grows from zero."""


def response_of(
    vertex: np.ndarray, moments: np.ndarray, turn: np.ndarray, mass: float = 1.0
) -> np.ndarray:
    """Response (3, 3) in the world's axes of a vertex (3,) of a body with principal moments (3,)
    and the rotation `turn` (3, 3) from principal axes to the world."""
    x, y, z = vertex
    arm = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) / mass + turn @ (arm @ np.diag(1.0 / moments) @ arm.T) @ turn.T


def planar_impulse(
    response: np.ndarray, velocity: np.ndarray, restitution: float, friction: float
) -> np.ndarray:
    """Impulse (3,) on a point that slips in the x-z plane and stays there: velocity and response
    have no part along y that would turn it.

    The slip changes linearly until it is zero, at the normal impulse p1, and then stays zero or
    grows the other way. So the normal velocity has two linear pieces, and its work two parabolas.
    """
    a, b, c = response[0, 0], response[0, 2], response[2, 2]
    slip, approach = velocity[0], velocity[2]
    before = -friction * math.copysign(1.0, slip)
    after = -b / a if abs(b) <= friction * a else -friction * math.copysign(1.0, b)
    slowing = b + a * before
    stops = slip == 0.0 or slip * slowing < 0.0
    p1 = (0.0 if slip == 0.0 else -slip / slowing) if stops else math.inf
    first, second = c + b * before, c + b * after

    def speed(p: float) -> float:
        return approach + first * min(p, p1) + second * max(p - p1, 0.0)

    def work(p: float) -> float:
        q = min(p, p1)
        return (approach + speed(q)) / 2.0 * q + (speed(q) + speed(p)) / 2.0 * (p - q)

    def root(function: Callable[[float], float], least: float) -> float:
        """Normal impulse beyond `least` at which a growing function is zero."""
        most = least + 1.0
        while function(most) < 0.0:
            most = 2.0 * most
        return float(brentq(function, least, most, xtol=1e-15, rtol=1e-14))

    # In a jam the approach first grows.
    jam = p1 if first <= 0.0 and stops else 0.0
    compressed = root(speed, jam)
    wanted = (1.0 - restitution**2) * work(compressed)
    ended = root(lambda p: work(p) - wanted, compressed) if restitution > 0.0 else compressed
    pushed = before * min(ended, p1) + after * max(ended - p1, 0.0)
    return np.array([pushed, 0.0, ended])


def _held_friction(response: np.ndarray, friction: float) -> np.ndarray:
    """Friction (2,) per normal impulse on a point without slip: what keeps it there, or opposite to
    the direction in which slip grows, found among all directions."""
    along, aside = response[:2, :2], response[:2, 2]
    sticking = -np.linalg.solve(along, aside)
    if np.linalg.norm(sticking) <= friction:
        return sticking

    def change(angle: float) -> np.ndarray:
        return aside - friction * along @ [math.cos(angle), math.sin(angle)]

    def turning(angle: float) -> float:
        return float(change(angle) @ [-math.sin(angle), math.cos(angle)])

    # In symmetric cases a root is at a multiple of a right angle.
    angles = 0.5 + np.linspace(-math.pi, math.pi, DIRECTIONS + 1)
    values = np.array([turning(angle) for angle in angles])
    for i in np.flatnonzero(values[:-1] * values[1:] <= 0.0):
        angle = brentq(turning, angles[i], angles[i + 1], xtol=1e-14)
        direction = np.array([math.cos(angle), math.sin(angle)])
        if change(angle) @ direction > 0.0:
            return -friction * direction
    raise AssertionError("no direction in which slip grows")


def turning_impulse(
    response: np.ndarray, velocity: np.ndarray, restitution: float, friction: float
) -> np.ndarray:
    """Impulse (3,) on a point whose slip may turn, by integration over the normal impulse."""
    scale = -velocity[2]
    along, aside, normal = response[:2, :2], response[:2, 2], response[2, 2]
    held = _held_friction(response, friction)

    def rates(_p: float, state: np.ndarray) -> np.ndarray:
        slip, size = state[:2], np.linalg.norm(state[:2])
        force = -friction * slip / size if is_sliding else held
        return np.array([*(aside + along @ force), normal + aside @ force, state[2], *force])

    def slows(_p: float, state: np.ndarray) -> float:
        return float(np.linalg.norm(state[:2]) - SLIP_END * scale)

    def stops(_p: float, state: np.ndarray) -> float:
        return float(state[2])

    def leaves(_p: float, state: np.ndarray) -> float:
        return float(state[3] - wanted)

    slows.terminal, slows.direction = True, -1.0  # type: ignore[attr-defined]
    stops.terminal, stops.direction = True, 1.0  # type: ignore[attr-defined]
    leaves.terminal, leaves.direction = True, 1.0  # type: ignore[attr-defined]
    # Slip (2), normal velocity, its work and friction's impulse (2).
    state = np.array([*velocity, 0.0, 0.0, 0.0])
    grown, wanted = 0.0, 0.0
    is_sliding = bool(friction > 0.0 and np.linalg.norm(velocity[:2]) > SLIP_END * scale)
    most = 1e3 * scale
    for ends in (stops, leaves):
        while restitution > 0.0 or ends is stops:
            events = [ends, slows] if is_sliding else [ends]
            solution = solve_ivp(
                rates,
                (grown, grown + most),
                state,
                "DOP853",
                events=events,
                rtol=ODE_TOLERANCE,
                atol=ODE_TOLERANCE * scale,
            )
            grown, state = float(solution.t[-1]), solution.y[:, -1]
            if len(solution.t_events[0]) > 0:
                break
            # Friction is constant from here on, along the line in which slip grows.
            is_sliding = False
        wanted = (1.0 - restitution**2) * state[3]
    return np.array([state[4], state[5], grown])
