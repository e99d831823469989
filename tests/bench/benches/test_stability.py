"""The suite of stiff and extreme bodies, and the bench's own verdicts."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from common.benches import run_bench

from dicedesign.bench.benches.stability import CaseRow, Extent, run_stability
from dicedesign.bench.bodies import solids, stiff
from dicedesign.bench.bodies.problem import Problem, turned
from dicedesign.bench.bodies.solids import ARCHIMEDEAN
from dicedesign.bench.bodies.stability_suite import stability_cases
from dicedesign.bench.frame import Run
from dicedesign.bench.reference.measurement import OK, measure, verdict
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.body import Body
from dicedesign.rest.basins import Basins, find_basins
from dicedesign.rest.poses import RestPoses, rest_poses

CASES = stability_cases()


def test_every_small_case_is_ok() -> None:
    """`.ci/run` has all of the short suite."""
    rows = list(run_stability(Run(Extent(turns=0, largest=8, short=True))))
    assert len(rows) > 50
    assert [row for row in rows if row.verdict != OK] == []


def test_names_are_unique() -> None:
    assert len({case.name for case in CASES}) == len(CASES)


@pytest.mark.parametrize(
    "start",
    [
        "tetrahedron", "dual of snub dodecahedron", "prism 3", "prism 64", "antiprism 64",
        "bipyramid 64", "icosphere 5", "box 1 x 2 x 3", "roof 1e-14", "bulge 1e-15", "dent 1e-15",
        "box needle 1e6", "box plate 1e-6", "glancing crossing 1e-14",
        "uniform box needle 1e6", "random plate 1e-6", "center 1e-13 from a facet",
        "center 1e-13 from an edge", "center 1e-13 from a corner", "foot 1e-13 inside an edge",
        "random body at 1e-9", "random body at 1e9", "random body 1e7 sizes away",
        "Conway-Guy 19-facet unistable", "weighted sphere", "lens", "basin beyond a hemisphere",
        "random hull 1e5", "globe 1e5", "prism 5000", "corner opposite a rest",
        "lattice body", "duplicate points", "collinear and coplanar extras",
        "unreferenced vertices", "1e6 interior points",
    ],
)  # fmt: skip
def test_the_suite_has(start: str) -> None:
    assert any(case.name.startswith(start) for case in CASES)


@pytest.mark.parametrize("name", ARCHIMEDEAN)
def test_archimedean_solids_have_equal_edges_and_corners_on_a_sphere(name: str) -> None:
    points = ARCHIMEDEAN[name]
    radii = np.sqrt((points**2).sum(-1))
    np.testing.assert_allclose(radii, radii[0], rtol=1e-14)
    problem = solids.archimedean(name)
    assert problem.shares is not None
    assert problem.shares.sum() == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize("power", [-3, -9, -13])
def test_the_glancing_crossing_is_as_glancing_as_it_says(power: int) -> None:
    problem = stiff.glancing(10.0**power)
    before = stiff.glancing(-(10.0**power))
    for one in (problem, before):
        assert verdict(measure(one)) == OK
    opened = measure(problem).probabilities
    closed = measure(before).probabilities
    # A corner becomes a maximum: the odds are continuous there.
    np.testing.assert_allclose(opened, closed, rtol=0, atol=10.0 * 10.0**power + 1e-14)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"excess": 2e-12}, "sum of probabilities off by 2.0e-12"),
        ({"excess": float("nan")}, "sum of probabilities off by nan"),
        ({"errors": {"oracle": 2e-12}}, r"error 2.0e-12 \(oracle\) above 1.0e-12"),
        ({"errors": {"oracle": float("nan")}}, r"error nan \(oracle\)"),
        ({"outside": 1e-9}, "point outside of the hull by 1.0e-09"),
        ({"rests": 5}, "5 rests instead of 4"),
    ],
)
def test_verdicts(change: dict, text: str) -> None:
    found = measure(solids.platonic("tetrahedron"))
    assert verdict(found, 4) == OK
    with pytest.raises(AssertionError, match=text):
        raise AssertionError(verdict(replace(found, **change), 4))


def test_an_error_may_be_as_large_as_the_condition_makes_it() -> None:
    """The odds of a needle that is turned change 1e5 times as fast as its corners."""
    found = measure(turned(solids.box(1.0, 1.0, 1e6), 3))
    assert 1e4 < found.condition < 1e7
    for error, expected in ((1e-10, OK), (1e-6, "error 1.0e-06 (oracle)")):
        assert verdict(replace(found, errors={"oracle": error})).startswith(expected)


def test_a_wrong_closed_form_is_noticed() -> None:
    problem = solids.platonic("cube")
    wrong = replace(problem, shares=np.array([0.2, 0.2, 0.15, 0.15, 0.15, 0.15]))
    assert verdict(measure(wrong)).startswith("error 3.3e-02 (closed form)")


def test_a_broken_symmetry_is_noticed() -> None:
    symmetries = (np.diag([-1.0, -1.0, 1.0]),)
    problem = Problem(solids.box(1, 2, 3).points, np.array([0.1, 0, 0]), symmetries=symmetries)
    assert "(symmetry)" in verdict(measure(problem))


@pytest.mark.parametrize("case", ["random body", "mesh"])
def test_a_wrong_center_of_a_uniform_body_is_noticed(case: str) -> None:
    problem = stiff.random_body(0)
    if case == "mesh":
        dented = convex_hull(problem.points)
        points = np.concatenate([dented.vertices, 0.5 * dented.centroid[None]])
        a, b, c = dented.triangles[0]
        inner = [[a, b, len(points) - 1], [b, c, len(points) - 1], [c, a, len(points) - 1]]
        triangles = np.concatenate([dented.triangles[1:], inner])
        problem = Problem(points, triangles=triangles)
    assert verdict(measure(problem)) == OK

    def wrong(body: Body, center: None, **options: Any) -> RestPoses:
        right = rest_poses(body, center, **options)
        off = rest_poses(body, right.center_of_mass + 1e-10, **options)
        return replace(off, center_of_mass_source=right.center_of_mass_source)

    assert "(oracle)" in verdict(measure(problem, query=wrong))


def test_each_side_of_a_tied_body_is_held_against_the_oracle(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    problem = stiff.off_balance(0.0, corner=False)
    found = measure(problem)
    assert found.tied
    assert verdict(found) == OK

    def one_wrong(*arguments: Any) -> tuple[Basins, ...]:
        first, *others = find_basins(*arguments)
        return replace(first, areas=np.roll(first.areas, 1)), *others

    monkeypatch.setattr("dicedesign.bench.reference.measurement.find_basins", one_wrong)
    assert "(oracle)" in verdict(measure(problem))


def test_turning_moves_the_center_too() -> None:
    problem = turned(Problem(solids.box(1, 2, 3).points, np.array([0.1, 0.2, 0.3])), 7)
    assert problem.center is not None
    distances = np.sort(((problem.points - problem.center) ** 2).sum(-1))
    expected = np.sort(((solids.box(1, 2, 3).points - [0.1, 0.2, 0.3]) ** 2).sum(-1))
    np.testing.assert_allclose(distances, expected, rtol=1e-14)


def test_a_suite_of_none_is_good(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_bench("stability", extent=Extent(turns=0, largest=-1)) == 0
    assert capsys.readouterr().out == "0 cases, 0 ok, 0 not\n"


def test_what_hangs_is_a_row() -> None:
    row = CaseRow("needle", excess=float("nan"), verdict="hang: no answer in 60 s")
    assert row.line().split()[:5] == ["needle", "0", "0", "-", "-"]
    assert row.line().endswith("  hang: no answer in 60 s")
