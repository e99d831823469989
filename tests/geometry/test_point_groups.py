"""Point groups against the tables of textbooks and the solids whose symmetries they are."""

from __future__ import annotations

import numpy as np
import pytest

from dicedesign.geometry.point_groups import (
    HIGHEST_ORDER,
    mirrors,
    point_group,
    pole_orbits,
)

ORDERS = {"C1": 1, "Cs": 2, "Ci": 2, "T": 12, "Td": 24, "Th": 24, "O": 24, "Oh": 48, "I": 60}
ORDERS |= {"Ih": 120}
for n in range(2, HIGHEST_ORDER + 1):
    ORDERS |= {f"C{n}": n, f"C{n}v": 2 * n, f"C{n}h": 2 * n, f"S{2 * n}": 2 * n}
    ORDERS |= {f"D{n}": 2 * n, f"D{n}h": 4 * n, f"D{n}d": 4 * n}

GOLDEN = (1.0 + np.sqrt(5.0)) / 2.0


def maps_onto_itself(group: np.ndarray, points: np.ndarray) -> bool:
    """Whether every element permutes the points."""
    for element in group:
        distance = np.linalg.norm((points @ element.T)[:, None] - points[None], axis=-1)
        if distance.min(axis=1).max() > 1e-12 or len(set(distance.argmin(axis=1))) < len(points):
            return False
    return True


def ring(corners: int, height: float, turn: float = 0.0) -> np.ndarray:
    """A regular polygon (corners, 3) with a corner at an angle `turn` from x."""
    angle = 2.0 * np.pi * np.arange(corners) / corners + turn
    return np.stack([np.cos(angle), np.sin(angle), np.full(corners, height)], axis=1)


@pytest.mark.parametrize("name", ORDERS)
def test_a_group_is_closed_and_as_large_as_in_the_textbook(name: str) -> None:
    group = point_group(name)
    assert len(group) == ORDERS[name]
    np.testing.assert_array_equal(group[0], np.eye(3))
    transposed = group.transpose(0, 2, 1)
    np.testing.assert_allclose(
        group @ transposed, np.broadcast_to(np.eye(3), group.shape), atol=1e-15
    )
    flat = group.reshape(-1, 9)
    products = (group[:, None] @ group[None]).reshape(-1, 9)
    gaps = np.abs(products[:, None] - flat[None]).max(axis=-1)
    assert gaps.min(axis=1).max() < 1e-15
    # Elements differ, and each element times all others is every element once.
    assert all(len(set(row)) == len(group) for row in gaps.argmin(axis=1).reshape(len(group), -1))
    # Inverses are there to the last bit.
    assert {matrix.tobytes() for matrix in transposed.copy()} == {m.tobytes() for m in group}


@pytest.mark.parametrize("name", ["D3h", "D6d", "C12v", "Oh", "Ih", "S10"])
def test_entries_are_exact_and_equal_where_they_should_be(name: str) -> None:
    size = np.unique(np.abs(point_group(name)))
    assert np.diff(size).min() > 1e-3
    for value in (0.0, 0.5, 1.0):
        near = size[np.abs(size - value) < 1e-3]
        assert (near == value).all()


@pytest.mark.parametrize(
    ("name", "points"),
    [
        ("Oh", np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T),
        ("Td", np.array([(1.0, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)])),
        ("Ih", np.array([np.roll((0, a, b), k) for k in range(3) for a in (-1, 1)
                         for b in (-GOLDEN, GOLDEN)])),
        ("D5h", np.concatenate([ring(5, 1.0), ring(5, -1.0)])),
        ("D7d", np.concatenate([ring(7, 1.0, np.pi / 14), ring(7, -1.0, -np.pi / 14)])),
        ("C6v", np.concatenate([ring(6, 1.0), [[0.0, 0.0, 2.0]]])),
        ("S4", np.concatenate([ring(2, 1.0, 0.3), ring(2, -1.0, 0.3 + np.pi / 2)])),
    ],
)  # fmt: skip
def test_known_solids_keep_their_place(name: str, points: np.ndarray) -> None:
    assert maps_onto_itself(point_group(name), points)
    # The check can tell: a solid that is nudged out of place does not.
    nudged = points.copy()
    nudged[0] += [0.01, 0.02, 0.03]
    assert not maps_onto_itself(point_group(name), nudged)


@pytest.mark.parametrize(
    ("name", "planes", "poles"),
    [
        ("C1", 0, []),
        ("Cs", 1, []),
        ("Ci", 0, []),
        ("C2", 0, [1, 1]),
        ("C5v", 5, [1, 1]),
        ("C4h", 1, [2]),
        ("S6", 0, [2]),
        ("D2", 0, [2, 2, 2]),
        ("D3", 0, [2, 3, 3]),
        ("D2d", 2, [2, 4]),
        ("D3h", 4, [2, 3, 3]),
        ("D3d", 3, [2, 6]),
        ("D12h", 13, [2, 12, 12]),
        ("T", 0, [4, 4, 6]),
        ("Td", 6, [4, 4, 6]),
        ("Th", 3, [6, 8]),
        ("O", 0, [6, 8, 12]),
        ("Oh", 9, [6, 8, 12]),
        ("Ih", 15, [12, 20, 30]),
    ],
)
def test_planes_and_poles_are_those_of_the_textbook(
    name: str, planes: int, poles: list[int]
) -> None:
    group = point_group(name)
    assert len(mirrors(group)) == planes
    for mirror in mirrors(group):
        np.testing.assert_allclose(np.linalg.eigvalsh(mirror), [-1.0, 1.0, 1.0], atol=1e-15)
    orbits = pole_orbits(group)
    assert sorted(len(orbit) for orbit in orbits) == poles
    for orbit in orbits:
        assert maps_onto_itself(group, orbit)
        np.testing.assert_allclose(np.linalg.norm(orbit, axis=1), 1.0, rtol=1e-15)
        # As many elements keep a pole as the theorem on orbits says, a rotation among them.
        keeping = group[np.linalg.norm(group @ orbit[0] - orbit[0], axis=1) < 1e-9]
        assert len(keeping) * len(orbit) == len(group)
        assert (np.linalg.det(keeping) > 0.0).sum() > 1
