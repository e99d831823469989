"""Starting shapes, named, random, symmetric and needles, against the forward model; layouts on
orbits against exhaustive search."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice, product

import numpy as np
import pytest

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import convex_hull, polyhedron_corners
from dicedesign.geometry.meshes.body import make_body
from dicedesign.geometry.point_groups import point_group
from dicedesign.optimize.coordinates import orbits_of_directions
from dicedesign.optimize.starts.needles import needle_near
from dicedesign.optimize.starts.orbit_layouts import OrbitLayouts, fitting_groups
from dicedesign.optimize.starts.search import shapes_near
from dicedesign.optimize.starts.shapes import (
    HENDECAHEDRA,
    hendecahedron,
    mesh_start,
    prism,
    repulsion,
    start_with_probabilities,
)
from dicedesign.optimize.starts.start import Start
from dicedesign.optimize.targets import binomial, fair, sum_of_dice
from dicedesign.rest.basins import find_basins
from dicedesign.rest.poses import rest_poses


def outcome_probabilities(start: Start) -> np.ndarray:
    """(k,) probabilities of the outcomes by the forward model, of a start with one rest for each
    and no other."""
    poses = rest_poses(start.points)
    outcome = np.argmax(poses.normals @ start.directions.T, axis=1)
    assert np.array_equal(np.sort(outcome), np.arange(len(start.directions)))
    np.testing.assert_allclose(poses.normals, start.directions[outcome], atol=1e-9)
    return poses.probabilities[np.argsort(outcome)]


@pytest.mark.parametrize(
    ("start", "facets"),
    [
        *[(prism(sides), 3 * sides) for sides in (3, 6, 12)],
        *[(hendecahedron(kind), 11) for kind in HENDECAHEDRA],
        *[(repulsion(outcomes, seed=3), outcomes) for outcomes in (4, 11, 30)],
    ],
)
def test_named_starts_rest_in_their_directions_only(start: Start, facets: int) -> None:
    probabilities = outcome_probabilities(start)
    assert len(convex_hull(start.points).normals) == facets
    if facets > len(probabilities):
        np.testing.assert_allclose(probabilities, 3.0 / facets, atol=1e-12)


@pytest.mark.parametrize("seed", range(2))
def test_a_mesh_start_in_single_precision_keeps_flat_facets_whole(seed: int) -> None:
    turn, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    box = np.array([(x, y, z) for x in (-1, 1) for y in (-2, 2) for z in (-3, 3)]) @ turn
    body = make_body(box.astype(np.float32))
    assert body.single_precision
    start = mesh_start(body, 6)
    hull = convex_hull(start.points)
    assert (len(hull.normals), len(hull.vertices)) == (6, 8)
    sides = np.concatenate([turn, -turn])
    for normals, tolerance in ((hull.normals, 1e-12), (sides, 1e-6)):
        nearest = normals[np.argmax(start.directions @ normals.T, axis=1)]
        np.testing.assert_allclose(start.directions, nearest, atol=tolerance)
    corners = np.lexsort(start.points.round(3).T), np.lexsort(start.normalize(box).round(3).T)
    np.testing.assert_allclose(
        start.normalize(box)[corners[1]], start.points[corners[0]], atol=1e-6
    )


def test_a_mesh_start_ranks_the_rests_for_a_given_center() -> None:
    points = np.random.default_rng(8).normal(size=(40, 3)) * [3.0, 2.0, 1.0] + [5.0, 0.0, -2.0]
    center = np.array([5.8, 0.4, -2.2])
    start = mesh_start(make_body(points), 3, center)
    poses = rest_poses(points, center)
    np.testing.assert_allclose(start.directions, poses.normals[:3], atol=1e-12)
    moved = rest_poses(start.points, start.normalize(center))
    np.testing.assert_allclose(moved.probabilities, poses.probabilities, atol=1e-10)
    assert np.abs(rest_poses(points).normals[:3] - poses.normals[:3]).max() > 0.1


def test_a_mesh_start_passes_on_notes() -> None:
    corners = np.vstack([np.eye(3), -np.ones((1, 3)), np.eye(3)[:1]])
    assert mesh_start(make_body(corners), 3).notes == (
        "welded 1 points to others at equal positions",
    )


def test_starts_have_the_documented_coordinates() -> None:
    def own(start: Start) -> np.ndarray:
        return start.origin + start.scale * start.points

    corners = own(prism(5, height=2.0, cap=1.0))
    assert np.hypot(corners[:, 0], corners[:, 1]).max() == pytest.approx(1.0)
    assert np.ptp(corners[:, 2]) == pytest.approx(4.0)
    np.testing.assert_allclose(corners[0], [1.0, 0.0, 1.0], atol=1e-15)
    bisymmetric = own(hendecahedron("bisymmetric"))
    np.testing.assert_allclose(bisymmetric.min(axis=0), [-2.0, -2.0, -1.2], atol=1e-12)
    np.testing.assert_allclose(bisymmetric.max(axis=0), [2.0, 2.0, 1.8], atol=1e-12)
    for tangent in (hendecahedron("circus"), repulsion(9, 1)):
        reach = (own(tangent) @ tangent.directions.T).max(axis=0)
        np.testing.assert_allclose(reach, 1.0, atol=1e-12)


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


def shapes(target: np.ndarray, seed: int, group: np.ndarray | None = None) -> Iterator[Start]:
    """Starts, without the turns that found none."""
    return filter(None, shapes_near(target, seed, group=group))


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
    for start in islice(shapes(target, 0, group), 4):
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


# Sizes of orbits in textbooks: on each end of the axes, then those of which there is any number.
ORBITS = {
    "C1": ([], [1]),
    "Cs": ([], [1, 2]),
    "C2": ([1, 1], [2]),
    "C2v": ([1, 1], [2, 4]),
    "C5v": ([1, 1], [5, 10]),
    "S4": ([2], [4]),
    "D3": ([2, 3, 3], [6]),
    "D3h": ([2, 3, 3], [6, 12]),
    "D3d": ([2, 6], [6, 12]),
    "T": ([4, 4, 6], [12]),
    "Oh": ([6, 8, 12], [24, 48]),
}


def fewest_orbits(classes: list[int], name: str) -> int | None:
    """Least number of orbits for classes of numbers of outcomes, by exhaustive search."""
    poles, others = ORBITS[name]
    best = None
    for owner in product(range(len(classes) + 1), repeat=len(poles)):
        total = 0
        for number, outcomes in enumerate(classes):
            on_axes = [size for size, of in zip(poles, owner, strict=True) if of == number]
            rest = outcomes - sum(on_axes)
            ways = [
                sum(counts)
                for counts in product(range(max(rest, 0) + 1), repeat=len(others))
                if sum(n * size for n, size in zip(counts, others, strict=True)) == rest
            ]
            if not ways:
                break
            total += len(on_axes) + min(ways)
        else:
            best = total if best is None else min(best, total)
    return best


def target_of(classes: list[int]) -> np.ndarray:
    """Probabilities in random order, with classes of equal ones."""
    weights = np.repeat(1.0 + np.arange(len(classes)), classes)
    return np.random.default_rng(0).permutation(weights / weights.sum())


@pytest.mark.parametrize("name", ORBITS)
def test_layouts_are_as_small_as_by_exhaustive_search(name: str) -> None:
    rng = np.random.default_rng(1)
    poles, others = ORBITS[name]
    possible = 0
    for _ in range(40):
        classes = rng.integers(1, 15, size=rng.integers(1, 4)).tolist()
        fewest, target = fewest_orbits(classes, name), target_of(classes)
        if fewest is None:
            with pytest.raises(InputError, match="to fill whole orbits of facets"):
                OrbitLayouts(target, point_group(name))
            continue
        possible += 1
        layout = OrbitLayouts(target, point_group(name)).draw(rng)
        assert len(layout) == fewest
        assert sorted(outcome for _, outcomes in layout for outcome in outcomes) == list(
            range(len(target))
        )
        for site, outcomes in layout:
            assert len(outcomes) == len(site.carriers)
            assert len(set(target[list(outcomes)])) == 1
            assert len(outcomes) in (others if site.pole is None else poles)
        # No end of an axis is taken twice.
        ends = [site.pole for site, _ in layout if site.pole is not None]
        assert len({tuple(np.round(end, 9)) for end in ends}) == len(ends)
    assert possible >= (1 if name == "Oh" else 3)


def test_probabilities_that_differ_by_rounding_are_equal() -> None:
    target = np.array([0.1 + 0.2, 0.3, 0.2, 0.2])
    layout = OrbitLayouts(target, point_group("Ci")).draw(np.random.default_rng(0))
    assert target[0] != target[1]
    assert {outcomes for _, outcomes in layout} == {(0, 1), (2, 3)}


@pytest.mark.parametrize(
    ("outcomes", "name"), [(4, "Td"), (6, "Oh"), (7, "D7h"), (10, "D5d"), (30, "Ih")]
)
def test_fair_dice_have_the_symmetry_of_isohedral_solids(outcomes: int, name: str) -> None:
    """Tetrahedron, cube, octahedron, dodecahedron, icosahedron, trapezohedra, the rhombic
    triacontahedron, and prisms for odd numbers."""
    assert fitting_groups(fair(outcomes).probabilities)[0] == name


def test_the_first_groups_have_an_orbit_for_each_probability() -> None:
    for target, distinct in ((binomial(4), 3), (sum_of_dice([6, 6]), 6)):
        for name in fitting_groups(target.probabilities)[:2]:
            group = point_group(name)
            start = next(shapes(target.probabilities, 0, group))
            orbits = orbits_of_directions(start.directions, group)
            assert len(np.unique(orbits)) == distinct
            for orbit in np.unique(orbits):
                assert np.ptp(target.probabilities[orbits == orbit]) < 1e-12
    assert fitting_groups(np.array([0.5, 0.3, 0.2])) == []


@pytest.mark.parametrize("target", [(0.5, 0.25, 0.25), (0.4, 0.3, 0.3)])
def test_as_three_facets_enclose_no_solid_larger_groups_come_first(target: tuple[float]) -> None:
    sizes = [len(point_group(name)) for name in fitting_groups(np.array(target))]
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[0] > sizes[-1]
