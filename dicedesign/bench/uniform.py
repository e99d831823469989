"""Coordinates of the Platonic and the Archimedean solids."""

from __future__ import annotations

from itertools import permutations, product
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root
from scipy.spatial.transform import Rotation

__all__ = ["ARCHIMEDEAN", "ARCHIMEDEAN_FACETS", "PLATONIC", "PLATONIC_FACETS"]

Floats = NDArray[np.float64]

GOLDEN: Final = (1.0 + np.sqrt(5.0)) / 2.0
TRIBONACCI: Final = 1.8392867552141612
"""Root of x^3 = x^2 + x + 1."""

EVEN: Final = ((0, 1, 2), (1, 2, 0), (2, 0, 1))
"""Permutations of three coordinates that keep their cyclic order."""

ANY: Final = tuple(permutations(range(3)))


def _spread(*corners: tuple[float, float, float], orders: tuple[tuple[int, ...], ...]) -> Floats:
    """All sign changes and the given permutations of some points, each once."""
    signs = np.array(list(product([-1.0, 1.0], repeat=3)))
    rows = [s * np.array(corner)[list(o)] for corner in corners for o in orders for s in signs]
    return np.unique(np.array(rows) + 0.0, axis=0)


def _snub_cube() -> Floats:
    signs = [np.array(s) for s in product([-1.0, 1.0], repeat=3)]
    corner = np.array([1.0, 1.0 / TRIBONACCI, TRIBONACCI])
    odd = [order for order in ANY if order not in EVEN]
    rows = [s * corner[list(o)] for o in EVEN for s in signs if s.prod() > 0]
    rows += [s * corner[list(o)] for o in odd for s in signs if s.prod() < 0]
    return np.array(rows)


def _snub_dodecahedron() -> Floats:
    """The orbit of a point, under the rotations of the icosahedron, that lies as far from its image
    by a fifth of a turn as from those by a third and by a half."""
    group = Rotation.create_group("I")
    vectors = group.as_rotvec()
    angles = np.sqrt((vectors**2).sum(-1))
    start, turns = np.zeros(3), []
    for fold in (5, 3, 2):
        axes = vectors[np.isclose(angles, 2.0 * np.pi / fold)]
        axes = np.concatenate([axes, -axes]) if fold == 2 else axes
        axis = axes[np.argmax(axes @ start)]
        start = start + axis / np.sqrt((axis**2).sum())
        turns.append(Rotation.from_rotvec(axis).as_matrix())

    def gaps(point: Floats) -> Floats:
        d5, d3, d2 = (float(((turn @ point - point) ** 2).sum()) for turn in turns)
        return np.array([d5 - d3, d3 - d2, point @ point - 1.0])

    corner = root(gaps, start / np.sqrt((start**2).sum()), tol=1e-15).x
    return group.as_matrix() @ (corner / np.sqrt((corner**2).sum()))


_G2, _R2 = GOLDEN * GOLDEN, np.sqrt(2.0)

PLATONIC: Final[dict[str, Floats]] = {
    "tetrahedron": np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]),
    "cube": _spread((1, 1, 1), orders=EVEN),
    "octahedron": _spread((1, 0, 0), orders=EVEN),
    "dodecahedron": np.concatenate(
        [_spread((1, 1, 1), orders=EVEN), _spread((0, 1 / GOLDEN, GOLDEN), orders=EVEN)]
    ),
    "icosahedron": _spread((0, 1, GOLDEN), orders=EVEN),
}

ARCHIMEDEAN: Final[dict[str, Floats]] = {
    "truncated tetrahedron": np.array(
        [p for p in _spread((1, 1, 3), orders=ANY).tolist() if np.prod(p) > 0]
    ),
    "cuboctahedron": _spread((1, 1, 0), orders=EVEN),
    "truncated cube": _spread((1, 1, _R2 - 1), orders=EVEN),
    "truncated octahedron": _spread((0, 1, 2), orders=ANY),
    "rhombicuboctahedron": _spread((1, 1, 1 + _R2), orders=EVEN),
    "truncated cuboctahedron": _spread((1, 1 + _R2, 1 + 2 * _R2), orders=ANY),
    "snub cube": _snub_cube(),
    "icosidodecahedron": _spread((0, 0, 2 * GOLDEN), (1, GOLDEN, _G2), orders=EVEN),
    "truncated dodecahedron": _spread(
        (0, 1 / GOLDEN, 2 + GOLDEN), (1 / GOLDEN, GOLDEN, 2 * GOLDEN), (GOLDEN, 2, _G2), orders=EVEN
    ),
    "truncated icosahedron": _spread(
        (0, 1, 3 * GOLDEN), (1, 2 + GOLDEN, 2 * GOLDEN), (GOLDEN, 2, _G2 * GOLDEN), orders=EVEN
    ),
    "rhombicosidodecahedron": _spread(
        (1, 1, _G2 * GOLDEN), (_G2, GOLDEN, 2 * GOLDEN), (2 + GOLDEN, 0, _G2), orders=EVEN
    ),
    "truncated icosidodecahedron": _spread(
        (1 / GOLDEN, 1 / GOLDEN, 3 + GOLDEN),
        (2 / GOLDEN, GOLDEN, 1 + 2 * GOLDEN),
        (1 / GOLDEN, _G2, 3 * GOLDEN - 1),
        (2 * GOLDEN - 1, 2, 2 + GOLDEN),
        (GOLDEN, 3, 2 * GOLDEN),
        orders=EVEN,
    ),
    "snub dodecahedron": _snub_dodecahedron(),
}

PLATONIC_FACETS: Final = {
    "tetrahedron": 4,
    "cube": 6,
    "octahedron": 8,
    "dodecahedron": 12,
    "icosahedron": 20,
}
"""How many facets each has."""

ARCHIMEDEAN_FACETS: Final[dict[str, dict[int, int]]] = {
    "truncated tetrahedron": {3: 4, 6: 4},
    "cuboctahedron": {3: 8, 4: 6},
    "truncated cube": {3: 8, 8: 6},
    "truncated octahedron": {4: 6, 6: 8},
    "rhombicuboctahedron": {3: 8, 4: 18},
    "truncated cuboctahedron": {4: 12, 6: 8, 8: 6},
    "snub cube": {3: 32, 4: 6},
    "icosidodecahedron": {3: 20, 5: 12},
    "truncated dodecahedron": {3: 20, 10: 12},
    "truncated icosahedron": {5: 12, 6: 20},
    "rhombicosidodecahedron": {3: 20, 4: 30, 5: 12},
    "truncated icosidodecahedron": {4: 30, 6: 20, 10: 12},
    "snub dodecahedron": {3: 80, 5: 12},
}
"""How many facets of 3, 4, ... corners each has."""
