"""Resting probabilities against closed forms, sampled flow, reference values and symmetries."""

from __future__ import annotations

import json
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from common.paths import public_data
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from dicedesign.errors import InputError, OutsideHullError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.reading import read_body, stl_bytes
from dicedesign.rest.equilibria import classify
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.rest.roll import roll_steps
from dicedesign.runtime.arrays import Floats
from tests.reference import solids
from tests.reference.extremes import ANTIPODE_SEEDS, lopsided_needle
from tests.reference.flow_oracle import flow_frequencies
from tests.reference.random_hulls import off_center_body

CUBE = np.array(list(product([-1.0, 1.0], repeat=3)))


def rotation(seed: int) -> Floats:
    """A rotation matrix; none for seed 0."""
    return np.eye(3) if seed == 0 else Rotation.random(random_state=seed).as_matrix()


def rolled_frequencies(poses: RestPoses, count: int, seed: int) -> Floats:
    """Frequencies of the rests from random orientations, each rolled alone."""
    downs = np.random.default_rng(seed).normal(size=(count, 3))
    ends = np.array([roll_steps(poses.morse.equilibria, down)[-1].down for down in downs])
    rests = np.argmax(ends @ poses.normals.T, axis=1)
    np.testing.assert_array_equal(ends, poses.normals[rests])
    return np.bincount(rests, minlength=len(poses.normals)) / count


def test_sampled_flow_gives_the_same_probabilities() -> None:
    """10 hulls, 1024 rolls each. A frequency may differ by 5 standard deviations of independent
    samples, and by what finite steps shift a basin's border: less than one step of 0.01 along
    borders of length up to 2 pi, over 4 pi. Evenly spread samples do much better on average."""
    count, step, seeds = 1024, 0.01, range(0, 30, 3)
    distances = []
    for seed in seeds:
        points, center = off_center_body(seed)
        rests = rest_poses(points, center)
        frequencies, lost = flow_frequencies(
            rests.hull.vertices, center, rests.normals, count, step, seed
        )
        p = rests.probabilities
        bound = 5 * np.sqrt(p * (1 - p) / count) + step / 2
        assert lost <= 0.01 * count
        assert (np.abs(frequencies - p) <= bound + lost / count).all(), seed
        distances.append(0.5 * np.abs(frequencies - p).sum())
    assert np.mean(distances) < 0.01


def test_platonic_solids_are_fair_and_boxes_have_their_solid_angles() -> None:
    bodies = [solids.platonic(name) for name in solids.PLATONIC]
    for sides in ((1.0, 1.0, 1.0), (1.0, 2.0, 3.0), (1.0, 1.0, 9.0), (5.0, 4.0, 0.1)):
        bodies.append(solids.box(*sides))
    for body, seed in product(bodies, range(3)):
        probabilities = rest_poses(body.points @ rotation(seed).T).probabilities
        expected = np.sort(body.shares)[::-1]
        np.testing.assert_allclose(probabilities, expected, rtol=0, atol=1e-12)


def test_public_meshes_agree_with_the_reference() -> None:
    reference = json.loads(public_data("reference_rest.json").read_text())
    assert len(reference) == 15
    for name, expected in reference.items():
        rests = rest_poses(read_body(public_data(name)), np.array(expected["center_of_mass"]))
        normals = np.array([rest["normal"] for rest in expected["rests"]])
        nearest = np.argmax(rests.normals @ normals.T, axis=1)
        assert sorted(nearest) == list(range(len(normals))), name
        # A file of rounded numbers may merge a sliver into a rest's facet, which turns its normal.
        np.testing.assert_allclose(rests.normals, normals[nearest], rtol=0, atol=1e-5, err_msg=name)
        probabilities = np.array([rest["probability"] for rest in expected["rests"]])
        np.testing.assert_allclose(
            rests.probabilities, probabilities[nearest], rtol=0, atol=1e-12, err_msg=name
        )


@settings(max_examples=40, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6), turn=st.integers(1, 10**6), power=st.integers(-9, 9))
def test_motions_change_nothing(seed: int, turn: int, power: int) -> None:
    points, center = off_center_body(seed)
    before = rest_poses(points, center)
    assert before.probabilities.sum() == pytest.approx(1.0, abs=1e-12)
    rng = np.random.default_rng(turn)
    order = rng.permutation(len(points))
    mirror = np.diag([1.0, 1.0, -1.0])
    shift = rng.normal(size=3)
    scale = 10.0**power

    def same(after: RestPoses, matrix: Floats) -> None:
        np.testing.assert_allclose(after.probabilities, before.probabilities, rtol=0, atol=1e-10)
        np.testing.assert_allclose(after.normals, before.normals @ matrix.T, rtol=0, atol=1e-9)

    turned = rotation(turn)
    same(rest_poses(points @ turned.T, turned @ center), turned)
    same(rest_poses(points * scale, center * scale), np.eye(3))
    same(rest_poses(points + shift, center + shift), np.eye(3))
    same(rest_poses(points[order], center), np.eye(3))
    same(rest_poses(points @ mirror, center @ mirror), mirror)


