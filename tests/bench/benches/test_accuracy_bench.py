"""The methods that the accuracy bench compares, and what it writes."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from common.benches import run_bench
from scipy.spatial.transform import Rotation

from dicedesign.bench.benches.accuracy import BodyAnswers, Extent, accuracy_figure
from dicedesign.bench.bodies.monostatic import conway_guy
from dicedesign.bench.bodies.problem import Problem
from dicedesign.bench.bodies.solids import box, platonic, prism
from dicedesign.bench.bodies.stiff import placed, random_body
from dicedesign.bench.frame import Run
from dicedesign.bench.measures.queries.answers import (
    CENTERS,
    DIRECTIONS,
    FLOAT32,
    FLOAT64,
    LATTICE,
    MONTE_CARLO,
    SOLID_ANGLES,
    TRIMESH,
    TRIMESH_SPREAD,
    Answer,
    answers,
    timed,
    timed_trimesh,
)
from dicedesign.bench.measures.queries.other_methods import (
    TrimeshError,
    TrimeshRequest,
    matched,
    solid_angle_probabilities,
    trimesh_poses,
)
from dicedesign.bench.reference.bodies_with_answers import Subject, built_in_bodies, make_subject
from dicedesign.bench.reference.precision import evaluated_probabilities
from dicedesign.bench.reference.sampled import (
    lattice_directions,
    random_directions,
    sampled_probabilities,
)
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.body import make_body
from dicedesign.rest.basins import find_basins
from dicedesign.rest.equilibria import Equilibria, classify


def classified(problem: Problem) -> Equilibria:
    hull = convex_hull(problem.points)
    return classify(hull, hull.centroid if problem.center is None else problem.center)


def turned(seed: int) -> np.ndarray:
    return Rotation.random(random_state=seed).as_matrix()


def subject_of(problem: Problem, *, oracle_facets: int = 2000) -> Subject:
    return make_subject("body", make_body(problem.points), oracle_facets=oracle_facets)


@pytest.mark.parametrize("make", [random_directions, lattice_directions])
def test_directions_are_even(make) -> None:
    directions = make(20_000, 3)
    np.testing.assert_allclose((directions**2).sum(-1), 1.0, rtol=1e-14)
    assert len(np.unique(directions, axis=0)) == 20_000
    # Means of 1, x and x x^T over the sphere, within five standard errors of random ones.
    assert np.abs(directions.mean(axis=0)).max() < 5.0 * np.sqrt(1.0 / 3.0 / 20_000)
    second = directions.T @ directions / 20_000
    assert np.abs(second - np.eye(3) / 3.0).max() < 5.0 * np.sqrt(4.0 / 45.0 / 20_000)
    np.testing.assert_array_equal(directions, make(20_000, 3))
    assert not np.array_equal(directions, make(20_000, 4))


@pytest.mark.parametrize(
    "problem",
    [box(1.0, 2.0, 3.0), platonic("tetrahedron"), prism(5)],
    ids=["box", "tetrahedron", "prism"],
)
def test_tracing_converges_to_closed_forms(problem: Problem) -> None:
    assert problem.shares is not None
    expected = np.sort(problem.shares)
    elements = classified(problem)
    for count, limit in ((1000, 1e-2), (100_000, 5e-4)):
        found = sampled_probabilities(elements, lattice_directions(count, 1))
        assert np.abs(np.sort(found) - expected).max() < limit
        found = sampled_probabilities(elements, random_directions(count, 1))
        deviation = np.sqrt(expected * (1.0 - expected) / count)
        assert (np.abs(np.sort(found) - expected) < 5.0 * deviation).all()
        assert abs(found.sum() - 1.0) < 1e-12


def test_random_directions_err_as_statistics_say() -> None:
    subject = subject_of(random_body(0, 20))
    exact = np.array([float(p) for p in subject.exact])
    elements = classify(subject.hull, subject.center)
    found = np.array(
        [sampled_probabilities(elements, random_directions(2000, s)) for s in range(20)]
    )
    rests = exact > 0.0
    assert (found[:, ~rests] == 0.0).all()
    scores = (found - exact)[:, rests] / np.sqrt(exact * (1.0 - exact) / 2000.0)[rests]
    assert 0.8 < np.sqrt((scores**2).mean()) < 1.2


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_lattice_beats_random_directions(seed: int) -> None:
    subject = subject_of(random_body(seed, 20))
    elements = classify(subject.hull, subject.center)
    errors = [
        subject.error(sampled_probabilities(elements, make(10_000, 0)))
        for make in (lattice_directions, random_directions)
    ]
    assert errors[0] < errors[1] / 2.0


def test_chunks_make_no_difference() -> None:
    elements, down = classified(random_body(1)), random_directions(1000, 5)
    whole = sampled_probabilities(elements, down)
    for at_once in (1, 99, 1000):
        np.testing.assert_array_equal(sampled_probabilities(elements, down, at_once), whole)


def test_solid_angles_of_a_box_seen_from_off_its_middle() -> None:
    center = np.array([0.2, -0.3, 0.1])
    hull = convex_hull(box(1.0, 2.0, 3.0).points)
    found = solid_angle_probabilities(classify(hull, center))
    half = np.array([0.5, 1.0, 1.5])
    for normal, share in zip(hull.normals, found, strict=True):
        axis, sign = int(np.argmax(np.abs(normal))), normal[np.argmax(np.abs(normal))]
        height = half[axis] - sign * center[axis]
        first, second = np.delete(np.arange(3), axis)
        angle = 0.0
        for a in (half[first] - center[first], half[first] + center[first]):
            for b in (half[second] - center[second], half[second] + center[second]):
                angle += np.arctan(a * b / (height * np.sqrt(a * a + b * b + height * height)))
        assert abs(share - angle / (4.0 * np.pi)) < 1e-15


def test_solid_angles_are_exact_where_all_elements_carry_equilibria() -> None:
    name, body = next(built_in_bodies())
    subject = make_subject(name, body)
    elements = classify(subject.hull, subject.center)
    assert elements.stable.all()
    assert elements.saddle.all()
    assert elements.maximum.all()
    assert subject.error(solid_angle_probabilities(elements)) < 1e-15


def test_trimesh_passes_solid_angles_on_as_we_do() -> None:
    subject = subject_of(random_body(0, 20))
    hull = subject.hull
    normals, shares = trimesh_poses(TrimeshRequest(hull.vertices, hull.triangles, subject.center))
    found, lost = matched(hull, normals, shares, 1e-6)
    assert lost == 0.0
    ours = solid_angle_probabilities(classify(hull, subject.center))
    np.testing.assert_allclose(found, ours, atol=1e-12)
    assert subject.error(ours) > 1e-3


@pytest.mark.parametrize("name", ["cube", "dodecahedron", "icosahedron"])
def test_trimesh_agrees_on_regular_solids(name: str) -> None:
    subject = subject_of(platonic(name))
    found = {a.method: a.error for a in answers(subject, most_directions=0, seconds=0.5)}
    for method in (TRIMESH, SOLID_ANGLES, FLOAT64):
        assert found[method] == pytest.approx(0.0, abs=1e-12)


def test_rests_without_a_facet_are_lost() -> None:
    hull = convex_hull(box(1.0, 1.0, 1.0).points)
    normals = np.array([[1.0, 0.0, 0.0], [1.0, 0.01, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    normals /= np.sqrt((normals**2).sum(-1))[:, None]
    found, lost = matched(hull, normals, np.array([0.3, 0.1, 0.4, 0.2]), 0.05)
    np.testing.assert_allclose(found, hull.normals @ [0.4, 0.0, 0.2] * (hull.normals.sum(-1) > 0))
    assert lost == 0.4


def test_float64_evaluation_is_this_models() -> None:
    for problem in (random_body(3), box(1.0, 2.0, 3.0), conway_guy()):
        hull = convex_hull(problem.points)
        center = hull.centroid if problem.center is None else problem.center
        sides = find_basins(hull, center)
        expected = np.zeros(len(hull.normals))
        for side in sides:
            expected[side.paths.rests] += side.areas / (4.0 * np.pi * len(sides))
        found = evaluated_probabilities(hull, sides, np.float64)
        np.testing.assert_allclose(found, expected, atol=1e-14)


@pytest.mark.parametrize("size", [1e-30, 1.0, 1e30])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_float32_evaluation_errs_like_float32(seed: int, size: float) -> None:
    subject = subject_of(placed(random_body(seed, 20), size, 0.0))
    sides = find_basins(subject.hull, subject.center)
    error = subject.error(evaluated_probabilities(subject.hull, sides, np.float32))
    assert 1e-9 < error < 1e-5


def test_the_reference_is_the_oracle_for_small_hulls_only() -> None:
    small, large = subject_of(random_body(0)), subject_of(random_body(0), oracle_facets=4)
    assert small.oracle
    assert not large.oracle
    assert small.rests == large.rests
    assert small.error(np.array(large.exact)) < 1e-14
    found = {a.method: a for a in answers(large, most_directions=100, seconds=1e-9)}
    assert found[FLOAT64].error is None
    assert found[FLOAT64].note == "taken as exact"
    assert found[FLOAT32].error is not None


def test_a_tied_body_is_measured_on_both_sides() -> None:
    square = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
    # Leans so far that its center of mass is above an edge.
    leaning = Problem(np.concatenate([square, square + np.array([1.0, 0.0, 1.0])]))
    subject = subject_of(leaning)
    assert subject.tied
    assert not subject_of(random_body(0)).tied
    found = {a.method: a for a in answers(subject, most_directions=100, seconds=1e-9)}
    error = found[FLOAT64].error
    assert error is not None
    assert error < 1e-12


def test_what_would_take_too_long_is_left_out() -> None:
    found = list(answers(subject_of(random_body(0)), most_directions=10**6, seconds=1e-9))
    left_out = [answer for answer in found if answer.note.startswith("left out, some")]
    assert [(a.method, a.samples) for a in left_out] == [
        *[(method, count) for method in (MONTE_CARLO, LATTICE) for count in DIRECTIONS],
        (SOLID_ANGLES, None),
        (TRIMESH, 1),
        *[(TRIMESH_SPREAD, count) for count in CENTERS],
    ]
    assert all(answer.seconds is None and answer.error is None for answer in left_out)
    assert {a.method for a in found if a.error is not None} == {FLOAT64, FLOAT32}


def fails_at_once(request: TrimeshRequest) -> object:
    raise IndexError("no such pose")


def fails_with_spread_centers(request: TrimeshRequest) -> object:
    return timed_trimesh(request) if request.variance == 0.0 else fails_at_once(request)


def fails_with_many(request: TrimeshRequest) -> object:
    return timed_trimesh(request) if request.samples < 100 else fails_at_once(request)


@pytest.mark.parametrize(
    ("ask", "notes"),
    [
        (fails_at_once, ["failed", *["left out, as with the exact center"] * 3]),
        (fails_with_spread_centers, ["", "failed", *["left out, as with fewer samples"] * 2]),
        (fails_with_many, ["", "", "failed", "left out, as with fewer samples"]),
    ],
)
def test_a_failure_of_trimesh_is_a_row(ask: object, notes: list[str]) -> None:
    subject = subject_of(random_body(0))
    found = list(answers(subject, most_directions=100, seconds=60.0, ask_trimesh=ask))
    rows = [(a.method, a.samples) for a in found[-4:]]
    assert rows == [(TRIMESH, 1), *[(TRIMESH_SPREAD, count) for count in CENTERS]]
    failed = "failed: IndexError: no such pose"
    assert [a.note for a in found[-4:]] == [failed if n == "failed" else n for n in notes]
    assert [a.error is None for a in found[-4:]] == [bool(note) for note in notes]


def test_trimesh_is_stopped_when_its_centers_are_never_inside() -> None:
    subject = subject_of(random_body(0))
    found = list(answers(subject, most_directions=100, seconds=1.5, spread=1e9))
    assert [a.note for a in found[-4:]] == [
        "",
        "left out, took more than 1.5 s",
        *["left out, as with fewer samples"] * 2,
    ]


def test_centers_are_spread_inside_needles_and_plates() -> None:
    points = np.random.default_rng(0).normal(size=(30, 3))
    for shape in ([1e6, 1.0, 1.0], [1.0, 1.0, 1e-5]):
        subject = make_subject("body", make_body(points * shape @ turned(3)))
        last = list(answers(subject, most_directions=100, seconds=2.0, centers=[10]))[-1]
        assert (last.method, last.note) == (TRIMESH_SPREAD, "")
        assert last.error is not None
        assert last.error < 0.1


@pytest.mark.parametrize("size", [1e-30, 1e-9, 1e-7, 1e9])
def test_the_size_of_a_body_makes_no_difference_to_trimesh(size: float) -> None:
    subject = subject_of(random_body(0, 30))
    hull = subject.hull
    expected, found = (
        trimesh_poses(
            TrimeshRequest(
                scale * hull.vertices,
                hull.triangles,
                scale * subject.center,
                variance=(0.01 * scale) ** 2,
                samples=3,
            )
        )
        for scale in (1.0, size)
    )
    np.testing.assert_allclose(found[1], expected[1], atol=1e-9)
    np.testing.assert_allclose(found[0], expected[0], atol=1e-9)


def test_what_is_no_answer_of_trimesh_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    hull = convex_hull(box(1.0, 2.0, 3.0).points)
    for transforms, shares, text in (
        (np.array([]), np.array([]), "no poses"),
        (np.eye(4)[None], np.array([np.nan]), "poses that are not numbers"),
        (np.full((1, 4, 4), np.nan), np.ones(1), "poses that are not numbers"),
    ):
        given = transforms, shares
        monkeypatch.setattr(trimesh.poses, "compute_stable_poses", lambda *a, g=given, **k: g)
        with pytest.raises(TrimeshError, match=f"^{text}$"):
            trimesh_poses(TrimeshRequest(hull.vertices, hull.triangles, hull.centroid))


def test_the_built_in_bodies_have_oracle_answers() -> None:
    subjects = [make_subject(name, body) for name, body in built_in_bodies()]
    assert [subject.rests for subject in subjects] == [11, 8, 35]
    assert all(subject.oracle for subject in subjects)
    assert len(subjects[2].hull.vertices) == 1000


def test_run_times_are_medians() -> None:
    naps = iter([0.01, 0.2, 0.02, 0.3])
    result, seconds = timed(lambda: time.sleep(next(naps)))
    assert result is None
    assert seconds == pytest.approx(0.11, abs=0.03)


def test_the_figure_holds_every_answer() -> None:
    subject = replace(subject_of(random_body(0)), name="a body")
    given = list(answers(subject, most_directions=1000, seconds=1.0))
    row = BodyAnswers.of(subject, given)
    assert (row.name, row.reference) == ("a body", "60-digit oracle")
    assert row.facets == len(subject.hull.normals)
    for method in (FLOAT64, FLOAT32, MONTE_CARLO, LATTICE, SOLID_ANGLES, TRIMESH):
        wanted = [(a.seconds, a.error) for a in given if a.method == method]
        assert row.points_of(method) == wanted
    (_, few), (_, many) = row.points_of("random directions, expected")
    assert few / many == pytest.approx(np.sqrt(10.0))
    assert "a body" in accuracy_figure([row, row], Run(None)).texts


def test_the_legend_keeps_its_order_where_a_panel_lacks_a_method() -> None:
    unknown, one_rest = subject_of(random_body(0), oracle_facets=4), subject_of(conway_guy())
    rows = [
        BodyAnswers.of(one, list(answers(one, most_directions=100, seconds=0.1)))
        for one in (unknown, one_rest)
    ]
    assert [row.reference for row in rows] == [FLOAT64, "60-digit oracle"]
    texts = accuracy_figure(rows, Run(None)).texts
    places = [texts.index(label) for label in (FLOAT64, FLOAT32, MONTE_CARLO)]
    assert places == list(range(places[0], places[0] + 3))
    expected = [len(row.points_of("random directions, expected")) for row in rows]
    assert expected == [1, 0]


def test_the_command_measures_a_mesh_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mesh, out = tmp_path / "box.stl", tmp_path / "new" / "bench"
    trimesh.creation.box((1.0, 2.0, 3.0)).export(mesh)
    assert run_bench("accuracy", mesh, "--out", out, extent=Extent(1000, 0.5)) == 0
    text = capsys.readouterr().out
    assert "box.stl: 6 facets, 6 rests; errors against 60-digit arithmetic" in text
    assert Answer(MONTE_CARLO, 1000).line()[:36] in text
    assert f"{10_000:>9}" not in text
    assert (out / "accuracy.png").read_bytes().startswith(b"\x89PNG")
    assert str(tmp_path) not in (out / "accuracy.json").read_text()
    (body,) = json.loads((out / "accuracy.json").read_text())["bodies"]
    assert [row["method"] for row in body["answers"]][:2] == [FLOAT64, FLOAT32]
