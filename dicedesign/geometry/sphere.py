"""Directions on the Gauss sphere, rotations and similarities.

Formulas are written once for NumPy arrays and torch tensors: functions that differ between
the two libraries take the module as `xp` (`numpy` or `torch`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dicedesign.runtime.arrays import Floats


def oblique_projection(u: Any, along: Any, normal: Any) -> Any:
    """Direction of `u` moved parallel to `along` until it is perpendicular to `normal`.

    With `along = r_p` and `normal` the edge vector this is the point where a flow line of the cell
    of vertex p crosses the arc of that edge; with `along = normal` it is the orthogonal projection.
    Free of divisions: the result is scaled by `along . normal`, and where that product goes to zero
    (a glancing crossing) it approaches the direction of `along`. It is reversed where the product
    is negative.

    u, along, normal: (..., 3), NumPy or torch; returns (..., 3).
    """
    return u * (along * normal).sum(-1)[..., None] - along * (u * normal).sum(-1)[..., None]


def foot_on_line(a: Any, b: Any, v: Any, xp: ModuleType) -> Any:
    """Nearest point to the origin on the line through a and b, times `v . v` with v = b - a: for
    the ends of an edge its saddle direction (eq. 7, 8).

    It is computed from the nearer of the two: from a far one its digits cancel.
    a, b, v: (..., 3); returns (..., 3).
    """
    nearer = ((a * a).sum(-1) <= (b * b).sum(-1))[..., None]
    return oblique_projection(xp.where(nearer, a, b), v, v)


def signed_solid_angle(n: Any, a: Any, b: Any, xp: ModuleType) -> Any:
    """Signed area in (-2 pi, 2 pi) of the spherical triangle (n, a, b), positive if n, a, b turn
    counter-clockwise seen from outside. Vectors need not be normalized.

    n, a, b: (..., 3); returns (...).
    Source: Van Oosterom and Strackee, IEEE Trans. Biomed. Eng. 30(2), 1983; used in eq. 10.
    """
    norm_n, norm_a, norm_b = (xp.sqrt((x * x).sum(-1)) for x in (n, a, b))
    determinant = (n * xp.linalg.cross(a, b)).sum(-1)
    denominator = (
        norm_n * norm_a * norm_b
        + (n * a).sum(-1) * norm_b
        + (n * b).sum(-1) * norm_a
        + (a * b).sum(-1) * norm_n
    )
    return 2.0 * xp.atan2(determinant, denominator)


def norms(vectors: NDArray[Any]) -> Floats:
    """Lengths (...) of vectors (..., 3)."""
    return np.sqrt((vectors * vectors).sum(-1))


def unit_vectors(vectors: NDArray[Any]) -> Floats:
    """Vectors (..., 3), none of them zero, at length 1."""
    return vectors / norms(vectors)[..., None]


def rigid_motion(turn: Floats, shift: Any) -> Floats:
    """Rigid motion (4, 4) of a rotation (3, 3) and then a shift (3,)."""
    return np.vstack([np.column_stack([turn, shift]), [0.0, 0.0, 0.0, 1.0]])


def turns_down(directions: Floats) -> Floats:
    """Smallest rotations (..., 3, 3) that turn unit directions (..., 3) to -z; those of z are half
    a turn about x."""
    x, y, z = np.moveaxis(directions, -1, 0)
    aside = np.sqrt(x * x + y * y)
    upward = aside == 0.0
    size = np.where(upward, 1.0, aside)
    a, b, k = x / size, np.where(upward, 1.0, y / size), 1.0 + z
    rows = [[1.0 - k * a * a, -k * a * b, x], [-k * a * b, 1.0 - k * b * b, y], [-x, -y, -z]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def quaternions(turns: Floats) -> Floats:
    """Unit quaternions (..., 4), in the order w, x, y, z with w >= 0, of rotations (..., 3, 3)."""
    trace = np.trace(turns, axis1=-2, axis2=-1)
    # Rows are multiples of the quaternion; that of its largest part loses no digits.
    rows = np.empty((*trace.shape, 4, 4))
    rows[..., 1:, 1:] = turns + np.swapaxes(turns, -1, -2)
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        rows[..., 0, k + 1] = rows[..., k + 1, 0] = turns[..., j, i] - turns[..., i, j]
        rows[..., k + 1, k + 1] += 1.0 - trace
    rows[..., 0, 0] = 1.0 + trace
    squares = rows.diagonal(axis1=-2, axis2=-1)
    best = squares.argmax(-1)[..., None, None]
    row = np.take_along_axis(rows, best, axis=-2)[..., 0, :]
    row = np.where(row[..., :1] < 0.0, -row, row)
    return row / np.linalg.norm(row, axis=-1, keepdims=True)


def angle_between(a: Floats, b: Floats) -> Floats:
    """Angle in [0, pi] between vectors a and b (..., 3), exact for small and flat angles."""
    # By components: np.linalg.cross takes three times as long for few vectors.
    x = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    y = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    z = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return np.asarray(np.arctan2(np.sqrt(x * x + y * y + z * z), (a * b).sum(-1)))


def even_directions(count: int) -> Floats:
    """(count, 3) unit directions, evenly spread over the sphere along a spiral.

    Source: Gonzalez, Math. Geosci. 42, 2010 (the Fibonacci lattice).
    """
    number = np.arange(count) + 0.5
    z, turn = 1.0 - 2.0 * number / count, math.pi * (1.0 + math.sqrt(5.0)) * number
    aside = np.sqrt(1.0 - z * z)
    return np.stack([aside * np.cos(turn), aside * np.sin(turn), z], axis=1)


def rotation_between(a: Floats, b: Floats) -> Floats:
    """Smallest rotation (3, 3) from the direction of a to the direction of b.

    For opposite directions the axis is chosen perpendicular to a, along the coordinate axis where
    a is smallest.
    """
    a = a / np.linalg.norm(a)
    b = b / np.linalg.norm(b)
    sine_axis = np.linalg.cross(a, b)
    cosine = float(a @ b)
    if cosine < 0.0 and float(sine_axis @ sine_axis) < np.finfo(np.float64).eps ** 2:
        axis = np.eye(3)[np.argmin(np.abs(a))]
        axis = axis - a * (axis @ a)
        axis /= np.linalg.norm(axis)
        return 2.0 * np.outer(axis, axis) - np.eye(3)
    # Two reflections: through the bisector (stable for every angle below pi).
    bisector = a + b
    if cosine < 0.0:
        # a + b cancels near pi; (a x b) x (a - b) has its direction.
        bisector = np.linalg.cross(np.linalg.cross(a, b), a - b)
    bisector /= np.linalg.norm(bisector)
    reflect_a = np.eye(3) - 2.0 * np.outer(a, a)
    reflect_bisector = np.eye(3) - 2.0 * np.outer(bisector, bisector)
    return reflect_bisector @ reflect_a


@dataclass(frozen=True)
class Similarity:
    """`scale * rotation @ x + shift`.

    Attributes
    ----------
    scale: positive; rotation: (3, 3), proper; shift: (3,).
    """

    scale: float
    rotation: Floats
    shift: Floats

    def __call__(self, points: Floats) -> Floats:
        """Images (n, 3) of points (n, 3), or (3,) of one."""
        return self.scale * (points @ self.rotation.T) + self.shift


def best_similarity(points: Floats, onto: Floats, weights: Floats) -> Similarity:
    """Similarity with the least weighted sum of squared distances between images of points (n, 3)
    and other points (n, 3); weights: (n,) not negative.

    Source: Umeyama, IEEE Trans. Pattern Anal. Mach. Intell. 13(4), 1991.
    """
    parts = weights / weights.sum()
    middle, goal = parts @ points, parts @ onto
    offsets, wanted = points - middle, onto - goal
    left, sizes, right = np.linalg.svd((parts[:, None] * wanted).T @ offsets)
    proper = np.array([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    rotation = left @ np.diag(proper) @ right
    scale = float((sizes * proper).sum() / (parts @ (offsets * offsets).sum(-1)))
    return Similarity(scale, rotation, goal - scale * rotation @ middle)
