"""Probabilities under priors, against closed forms, other ways to the same, and rolled bodies."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy import integrate
from scipy.spatial.transform import Rotation

import dicedesign as dd
from dicedesign.errors import InputError
from dicedesign.rest.border_arcs import integrals
from dicedesign.runtime.arrays import Floats
from tests.reference.extremes import ANTIPODE_SEEDS, lopsided_needle

CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
AXES = np.random.default_rng(0).normal(size=(3, 3))


def random_body(seed: int, corners: int = 24) -> Floats:
    points = np.random.default_rng(seed).normal(size=(corners, 3))
    return points / np.linalg.norm(points, axis=1)[:, None] * [1.0, 1.1, 0.8]


def by_facet(poses: dd.RestPoses, values: Floats | None = None) -> Floats:
    """(m,) probabilities of the facets, or other values of the rests."""
    spread = np.zeros(len(poses.hull.normals))
    spread[poses.facets] = poses.probabilities if values is None else values
    return spread


def draw_directions(axis: Floats, concentration: float, count: int) -> Floats:
    """(count, 3) directions by the distribution of von Mises and Fisher, as Wood draws them."""
    rng = np.random.default_rng(7)
    u, turn = rng.random(count), 2.0 * np.pi * rng.random(count)
    cosine = 1.0 + np.log(u + (1.0 - u) * np.exp(-2.0 * concentration)) / concentration
    sine = np.sqrt(1.0 - cosine**2)
    local = np.column_stack([sine * np.cos(turn), sine * np.sin(turn), cosine])
    return Rotation.align_vectors([axis], [[0.0, 0.0, 1.0]])[0].apply(local)


def test_a_cube_about_the_axis_of_a_face() -> None:
    for concentration in (1e-9, 0.3, 5.0, 100.0, 1e4, 1e12):

        def sector(azimuth: float, k: float = concentration) -> float:
            # The basin of the face ends at the angle whose tangent is 1 / cos of the azimuth.
            cosine = 1.0 / np.hypot(1.0, 1.0 / np.cos(azimuth))
            return float(np.expm1(-k * (1.0 - cosine)) / np.expm1(-2.0 * k) / (2.0 * np.pi))

        expected = 8.0 * integrate.quad(sector, 0.0, np.pi / 4.0, epsabs=1e-13)[0]
        poses = dd.rest_poses(CUBE).under(dd.VonMisesFisher([0.0, 0.0, 2.0], concentration))
        face = int(np.argmax(poses.normals[:, 2]))
        sides = np.abs(poses.normals[:, 2]) < 0.5
        assert poses.probabilities[face] == pytest.approx(expected, abs=1e-13)
        assert np.ptp(poses.probabilities[sides]) < 1e-15
        assert poses.errors is not None
        assert poses.errors.max() < 1e-13


def test_three_kinds_of_uniform_priors_agree() -> None:
    for seed, axis in enumerate(AXES):
        poses = dd.rest_poses(random_body(seed))
        for prior in (
            dd.VonMisesFisher(axis, 0.0),
            dd.SphericalCap(axis, 180.0),
            dd.DensityFunction(lambda u: np.full(len(u), 0.7)),
        ):
            np.testing.assert_allclose(by_facet(poses.under(prior)), by_facet(poses), atol=1e-13)


def test_a_cube_in_half_spheres() -> None:
    poses = dd.rest_poses(CUBE)
    face = poses.under("half:0,0,-3")
    np.testing.assert_allclose(
        face.probabilities, [1 / 3, 1 / 6, 1 / 6, 1 / 6, 1 / 6, 0], atol=1e-15
    )
    np.testing.assert_allclose(face.normals[0], [0, 0, -1], atol=1e-15)
    corner = poses.under("half:1,1,1")
    # About a corner three faces lose a triangle with an angle of 120 degrees between two sides that
    # go from a corner of the face to the middles of its borders.
    side = np.arccos(np.sqrt(2.0 / 3.0))
    tangent = np.tan(side / 2.0) ** 2
    excess = 2.0 * np.arctan2(
        tangent * np.sin(2.0 * np.pi / 3.0), 1.0 + tangent * np.cos(2.0 * np.pi / 3.0)
    )
    near = (4.0 * np.pi / 6.0 - excess) / (2.0 * np.pi)
    np.testing.assert_allclose(corner.probabilities[:3], near, atol=1e-15)
    np.testing.assert_allclose(corner.probabilities[3:], 1.0 / 3.0 - near, atol=1e-15)


def test_cubature_of_a_function_and_the_one_integral_agree() -> None:
    for seed, axis, concentration in zip(ANTIPODE_SEEDS, AXES, (0.5, 20.0, 0.5), strict=False):
        body = lopsided_needle(seed)
        poses = dd.rest_poses(body.points, body.center)
        known = dd.VonMisesFisher(axis, concentration)
        by_cubature = poses.under(dd.DensityFunction(lambda u, known=known: 3.0 * known.density(u)))
        np.testing.assert_allclose(by_facet(by_cubature), by_facet(poses.under(known)), atol=1e-13)


def errors(poses: dd.RestPoses) -> Floats:
    """(m,) errors of the facets."""
    return by_facet(poses, poses.errors)


def test_errors_bound_what_is_missed(monkeypatch: pytest.MonkeyPatch) -> None:
    poses, axis = dd.rest_poses(random_body(0, 8)), AXES[0]
    monkeypatch.setattr("dicedesign.rest.border_arcs.MOST_VALUES", 800_000)
    rough = poses.under(dd.DensityFunction(lambda u: (u @ axis > 0.0).astype(float)))
    off = np.abs(by_facet(rough) - by_facet(poses.under(dd.SphericalCap(axis))))
    assert off.max() > 1e-12
    assert (off <= errors(rough)).all()
    assert errors(rough).max() < 1e-3
    for seed, axis in enumerate(AXES):
        poses = dd.rest_poses(random_body(seed, 8))
        exact = poses.under(dd.VonMisesFisher(axis, 1e4))
        with monkeypatch.context() as patch:
            patch.setattr("dicedesign.rest.density_priors.TOLERANCE", 1e-3)
            coarse = poses.under(dd.VonMisesFisher(axis, 1e4))
        assert (np.abs(by_facet(coarse) - by_facet(exact)) <= errors(coarse)).all()
        assert errors(exact).max() < 1e-13 < errors(coarse).max() < 1e-3
        # A cap and what it leaves out make up the sphere.
        cap, rest = (poses.under(dd.SphericalCap(sign * axis, 90.0)) for sign in (1.0, -1.0))
        off = np.abs((by_facet(cap) + by_facet(rest)) / 2.0 - by_facet(poses))
        bound = (errors(cap) + errors(rest)) / 2.0
        assert (off <= bound).all()
        assert bound.max() < 1e-14


def test_sampled_directions_roll_as_often_as_predicted() -> None:
    poses = dd.rest_poses(random_body(4))
    directions = draw_directions(AXES[1], 20.0, 40_000)
    by_samples = poses.under(dd.SampledDirections(directions))
    said = by_facet(poses.under(dd.VonMisesFisher(AXES[1], 20.0)))
    assert by_samples.errors is not None
    # The intervals hold 95 %: of 12 probabilities or so, most.
    assert (
        np.abs(by_samples.probabilities - said[by_samples.facets]) <= by_samples.errors
    ).mean() > 0.7
    np.testing.assert_allclose(by_samples.probabilities, said[by_samples.facets], atol=0.01)


def test_prior_and_body_may_turn_together_and_units_do_not_matter() -> None:
    points, turn = random_body(6), Rotation.from_rotvec([0.3, -1.0, 0.7])
    for axis in AXES:
        for make_prior in (lambda a: dd.VonMisesFisher(a, 7.0), lambda a: dd.SphericalCap(a, 50.0)):
            original = dd.rest_poses(points).under(make_prior(1e-200 * axis))
            turned = dd.rest_poses(1e6 * turn.apply(points)).under(make_prior(turn.apply(axis)))
            np.testing.assert_allclose(original.probabilities, turned.probabilities, atol=1e-13)


def test_a_fit_finds_the_axis_and_the_concentration() -> None:
    for concentration in (0.8, 12.0, 3000.0):
        fitted = dd.VonMisesFisher.fitted(draw_directions(AXES[2], concentration, 50_000))
        assert fitted.concentration == pytest.approx(concentration, rel=0.03)
        axis = AXES[2] / np.linalg.norm(AXES[2])
        assert np.dot(fitted.axis, axis) > 1.0 - 1e-3
    assert dd.VonMisesFisher.fitted(CUBE).concentration < 1e-15
    assert dd.VonMisesFisher.fitted([[0.0, 0.0, 2.0], [0.0, 0.0, -1.0]]).concentration == 0.0
    assert dd.VonMisesFisher.fitted([[0.0, 0.0, 5.0]]).concentration > 1e9


def test_directions_in_a_file_may_have_a_header_and_empty_lines(tmp_path: Path) -> None:
    path = tmp_path / "directions.csv"
    path.write_text("x,y,z\n0,0,3\n\n0,-2,0\n")
    prior = dd.SampledDirections.read(path)
    np.testing.assert_array_equal(prior.directions, [[0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    path.write_text("0,0,3\nx,y,z\n")
    with pytest.raises(InputError, match="in line 2"):
        dd.SampledDirections.read(path)


@pytest.mark.parametrize(
    ("prior", "said"),
    [
        ("vmf:0,0,1:-1", "concentration"),
        ("vmf:0,0,1", "vmf:x,y,z:CONCENTRATION"),
        ("cap:0,0,1:181", "angle"),
        ("normal:0,0,1", "vmf:x,y,z:CONCENTRATION or"),
        (lambda u: u[:, 0], "prior"),
        (lambda u: np.full(len(u), np.nan), "prior"),
        (lambda u: np.zeros(len(u)), "prior"),
        ([], "directions"),
        ([[0, 0, 0]], "directions"),
    ],
)
def test_a_prior_that_is_none_is_refused(prior: object, said: str) -> None:
    """A text, a function that is no density, or samples that are no directions."""
    poses = dd.rest_poses(CUBE)
    kind = {str: str, list: dd.SampledDirections}.get(type(prior), dd.DensityFunction)
    with pytest.raises(dd.InputError, match=said):
        poses.under(kind(prior))


def test_peaks_and_kinks_and_empty_intervals() -> None:
    widths = np.array([1.0, 1e-3, 1e-6])

    def peak(rows: np.ndarray, x: np.ndarray) -> np.ndarray:
        w = widths[rows, None]
        return np.stack([w / (w**2 + x**2), np.sqrt(np.abs(x))], axis=-1)

    edges = np.array([[0.0, 0.0, 2.0]] * 3)
    values, errors = integrals(peak, edges, 1e-13)
    np.testing.assert_allclose(values[:, 0], np.arctan(2.0 / widths), rtol=1e-12)
    np.testing.assert_allclose(values[:, 1], 2.0**1.5 * 2.0 / 3.0, rtol=1e-12)
    assert errors.max() < 1e-11
