"""Gradients against 60-digit differences, at glancing paths, at events, on degenerate bodies."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import torch
from common.benches import run_bench

from dicedesign.bench.benches.gradients import Extent, HullsRow
from dicedesign.bench.bodies import extremes, solids, stiff
from dicedesign.bench.bodies.problem import Problem, turned
from dicedesign.bench.bodies.random_hulls import KINDS, random_hull
from dicedesign.bench.bodies.solids import PLATONIC
from dicedesign.bench.measures.designs.decision_events import DISCONTINUOUS, EVENTS, find_events
from dicedesign.bench.measures.gradients.gradient_errors import (
    compare_gradients,
    exponent,
    gradient_row,
    grazing_body,
    is_sound,
)
from dicedesign.bench.measures.gradients.path_angles import smallest_growth_and_slant
from dicedesign.bench.reference.oracle_derivatives import oracle_derivative
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.sphere import angle_between, oblique_projection, unit_vectors
from dicedesign.gradient.differentiable_rest import differentiable_rest
from dicedesign.gradient.rest_odds import RestEvaluation, evaluate_rests
from dicedesign.gradient.solid_moments import hull_centroid
from dicedesign.rest.equilibria import classify
from dicedesign.rest.morse import separatrices, separatrix_points
from dicedesign.rest.poses import rest_poses

torch.set_num_threads(1)

SMALL = Extent(hulls=8, solids=2, polyhedra=2, bodies=1, growths=5, seconds=0.0)

TETRAHEDRON = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])


def all_gradients(problem: Problem) -> tuple[np.ndarray, list[np.ndarray]]:
    """Center of mass, and the gradient (n, 3) of each probability, with that in a given center of
    mass as last row."""
    points = torch.tensor(problem.points, requires_grad=True)
    variables = [points]
    if problem.center is not None:
        variables.append(torch.tensor(problem.center, requires_grad=True))
    _, odds = differentiable_rest(points, *variables[1:])
    found = (torch.autograd.grad(p, variables, retain_graph=True) for p in odds)
    joined = [np.concatenate([g.numpy().reshape(-1, 3) for g in of_one]) for of_one in found]
    return evaluate_rests(points, *variables[1:]).equilibria.center_of_mass, joined


def test_gradients_are_those_of_the_oracle() -> None:
    rows = list(compare_gradients(24))
    assert is_sound(rows)
    assert max(max(row.error, row.jacobian_error) for row in rows) < 1e-11
    assert {row.name.rpartition(" ")[0] for row in rows} == set(KINDS)
    assert sum(row.uniform for row in rows) == 12
    assert {row.corners for row in rows} <= set(range(4, 21))
    assert min(row.rests for row in rows) >= 2


def test_a_wrong_gradient_is_noticed() -> None:
    """A thousandth of the centroid's own motion is left out."""

    def lazy(points: torch.Tensor, center: torch.Tensor | None) -> RestEvaluation:
        if center is None:
            hull = convex_hull(points.detach().numpy())
            right = hull_centroid(points[hull.source], hull)
            center = 0.999 * right + 0.001 * right.detach()
        return evaluate_rests(points, center)

    uniform, given = (
        gradient_row(*random_hull(number), evaluate=lazy) for number in (1, 1 + len(KINDS))
    )
    assert uniform.error > 1e-5
    assert not uniform.ok
    assert given.ok


@pytest.mark.parametrize("number", range(8))
def test_random_hulls_follow_from_their_numbers(number: int) -> None:
    kind, problem = random_hull(number)
    assert kind == tuple(KINDS)[number % 4]
    np.testing.assert_array_equal(problem.points, random_hull(number)[1].points)
    assert (problem.center is None) == (number < 4)


@pytest.mark.parametrize("uniform", [True, False])
def test_the_oracle_knows_how_a_tetrahedron_changes(uniform: bool) -> None:
    """A corner that moves out changes the three facets around it alike, and nothing about a given
    center in the middle: the borders of the basin opposite stay. Nor does a moved or turned body
    change."""
    hull = convex_hull(TETRAHEDRON)
    center = None if uniform else np.zeros(3)
    outward = np.zeros_like(TETRAHEDRON)
    outward[0] = 1.0
    found = oracle_derivative(hull, center, outward, np.zeros(3))
    opposite = int(np.argmin(hull.normals @ TETRAHEDRON[0]))
    around = np.delete(found, opposite)
    np.testing.assert_allclose(around, -found[opposite] / 3.0, rtol=1e-15, atol=1e-30)
    assert (abs(found[opposite]) > 1e-3) == uniform
    for along in (np.ones((4, 3)), np.linalg.cross([0.25, 0.5, 2.0], TETRAHEDRON)):
        move = np.ones(3) if along[0, 0] == 1.0 else np.zeros(3)
        np.testing.assert_allclose(oracle_derivative(hull, center, along, move), 0.0, atol=1e-30)


