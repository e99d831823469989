"""What of a body's geometry lets momentum carry it into another rest than the model says.

Rests that lie near the border of their basin, and saddles that lie nearer to one of their two rests
than to the other, lose against simulations in which bodies keep their speed (section 4.1).
"""

from __future__ import annotations

from types import ModuleType
from typing import Any, Final

import numpy as np

from dicedesign.geometry.sphere import angle_between, norms
from dicedesign.rest.morse import Separatrices
from dicedesign.rest.poses import RestPoses
from dicedesign.runtime.arrays import Floats

SHORT_ARC: Final = 1e-24
"""Squared sine of an arc below which its chord takes its place."""


def asymmetry(poses: RestPoses) -> float:
    """The asymmetry rho of a body, 0 to 1/2 times the number of pairs of neighbouring basins.

    A pair counts once, at the lowest saddle of its border, over which a body rolls at the least
    speed. With every saddle counted, a coin would have the more the more corners it is drawn with:
    0.56 for 40 in place of 0.014.

    Source: eq. 20, 21.
    """
    morse = poses.morse
    pairs = np.sort(morse.saddle_basins, axis=1)
    heights = (morse.equilibria.radii @ morse.saddles.T).max(axis=0)
    lowest_first = np.argsort(heights, kind="stable")
    # The first of each pair is kept.
    _, first = np.unique(pairs[lowest_first], axis=0, return_index=True)
    saddles = lowest_first[first]
    basins = pairs[saddles]
    angles = angle_between(poses.normals[basins], morse.saddles[saddles, None])
    # phi - 1/2
    unequal = angles.max(axis=1) / angles.sum(axis=1) - 0.5
    return float((poses.probabilities[basins].min(axis=1) * unequal).sum())


def border_margins(poses: RestPoses) -> Floats:
    """(k,) least angle in radians from each rest's normal to the border of its basin, at saddles or
    anywhere else; pi for a body with one rest."""
    a, b = poses.morse.branches[:, :-1], poses.morse.branches[:, 1:]
    plane = np.linalg.cross(a, b)
    margins = np.full(len(poses.normals), np.pi)
    for basins in poses.morse.saddle_basins.T:
        basin = np.repeat(basins, 2)
        normal = poses.normals[basin][:, None]
        # The foot on the great circle counts if it lies on the arc.
        above = (np.linalg.cross(plane, a) * normal).sum(-1) > 0.0
        below = (np.linalg.cross(b, plane) * normal).sum(-1) > 0.0
        height = np.arctan2(np.abs((plane * normal).sum(-1)), norms(np.linalg.cross(plane, normal)))
        ends = np.minimum(angle_between(a, normal), angle_between(b, normal))
        angles = np.where(above & below, height, ends)
        np.minimum.at(margins, basin, angles.min(axis=1))
    return margins


def basin_moments(paths: Separatrices, points: Any, xp: ModuleType) -> Any:
    """(k, 3) integrals of the direction over each basin, which point to the basins' barycenters.

    An arc of angle t in a plane with unit normal m, counter-clockwise about the basin, contributes
    m t / 2, by Stokes' theorem; so no more than the border is needed.

    paths: the separatrices; points: (2 s, depth + 2, 3) on them, from `separatrix_points`, NumPy or
    torch as `xp` says.
    """
    unit = points / xp.sqrt((points * points).sum(-1))[..., None]
    a, b = unit[:, :-1], unit[:, 1:]
    cross = xp.linalg.cross(a, b)
    squared = (cross * cross).sum(-1)
    curved = squared > SHORT_ARC
    sine = xp.sqrt(xp.where(curved, squared, 1.0))
    ratio = xp.where(curved, xp.atan2(sine, (a * b).sum(-1)) / sine, 1.0)
    halves = (ratio[..., None] * cross).sum(1).reshape(-1, 2, 3) / 2.0
    # The branch into the head's cell runs along the left basin's border, the other against it.
    left = halves[:, 0] - halves[:, 1]
    borders = paths.basins[None] == np.arange(len(paths.rests))[:, None, None]
    signs = borders[..., 0].astype(np.float64) - borders[..., 1]
    return xp.asarray(signs) @ left
