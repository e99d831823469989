"""Which symmetry a target allows, and which of all is the most helpful."""

from __future__ import annotations

import numpy as np
import pytest

from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.point_groups import point_group
from dicedesign.optimize.coordinates.linked import orbits_of_directions
from dicedesign.optimize.starts.orbit_layouts import fitting_groups, group_names
from dicedesign.optimize.starts.symmetric_search import symmetric_shapes_near
from dicedesign.optimize.targets import binomial, fair, sum_of_dice


def test_all_groups_are_known_and_named_once() -> None:
    names = group_names()
    assert len(set(names)) == len(names)
    assert sorted(len(point_group(name)) for name in names)[-1] == 120


@pytest.mark.parametrize(
    ("outcomes", "name"),
    [
        (3, "D3h"),
        (4, "Td"),
        (5, "D5h"),
        (6, "Oh"),
        (7, "D7h"),
        (8, "Oh"),
        (10, "D5d"),
        (12, "Ih"),
        (14, "D7d"),
        (20, "Ih"),
        (24, "Oh"),
        (30, "Ih"),
    ],
)
def test_fair_dice_are_the_solids_whose_faces_are_all_alike(outcomes: int, name: str) -> None:
    """Tetrahedron, cube, octahedron, dodecahedron, icosahedron, trapezohedra, the rhombic
    triacontahedron, and prisms for odd numbers."""
    assert fitting_groups(fair(outcomes).probabilities)[0] == name


@pytest.mark.parametrize(
    ("target", "odds_left"),
    [
        (binomial(3).probabilities, 2),
        (binomial(4).probabilities, 3),
        (sum_of_dice([6, 6]).probabilities, 6),
        (np.array([2, 2, 2, 2, 2, 5]) / 15.0, 2),
    ],
)
def test_images_share_their_odds(target: np.ndarray, odds_left: int) -> None:
    """In shapes that are made for the first groups, each orbit of facets has one odds, and there
    are as many orbits as different odds."""
    for name in fitting_groups(target)[:2]:
        group = point_group(name)
        starts = symmetric_shapes_near(target, group, 0)
        start = next(one for one in starts if one is not None)
        orbits = orbits_of_directions(start.directions, group)
        assert len(np.unique(orbits)) == odds_left
        for orbit in np.unique(orbits):
            assert np.ptp(target[orbits == orbit]) < 1e-12
        assert len(convex_hull(start.points).normals) >= len(target)


def test_different_odds_allow_none() -> None:
    assert fitting_groups(np.array([0.5, 0.3, 0.2])) == []