def test_the_oracle_agrees_with_coarse_differences_on_a_box() -> None:
    hull = convex_hull(solids.box(1.0, 2.0, 3.0).points)
    center, along = np.array([0.1, 0.2, 0.3]), np.array([0.5, -0.2, 0.1])
    still = np.zeros_like(hull.vertices)
    found = oracle_derivative(hull, center, still, along)
    coarse = np.zeros(6)
    for sign in (1.0, -1.0):
        poses = rest_poses(hull.vertices, center + sign * 1e-5 * along)
        coarse[poses.facets] += sign * poses.probabilities / 2e-5
    np.testing.assert_allclose(found, coarse, atol=1e-8)


def test_the_slant_is_the_angle_between_line_and_arc() -> None:
    """Against the angle between the planes of the two great circles."""
    checked = 0
    for number in range(0, 40):
        problem = random_hull(number)[1]
        hull = convex_hull(problem.points)
        center = hull.centroid if problem.center is None else problem.center
        paths = separatrices(classify(hull, center))
        points = separatrix_points(paths, hull.vertices, center, np)
        growths, slants = [1.0], [1.0]
        for branch, step in zip(*np.nonzero(paths.crossed[:, :, 0] >= 0), strict=True):
            if step >= paths.lengths[branch]:
                continue
            p, q = paths.crossed[branch, step]
            r, v = hull.vertices[p] - center, hull.vertices[q] - hull.vertices[p]
            plane = np.linalg.cross(points[branch, step], r)
            slants.append(float(np.sin(angle_between(plane, v))))
            growths.append(float(np.cos(angle_between(r, v))))
            checked += 1
        found = smallest_growth_and_slant(paths, hull.vertices, center)
        np.testing.assert_allclose(found, (min(growths), min(slants)), rtol=1e-8)
    assert checked > 50


def test_the_angle_of_a_crossing_and_its_derivative() -> None:
    """The formulas on which the statement about the growth of gradients rests."""
    rng = np.random.default_rng(0)
    for _ in range(200):
        r, v = np.array([0.0, 0.0, 1.0]), unit_vectors(rng.normal(size=3))
        u = unit_vectors(rng.normal(size=3))
        v, u = (-v if v @ r < 0.0 else v), (-u if u @ r < 0.0 else u)
        if u @ v >= 0.0:
            continue
        rho, alpha, theta = r @ v, -u @ v, angle_between(u, r)
        crossing = oblique_projection(u, r, v)
        phi = np.arctan2(rho * np.sin(theta), alpha + rho * np.cos(theta))
        assert angle_between(crossing, r) == pytest.approx(phi, abs=1e-12)
        squared = rho**2 + alpha**2 + 2.0 * rho * alpha * np.cos(theta)
        assert crossing @ crossing == pytest.approx(squared, rel=1e-12)
        plane = np.linalg.cross(u, r)
        slant = np.sin(angle_between(plane, v))
        assert slant == pytest.approx(np.sqrt(squared) / np.sin(theta), rel=1e-9)


def test_a_glancing_path_alone_leaves_the_gradient_small() -> None:
    rows = [gradient_row("", stiff.glancing(sign * 1e-3**n)) for n in (1, 4) for sign in (1, -1)]
    assert rows[2].growth == pytest.approx(1e-12, rel=1e-3)
    assert all(row.ok and 0.5 < row.size < 1.5 for row in rows)


def test_a_path_that_grazes_an_arc_makes_the_gradient_grow() -> None:
    rows = [gradient_row("", grazing_body(10.0**-n, 10.0 ** (-n - 2))) for n in (3, 6, 9, 12)]
    assert exponent(rows) == pytest.approx(-1.0, abs=1e-3)
    for row in rows:
        assert 1.0 < row.size * row.growth < 3.0
        assert row.growth <= row.slant < 2.0 * row.growth
        assert row.error < 1e-12
    wider = gradient_row("", grazing_body(1e-9, 1e-9))
    assert wider.growth == pytest.approx(1e-9, rel=1e-3)
    assert wider.size < 0.5 * rows[2].size
    assert wider.slant > 3.0 * rows[2].slant


def test_events_are_of_four_kinds_and_the_derivatives_beside_them_are_right() -> None:
    met = list(find_events([24, 34]))
    assert {event.kind for event in met} == set(EVENTS)
    for event in met:
        assert event.ok
        assert event.error < 1e-11
        assert event.jumps == (event.kind in DISCONTINUOUS)
        assert all(0.0 < slope < 1e4 for slope in event.slopes)
    assert not replace(met[0], jump=0.5 - met[0].jumps).ok


