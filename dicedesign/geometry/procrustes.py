"""The similarity that lays one set of points best onto another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dicedesign.runtime.arrays import Floats


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
        """(n, 3) images of points (n, 3), or (3,) that of one."""
        return self.scale * (points @ self.rotation.T) + self.shift


def best_similarity(points: Floats, onto: Floats, weights: Floats) -> Similarity:
    """That with the least weighted sum of squared distances of the images of points (n, 3) from
    others (n, 3); weights: (n,) not negative.

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
