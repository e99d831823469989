"""Footprints, and places on a floor: inside it, apart from each other, and how many there are."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from manifold3d import CrossSection
from scipy.optimize import linprog

from dicedesign.scenes.room import Footprint, fit_floor, gap, pack


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


@pytest.mark.parametrize("seed", range(2))
def test_all_have_a_place_on_the_floor_that_is_said_to_fit(seed: int) -> None:
    footprints = polygons(40, seed)
    floor, shifts = fit_floor(footprints, np.random.default_rng(seed))
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
    # What is larger than the floor has no place.
    assert np.isnan(pack(footprints[:5], (0.1, 100.0), np.random.default_rng(1))).all()


def test_one_seed_is_one_layout() -> None:
    footprints = polygons(20, 5)
    once, again = (fit_floor(footprints, np.random.default_rng(9)) for _ in range(2))
    assert once[0] == again[0]
    np.testing.assert_array_equal(once[1], again[1])


def meet(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two convex hulls of points have one in common, by a linear program."""
    n, m = len(one), len(other)
    rows = np.vstack([np.hstack([one.T, -other.T]), np.r_[np.ones(n), np.zeros(m)]])
    rows = np.vstack([rows, np.r_[np.zeros(n), np.ones(m)]])
    return bool(linprog(np.zeros(n + m), A_eq=rows, b_eq=[0.0, 0.0, 1.0, 1.0]).status == 0)


def test_repeated_points_and_points_on_edges_are_no_corners() -> None:
    grid = np.stack(np.meshgrid(np.arange(4.0), np.arange(3.0)), axis=-1).reshape(-1, 2)
    polygon = Footprint.under(np.concatenate([grid, grid, grid[:1] + 1e-17]))
    assert sorted(map(tuple, polygon.corners.tolist())) == [(0, 0), (0, 2), (3, 0), (3, 2)]
    assert polygon.area == 6.0


@pytest.mark.parametrize("seed", range(20))
def test_a_strip_is_there_where_two_have_no_point_in_common(seed: int) -> None:
    rng = np.random.default_rng(seed)
    one, other = (rng.normal(size=(8, 2)) * [1.5, 0.4] for _ in range(2))
    shift = rng.normal(size=2) * 1.5
    found = gap(Footprint.under(one), Footprint.under(other), shift)
    assert (found <= 0.0) == meet(one, other + shift)
    # As wide as it is, the second may be pushed by nearly that without meeting the first.
    if found > 0.0:
        for angle in np.linspace(0.0, 2.0 * np.pi, 9):
            push = 0.999 * found * np.array([np.cos(angle), np.sin(angle)])
            assert not meet(one, other + shift + push)
