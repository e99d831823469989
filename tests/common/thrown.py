"""Bodies to throw, and statistical tests of counts."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats
from scipy.spatial.transform import Rotation

from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.body import make_body
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.throws.rigid_body import RigidBody, release_states, rigid_body
from dicedesign.throws.tables import Table

BOARD = Table("board", restitution=0.65, friction=0.2, height=0.1, speed=0.3, spin=15.0)
"""Table whose throws differ only in orientation."""


def rigid_body_with_rests(
    points: ArrayLike, center: ArrayLike | None = None
) -> tuple[RigidBody, RestPoses]:
    """Rigid body and rests of the hull of points. center: center of mass; None is uniform."""
    body = make_body(points)
    poses = rest_poses(body, center)
    return rigid_body(body, poses), poses


def box(*half: float) -> np.ndarray:
    """Corners of a box around the origin. half: half of each side."""
    return np.array(list(product((-1.0, 1.0), repeat=3))) * half


OCTAHEDRON = np.concatenate([np.eye(3), -np.eye(3)])


def random_points(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.normal(size=(6 + 2 * seed, 3)) * [1.0, 0.8, 0.6] + [3.0, 2.0, 1.0]


def random_body(seed: int) -> tuple[RigidBody, RestPoses]:
    """Random body whose center of mass is not its centroid."""
    points = random_points(seed)
    hull = convex_hull(points)
    inner_point = np.random.default_rng(seed).dirichlet(np.ones(len(points))) @ points
    return rigid_body_with_rests(points, 0.6 * hull.centroid + 0.4 * inner_point)


def sample_states(body: RigidBody, table: Table, drops: int, seed: int = 0) -> np.ndarray:
    """Release states (n, 13) of throws."""
    return release_states(body, table, drops, np.random.default_rng(seed))


def turns_of(states: np.ndarray) -> np.ndarray:
    """Rotations (n, 3, 3) from principal axes to the world."""
    return Rotation.from_quat(states[:, 3:7], scalar_first=True).as_matrix()


def fits(counts: ArrayLike, probabilities: ArrayLike) -> float:
    """p-value of Pearson's chi-squared test of counts against probabilities."""
    came = np.asarray(counts, dtype=np.float64)
    return float(stats.chisquare(came, came.sum() * np.asarray(probabilities)).pvalue)


def alike(first: ArrayLike, second: ArrayLike) -> float:
    """p-value of the chi-squared test of homogeneity; rare outcomes are merged."""
    both = np.array([first, second])
    rare = both.sum(axis=0) < 20
    if rare.any():
        both = np.column_stack([both[:, ~rare], both[:, rare].sum(axis=1)])
    both = both[:, both.sum(axis=0) > 0]
    return float(stats.chi2_contingency(both).pvalue)