DEGENERATE = {
    **{f"{name}, turned": turned(solids.platonic(name), 1) for name in PLATONIC},
    **{f"prism {n}": solids.prism(n) for n in (3, 4, 7, 64)},
    **{f"antiprism {n}": solids.antiprism(n) for n in (4, 9)},
    "icosphere": solids.icosphere(2),
    "box": solids.box(5.0, 4.0, 0.1),
    "box needle": turned(solids.box(1.0, 1.0, 1e6), 3),
    "box plate": turned(solids.box(1.0, 1.0, 1e-6), 3),
    **{f"needle {seed}": stiff.stretched(seed, (1.0, 1.0, 1e6)) for seed in range(4)},
    **{f"plate {seed}": stiff.stretched(seed, (1.0, 1.0, 1e-6)) for seed in range(4)},
    **{f"roof 1e-{n}": stiff.roof(10.0**-n, centered=n % 4 == 0) for n in (2, 6, 10, 14)},
    **{f"bulge 1e-{n}": stiff.bulging_cube(10.0**-n) for n in (3, 7, 11, 15)},
    **{f"dent 1e-{n}": stiff.dented_cube(10.0**-n) for n in (3, 7, 11, 15)},
    **{f"hidden {n}": stiff.hidden_center(1e-9, n) for n in (1, 2, 3)},
    **{f"foot {d}": stiff.off_balance(d, corner=c) for d, c in ((1e-9, False), (-1e-9, True))},
    **{f"opposed 1e-{n}": stiff.opposed(10.0**-n) for n in (3, 8, 14)},
    "opposed": stiff.opposed(0.0),
    **{f"wrap {seed}": extremes.lopsided_needle(seed) for seed in extremes.ANTIPODE_SEEDS[:3]},
    "lens": extremes.lens(),
    "weighted sphere": extremes.weighted_sphere(),
    "duplicates": extremes.with_duplicates(),
    "extras": extremes.with_extras(),
}


@pytest.mark.parametrize("name", DEGENERATE)
def test_gradients_of_degenerate_bodies_are_finite_and_know_the_symmetries(name: str) -> None:
    """Translation, scaling and rotation change no probability; one rest has no gradient at all."""
    problem = DEGENERATE[name]
    middle, found = all_gradients(problem)
    places = problem.points - middle
    if problem.center is not None:
        places = np.concatenate([places, np.zeros((1, 3))])
    reach = float(np.sqrt((places**2).sum(-1)).max())
    assert np.isfinite(found).all()
    size = float(np.abs(found).max())
    assert (size == 0.0) == (len(found) == 1)
    # A move of the corners by rounding changes gradients by as much as they are large.
    tolerance = 1e-14 * size * (1.0 + size * reach)
    for gradient in found:
        assert np.abs(gradient.sum(axis=0)).max() <= tolerance
        assert abs((places * gradient).sum()) <= tolerance * reach
        assert np.abs(np.linalg.cross(places, gradient).sum(axis=0)).max() <= tolerance * reach


def test_bodies_that_balance_exactly_have_the_model_s_odds_and_finite_gradients() -> None:
    """Both one-sided derivatives of an event are finite, and so is their mean."""
    balanced = 0
    for seed in range(60):
        for center in (None, np.zeros(3)):
            problem = replace(stiff.lattice_body(seed), center=center)
            poses = rest_poses(problem.points, center)
            balanced += any("balances" in note for note in poses.notes)
            given = None if center is None else torch.as_tensor(center)
            normals, odds = differentiable_rest(torch.as_tensor(problem.points), given)
            # Equal odds may come in another order.
            nearest = np.argmax(poses.normals @ normals.numpy().T, axis=1)
            assert len(odds) == len(poses.probabilities) == len(set(nearest.tolist()))
            np.testing.assert_allclose(odds.numpy()[nearest], poses.probabilities, atol=1e-12)
            assert all(np.isfinite(gradient).all() for gradient in all_gradients(problem)[1])
    assert balanced > 10


def test_the_command_tells_of_all(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_bench("gradients", extent=SMALL) == 0
    table = capsys.readouterr().out
    assert "ellipsoid, uniform" in table
    assert "verdict: ok" in table
    assert all(kind in table for kind in EVENTS)
    arguments = ["gradients", "--hulls", "4", "--json"]
    assert run_bench(*arguments, extent=SMALL) == 0
    given = json.loads(capsys.readouterr().out)
    assert [one["ok"] for one in given["hulls"]] == [True] * 4
    assert len(given["glancing"]) == 10
    assert given["exponents"]["grazing"] == pytest.approx(-1.0, abs=0.1)
    assert {row["name"] for row in given["polygons"]} == {
        *("cube", "cube, turned", "random 0", "random 1")
    }
    assert all(row["ok"] for row in given["polygons"])
    assert given["times"][0]["name"] == "cube"
    assert given["ok"]


def test_hulls_are_summed_up() -> None:
    right = gradient_row("ellipsoid 1", random_hull(1)[1])
    wrong = replace(right, error=2.0 * right.limit)
    row = HullsRow.of("all", [right, right, wrong])
    assert (row.hulls, row.failed, row.of_limit) == (3, 1, 2.0)
    assert (row.median, row.worst) == (right.error, wrong.error)
