"""Reach of cavities in a cube, against a closed form."""

from __future__ import annotations

import numpy as np
import pytest
from common.dented_cube import dented_cube

from dicedesign.concave.hollow.reach import reach
from dicedesign.errors import InputError


def farthest(half: float) -> float:
    """Shift x along an edge of a cube of side 2 with all hollow of an inner one, of half its side
    as given, that lies behind the center of mass which it then has: the moment of the cube about
    that, 8 x, is what the hollow takes away."""
    x = 0.0
    for _ in range(100):
        x = 4.0 * half**2 * (half + x) ** 2 / 16.0
    return x


@pytest.mark.parametrize("wall", [0.2, 0.5])
def test_reach_in_a_cube_along_its_edges(wall: float) -> None:
    expected = farthest(1.0 - wall)
    shifts = reach(dented_cube(0.0), wall)
    for direction in np.concatenate([np.eye(3), -np.eye(3)]):
        most = float((shifts.vertices @ direction).max())
        assert 0.75 * expected < most < 1.03 * expected


def test_part_of_it() -> None:
    whole, half = (reach(dented_cube(0.0), 0.3, part) for part in (1.0, 0.5))
    assert half.diameter == pytest.approx(0.5 * whole.diameter, rel=1e-12)


def test_walls_that_leave_no_room() -> None:
    with pytest.raises(InputError, match="hollow: expected walls that leave room for cavities"):
        reach(dented_cube(0.0), 1.1)
