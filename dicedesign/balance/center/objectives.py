"""Goals as residuals that are to be zero, linear in the odds of the rests."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from dicedesign.balance.center.goals import EqualOdds, GivenOdds, Standing
from dicedesign.balance.center.rests_at import Rests, counted_for, top_directions
from dicedesign.errors import InputError
from dicedesign.geometry.sphere import angle_between, unit_vectors
from dicedesign.rest.poses import RestPoses
from dicedesign.runtime.arrays import Floats
from dicedesign.tolerances import SAME_REST_ANGLE

__all__ = ["Objective", "ServedGoal", "objective_of", "pose_direction"]


@dataclass(frozen=True, eq=False)
class ServedGoal:
    """How far rests are from a goal.

    Attributes
    ----------
    directions: (c, 3) down in the poses that the goal is about.
    odds: (c,) theirs; wanted: (c,).
    residuals: (r,), of which the sum of squares is to be least.
    weights: (r, k) derivatives of the residuals by the odds of the rests.
    """

    directions: Floats
    odds: Floats
    wanted: Floats
    residuals: Floats
    weights: Floats

    @property
    def error(self) -> float:
        """Largest difference between odds and what is wanted."""
        return float(np.abs(self.odds - self.wanted).max())


Objective: TypeAlias = Callable[[Rests, float], ServedGoal]
"""From rests, and how much it counts that little is left to other poses, to residuals."""


def objective_of(goal: EqualOdds | Standing | GivenOdds, poses: RestPoses) -> Objective:
    """The residuals of a goal.

    poses: of the body as it is, whose numbers the goal has.

    Raises InputError: no such pose.
    """
    if isinstance(goal, EqualOdds):
        return _equal(goal.count)
    if isinstance(goal, Standing):
        return _given(pose_direction(goal, poses)[None], np.ones(1))
    wanted = np.array(goal.odds, dtype=np.float64)
    if goal.poses is None:
        return _given(None, np.sort(wanted)[::-1])
    directions = np.stack([_numbered("poses", pose, poses) for pose in goal.poses])
    _check_apart(goal.poses, directions)
    return _given(directions, wanted)


def pose_direction(goal: Standing, poses: RestPoses) -> Floats:
    """(3,) down in the pose that a body is to stand in. Raises InputError for none."""
    if goal.down is None:
        assert goal.pose is not None
        return _numbered("stand", goal.pose, poses)
    down = unit_vectors(np.array(goal.down, dtype=np.float64))
    angles = angle_between(poses.hull.normals, down)
    nearest = int(angles.argmin())
    if angles[nearest] > SAME_REST_ANGLE:
        other = ",".join(f"{x + 0.0:.4g}" for x in poses.hull.normals[nearest])
        raise InputError(
            "stand: expected a direction within 5 degrees of a facet's normal, got "
            f"{','.join(f'{x:g}' for x in goal.down)}, {np.degrees(angles[nearest]):.3g} from the "
            f"nearest, {other}; there is no face to stand on, take that one"
        )
    return poses.hull.normals[nearest]


def _numbered(key: str, pose: int, poses: RestPoses) -> Floats:
    count = len(poses.facets)
    if pose > count:
        raise InputError(
            f"{key}: expected the number of a pose from 1 to {count}, got {pose}; dicedesign rest "
            "lists them, and a direction will do for a face that the body does not rest on"
        )
    return poses.normals[pose - 1]


def _check_apart(numbers: tuple[int, ...], directions: Floats) -> None:
    angles = angle_between(directions[:, None], directions[None])
    angles[np.tril_indices(len(directions))] = np.pi
    first, second = np.unravel_index(int(angles.argmin()), angles.shape)
    if angles[first, second] <= SAME_REST_ANGLE:
        raise InputError(
            f"poses: expected poses more than 5 degrees apart, got {numbers[first]} and "
            f"{numbers[second]}, {np.degrees(angles[first, second]):.2g} degrees apart, which are "
            "one to the eye; leave one out"
        )


def _given(directions: Floats | None, wanted: Floats) -> Objective:
    def serve(rests: Rests, share: float) -> ServedGoal:
        chosen = top_directions(rests, len(wanted)) if directions is None else directions
        counted = counted_for(rests, chosen).astype(np.float64)
        # Poses that are missing have no odds, and no direction.
        counted = np.pad(counted, ((0, len(wanted) - len(counted)), (0, 0)))
        odds = counted @ rests.odds
        return ServedGoal(chosen, odds, wanted, odds - wanted, counted)

    return serve


def _equal(count: int) -> Objective:
    def serve(rests: Rests, share: float) -> ServedGoal:
        chosen = top_directions(rests, count)
        counted = counted_for(rests, chosen).astype(np.float64)
        counted = np.pad(counted, ((0, count - len(counted)), (0, 0)))
        odds = counted @ rests.odds
        mean = odds.mean()
        # Their differences from the mean, and what all together lack of 1.
        rows = np.vstack([counted - counted.mean(axis=0), share * counted.sum(axis=0)[None]])
        residuals = np.append(odds - mean, share * (odds.sum() - 1.0))
        return ServedGoal(chosen, odds, np.full(count, mean), residuals, rows)

    return serve
