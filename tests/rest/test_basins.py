"""Resting probabilities against closed forms, sampled flow, reference values and symmetries."""

from __future__ import annotations

import json
from itertools import product

import numpy as np
import pytest
from common.paths import public_data
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from dicedesign.errors import OutsideHullError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.rest.morse import border_areas, separatrices, separatrix_points, wraps
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.rest.roll import roll_steps
from tests.reference import solids
from tests.reference.flow_oracle import flow_frequencies

CUBE = np.array(list(product([-1.0, 1.0], repeat=3)))


def rotation(seed: int) -> np.ndarray:
    return Rotation.random(random_state=seed).as_matrix()


def random_body(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """4 to 30 points and a center of mass inside, away from the centroid."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(4 + seed % 27, 3)) * rng.uniform(0.5, 1.5, size=3)
    hull = convex_hull(points)
    somewhere = rng.dirichlet(np.ones(len(hull.vertices))) @ hull.vertices
    return points, 0.6 * hull.centroid + 0.4 * somewhere


def needle(seed: int, spread: float = 0.5) -> tuple[np.ndarray, np.ndarray]:
    """A long thin body and a center of mass, nearer to its corners for a smaller `spread`."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(7, 3)) * [0.2, 0.2, 1.0]
    hull = convex_hull(points)
    return points, rng.dirichlet(np.full(len(hull.vertices), spread)) @ hull.vertices


def test_sampled_flow_gives_the_same_probabilities() -> None:
    """20 hulls, 1024 rolls each. A frequency may differ by 5 standard deviations of independent
    samples, and by what finite steps shift a basin's border: less than one step of 0.01 along
    borders of length up to 2 pi, over 4 pi. Evenly spread samples do much better on average."""
    count, step, seeds = 1024, 0.01, range(20)
    distances = []
    for seed in seeds:
        points, center = random_body(seed)
        rests = rest_poses(points, center)
        hull = rests.hull
        frequencies, lost = flow_frequencies(
            hull.vertices, center, rests.normals, count, step, seed
        )
        p = rests.probabilities
        bound = 5 * np.sqrt(p * (1 - p) / count) + step / 2
        assert lost <= 0.01 * count
        assert (np.abs(frequencies - p) <= bound + lost / count).all(), seed
        distances.append(0.5 * np.abs(frequencies - p).sum())
    assert np.mean(distances) < 0.01


@pytest.mark.parametrize("name", solids.PLATONIC)
def test_platonic_solids_are_fair(name: str) -> None:
    facets = solids.PLATONIC_FACETS[name]
    for seed in range(6):
        points = solids.PLATONIC[name] @ (np.eye(3) if seed == 0 else rotation(seed))
        probabilities = rest_poses(points).probabilities
        np.testing.assert_allclose(probabilities, [1 / facets] * facets, rtol=0, atol=1e-12)


@pytest.mark.parametrize("sides", [(1.0, 1.0, 1.0), (1.0, 2.0, 3.0), (1.0, 1.0, 9.0), (5, 4, 0.1)])
@pytest.mark.parametrize("seed", range(3))
def test_a_box_has_its_solid_angles(sides: tuple[float, float, float], seed: int) -> None:
    rests = rest_poses(0.5 * CUBE * sides @ rotation(seed).T)
    expected = []
    for a, b, c in (sides, np.roll(sides, 1), np.roll(sides, 2)):
        angle = 4 * np.arcsin(a * b / np.sqrt((a * a + c * c) * (b * b + c * c)))
        expected += [angle / (4 * np.pi)] * 2
    np.testing.assert_allclose(rests.probabilities, sorted(expected)[::-1], rtol=0, atol=1e-12)


@pytest.mark.parametrize("number", range(15))
def test_public_meshes_agree_with_the_reference(number: int) -> None:
    reference = json.loads(public_data("reference_rest.json").read_text())
    name, expected = list(reference.items())[number]
    center = np.array(expected["center_of_mass"])
    rests = rest_poses(read_body(public_data(name)), center)
    normals = np.array([rest["normal"] for rest in expected["rests"]])
    probabilities = np.array([rest["probability"] for rest in expected["rests"]])
    assert len(rests.normals) == len(normals)
    nearest = np.argmax(rests.normals @ normals.T, axis=1)
    assert sorted(nearest) == list(range(len(normals)))
    # A file of rounded numbers may merge a sliver into a rest's facet, which turns its normal.
    np.testing.assert_allclose(rests.normals, normals[nearest], rtol=0, atol=1e-5)
    np.testing.assert_allclose(rests.probabilities, probabilities[nearest], rtol=0, atol=1e-12)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6), turn=st.integers(0, 10**6), power=st.integers(-9, 9))
