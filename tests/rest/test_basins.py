"""Resting probabilities against closed forms, sampled flow, reference values and symmetries."""

from __future__ import annotations

import json
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from common.paths import public_data
from scipy.spatial.transform import Rotation

from dicedesign.errors import InputError, OutsideHullError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.reading import read_body, stl_bytes
from dicedesign.rest.equilibria import classify
from dicedesign.rest.poses import rest_poses
from dicedesign.rest.roll import roll_steps
from dicedesign.runtime.arrays import Floats
from tests.reference import solids
from tests.reference.random_hulls import off_center_body
from tests.reference.roller import roll_frequencies

CUBE = np.array(list(product([-1.0, 1.0], repeat=3)))


def rotation(seed: int) -> Floats:
    """A rotation matrix; none for seed 0."""
    return np.eye(3) if seed == 0 else Rotation.random(random_state=seed).as_matrix()


def test_rolls_without_a_hull_give_the_same_probabilities() -> None:
    """6 bodies, 512 rolls each. A frequency may differ by 5 standard deviations of independent
    samples; evenly spread ones do much better on average."""
    count, seeds = 512, range(0, 30, 5)
    distances = []
    for seed in seeds:
        points, center = off_center_body(seed)
        rests = rest_poses(points, center)
        frequencies, lost = roll_frequencies(points, center, rests.normals, count, seed)
        p = rests.probabilities
        assert lost == 0
        assert (np.abs(frequencies - p) <= 5 * np.sqrt(p * (1 - p) / count)).all(), seed
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
        for down in rng.normal(size=(50, 3)):
            end = roll_steps(rests.morse.equilibria, down)[-1].down
            np.testing.assert_array_equal(end, rests.normals[0])


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


def test_a_center_is_three_finite_numbers_inside_whatever_the_size() -> None:
    for center in ([0.0, 0.0], [0.0, np.nan, 0.0], [[0.0] * 3]):
        with pytest.raises(InputError, match="center of mass"):
            rest_poses(CUBE, center)
    with pytest.raises(OutsideHullError, match=r"which is 0.5 outside facet \d of the hull"):
        rest_poses(CUBE, [0.0, -1.5, 0.0])
    for size in (1e-6, 1.0, 1e6):
        hull = convex_hull(size * CUBE)
        for x, where in ((1.0 - 1e-14, "boundary"), (1.0 + 1e-14, "boundary"), (1.1, "outside")):
            with pytest.raises(OutsideHullError, match=where):
                classify(hull, [0.0, size * x, 0.0])
        classify(hull, [0.0, size * (1.0 - 1e-12), 0.0])
