"""Footprints are placed inside the floor, apart from each other."""

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
    """Judge by boolean operations on pairs of polygons."""
    shapes = []
    for footprint, shift in zip(footprints, shifts, strict=True):
        if np.isnan(shift).any():
            continue
        moved = footprint.corners + shift
        assert (np.abs(moved) <= np.array(floor) / 2.0 + 1e-12).all()
        shapes.append(CrossSection([moved]))
    for first, second in combinations(shapes, 2):
        assert (first ^ second).area() == 0.0


@pytest.mark.parametrize("seed", range(2))
def test_fit_floor_has_room_for_all(seed: int) -> None:
    footprints = polygons(40, seed)
    floor, shifts = fit_floor(footprints, np.random.default_rng(seed))
    assert not np.isnan(shifts).any()
    check_places(footprints, shifts, floor)
    covered = sum(footprint.area for footprint in footprints)
    assert 0.2 < covered / (floor[0] * floor[1]) < 0.5
    assert floor[0] / floor[1] == pytest.approx(4.0 / 3.0, rel=0.01)


def test_a_small_floor_holds_many() -> None:
    footprints = polygons(70, 7)
    floor = (12.0, 7.0)
    shifts = pack(footprints, floor, np.random.default_rng(1))
    check_places(footprints, shifts, floor)
    fits = ~np.isnan(shifts[:, 0])
    covered = np.array([footprint.area for footprint in footprints])[fits].sum()
    assert not fits.all()
    assert covered > 0.5 * floor[0] * floor[1]
    # A footprint larger than the floor has no place.
    assert np.isnan(pack(footprints[:5], (0.1, 100.0), np.random.default_rng(1))).all()


def test_a_seed_determines_the_layout() -> None:
    footprints = polygons(20, 5)
    first, second = (fit_floor(footprints, np.random.default_rng(9)) for _ in range(2))
    assert first[0] == second[0]
    np.testing.assert_array_equal(first[1], second[1])


def intersect(first: np.ndarray, second: np.ndarray) -> bool:
    """Whether the convex hulls of two point sets intersect, by a linear program."""
    n, m = len(first), len(second)
    sums = [np.r_[np.ones(n), np.zeros(m)], np.r_[np.zeros(n), np.ones(m)]]
    rows = np.vstack([np.hstack([first.T, -second.T]), *sums])
    return bool(linprog(np.zeros(n + m), A_eq=rows, b_eq=[0.0, 0.0, 1.0, 1.0]).status == 0)


def test_footprints_drop_repeated_points_and_points_on_edges() -> None:
    grid = np.stack(np.meshgrid(np.arange(4.0), np.arange(3.0)), axis=-1).reshape(-1, 2)
    polygon = Footprint.under(np.concatenate([grid, grid, grid[:1] + 1e-17]))
    assert sorted(map(tuple, polygon.corners.tolist())) == [(0, 0), (0, 2), (3, 0), (3, 2)]
    assert polygon.area == 6.0


@pytest.mark.parametrize("seed", range(10))
def test_the_gap_separates_disjoint_polygons(seed: int) -> None:
    rng = np.random.default_rng(seed)
    first, second = (rng.normal(size=(8, 2)) * [1.5, 0.4] for _ in range(2))
    shift = rng.normal(size=2) * 1.5
    width = gap(Footprint.under(first), Footprint.under(second), shift)
    assert (width <= 0.0) == intersect(first, second + shift)
    # The second polygon can move by the width of the gap in any direction.
    if width > 0.0:
        for angle in np.linspace(0.0, 2.0 * np.pi, 9):
            push = 0.999 * width * np.array([np.cos(angle), np.sin(angle)])
            assert not intersect(first, second + shift + push)
