"""Bodies of rounded coordinates rest as their points say, whatever rounding did to facets."""

from __future__ import annotations

import numpy as np
import pytest
from common.paths import public_data
from scipy.spatial import ConvexHull as QhullHull

from dicedesign.geometry.meshes.body import Body, make_body
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.runtime.arrays import Floats
from tests.reference.roller import roll_frequencies

ANGLE = np.radians(1.0)


def lathed(rng: np.random.Generator) -> Floats:
    """Points (n, 3) of a body turned from a profile, with a regular polygon for a circle."""
    sides = int(rng.integers(3, 49))
    turns = 2.0 * np.pi * np.arange(sides) / sides
    circle = np.column_stack([np.cos(turns), np.sin(turns), np.zeros(sides)])
    heights, radii = np.sort(rng.uniform(-1.0, 1.0, 5)), rng.uniform(0.1, 1.0, 5)
    rings = [r * circle + [0.0, 0.0, z] for r, z in zip(radii, heights, strict=True)]
    return np.concatenate(rings) * 10.0 ** rng.uniform(-1.0, 1.0)


def chamfered(rng: np.random.Generator) -> Floats:
    """Points (n, 3) of a prism with one chamfered end."""
    turns = np.sort(rng.uniform(0.0, 2.0 * np.pi, int(rng.integers(4, 40))))
    base = np.column_stack([np.cos(turns), np.sin(turns), np.zeros(len(turns))])
    height, chamfer = rng.uniform(0.2, 2.0), rng.uniform(0.01, 0.1)
    levels = [(1.0, 0.0), (1.0, height - chamfer), (1.0 - chamfer, height)]
    return np.concatenate([scale * base + [0.0, 0.0, z] for scale, z in levels])


def rounded(points: Floats, rng: np.random.Generator) -> Floats:
    """Points (n, 3) moved by up to 100 extents and rounded to float32 or to decimals."""
    away = rng.normal(size=3)
    away *= 10.0 ** rng.uniform(0.0, 2.0) * np.ptp(points, axis=0).max() / np.linalg.norm(away)
    decimals = int(rng.integers(2, 8))
    if decimals > 5:
        return (points + away).astype(np.float32).astype(np.float64)
    return np.round(points + away, decimals)


def difference(poses: RestPoses, other: RestPoses) -> float:
    """Largest difference of the probabilities of rests and of those of another body near them."""
    cosines = other.normals @ poses.normals.T
    assert (cosines.max(axis=1)[other.probabilities > 1e-9] > np.cos(ANGLE)).all()
    near = np.bincount(cosines.argmax(axis=1), other.probabilities, len(poses.normals))
    return float(np.abs(near - poses.probabilities).max())


@pytest.mark.parametrize("shape", [lathed, chamfered])
def test_rounded_bodies_rest_as_their_points_say(shape) -> None:  # type: ignore[no-untyped-def]
    for seed in range(30):
        rng = np.random.default_rng(seed)
        points = rounded(shape(rng), rng)
        body = make_body(points, single_precision=True)
        poses = rest_poses(body)
        assert difference(poses, rest_poses(body, coplanar_tolerance=0.0)) < 1e-12, seed
        assert len(poses.normals) <= len(rest_poses(points, coplanar_tolerance=0.0).normals)
        order = rng.permutation(len(points))
        other = rest_poses(make_body(points[order], single_precision=True))
        assert difference(poses, other) < 1e-9
        # Motions and a change of size that round nothing.
        motion = np.array([[0.0, 0.0, 4.0], [4.0, 0.0, 0.0], [0.0, -4.0, 0.0]])
        moved = rest_poses(make_body(points @ motion, single_precision=True))
        shares = (np.sort(each.probabilities) for each in (poses, moved))
        np.testing.assert_allclose(*shares, rtol=0, atol=1e-9)
        if seed % 10 == 0:
            corners = points[QhullHull(points).vertices]
            frequencies, lost = roll_frequencies(
                corners, poses.center_of_mass, poses.normals, 128, seed
            )
            p = poses.probabilities
            assert lost == 0
            assert (np.abs(frequencies - p) <= 5.0 * np.sqrt(p * (1.0 - p) / 128) + 0.01).all()


def case(name: str) -> Body:
    return read_body(public_data(f"cases/{name}"))


def test_a_ring_far_from_the_origin_rests_as_near_it() -> None:
    far, near = (
        rest_poses(case(f"01_{name}.obj")) for name in ("ring_far_from_origin", "same_at_origin")
    )
    assert len(far.probabilities) == len(near.probabilities) == 11
    assert difference(far, near) < 1e-4
    assert far.probabilities[0] == pytest.approx(0.1477, abs=5e-5)
    assert ((far.probabilities[1:10] > 0.0945) & (far.probabilities[1:10] < 0.095)).all()


def test_a_cloud_of_a_smooth_surface_in_single_precision_is_no_coarser_body() -> None:
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(2000, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    for place in (0.0, 300.0):
        points = (directions * [1.0, 0.8, 0.7] + place).astype(np.float32)
        poses, exact = rest_poses(points), rest_poses(points, coplanar_tolerance=0.0)
        assert difference(poses, exact) < 1e-12
