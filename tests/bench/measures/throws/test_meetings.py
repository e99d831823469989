"""Dice that meet another one or a wall, in MuJoCo."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from common.thrown import BOARD, OCTAHEDRON, thrown, turn_down

from dicedesign.bench.measures.throws.meetings import BESIDE, meet
from dicedesign.throws.engines.mujoco_engine import throw_states
from dicedesign.throws.release import released

pytest.importorskip("mujoco", reason="the extra 'throws' is not installed")

TABLE = replace(BOARD, height=0.03, speed=0.5, spin=5.0)
BODY, _ = thrown(OCTAHEDRON * [1.0, 1.1, 1.2])


def states(count: int) -> np.ndarray:
    return released(BODY, TABLE, np.arange(count), "uniform", np.random.default_rng(2))


def test_a_die_alone_is_thrown_as_by_the_engine() -> None:
    """Most throws where nothing bounces, though the engine's steps are of another kind; of throws
    that have nothing to do with each other an eighth would end alike."""
    dead = replace(TABLE, restitution=0.0, speed=0.0, spin=0.0)
    let_go = states(20)
    let_go[:, 7:] = 0.0
    found = meet(BODY, dead, let_go[:, None], None)
    assert (found.rests[:, 0] == throw_states(BODY, dead, let_go)).sum() >= 14
    assert not found.touched.any()


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_dice_that_fly_at_each_other_touch_and_others_do_not(way: float) -> None:
    pairs = states(8).reshape(4, 2, 13)
    pairs[:, 1, 0] += way * BESIDE * TABLE.size
    pairs[:, 1, 7] *= -1.0
    found = meet(BODY, TABLE, pairs, "die")
    assert found.touched.tolist() == [way > 0.0] * 4
    assert found.rests.min() >= 0


@pytest.mark.parametrize("speed", [1.5, -1.5])
def test_dice_touch_the_wall_that_they_fly_at(speed: float) -> None:
    towards = states(6)[:, None]
    towards[:, 0, 7] = speed
    found = meet(BODY, TABLE, towards, "wall")
    assert found.touched.tolist() == [speed > 0.0] * 6


def test_a_die_that_lies_is_followed_while_another_comes() -> None:
    """One at rest, that a fast one hits above the middle, ends on other faces."""
    pairs = states(12).reshape(6, 2, 13)
    alone = meet(BODY, TABLE, pairs[:, 1:], None).rests[:, 0]
    ways = np.linspace(0.0, 1.0, 6)
    # Where it ended without company: on the side on which it lies, and nowhere else.
    for pair, rest, part in zip(pairs, alone, ways, strict=True):
        pair[1] = lying(rest)
        pair[0, :3] = -0.04, 0.004 * (part - 0.5), 1.5 * pair[1, 2]
        pair[0, 7] = 2.0
    fast = replace(TABLE, speed=2.0)
    still = meet(BODY, fast, pairs[:, 1:], None).rests[:, 0]
    assert still.tolist() == alone.tolist()
    found = meet(BODY, fast, pairs, "die")
    hit, missed = found.touched, ~found.touched
    assert 3 <= hit.sum() < 6
    assert found.rests[missed, 1].tolist() == alone[missed].tolist()
    assert (found.rests[hit, 1] != alone[hit]).any()


def lying(rest: int) -> np.ndarray:
    """The state of a die at rest."""
    state = np.zeros(13)
    state[2] = BODY.rest_heights[rest] * TABLE.size / 2.0
    state[3:7] = turn_down(BODY.rest_normals[rest])
    return state