def test_motions_change_nothing(seed: int, turn: int, power: int) -> None:
    points, center = random_body(seed)
    before = rest_poses(points, center)
    assert before.probabilities.sum() == pytest.approx(1.0, abs=1e-12)
    rng = np.random.default_rng(turn)
    order = rng.permutation(len(points))
    mirror = np.diag([1.0, 1.0, -1.0])
    shift = rng.normal(size=3)
    scale = 10.0**power

    def same(after: RestPoses, matrix: np.ndarray) -> None:
        np.testing.assert_allclose(after.probabilities, before.probabilities, rtol=0, atol=1e-10)
        np.testing.assert_allclose(after.normals, before.normals @ matrix.T, rtol=0, atol=1e-9)

    turned = rotation(turn)
    same(rest_poses(points @ turned.T, turned @ center), turned)
    same(rest_poses(points * scale, center * scale), np.eye(3))
    same(rest_poses(points + shift, center + shift), np.eye(3))
    same(rest_poses(points[order], center), np.eye(3))
    same(rest_poses(points @ mirror, center @ mirror), mirror)


@pytest.mark.parametrize("seed", [98, 162, 220, 245, 269, 288, 333, 428])
def test_a_body_with_one_rest_always_ends_on_it(seed: int) -> None:
    points, center = needle(seed, 0.1)
    rests = rest_poses(points, center)
    assert rests.probabilities.tolist() == [1.0]
    assert rests.margins.tolist() == [np.pi]
    assert rests.morse.polylines == ()
    assert (rests.morse.basin_of_facet == 0).all()
    for down in np.random.default_rng(seed).normal(size=(50, 3)):
        ended = roll_steps(rests.morse.equilibria, down)[-1].down
        np.testing.assert_array_equal(ended, rests.normals[0])


@pytest.mark.parametrize("seed", [5, 102, 255, 278, 463, 482, 623, 874])
def test_a_basin_may_hold_the_antipode_of_its_normal(seed: int) -> None:
    points, center = needle(seed)
    rests = rest_poses(points, center)
    equilibria = rests.morse.equilibria
    paths = separatrices(equilibria)
    vertices, normals = equilibria.hull.vertices, equilibria.hull.normals[paths.rests]
    border = border_areas(paths, separatrix_points(paths, vertices, center, np), normals, np)
    added = wraps(np.bincount(paths.basins.ravel(), weights=border.ravel()))
    assert added.sum() == 1
    assert paths.rests[np.argmax(added)] == rests.facets[0]
    assert rests.probabilities[0] > 0.5
    ended = roll_steps(equilibria, -rests.normals[0])[-1].down
    np.testing.assert_array_equal(ended, rests.normals[0])
    downs = np.random.default_rng(seed).normal(size=(400, 3))
    ends = np.array([roll_steps(equilibria, down)[-1].down for down in downs])
    frequencies = (
        np.bincount(np.argmax(ends @ rests.normals.T, axis=1), minlength=len(normals)) / 400
    )
    p = rests.probabilities
    assert (np.abs(frequencies - p) <= 5 * np.sqrt(p * (1 - p) / 400)).all()


@pytest.mark.parametrize(
    ("center", "where"),
    [
        ([1.0, 0.0, 0.0], r"\[1.0, 0.0, 0.0\], which is on the boundary, at facet \d of the hull"),
        ([0.0, -1.5, 0.0], r"\[0.0, -1.5, 0.0\], which is 0.5 outside facet \d of the hull"),
        ([1.0, 1.0, 1.0], "which is on the boundary, at facet"),
        ([1e9, 0.0, 0.0], r"which is 1e\+09 outside facet"),
    ],
)
def test_a_center_that_is_not_inside_is_refused(center: list[float], where: str) -> None:
    with pytest.raises(OutsideHullError, match=where) as caught:
        rest_poses(CUBE, center)
    assert "expected a point strictly inside the hull" in str(caught.value)
    assert "Give one within the hull or leave it out" in str(caught.value)
