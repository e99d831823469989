"""What a center of mass is to do for the probabilities of a body: goals, the probabilities as
functions of the center of mass, and goals as residuals that are to be zero, linear in the
probabilities."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np
import torch

from dicedesign.errors import InputError, is_finite_number
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import angle_between, unit_vectors
from dicedesign.gradient.rest_probabilities import RestEvaluation
from dicedesign.rest.basins import Basins, basin_areas
from dicedesign.rest.equilibria import classify
from dicedesign.rest.morse import separatrices
from dicedesign.rest.outcomes import assign_rests
from dicedesign.rest.poses import RestPoses
from dicedesign.runtime.arrays import Booleans, Floats, Integers
from dicedesign.tolerances import PROBABILITY_SUM_TOLERANCE, SAME_REST_ANGLE

MOST_POSES: Final = 100
"""That a goal is about: three coordinates do not lead many probabilities."""


@dataclass(frozen=True)
class EqualProbabilities:
    """Equal probabilities of the most probable poses, whichever these are then (Figure 12).

    `count`: of these poses, from 2 to `MOST_POSES`. Raises InputError for another.
    """

    count: int

    def __post_init__(self) -> None:
        if self.count != int(self.count) or not 2 <= self.count <= MOST_POSES:
            raise InputError(
                f"equal: expected a number of poses from 2 to {MOST_POSES}, got {self.count}; take "
                "3, say"
            )


@dataclass(frozen=True)
class Standing:
    """The largest probabilities of one pose.

    Give one of `pose`, its number as `dicedesign rest` lists it, 1 for the most probable, and
    `down`, (x, y, z), the direction that points down then, to within 5 degrees. Raises InputError
    for neither, both, or what is none.
    """

    pose: int | None = None
    down: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        if (self.pose is None) == (self.down is None):
            raise InputError(
                "stand: expected the number of a pose or the direction that points down, got "
                f"{'neither' if self.pose is None else 'both'}; give one"
            )
        if self.pose is not None and (self.pose != int(self.pose) or self.pose < 1):
            raise InputError(
                f"stand: expected the number of a pose, 1 for the most probable, got {self.pose}; "
                "dicedesign rest lists them"
            )
        if self.down is not None and (
            len(self.down) != 3
            or not all(map(is_finite_number, self.down))
            or not 0.0 < sum(abs(x) for x in self.down) < 1e100
        ):
            raise InputError(
                f"stand: expected a direction x,y,z other than 0,0,0, got {self.down}; 0,0,-1 is "
                "down as the body is in its file"
            )


@dataclass(frozen=True)
class FewestRests:
    """Goal: as few rests as possible."""


@dataclass(frozen=True)
class GivenProbabilities:
    """Probabilities of some poses; all others are left what remains.

    Attributes
    ----------
    probabilities: above 0, with a sum of at most 1.
    poses: as many numbers of poses, as `dicedesign rest` lists them, from 1; None for the most
        probable ones, whichever these are then, in the order of their probabilities.

    Raises InputError for what is none.
    """

    probabilities: tuple[float, ...]
    poses: tuple[int, ...] | None = None

    def __post_init__(self) -> None:
        probabilities = self.probabilities
        if not 1 <= len(probabilities) <= MOST_POSES or not all(
            map(is_finite_number, probabilities)
        ):
            raise InputError(
                f"target: expected from 1 to {MOST_POSES} probabilities, got {probabilities}; "
                "give some "
                "numbers"
            )
        if min(probabilities) <= 0.0 or sum(probabilities) > 1.0 + PROBABILITY_SUM_TOLERANCE:
            raise InputError(
                "target: expected probabilities above 0 with a sum of at most 1, got "
                f"{', '.join(f'{p:g}' for p in probabilities)} with a sum of "
                f"{sum(probabilities):.6g}; what they "
                "leave is for all other poses"
            )
        if self.poses is None:
            return
        if len(self.poses) != len(self.probabilities) or len(set(self.poses)) < len(self.poses):
            raise InputError(
                f"poses: expected {len(self.probabilities)} numbers of poses, each once, as there "
                "are probabilities, "
                f"got {self.poses}; give one for each"
            )
        if any(pose != int(pose) or pose < 1 for pose in self.poses):
            raise InputError(
                f"poses: expected numbers of poses, 1 for the most probable, got {self.poses}; "
                "dicedesign rest lists them"
            )


Goal: TypeAlias = EqualProbabilities | Standing | FewestRests | GivenProbabilities
"""What a center of mass is to do."""


@dataclass(frozen=True, eq=False)
class Rests:
    """The rests of a hull with one center of mass.

    Attributes
    ----------
    basins: of the body; facets: (k,) of the hull; normals: (k, 3) theirs; probabilities: (k,).
    """

    basins: Basins
    facets: Integers
    normals: Floats
    probabilities: Floats

    def slopes(self, weights: Floats) -> Floats:
        """(r, 3) gradients in the center of mass of sums of the probabilities times weights (r,
        k)."""
        equilibria = self.basins.equilibria
        center = torch.tensor(equilibria.center_of_mass, requires_grad=True)
        vertices = torch.from_numpy(equilibria.hull.vertices)
        probabilities = RestEvaluation(equilibria, vertices, center, self.basins).probabilities
        numbers = [
            torch.autograd.grad(probabilities, center, torch.from_numpy(row), retain_graph=True)[
                0
            ].numpy()
            for row in np.ascontiguousarray(weights)
        ]
        return np.stack(numbers)


def rests_at(hull: ConvexHull, center: Floats) -> Rests | None:
    """The rests of a hull with a center of mass (3,); None where there are none to be had: it is
    not inside, or facets are too uneven for it.

    A body that is tied to within rounding is taken for one beside it, unlike by `rest_poses`: a
    search does not end where probabilities jump, and looking for ties takes up to a hundred times
    as long.
    """
    try:
        equilibria = classify(hull, center)
        paths = separatrices(equilibria)
        basins = Basins(equilibria, paths, basin_areas(equilibria, paths))
    except InputError:
        return None
    return Rests(basins, paths.rests, hull.normals[paths.rests], basins.areas / (4.0 * np.pi))


def top_directions(rests: Rests, count: int) -> Floats:
    """(c, 3) down in the most probable poses, c at most `count`, each a rest with all that are
    within `SAME_REST_ANGLE` of it and not of a more probable one; by probabilities."""
    order = np.argsort(-rests.probabilities, kind="stable")
    left, own = rests.normals[order], []
    while len(left) > 0:
        own.append(left[0])
        left = left[angle_between(left, left[0]) > SAME_REST_ANGLE]
    directions = np.array(own)
    probabilities = assign_rests(rests.normals, rests.probabilities, directions).probabilities
    return directions[np.argsort(-probabilities, kind="stable")[:count]]


def pose_probabilities(poses: RestPoses, directions: Floats) -> Floats:
    """(c,) probabilities of poses with directions (c, 3), summed over the rests that count for
    each. A pose without a rest within `SAME_REST_ANGLE` has probability 0."""
    counted = _count_rests(poses.normals, poses.probabilities, directions)
    return np.asarray(counted @ poses.probabilities)


def _count_rests(normals: Floats, probabilities: Floats, directions: Floats) -> Booleans:
    """(c, k) whether each rest counts for each of the poses."""
    outcomes = assign_rests(normals, probabilities, directions)
    counted = outcomes.outcome_of_rest == np.arange(len(directions))[:, None]
    near = angle_between(normals[outcomes.main], directions) <= SAME_REST_ANGLE
    return np.asarray(counted & (near & (outcomes.main >= 0))[:, None])


@dataclass(frozen=True, eq=False)
class ServedGoal:
    """Distance of the rests of a body from a goal.

    Attributes
    ----------
    directions: (c, 3) down in the poses that the goal is about.
    probabilities: (c,) theirs; wanted: (c,).
    residuals: (r,), of which the sum of squares is to be least.
    weights: (r, k) derivatives of the residuals by the probabilities of the rests.
    """

    directions: Floats
    probabilities: Floats
    wanted: Floats
    residuals: Floats
    weights: Floats


Objective: TypeAlias = Callable[[Rests, float], ServedGoal]
"""From rests, and how much it counts that little is left to other poses, to residuals."""


def objective_of(
    goal: EqualProbabilities | Standing | GivenProbabilities, poses: RestPoses
) -> Objective:
    """The residuals of a goal.

    poses: of the body as it is, whose numbers the goal has.

    Raises InputError: no such pose.
    """
    directions = wanted = None
    if isinstance(goal, EqualProbabilities):
        count = goal.count
    elif isinstance(goal, Standing):
        count, directions, wanted = 1, pose_direction(goal, poses)[None], np.ones(1)
    else:
        count, wanted = len(goal.probabilities), np.sort(goal.probabilities)[::-1]
        if goal.poses is not None:
            wanted = np.array(goal.probabilities)
            directions = np.stack([_check_pose("poses", pose, poses) for pose in goal.poses])
            angles = angle_between(directions[:, None], directions[None])
            angles[np.tril_indices(count)] = np.pi
            first, second = np.unravel_index(int(angles.argmin()), angles.shape)
            if angles[first, second] <= SAME_REST_ANGLE:
                raise InputError(
                    f"poses: expected poses more than 5 degrees apart, got {goal.poses[first]} and "
                    f"{goal.poses[second]}, {np.degrees(angles[first, second]):.2g} degrees apart, "
                    "which are one to the eye; leave one out"
                )

    def serve(rests: Rests, share: float) -> ServedGoal:
        chosen = top_directions(rests, count) if directions is None else directions
        # Poses that are missing have no probabilities, and no direction.
        counted = np.zeros((count, len(rests.probabilities)))
        counted[: len(chosen)] = _count_rests(rests.normals, rests.probabilities, chosen)
        probabilities = counted @ rests.probabilities
        if wanted is not None:
            return ServedGoal(chosen, probabilities, wanted, probabilities - wanted, counted)
        mean = probabilities.mean()
        # Their differences from the mean, and what all together lack of 1.
        rows = np.vstack([counted - counted.mean(axis=0), share * counted.sum(axis=0)[None]])
        residuals = np.append(probabilities - mean, share * (probabilities.sum() - 1.0))
        return ServedGoal(chosen, probabilities, np.full(count, mean), residuals, rows)

    return serve


def pose_direction(goal: Standing, poses: RestPoses) -> Floats:
    """(3,) down in the pose that a body is to stand in. Raises InputError for none."""
    if goal.down is None:
        assert goal.pose is not None
        return _check_pose("stand", goal.pose, poses)
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


def _check_pose(key: str, pose: int, poses: RestPoses) -> Floats:
    count = len(poses.facets)
    if pose > count:
        raise InputError(
            f"{key}: expected the number of a pose from 1 to {count}, got {pose}; dicedesign rest "
            "lists them, and a direction will do for a face that the body does not rest on"
        )
    return poses.normals[pose - 1]
