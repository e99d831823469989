"""Exact replacements for functions of other libraries, with equal names and results."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from dicedesign.errors import InputError, OutsideHullError, check_whole, is_finite_number
from dicedesign.runtime.arrays import Floats, Integers

if TYPE_CHECKING:
    from dicedesign.geometry.hulls.hull import ConvexHull
    from dicedesign.rest.poses import RestPoses

__all__ = ["compute_stable_poses"]

_MOST_REFUSED = 1000
"""Maximum number of random centers of mass for each one inside the hull."""


def compute_stable_poses(
    mesh: Any,
    center_mass: ArrayLike | None = None,
    sigma: float = 0.0,
    n_samples: int = 1,
    threshold: float = 0.0,
    seed: int | np.random.Generator | None = None,
) -> tuple[Floats, Floats]:
    """Resting poses of a mesh with their probabilities, a replacement for
    `trimesh.poses.compute_stable_poses`. See "In place of trimesh" in docs/researchers.md for the
    differences.

    Parameters
    ----------
    mesh: a `trimesh.Trimesh`, or what `rest_poses` takes.
    center_mass: (3,) in the mesh's unit, strictly inside the hull; None takes the mesh's own if it
        bounds a volume, else the default of `rest_poses`.
    sigma: variance of a Gaussian error of the center of mass along each axis, in squared length
        units, at least 0. The probabilities are the mean of the exact probabilities over
        `n_samples` random centers inside the hull.
    n_samples: number of centers, above 0; no effect if sigma is 0.
    threshold: poses with at most this probability are omitted; the others are not scaled.
    seed: random seed of the centers.

    Returns
    -------
    (n, 4, 4) transforms that stand the mesh on the plane z = 0, the most probable first, with the
    mesh's origin on the z axis and trimesh's headings, and (n,) probabilities.

    Raises
    ------
    DegenerateBodyError, OutsideHullError: as `rest_poses`; also if almost no random center is
        inside the hull.
    InputError: another argument is not as described.
    """
    # Importing the package loads none of these.
    from dicedesign.rest.poses import analyze, generator_of, rest_poses

    if not (is_finite_number(sigma) and sigma >= 0.0):
        raise InputError(f"sigma: expected a finite number of at least 0, got {sigma!r}; change it")
    if isinstance(n_samples, bool) or not isinstance(n_samples, int | np.integer):
        raise InputError(f"n_samples: expected a whole number, got {n_samples!r}; round it")
    check_whole("n_samples", int(n_samples))
    if not is_finite_number(threshold):
        raise InputError(f"threshold: expected a finite number, got {threshold!r}; try 0")
    if center_mass is None and getattr(mesh, "is_volume", False):
        center_mass = mesh.center_mass
    poses = rest_poses(mesh, center_mass)
    probabilities = np.zeros(len(poses.hull.normals))
    if sigma == 0.0:
        probabilities[poses.facets] = poses.probabilities
    else:
        scatter = float(np.sqrt(sigma))
        centers = _inside(poses, scatter, int(n_samples), generator_of(seed))
        for center in centers:
            sample = analyze(poses.hull, center)
            np.add.at(probabilities, _facets_in(poses.hull, sample), sample.probabilities)
        probabilities /= len(centers)
    likely = np.flatnonzero(probabilities > max(threshold, 0.0))
    likely = likely[np.argsort(-probabilities[likely], kind="stable")]
    transforms = [_transform(poses.hull, normal) for normal in poses.hull.normals[likely]]
    return np.array(transforms).reshape(-1, 4, 4), probabilities[likely]


def _inside(poses: RestPoses, scatter: float, count: int, chance: np.random.Generator) -> Floats:
    """Draw points (count, 3) inside the hull around the center of mass."""
    hull = poses.hull
    depths = hull.heights(poses.center_of_mass)
    centers: list[Floats] = []
    lacking, drawn = count, 0
    while lacking:
        if drawn > _MOST_REFUSED * count:
            raise OutsideHullError(
                f"sigma: expected a scatter that leaves the center of mass inside the hull, but "
                f"of {drawn} centers drawn {count - lacking} were; lower sigma, which is the "
                "square of the scatter"
            )
        moves = scatter * chance.standard_normal((lacking, 3))
        inside = (moves @ hull.normals.T < depths).all(axis=1)
        centers.append(poses.center_of_mass + moves[inside])
        drawn += lacking
        lacking -= int(inside.sum())
    return np.concatenate(centers)


def _facets_in(hull: ConvexHull, sample: RestPoses) -> Integers:
    """Facets (k,) of a hull for a sample's rests. The sample's hull may have been rebuilt from its
    corners if facets are uneven."""
    if sample.hull is hull:
        return sample.facets
    return np.asarray((sample.normals @ hull.normals.T).argmax(axis=1))


def _transform(hull: ConvexHull, normal: Floats) -> Floats:
    """Motion (4, 4) that turns a normal down and a level direction of the mesh to x, and lifts the
    hull onto z = 0."""
    up = -normal
    level = np.array([-up[1], up[0], 0.0])
    length = float(np.linalg.norm(level))
    level = level / length if length > 0.0 else np.array([1.0, 0.0, 0.0])
    transform = np.eye(4)
    transform[:3, :3] = [level, np.cross(up, level), up]
    transform[2, 3] = -float((hull.vertices @ up).min())
    return transform
