"""Starting shapes for any probabilities, needles and the pool that sorts them, and those with a
symmetry."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

import numpy as np
import pytest

from dicedesign.geometry.hulls.hull import convex_hull, polyhedron_corners
from dicedesign.geometry.point_groups import point_group
from dicedesign.optimize.starts.needles import needle_near
from dicedesign.optimize.starts.search import shapes_near
from dicedesign.optimize.starts.shapes import start_with_probabilities
from dicedesign.optimize.starts.start import Start
from dicedesign.optimize.targets import binomial, sum_of_dice
from dicedesign.rest.basins import find_basins
from dicedesign.rest.poses import rest_poses

TARGETS = {
    "a coin": np.array([0.5, 0.5]),
    "a bent coin": np.array([0.1, 0.9]),
    "two coins": binomial(2).probabilities,
    "hardly anything else": np.array([0.01, 0.97, 0.01, 0.01]),
    "one in a thousand": np.array([0.999, 0.0005, 0.0005]),
    "hardly ever": np.array([0.6, 0.3999, 1e-4]),
    "two in the lead": np.array([0.45, 0.45, 0.04, 0.03, 0.03]),
    "two dice": sum_of_dice([6, 6]).probabilities,
    "three dice": sum_of_dice([6, 6, 6]).probabilities,
}


def random_half_spaces(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Half-spaces, some of which usually cut nothing, or leave a direction open."""
    count = int(rng.integers(5, 16))
    normals = rng.normal(size=(count, 3)) * np.exp(rng.normal(size=(count, 1)))
    return normals, np.exp(0.3 * rng.normal(size=count)) * np.linalg.norm(normals, axis=1)


def shapes(target: np.ndarray, seed: int) -> Iterator[Start]:
    """Starts, without the turns that found none."""
    return (start for start in shapes_near(target, seed) if start is not None)


def outcome_probabilities(start: Start) -> np.ndarray:
    """(k,) probabilities of the outcomes by the forward model, of a start with one rest for each
    and no other."""
    poses = rest_poses(start.points)
    outcome = np.argmax(poses.normals @ start.directions.T, axis=1)
    assert np.array_equal(np.sort(outcome), np.arange(len(start.directions)))
    assert (poses.normals * start.directions[outcome]).sum(-1) == pytest.approx(1.0, abs=1e-9)
    return poses.probabilities[np.argsort(outcome)]


def test_starts_from_half_spaces_agree_with_the_forward_model() -> None:
    rng, solids, unbounded = np.random.default_rng(0), 0, 0
    while solids < 60:
        normals, distances = random_half_spaces(rng)
        if not _is_bounded(normals):
            unbounded += 1
            assert all(
                start_with_probabilities(normals, distances, count) is None for count in (2, 4)
            )
            continue
        solids += 1
        poses = rest_poses(polyhedron_corners(normals, distances))
        units = normals / np.linalg.norm(normals, axis=1)[:, None]
        expected = np.argmax(poses.normals @ units.T, axis=1)
        candidate = start_with_probabilities(normals, distances, len(expected))
        assert candidate is not None
        start, probabilities, rests = candidate
        assert rests.tolist() == sorted(expected.tolist())
        np.testing.assert_allclose(outcome_probabilities(start), probabilities, atol=1e-12)
        np.testing.assert_allclose(start.directions, units[rests], atol=1e-9)
        assert start_with_probabilities(normals, distances, len(expected) + 1) is None
    assert unbounded > 5


def _is_bounded(normals: np.ndarray) -> bool:
    """Whether the hull of directions has the origin inside."""
    return bool((convex_hull(normals).heights(np.zeros(3)) > 0.0).all())


@pytest.mark.parametrize("name", TARGETS)
def test_needles_have_the_probabilities_wanted(name: str) -> None:
    target = TARGETS[name]
    rng = np.random.default_rng(0)
    starts = [needle_near(target, rng) for _ in range(6)]
    needles = [start for start in starts if start is not None]
    assert needles
    for start in needles:
        probabilities = outcome_probabilities(start)
        assert np.abs(probabilities - target).max() < 1e-3
        assert (np.abs(probabilities - target) < 0.2 * target).all()
        # Slanted ends put the center of mass on the axis, from where the section was drawn.
        center = convex_hull(start.points).centroid * start.scale + start.origin
        assert np.abs(center / start.scale).max() < 1e-9
        extents = np.ptp(start.points, axis=0)
        assert extents[0] > extents[1:].max()


def test_a_seed_proposes_the_same_shapes_again() -> None:
    target = np.array([0.55, 0.2, 0.15, 0.1])
    first, again, other = ([s.points for s in islice(shapes(target, n), 5)] for n in (1, 1, 2))
    for points, same in zip(first, again, strict=True):
        np.testing.assert_array_equal(points, same)
    assert any(a.shape != b.shape or (a != b).any() for a, b in zip(first, other, strict=True))


def test_needles_and_the_nearest_of_many_polyhedra_are_proposed() -> None:
    """Polyhedra proposed as they are drawn would miss by 0.4."""
    target = np.array([0.3, 0.3, 0.2, 0.1, 0.06, 0.04])
    starts = islice(shapes(target, 0), 30)
    misses = np.array([np.abs(outcome_probabilities(start) - target).sum() for start in starts])
    is_needle = misses < 0.01
    assert 8 <= is_needle.sum() <= 10
    assert np.median(misses[~is_needle]) < 0.3


HALF = np.full(20, 1 / 19)
HALF[[0, 19]] = 0.5 / 19
CASES = {
    "two dice, mirror": (sum_of_dice([6, 6]).probabilities, "Cs"),
    "two dice, half turn": (sum_of_dice([6, 6]).probabilities, "C2"),
    "a coin": (np.full(2, 1 / 2), "D2d"),
    "five": (np.full(5, 1 / 5), "D3h"),
    "half weight": (HALF, "D3d"),
    "loaded": (np.array([1 / 3] + [2 / 15] * 5), "C5v"),
    "coins": (binomial(5).probabilities, "C2v"),
}


@pytest.mark.parametrize("name", CASES)
def test_starts_are_symmetric_and_have_a_rest_for_each_outcome(name: str) -> None:
    target, group = CASES[name][0], point_group(CASES[name][1])
    for start in islice(filter(None, shapes_near(target, 0, group=group)), 4):
        probabilities = outcome_probabilities(start)
        hull = convex_hull(start.points)
        assert len(find_basins(hull, hull.centroid)) == 1
        extents = np.ptp(start.points, axis=0)
        assert extents.max() == pytest.approx(2.0)
        np.testing.assert_allclose(hull.centroid, np.zeros(3), atol=1e-12)
        for element in group:
            images = start.points @ element.T
            gaps = np.linalg.norm(images[:, None] - start.points[None], axis=-1)
            assert gaps.min(axis=1).max() < 1e-10
            cosines = (start.directions @ element.T) @ start.directions.T
            image = np.argmax(cosines, axis=1)
            np.testing.assert_allclose(probabilities[image], probabilities, atol=1e-12)
            np.testing.assert_allclose(target[image], target, rtol=1e-12)
