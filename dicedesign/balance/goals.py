"""Goals for a center of mass, goals as residuals that are linear in the probabilities of rests, and
descents of their squares."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import torch

from dicedesign.balance.regions import Halfspaces, least_within
from dicedesign.errors import InputError, check_whole
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import angle_between, unit_vectors
from dicedesign.gradient.rest_probabilities import RestEvaluation
from dicedesign.rest.basins import Basins, basin_areas
from dicedesign.rest.equilibria import classify
from dicedesign.rest.morse import separatrices
from dicedesign.rest.outcomes import assign_rests
from dicedesign.rest.poses import RestPoses
from dicedesign.runtime.arrays import Booleans, Floats
from dicedesign.tolerances import PROBABILITY_SUM_TOLERANCE, SAME_REST_ANGLE

MAX_POSES = 100
"""Largest number of poses of a goal; three coordinates do not control many probabilities."""


@dataclass(frozen=True)
class EqualProbabilities:
    """Goal: equal probabilities of the most probable poses, whichever these are then (Figure 12).

    count: number of poses, from 2 to `MAX_POSES`. Raises InputError for another.
    """

    count: int

    def __post_init__(self) -> None:
        check_whole("equal", self.count, 2, MAX_POSES)


@dataclass(frozen=True)
class Standing:
    """Goal: the largest probability of one pose.

    Give one of `pose`, its number in `dicedesign rest`, 1 for the most probable, and `down`,
    (x, y, z), the direction that points down in the pose, to within 5 degrees. Raises InputError
    for neither, both, or invalid ones.
    """

    pose: int | None = None
    down: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        if (self.pose is None) == (self.down is None):
            raise InputError(
                "stand: expected the number of a pose or the direction that points down, got "
                f"{'neither' if self.pose is None else 'both'}; give one"
            )
        if self.pose is not None:
            check_whole("stand", self.pose)
        elif self.down is not None and (
            len(self.down) != 3 or not 0.0 < sum(map(abs, self.down)) < 1e100
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
    """Goal: given probabilities of some poses; the rest is for all other poses.

    Attributes
    ----------
    probabilities: above 0, with a sum of at most 1.
    poses: numbers of the poses in `dicedesign rest`, from 1; None for the most probable poses,
        whichever these are then, in the order of their probabilities.

    Raises InputError for invalid values.
    """

    probabilities: tuple[float, ...]
    poses: tuple[int, ...] | None = None

    def __post_init__(self) -> None:
        p, poses = self.probabilities, self.poses
        most = 1.0 + PROBABILITY_SUM_TOLERANCE
        if not (1 <= len(p) <= MAX_POSES and min(p) > 0.0 and sum(p) <= most):
            raise InputError(
                f"target: expected probabilities of 1 to {MAX_POSES} poses, above 0 and with a sum "
                f"of at most 1, got {', '.join(f'{x:g}' for x in p)}; correct them"
            )
        if poses is not None and not (len(poses) == len(set(poses)) == len(p) and min(poses) > 0):
            raise InputError(
                f"poses: expected {len(p)} numbers of poses, each once, 1 for the most probable, "
                f"got {poses}; give one for each of the probabilities"
            )


Goal: TypeAlias = EqualProbabilities | Standing | FewestRests | GivenProbabilities
"""Goal for a center of mass."""


@dataclass(frozen=True, eq=False)
class Rests:
    """Rests of a hull with one center of mass.

    Attributes
    ----------
    basins: of the body; normals: (k, 3) of their facets; probabilities: (k,).
    """

    basins: Basins
    normals: Floats
    probabilities: Floats

    def slopes(self, weights: Floats) -> Floats:
        """(r, 3) gradients of weighted sums of the probabilities with respect to the center of
        mass; weights: (r, k)."""
        equilibria = self.basins.equilibria
        center = torch.tensor(equilibria.center_of_mass, requires_grad=True)
        vertices = torch.from_numpy(equilibria.hull.vertices)
        probabilities = RestEvaluation(equilibria, vertices, center, self.basins).probabilities
        gradients = [
            torch.autograd.grad(probabilities, center, row, retain_graph=True)[0].numpy()
            for row in torch.from_numpy(np.ascontiguousarray(weights))
        ]
        return np.stack(gradients)


def rests_at(hull: ConvexHull, center: Floats) -> Rests | None:
    """Rests of a hull with a center of mass (3,); None if it is not inside, or facets are too
    uneven.

    Unlike in `rest_poses`, a body that balances within rounding is not treated as a mean of both
    sides: a search does not end at jumps, and their detection takes up to a hundred times as long.
    """
    try:
        equilibria = classify(hull, center)
        paths = separatrices(equilibria)
        basins = Basins(equilibria, paths, basin_areas(equilibria, paths))
    except InputError:
        return None
    return Rests(basins, hull.normals[paths.rests], basins.areas / (4.0 * np.pi))


def top_directions(rests: Rests | RestPoses, count: int) -> Floats:
    """(c, 3) directions that point down in the c <= `count` most probable poses, sorted by
    probability. Rests within `SAME_REST_ANGLE` of a more probable one belong to its pose."""
    order = np.argsort(-rests.probabilities, kind="stable")
    left, own = rests.normals[order], []
    while len(left) > 0:
        own.append(left[0])
        left = left[angle_between(left, left[0]) > SAME_REST_ANGLE]
    directions = np.array(own)
    probabilities = assign_rests(rests.normals, rests.probabilities, directions).probabilities
    return directions[np.argsort(-probabilities, kind="stable")[:count]]


def pose_probabilities(poses: RestPoses, directions: Floats) -> Floats:
    """(c,) probabilities of poses with directions (c, 3), summed over the rests of each. A pose
    without a rest within `SAME_REST_ANGLE` has probability 0."""
    return np.asarray(_rests_of_poses(poses, directions) @ poses.probabilities)


def _rests_of_poses(rests: Rests | RestPoses, directions: Floats) -> Booleans:
    """(c, k) whether each rest belongs to each of the poses."""
    outcomes = assign_rests(rests.normals, rests.probabilities, directions)
    belongs = outcomes.outcome_of_rest == np.arange(len(directions))[:, None]
    near = angle_between(rests.normals[outcomes.main], directions) <= SAME_REST_ANGLE
    return np.asarray(belongs & (near & (outcomes.main >= 0))[:, None])


@dataclass(frozen=True, eq=False)
class ServedGoal:
    """Residuals of a goal for the rests of a body.

    Attributes
    ----------
    directions: (c, 3) directions that point down in the poses of the goal.
    probabilities, wanted: (c,) of these poses.
    residuals: (r,), whose sum of squares is minimized.
    weights: (r, k) derivatives of the residuals with respect to the probabilities of the rests.
    """

    directions: Floats
    probabilities: Floats
    wanted: Floats
    residuals: Floats
    weights: Floats


Objective: TypeAlias = Callable[[Rests | RestPoses, float], ServedGoal]
"""Function of rests and of the weight of the probability of other poses."""


def objective_of(
    goal: EqualProbabilities | Standing | GivenProbabilities, poses: RestPoses
) -> Objective:
    """Residuals of a goal.

    poses: of the original body, to which the numbers of the goal refer.

    Raises InputError for a pose that the body does not have.
    """
    directions = wanted = None
    if isinstance(goal, EqualProbabilities):
        count = goal.count
    elif isinstance(goal, Standing):
        count, directions, wanted = 1, _standing_direction(goal, poses)[None], np.ones(1)
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
                    "which is too near to tell apart; leave one out"
                )

    def serve(rests: Rests | RestPoses, share: float) -> ServedGoal:
        chosen = top_directions(rests, count) if directions is None else directions
        # Missing poses have no direction and probability 0.
        belongs = np.zeros((count, len(rests.probabilities)))
        belongs[: len(chosen)] = _rests_of_poses(rests, chosen)
        probabilities = belongs @ rests.probabilities
        if wanted is not None:
            return ServedGoal(chosen, probabilities, wanted, probabilities - wanted, belongs)
        mean = probabilities.mean()
        # Differences from the mean, and the probability of other poses.
        rows = np.vstack([belongs - belongs.mean(axis=0), share * belongs.sum(axis=0)[None]])
        residuals = np.append(probabilities - mean, share * (probabilities.sum() - 1.0))
        return ServedGoal(chosen, probabilities, np.full(count, mean), residuals, rows)

    return serve


def _standing_direction(goal: Standing, poses: RestPoses) -> Floats:
    """(3,) direction that points down in the wanted pose. Raises InputError if there is none."""
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


ENOUGH = 1e-12
"""Norm of the residuals at which a goal is reached exactly."""

DAMPING = (1e-3, 0.2, 8.0, 1e12)
"""Damping of the first step, relative to the largest squared slope; factors after an accepted and
after a rejected step; and largest damping, at which the descent stops."""

FIRST_SEARCH = 0.02
"""Length of the first steps along the axes, relative to the diameter of the hull."""

LAST_SEARCH = 1e-5
"""Least length of steps along the axes, relative to the diameter of the hull."""

AXES = np.concatenate([np.eye(3), -np.eye(3)])


@dataclass(frozen=True)
class Descent:
    """Descent of one objective for one hull.

    Attributes
    ----------
    within: region of the center of mass.
    steps: largest number of steps of each kind.
    share: weight of the probability of other poses.
    """

    hull: ConvexHull
    objective: Objective
    within: Halfspaces
    steps: int
    share: float = 0.0

    def value(self, center: Floats) -> float:
        """Sum of squares at a center of mass (3,); infinite outside of the region."""
        return self._serve(center)[0]

    def from_center(self, center: Floats) -> Floats:
        """Center of mass at the end of a descent.

        Levenberg-Marquardt steps minimize the quadratic model within the half-spaces. If none
        descends, at jumps or kinks of the probabilities, steps of decreasing length along the axes
        are tried.
        """
        value = self.value(center)
        for _ in range(3):
            center, now = self.by_squares(center)
            length = FIRST_SEARCH * self.hull.diameter
            for _ in range(self.steps):
                if now <= ENOUGH**2 or length < LAST_SEARCH * self.hull.diameter:
                    break
                values = [self.value(center + length * axis) for axis in AXES]
                least = int(np.argmin(values))
                if values[least] < now:
                    center, now = center + length * AXES[least], values[least]
                else:
                    length *= 0.5
            if now <= ENOUGH**2 or now >= (1.0 - 1e-6) * value:
                break
            value = now
        return center

    def by_squares(self, center: Floats) -> tuple[Floats, float]:
        """Center of mass after Levenberg-Marquardt steps alone, and its sum of squares."""
        damping, factor_less, factor_more, most = DAMPING
        value, served_rests = self._serve(center)
        for _ in range(self.steps):
            if served_rests is None or value <= ENOUGH**2:
                break
            served, rests = served_rests
            slopes = rests.slopes(served.weights)
            form, slope = slopes.T @ slopes, slopes.T @ served.residuals
            largest = float(np.diag(form).max())
            heights = self.within.heights(center).clip(0.0)
            while damping <= most and largest > 0.0:
                damped = form + damping * largest * np.eye(3)
                step = least_within(damped, slope, self.within.normals, heights)
                now, following = self._serve(center + step)
                if now < value:
                    break
                damping *= factor_more
            else:
                break
            center, damping = center + step, damping * factor_less
            before, value, served_rests = value, now, following
            if value > (1.0 - 1e-9) * before:
                break
        return center, value

    def _serve(self, center: Floats) -> tuple[float, tuple[ServedGoal, Rests] | None]:
        is_outside = (self.within.heights(center) < -1e-12 * self.hull.diameter).any()
        rests = None if is_outside else rests_at(self.hull, center)
        if rests is None:
            return np.inf, None
        served = self.objective(rests, self.share)
        return float(served.residuals @ served.residuals), (served, rests)
