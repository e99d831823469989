"""Odds under priors, against closed forms, other quadratures, drawn directions and each other."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import integrate
from scipy.spatial.transform import Rotation

import dicedesign as dd
from dicedesign.runtime.arrays import Floats
from tests.reference.extremes import (
    ANTIPODE_SEEDS,
    lens,
    lopsided_needle,
    weighted_sphere,
)

CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
AXES = np.random.default_rng(0).normal(size=(3, 3))


def random_body(seed: int, corners: int = 24) -> Floats:
    points = np.random.default_rng(seed).normal(size=(corners, 3))
    return points / np.linalg.norm(points, axis=1)[:, None] * [1.0, 1.1, 0.8]


def by_facet(poses: dd.RestPoses) -> Floats:
    """(m,) odds of the facets."""
    odds = np.zeros(len(poses.hull.normals))
    odds[poses.facets] = poses.probabilities
    return odds


def drawn(axis: Floats, concentration: float, count: int) -> Floats:
    """(count, 3) directions by the distribution of von Mises and Fisher, as Wood draws them."""
    rng = np.random.default_rng(7)
    u, turn = rng.random(count), 2.0 * np.pi * rng.random(count)
    cosine = 1.0 + np.log(u + (1.0 - u) * np.exp(-2.0 * concentration)) / concentration
    sine = np.sqrt(1.0 - cosine**2)
    local = np.column_stack([sine * np.cos(turn), sine * np.sin(turn), cosine])
    return Rotation.align_vectors([axis], [[0.0, 0.0, 1.0]])[0].apply(local)


@pytest.mark.parametrize("concentration", [1e-9, 0.3, 5.0, 100.0, 1e4, 1e12])
def test_a_cube_about_the_axis_of_a_face(concentration: float) -> None:
    def cap(cosine: float) -> float:
        part = np.expm1(-concentration * (1.0 - cosine)) / np.expm1(-2.0 * concentration)
        return float(part)

    # The basin of the face ends at the angle whose tangent is 1 / cos of the azimuth.
    def sector(azimuth: float) -> float:
        return cap(1.0 / np.hypot(1.0, 1.0 / np.cos(azimuth))) / (2.0 * np.pi)

    expected = 8.0 * integrate.quad(sector, 0.0, np.pi / 4.0, epsabs=1e-13)[0]
    poses = dd.rest_poses(CUBE).under(dd.VonMisesFisher([0.0, 0.0, 2.0], concentration))
    assert poses.errors is not None
    face = int(np.argmax(poses.normals[:, 2]))
    sides = np.abs(poses.normals[:, 2]) < 0.5
    assert poses.probabilities[face] == pytest.approx(expected, abs=1e-13)
    assert np.ptp(poses.probabilities[sides]) < 1e-15
    assert poses.errors.max() < 1e-13


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("seed", range(3))
def test_all_directions_alike_in_three_ways(axis: Floats, seed: int) -> None:
    poses = dd.rest_poses(random_body(seed))
    for prior in (
        dd.VonMisesFisher(axis, 0.0),
        dd.SphericalCap(axis, 180.0),
        dd.DensityFunction(lambda u: np.full(len(u), 0.7)),
    ):
        np.testing.assert_allclose(by_facet(poses.under(prior)), by_facet(poses), atol=1e-13)


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("seed", range(3))
def test_opposite_half_spheres_mix_to_all_directions(axis: Floats, seed: int) -> None:
    poses = dd.rest_poses(random_body(seed))
    halves = [by_facet(poses.under(dd.SphericalCap(side))) for side in (axis, -axis)]
    np.testing.assert_allclose(np.mean(halves, axis=0), by_facet(poses), atol=1e-14)
    assert halves[0].sum() == pytest.approx(1.0, abs=1e-14)


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


def test_a_cap_within_one_basin() -> None:
    poses = dd.rest_poses(CUBE)
    np.testing.assert_allclose(
        poses.under("cap:0,0,1:34").probabilities, [1, 0, 0, 0, 0, 0], atol=1e-14
    )
    # At 45 degrees it touches the arcs to the four sides; at 46 it reaches over them.
    assert poses.under("cap:0,0,1:46").probabilities[4] > 1e-4
    assert poses.under("cap:1,0,1:20").probabilities[:2] == pytest.approx([0.5, 0.5], abs=1e-14)


@pytest.mark.parametrize("concentration", [0.5, 20.0])
@pytest.mark.parametrize("seed", ANTIPODE_SEEDS[:3])
def test_cubature_of_a_function_and_the_one_integral_agree(seed: int, concentration: float) -> None:
    body = lopsided_needle(seed)
    poses = dd.rest_poses(body.points, body.center)
    for axis in AXES:
        known = dd.VonMisesFisher(axis, concentration)
        found = poses.under(dd.DensityFunction(lambda u, known=known: 3.0 * known.density(u)))
        np.testing.assert_allclose(by_facet(found), by_facet(poses.under(known)), atol=1e-13)


def test_the_error_of_a_rough_density_is_told() -> None:
    poses, axis = dd.rest_poses(random_body(1, 8)), AXES[0]
    rough = poses.under(dd.DensityFunction(lambda u: (u @ axis > 0.0).astype(float)))
    off = np.abs(by_facet(rough) - by_facet(poses.under(dd.SphericalCap(axis)))).max()
    assert rough.errors is not None
    assert 1e-12 < off <= rough.errors.max() < 1e-3


@pytest.mark.parametrize("concentration", [2.0, 30.0])
def test_drawn_directions_roll_as_often_as_said(concentration: float) -> None:
    poses = dd.rest_poses(random_body(4))
    directions = drawn(AXES[1], concentration, 40_000)
    found = poses.under(dd.SampledDirections(directions))
    said = by_facet(poses.under(dd.VonMisesFisher(AXES[1], concentration)))
    assert found.errors is not None
    # The intervals hold 95 %: of 12 odds or so, most.
    assert (np.abs(found.probabilities - said[found.facets]) <= found.errors).mean() > 0.7
    np.testing.assert_allclose(found.probabilities, said[found.facets], atol=0.01)


def test_samples_end_where_single_rolls_do() -> None:
    points = random_body(5)
    poses = dd.rest_poses(points)
    directions = np.random.default_rng(3).normal(size=(60, 3))
    counts = np.zeros(len(poses.hull.normals))
    for down in directions:
        counts[np.argmax(poses.hull.normals @ dd.roll(points, down)[-1].down)] += 1
    found = poses.under(dd.SampledDirections(directions))
    np.testing.assert_allclose(by_facet(found), counts / 60, atol=1e-15)


def test_one_rest_has_it_all() -> None:
    body = weighted_sphere()
    poses = dd.rest_poses(body.points, body.center)
    for prior in ("vmf:1,2,3:40", "half:1,2,3", dd.DensityFunction(lambda u: 1.0 + u[:, 0])):
        np.testing.assert_allclose(poses.under(prior).probabilities, [1.0], atol=1e-14)


def test_a_tied_body_has_the_mean_of_both_sides() -> None:
    # The center of mass over an edge of a face.
    wedge = np.array([[0, 0, 0], [2, 0, 0], [0, 1, 0], [2, 1, 0], [-1, 0, 2], [2, 0, 2.0]])
    wedge = np.concatenate([wedge, wedge[4:] + np.array([0, 1, 0])])
    poses = dd.rest_poses(wedge, [0.0, 0.5, 0.9])
    assert len(poses.basins) > 1
    for axis in AXES:
        halves = [by_facet(poses.under(dd.SphericalCap(side))) for side in (axis, -axis)]
        np.testing.assert_allclose(np.mean(halves, axis=0), by_facet(poses), atol=1e-13)
        aside = [
            by_facet(dd.rest_poses(wedge, [x, 0.5, 0.9]).under(dd.VonMisesFisher(axis, 3.0)))
            for x in (1e-7, -1e-7)
        ]
        found = by_facet(poses.under(dd.VonMisesFisher(axis, 3.0)))
        np.testing.assert_allclose(found, np.mean(aside, axis=0), atol=1e-6)


def test_prior_and_body_may_turn_together_and_units_do_not_matter() -> None:
    points, turn = random_body(6), Rotation.from_rotvec([0.3, -1.0, 0.7])
    for axis in AXES:
        for made in (lambda a: dd.VonMisesFisher(a, 7.0), lambda a: dd.SphericalCap(a, 50.0)):
            here = dd.rest_poses(points).under(made(1e-200 * axis))
            there = dd.rest_poses(1e6 * turn.apply(points)).under(made(turn.apply(axis)))
            np.testing.assert_allclose(here.probabilities, there.probabilities, atol=1e-13)


def test_a_flat_body_on_its_two_sides() -> None:
    body = lens()
    poses = dd.rest_poses(body.points, body.center)
    np.testing.assert_allclose(poses.under("half:0,0,1").probabilities, [1.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(poses.under("half:1,0,0").probabilities, [0.5, 0.5], atol=1e-15)


def test_odds_without_a_prior_come_back() -> None:
    poses = dd.rest_poses(random_body(7))
    back = poses.under("vmf:0,0,1:4").under(None)
    np.testing.assert_array_equal(back.probabilities, poses.probabilities)
    assert back.prior is None
    assert back.errors is None


def test_what_is_thrown_has_no_prior() -> None:
    points = random_body(8)
    poses = dd.rest_poses(points)
    body = dd.make_body(points)
    with pytest.raises(dd.InputError, match=r"under\(None\)"):
        dd.thrown_odds(body, poses.under("half:0,0,1"))
    assert dd.thrown_odds(body, poses.under("half:0,0,1").under(None)).sum() == pytest.approx(1.0)


def test_a_fit_finds_the_axis_and_the_concentration() -> None:
    for concentration in (0.8, 12.0, 3000.0):
        fitted = dd.VonMisesFisher.fitted(drawn(AXES[2], concentration, 50_000))
        assert fitted.concentration == pytest.approx(concentration, rel=0.03)
        axis = AXES[2] / np.linalg.norm(AXES[2])
        assert np.dot(fitted.axis, axis) > 1.0 - 1e-3
    assert dd.VonMisesFisher.fitted(CUBE).concentration < 1e-15
    assert dd.VonMisesFisher.fitted([[0.0, 0.0, 5.0]]).concentration > 1e9


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("vmf:0,0,0:3", "not all zero"),
        ("vmf:0,0,nan:3", "finite"),
        ("vmf:0,0,1:-1", "concentration"),
        ("vmf:0,0,1:nan", "concentration"),
        ("vmf:0,0,1", "vmf:x,y,z:CONCENTRATION"),
        ("half:1,2", "three"),
        ("half:a,b,c", "half:x,y,z"),
        ("cap:0,0,1:0", "angle"),
        ("cap:0,0,1:181", "angle"),
        ("normal:0,0,1", "vmf:x,y,z:CONCENTRATION or"),
        ("samples:/no/such/file.csv", "/no/such/file.csv"),
    ],
)
def test_a_prior_that_is_none_is_refused(text: str, said: str) -> None:
    with pytest.raises(dd.InputError, match=said):
        dd.rest_poses(CUBE).under(text)


@pytest.mark.parametrize(("body", "direction"), [(1, 5), (3, 0), (7, 1)])
def test_a_peak_that_one_of_two_sums_misses_is_told(body: int, direction: int) -> None:
    peak = dd.VonMisesFisher(np.random.default_rng(direction).normal(size=3).tolist(), 1e6)
    poses = dd.rest_poses(random_body(body))
    exact = (by_facet(poses.under(peak)) + by_facet(poses)) / 2.0
    under = poses.under(dd.DensityFunction(lambda u: peak.density(u) + 1.0 / (4.0 * np.pi)))
    assert under.errors is not None
    assert np.abs(by_facet(under) - exact).max() <= under.errors.max() + 1e-12


@pytest.mark.parametrize("number", ["3", None, True, np.array([1.0, 2.0])])
def test_what_is_no_number_is_refused(number: object) -> None:
    with pytest.raises(dd.InputError, match="concentration"):
        dd.VonMisesFisher([0, 0, 1], number)  # type: ignore[arg-type]
    with pytest.raises(dd.InputError, match="angle"):
        dd.SphericalCap([0, 0, 1], number)  # type: ignore[arg-type]
    with pytest.raises(dd.InputError, match="prior"):
        dd.rest_poses(CUBE).under([number])  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "function",
    [
        lambda u: u[:, 0],
        lambda u: np.full(len(u), np.nan),
        lambda u: np.zeros(len(u)),
        lambda u: u,
        lambda u: 1.0,
    ],
)
def test_a_function_that_is_no_density_is_refused(function: object) -> None:
    with pytest.raises(dd.InputError, match="prior"):
        dd.rest_poses(CUBE).under(dd.DensityFunction(function))  # type: ignore[arg-type]


@pytest.mark.parametrize("directions", [[], [[1, 2]], [[0, 0, 0]], [[0, 0, np.inf]], "x"])
def test_samples_that_are_no_directions_are_refused(directions: object) -> None:
    with pytest.raises(dd.InputError, match="directions"):
        dd.SampledDirections(directions)  # type: ignore[arg-type]