def test_a_body_with_one_rest_always_ends_on_it() -> None:
    for seed in (98, 162, 220, 245, 269, 288, 333, 428):
        rng = np.random.default_rng(seed)
        hull = convex_hull(rng.normal(size=(7, 3)) * [0.2, 0.2, 1.0])
        center = rng.dirichlet(np.full(len(hull.vertices), 0.1)) @ hull.vertices
        rests = rest_poses(hull.vertices, center)
        assert rests.probabilities.tolist() == [1.0], seed
        assert rests.margins.tolist() == [np.pi]
        assert rests.morse.polylines == ()
        assert (rests.morse.basin_of_facet == 0).all()
        assert rolled_frequencies(rests, 50, seed).tolist() == [1.0]


def test_a_basin_may_hold_the_antipode_of_its_normal() -> None:
    for seed in ANTIPODE_SEEDS:
        body = lopsided_needle(seed)
        rests = rest_poses(body.points, body.center)
        p = rests.probabilities
        assert p[0] > 0.5, seed
        ended = roll_steps(rests.morse.equilibria, -rests.normals[0])[-1].down
        np.testing.assert_array_equal(ended, rests.normals[0])
        errors = np.abs(rolled_frequencies(rests, 200, seed) - p)
        assert (errors <= 5 * np.sqrt(p * (1 - p) / 200)).all(), seed


def test_an_stl_rests_as_its_source(tmp_path: Path) -> None:
    """Bodies that went through float32, of any size, anywhere."""
    bodies = {name: solids.platonic(name) for name in ("cube", "dodecahedron")}
    bodies["prism"] = solids.prism(12)
    path = tmp_path / "body.stl"
    places = product((0, 1, 2), (0.01, 17.3, 250.0), (0.0, 0.4, 3.0))
    for (name, body), (turn, radius, offset) in product(bodies.items(), places):
        place = offset * radius * np.array([0.3, -0.5, 0.81])
        circumradius = np.linalg.norm(body.points[0])
        hull = convex_hull(body.points @ rotation(turn).T * radius / circumradius + place)
        path.write_bytes(stl_bytes(hull.surface))
        read = read_body(path)
        assert read.single_precision
        before, after = rest_poses(hull.vertices), rest_poses(read)
        assert after.center_of_mass_source == "uniform solid"
        assert len(after.normals) == len(before.normals) == body.rests, (name, radius, offset)
        image = np.abs(after.normals[None] - before.normals[:, None]).max(-1).argmin(axis=1)
        assert sorted(image) == list(range(body.rests))
        for ours, theirs in (
            (after.normals, before.normals),
            (after.probabilities, before.probabilities),
        ):
            np.testing.assert_allclose(ours[image], theirs, rtol=0, atol=1e-5, err_msg=name)


def test_a_cube_rests_on_facets_balances_on_corners_and_tips_over_edges() -> None:
    cube = classify(convex_hull(CUBE), [0, 0, 0])
    assert cube.stable.all()
    assert cube.maximum.all()
    assert cube.saddle.sum() == 2 * 12
    assert cube.hinge.all()
    lengths = np.linalg.norm(cube.saddle_directions, axis=1)
    unit = np.abs(cube.saddle_directions / lengths[:, None])
    np.testing.assert_allclose(np.sort(unit, axis=1), [[0, 0.5**0.5, 0.5**0.5]] * 24, atol=1e-15)


def test_edges_are_hinges_where_the_foot_is_between_their_ends() -> None:
    hull = convex_hull(CUBE * [1.0, 2.0, 3.0])
    for shift in (0.0, 0.3):
        center = np.array([0.0, shift, -shift])
        a, b = hull.vertices[hull.tail], hull.vertices[hull.head]
        t = ((center - a) * (b - a)).sum(1) / ((b - a) ** 2).sum(1)
        np.testing.assert_array_equal(classify(hull, center).hinge, (t > 0) & (t < 1))


@pytest.mark.parametrize(
    ("center", "where"),
    [
        ([1.0, 0.0, 0.0], r"\[1.0, 0.0, 0.0\], which is on the boundary, at facet \d of the hull"),
        ([0.0, -1.5, 0.0], r"\[0.0, -1.5, 0.0\], which is 0.5 outside facet \d of the hull"),
        ([1.0, 1.0, 1.0], "which is on the boundary, at facet"),
    ],
)
def test_a_center_that_is_not_inside_is_refused(center: list[float], where: str) -> None:
    with pytest.raises(OutsideHullError, match=where):
        rest_poses(CUBE, center)


def test_a_center_is_three_finite_numbers_inside_whatever_the_size() -> None:
    for center in ([0.0, 0.0], [0.0, np.nan, 0.0], [0.0, 0.0, np.inf], [[0.0] * 3]):
        with pytest.raises(InputError, match="center of mass"):
            rest_poses(CUBE, center)
    for size in (1e-6, 1.0, 1e6):
        hull = convex_hull(size * CUBE)
        for x, where in ((1.0 - 1e-14, "boundary"), (1.0 + 1e-14, "boundary"), (1.1, "outside")):
            with pytest.raises(OutsideHullError, match=where):
                classify(hull, [0.0, size * x, 0.0])
        classify(hull, [0.0, size * (1.0 - 1e-12), 0.0])
