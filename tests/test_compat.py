"""In place of trimesh: the same answers where its estimate is right, the truth where it is not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import trimesh

import dicedesign as dd
from dicedesign.compat import compute_stable_poses
from dicedesign.errors import InputError, OutsideHullError
from dicedesign.geometry.hulls.hull import convex_hull
from tests.reference.oracle import hull_probabilities


def turn_mesh(mesh: trimesh.Trimesh, seed: int) -> trimesh.Trimesh:
    """A mesh in any orientation and place."""
    rng = np.random.default_rng(seed)
    copy = mesh.copy()
    copy.apply_transform(trimesh.transformations.random_rotation_matrix(rng.random(3)))
    copy.apply_translation(rng.normal(size=3))
    return copy


def blob(seed: int, count: int = 20) -> trimesh.Trimesh:
    points = np.random.default_rng(seed).normal(size=(count, 3))
    return trimesh.convex.convex_hull(points)


def by_normal(transforms: np.ndarray, probabilities: np.ndarray) -> dict[tuple[float, ...], float]:
    """Probabilities by the direction of the mesh that is up."""
    keys = [tuple(np.round(transform[2, :3], 5) + 0.0) for transform in transforms]
    return dict(zip(keys, probabilities.tolist(), strict=True))


ALL_FACETS_HOLD = {
    "cube": trimesh.creation.box(),
    "brick": trimesh.creation.box((1.0, 2.0, 3.0)),
    "icosahedron": trimesh.creation.icosahedron(),
    "prism": trimesh.creation.cylinder(radius=1.0, height=2.0, sections=7),
}
"""Bodies that rest on all their facets: there a facet's basin is what it covers as seen from the
center of mass, which is what trimesh computes."""


@pytest.mark.parametrize("name", ALL_FACETS_HOLD)
@pytest.mark.parametrize("seed", [0, 1])
def test_results_agree_with_trimesh_if_all_facets_are_stable(name: str, seed: int) -> None:
    mesh = turn_mesh(ALL_FACETS_HOLD[name], seed)
    ours, theirs = compute_stable_poses(mesh), trimesh.poses.compute_stable_poses(mesh)
    mine, other = by_normal(*ours), by_normal(*theirs)
    assert len(mine) == len(other)
    for normal, probability in mine.items():
        nearest = min(other, key=lambda key: np.linalg.norm(np.subtract(key, normal)))
        assert other[nearest] == pytest.approx(probability, abs=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_transforms_are_those_of_trimesh(seed: int) -> None:
    mesh = blob(seed)
    ours, _ = compute_stable_poses(mesh)
    theirs, _ = trimesh.poses.compute_stable_poses(mesh)
    assert len(ours) == len(theirs)
    for transform in ours:
        nearest = theirs[np.linalg.norm(theirs[:, 2, :3] - transform[2, :3], axis=1).argmin()]
        np.testing.assert_allclose(transform, nearest, atol=1e-9)


def test_trimesh_is_wrong_if_facets_topple() -> None:
    """A facet that does not hold is left to several neighbors; trimesh gives one of them all."""
    mesh = blob(3, 12)
    ours, other = compute_stable_poses(mesh), by_normal(*trimesh.poses.compute_stable_poses(mesh))
    exact = hull_probabilities(convex_hull(mesh.vertices), [mesh.center_mass])
    np.testing.assert_allclose(np.sort(ours[1]), sorted(filter(None, map(float, exact))))
    assert max(abs(other[normal] - p) for normal, p in by_normal(*ours).items()) > 0.015


def test_a_threshold_omits_poses_and_scales_none() -> None:
    mesh = blob(4)
    transforms, probabilities = compute_stable_poses(mesh)
    limit = float(probabilities[2])
    fewer, likely = compute_stable_poses(mesh, threshold=limit)
    np.testing.assert_array_equal(likely, probabilities[probabilities > limit])
    np.testing.assert_array_equal(fewer, transforms[: len(fewer)])
    none, probabilities = compute_stable_poses(mesh, threshold=1.0)
    assert none.shape == (0, 4, 4)
    assert probabilities.shape == (0,)


def test_sigma_is_the_mean_over_centers_of_mass() -> None:
    """Identical draws, each analyzed alone."""
    mesh, sigma, count = blob(6), 4e-3, 12
    transforms, probabilities = compute_stable_poses(mesh, sigma=sigma, n_samples=count, seed=3)
    rng = np.random.default_rng(3)
    centers = mesh.center_mass + np.sqrt(sigma) * rng.standard_normal((count, 3))
    expected: dict[tuple[float, ...], float] = {}
    for center in centers:
        poses = dd.rest_poses(mesh, center)
        for normal, p in zip(poses.normals, poses.probabilities, strict=True):
            key = tuple(np.round(-normal, 5) + 0.0)
            expected[key] = expected.get(key, 0.0) + p / count
    means = by_normal(transforms, probabilities)
    assert means.keys() == expected.keys()
    for key, p in expected.items():
        assert means[key] == pytest.approx(p, abs=1e-12)
    assert probabilities.sum() == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize(
    ("arguments", "kind", "said"),
    [
        ({"sigma": -1.0}, InputError, "sigma"),
        ({"sigma": np.nan}, InputError, "sigma"),
        ({"n_samples": 0}, InputError, "n_samples"),
        ({"n_samples": 2.5}, InputError, "n_samples"),
        ({"threshold": np.inf}, InputError, "threshold"),
        ({"sigma": 1.0, "seed": -4}, InputError, "rng"),
        ({"center_mass": [9.0, 0.0, 0.0]}, OutsideHullError, "center of mass"),
        ({"sigma": 1e12, "n_samples": 2, "seed": 0}, OutsideHullError, "sigma"),
    ],
)
def test_what_cannot_be_meant(arguments: dict[str, Any], kind: type[Exception], said: str) -> None:
    with pytest.raises(kind, match=said):
        compute_stable_poses(trimesh.creation.box(), **arguments)
