"""Bodies of many faces for few outcomes: solids whose faces are all images of each other, and
solids whose faces are in opposite parallel pairs, each face about as large as its share.

A body is given by the outward unit normals of its planes and their distances from the origin. As
opposite faces are parallel, such dice are read on top. The tetrahedron is the exception: it is read
around its top corner.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources

import numpy as np

from dicedesign.geometry.point_groups import GOLDEN, HIGHEST_ORDER, point_group
from dicedesign.geometry.sphere import unit_vectors
from dicedesign.runtime.arrays import Floats, Integers

KITE = math.sqrt(2.0) - 1.0
"""Tangent that makes the kites of a solid of 24 faces of least area."""

SEVERAL_AXES: dict[int, tuple[str, str, tuple[float, float, float]]] = {
    4: ("tetrahedron", "Td", (1.0, 1.0, 1.0)),
    6: ("cube", "Oh", (0.0, 0.0, 1.0)),
    8: ("octahedron", "Oh", (1.0, 1.0, 1.0)),
    12: ("dodecahedron", "Ih", (0.0, 1.0, GOLDEN)),
    20: ("icosahedron", "Ih", (1.0, 1.0, 1.0)),
    24: ("deltoidal icositetrahedron", "Oh", (KITE, KITE, 1.0)),
    30: ("rhombic triacontahedron", "Ih", (0.0, 0.0, 1.0)),
    48: ("disdyakis dodecahedron", "Oh", (0.2524, 0.546, 1.0)),
    60: ("deltoidal hexecontahedron", "Ih", (0.32509 / GOLDEN, 0.22971, 0.5548 * GOLDEN)),
    120: ("disdyakis triacontahedron", "Ih", (0.12796, 0.19389, 1.0)),
}
"""Name, point group and normal of one face of the solids with several main axes, by the number of
their faces. Of those with a free shape it is the one of least area."""

RING_HEIGHT = math.sqrt(0.5)
"""Height of the normals of two rings over their distance from the axis, with which trapezohedra
and double pyramids have the least area around a sphere, for any number of faces."""

MOST_RING_FACES = 28
"""Most faces of a trapezohedron or a double pyramid. With more they are narrow, and other bodies
have more room for labels."""

MOST_DOUBLED_FACES = 34
"""Most of a trapezohedron that has two for each outcome, which no other body makes as right. With
more, labels would need dice of 60 mm."""


WHOLE = 1e-9
"""Largest difference of a number of faces from a whole one."""


@dataclass(frozen=True, eq=False)
class EqualFaces:
    """Solid whose faces are images of each other, and so come up equally often however it is
    thrown.

    Attributes
    ----------
    name: of the solid. group: name of a point group that carries each face to every other, or None
        if it has no name here.
    normals: (f, 3) outward unit normals of its planes, at equal distances from the origin.
    """

    name: str
    group: str | None
    normals: Floats


def equal_faces_body(faces: int) -> EqualFaces | None:
    """The most compact solid of equal faces, with opposite faces parallel, or a tetrahedron. None
    if none has this number of faces and room for labels."""
    if faces in SEVERAL_AXES:
        name, known, normal = SEVERAL_AXES[faces]
        images = unit_vectors(np.array(normal)) @ point_group(known).transpose(0, 2, 1)
        _, first = np.unique(images.round(6) + 0.0, axis=0, return_index=True)
        return EqualFaces(name, known, images[np.sort(first)])
    if faces % 2 or not 6 < faces <= MOST_DOUBLED_FACES:
        return None
    sides = faces // 2
    # Opposite faces are parallel: the rings are turned against each other if their number is odd.
    name, kind = ("trapezohedron", "d") if sides % 2 else ("double pyramid", "h")
    turns = 2.0 * np.pi * (np.arange(sides) + 0.5) / sides
    rings = [(turns, 1.0), (turns + np.pi * (sides % 2), -1.0)]
    normals = [
        np.column_stack([np.cos(angles), np.sin(angles), np.full(sides, side * RING_HEIGHT)])
        for angles, side in rings
    ]
    group = f"D{sides}{kind}" if sides <= HIGHEST_ORDER else None
    return EqualFaces(name, group, unit_vectors(np.concatenate(normals)))


def numbers_of_equal_faces(probabilities: Floats) -> list[int]:
    """Numbers of equal faces of which each outcome has a whole number, and for which there is a
    solid, ascending. A tetrahedron is for four outcomes only. probabilities: (k,)."""
    fitting = list[int]()
    doubled, rings = 2 * len(probabilities), {*range(8, MOST_RING_FACES + 1, 2)}
    if doubled <= MOST_DOUBLED_FACES and np.ptp(probabilities) < WHOLE:
        rings.add(doubled)
    for faces in sorted(rings | SEVERAL_AXES.keys()):
        parts = probabilities * faces
        is_whole = np.abs(parts - parts.round()).max() < WHOLE and parts.min() > 0.5
        if is_whole and (faces > 4 or len(probabilities) == faces):
            fitting.append(faces)
    return fitting


MISMATCH = 4.0
"""Weight of the mean squared logarithm of shares over the mean share, beside that of gaps between
opposite faces."""

GAP = 6.0
"""Weight of the squared logarithm of the ratio of the shares of two opposite faces."""


@dataclass(frozen=True, eq=False)
class FaceShares:
    """Numbers of faces of each outcome, in opposite pairs.

    Attributes
    ----------
    outcome: (2 m,) of each face; faces i and i + m are opposite.
    shares: (2 m,) of each face, an equal part of its outcome's probability.
    cost: 0 if all shares are equal, more the farther they are from each other, in pairs above all.
    """

    outcome: Integers
    shares: Floats
    cost: float


def share_faces(probabilities: Floats, faces: int) -> FaceShares:
    """Numbers of faces of outcomes with probabilities (k,), so that all faces, and even more so two
    opposite ones, have shares as equal as a search finds.

    Outcomes with an odd number have one face opposite to one of another outcome. Faces are moved
    from outcome to outcome while that helps, from rounded parts on. faces: even, at least k.
    """
    outcomes = len(probabilities)
    steps = np.eye(outcomes, dtype=np.int64)
    swaps = (steps[:, None] - steps[None]).reshape(-1, outcomes)
    moves = np.concatenate([swaps, 2 * swaps])

    def costs(counts: Integers) -> Floats:
        """(n,) costs of numbers of faces (n, k)."""
        logarithms = np.log(probabilities / np.maximum(counts, 1))
        off = (counts * (logarithms + np.log(faces)) ** 2).sum(axis=1) / faces
        odd = np.sort(np.where(counts % 2 == 1, logarithms, np.inf), axis=1)
        odd = odd[:, : outcomes // 2 * 2]
        gaps = odd[:, 1::2] - np.where(np.isinf(odd[:, ::2]), 0.0, odd[:, ::2])
        gaps = np.where(np.isinf(gaps), 0.0, gaps)
        return np.where(
            counts.min(axis=1) < 1, np.inf, MISMATCH * off + GAP * (gaps**2).sum(axis=1)
        )

    best = None
    for pair in (1, 2):
        counts = np.ones(outcomes, dtype=np.int64)
        while counts.sum() < faces:
            # Webster's method: the next seats go to the largest quotient.
            counts[np.argmax(probabilities / (counts + pair / 2.0))] += min(
                pair, faces - int(counts.sum())
            )
        least = float(costs(counts[None])[0])
        while True:
            tried = costs(counts + moves)
            step = int(tried.argmin())
            if not tried[step] < least - 1e-9:
                break
            counts, least = counts + moves[step], float(tried[step])
        if best is None or least < best[0]:
            best = least, counts
    assert best is not None
    cost, counts = best
    shares = probabilities / counts
    odd = np.flatnonzero(counts % 2)
    odd = odd[np.argsort(shares[odd], kind="stable")]
    first = np.concatenate([np.repeat(np.arange(outcomes), counts // 2), odd[::2]])
    second = np.concatenate([np.repeat(np.arange(outcomes), counts // 2), odd[1::2]])
    outcome = np.concatenate([first, second])
    return FaceShares(outcome, shares[outcome], cost)


@dataclass(frozen=True, eq=False)
class FaceCode:
    """Planes about the origin in opposite pairs: i and i + m are parallel.

    Attributes
    ----------
    normals: (2 m, 3) outward unit normals. distances: (2 m,) from the origin.
    bias: (2 m,) logarithms of probabilities when thrown over those in the momentum model; zeros if
        they are not known.
    """

    normals: Floats
    distances: Floats
    bias: Floats


@cache
def even_codes() -> Mapping[int, FaceCode]:
    """Codes of faces of nearly one size that come with the package, by their number of faces. Their
    bias is of 100,000 simulated throws onto board-game: `python -m benchmarks codes`
    makes them."""
    text = resources.files("dicedesign.optimize.starts").joinpath("codes.json").read_text()
    codes = dict[int, FaceCode]()
    for faces, numbers in json.loads(text).items():
        half = unit_vectors(np.array(numbers["normals"]))
        normals = np.concatenate([half, -half])
        codes[int(faces)] = FaceCode(normals, np.ones(len(normals)), np.array(numbers["bias"]))
    return codes


REPULSION = 6
"""Power of the distance with which the faces of a code repel each other."""

ROOM = 3.5
"""Sum of the squared radii of all faces on the unit sphere, at which they about touch."""

OUTWARD = 0.2
"""Share of the depth of the spherical cap of a face by which its plane is moved outward."""


def weighted_code(shares: Floats, seed: int) -> FaceCode:
    """Code of faces of about the given shares (2 m,), of one size for two opposite ones.

    The normals repel each other as discs of these sizes would, from random ones on.
    """
    # Few callers need the minimizer.
    from scipy.optimize import minimize

    pairs = len(shares) // 2
    radii = np.sqrt(np.sqrt(shares[:pairs] * shares[pairs:]))
    radii *= math.sqrt(ROOM / 2.0 / (radii**2).sum())
    squares = (radii[:, None] + np.concatenate([radii, radii])) ** 2
    own = np.arange(pairs)

    def energy(flat: Floats) -> tuple[float, Floats]:
        vectors = flat.reshape(-1, 3)
        lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
        half = vectors / lengths
        offsets = half[:, None] - np.concatenate([half, -half])
        ratios = (offsets**2).sum(axis=-1) / squares
        ratios[own, own] = np.inf
        terms = ratios ** (-REPULSION / 2)
        force = -REPULSION * ((terms / ratios / squares)[..., None] * offsets).sum(axis=1)
        force -= (force * half).sum(axis=1, keepdims=True) * half
        return float(terms.sum()) / 2.0, (force / lengths).ravel()

    start = np.random.default_rng([pairs, seed]).normal(size=3 * pairs)
    found = minimize(energy, start, jac=True, method="L-BFGS-B", options={"maxiter": 3000})
    half = unit_vectors(found.x.reshape(-1, 3))
    depths = np.log(np.cos(radii))
    distances = np.exp(OUTWARD * (depths - depths.mean()))
    return FaceCode(
        np.concatenate([half, -half]),
        np.concatenate([distances, distances]),
        np.zeros(2 * pairs),
    )
