"""Places on a floor: inside it, apart from each other, and how many there are."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from manifold3d import CrossSection

from dicedesign.scenes.footprints import Footprint
from dicedesign.scenes.packing import fitting_floor, pack


def polygons(count: int, seed: int) -> list[Footprint]:
    rng = np.random.default_rng(seed)
    return [
        Footprint.under(rng.normal(size=(10, 2)) * rng.uniform(0.3, 2.0, 2) + rng.normal(size=2))
        for _ in range(count)
    ]


def check_places(footprints: list[Footprint], shifts: np.ndarray, floor: tuple[float, ...]) -> None:
    """By boolean operations on polygons, pair by pair."""
    shapes = []
    for footprint, shift in zip(footprints, shifts, strict=True):
        if np.isnan(shift).any():
            continue
        moved = footprint.corners + shift
        assert (np.abs(moved) <= np.array(floor) / 2.0 + 1e-12).all()
        shapes.append(CrossSection([moved]))
    for one, other in combinations(shapes, 2):
        assert (one ^ other).area() == 0.0


@pytest.mark.parametrize("seed", range(3))
def test_all_have_a_place_on_the_floor_that_is_said_to_fit(seed: int) -> None:
    footprints = polygons(40, seed)
    floor, shifts = fitting_floor(footprints, np.random.default_rng(seed))
    assert not np.isnan(shifts).any()
    check_places(footprints, shifts, floor)
    covered = sum(footprint.area for footprint in footprints)
    assert 0.2 < covered / (floor[0] * floor[1]) < 0.5
    assert floor[0] / floor[1] == pytest.approx(4.0 / 3.0, rel=0.01)


def test_a_crowded_floor_holds_many_and_leaves_out_the_rest() -> None:
    footprints = polygons(120, 7)
    floor = (16.0, 9.0)
    shifts = pack(footprints, floor, np.random.default_rng(1))
    check_places(footprints, shifts, floor)
    placed = ~np.isnan(shifts[:, 0])
    covered = sum(f.area for f, there in zip(footprints, placed, strict=True) if there)
    assert not placed.all()
    assert covered > 0.5 * floor[0] * floor[1]


def test_what_is_larger_than_the_floor_has_no_place() -> None:
    footprints = polygons(5, 3)
    assert np.isnan(pack(footprints, (0.1, 100.0), np.random.default_rng(1))).all()


def test_one_seed_is_one_layout() -> None:
    footprints = polygons(20, 5)
    once, again = (fitting_floor(footprints, np.random.default_rng(9)) for _ in range(2))
    assert once[0] == again[0]
    np.testing.assert_array_equal(once[1], again[1])
