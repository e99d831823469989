"""A body whose center of mass was moved."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from dicedesign.balance.ways.way import Made
from dicedesign.geometry.sphere import angle_between
from dicedesign.rest.poses import RestPoses
from dicedesign.runtime.arrays import Floats
from dicedesign.tolerances import SAME_REST_ANGLE

__all__ = ["Balanced"]


@dataclass(frozen=True, eq=False)
class Balanced:
    """A body with its center of mass elsewhere. Lengths are in mm.

    Attributes
    ----------
    reached: whether the file has what was wanted.
    by: the way in which it was made.
    directions: (c, 3) down in the poses that the goal is about, of fewest rests in all that are
        left, in the file.
    before: (c,) odds of these poses as the body came; odds: (c,) by the files read back.
    wanted: (c,) or None where the goal is no number.
    rests: by the files read back; rests_before.
    center_before, center_wanted, center: (3,) of mass; the last by the files read back.
    clearance: distance from the center of mass to the nearest at which a rest appears or vanishes.
    made: the files.
    poses_before, poses: rests of the body as it came, and by the files.
    notes: what was done, and what would do more, a sentence each.
    """

    reached: bool
    by: str
    directions: Floats
    before: Floats
    odds: Floats
    wanted: Floats | None
    rests: int
    rests_before: int
    center_before: Floats
    center_wanted: Floats
    center: Floats
    clearance: float
    made: Made
    poses_before: RestPoses
    poses: RestPoses
    notes: tuple[str, ...]

    @property
    def error(self) -> float | None:
        """Largest difference of odds from what is wanted; None where that is no number."""
        return None if self.wanted is None else float(np.abs(self.odds - self.wanted).max())

    @property
    def numbers(self) -> tuple[int | None, ...]:
        """Of the poses as `dicedesign rest` lists them for the body as it came; None for those that
        it had not."""
        angles = angle_between(self.directions[:, None], self.poses_before.normals[None])
        nearest = angles.argmin(axis=1)
        near = angles.min(axis=1) <= SAME_REST_ANGLE
        return tuple(int(k) + 1 if found else None for k, found in zip(nearest, near, strict=True))

    def data(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "reached": self.reached,
            "by": self.by,
            "poses": [
                {
                    "pose": number,
                    "normal": normal.tolist(),
                    "before": float(before),
                    "wanted": None if wanted is None else float(wanted),
                    "odds": float(odds),
                }
                for number, normal, before, wanted, odds in zip(
                    self.numbers,
                    self.directions,
                    self.before,
                    [None] * len(self.odds) if self.wanted is None else self.wanted,
                    self.odds,
                    strict=True,
                )
            ],
            "max_abs_error": self.error,
            "rests_before": self.rests_before,
            "rests": self.rests,
            "center_before_mm": self.center_before.tolist(),
            "center_wanted_mm": self.center_wanted.tolist(),
            "center_mm": self.center.tolist(),
            "clearance_mm": self.clearance,
            "wall_mm": self.made.wall_mm,
            "made": dict(self.made.facts),
            "notes": list(self.notes),
        }
