"""The speed bench: what it measures, its arithmetic, and the command."""

from __future__ import annotations

import json
import time
from pathlib import Path

import numpy as np
import pytest
from common.benches import run_bench

from dicedesign import rest_poses
from dicedesign.bench.benches.speed import Extent
from dicedesign.bench.measures.designs.design_steps import part_works, speed_parts
from dicedesign.bench.measures.programs import (
    FEW_FILES,
    FolderRow,
    cold_starts,
    job_counts,
    peak_memory,
    throughput,
    wall_seconds,
)
from dicedesign.bench.measures.queries.other_methods import (
    MOST_CORNERS,
    TrimeshRequest,
    TrimeshTimer,
)
from dicedesign.bench.measures.queries.query_speed import PAPER, Effort, energy_gradient, speed_row
from dicedesign.bench.reference.speed_cases import (
    Ratios,
    built_in_cases,
    goals,
    mesh_case,
    sphere_case,
)
from dicedesign.cli.main import main
from dicedesign.geometry.meshes.body import make_body
from dicedesign.optimize.coordinates.vertices import VertexCoordinates
from dicedesign.optimize.energy.objective import Objective

ONCE = Effort(rounds=1, seconds=0.0)

# The cases.


def test_the_built_in_cases_are_what_their_names_say() -> None:
    cases = {case.name: case for case in built_in_cases()}
    quick = [case.name for case in built_in_cases(100)]
    assert list(cases)[: len(quick)] == quick
    assert len(cases) == len(quick) + 4
    for name, case in cases.items():
        count = int(name.split()[0].replace(",", "")) if " on " in name else len(case.points)
        assert case.points.shape == (count, 3)
        if name.endswith("sphere"):
            np.testing.assert_allclose((case.points**2).sum(-1), 1.0, rtol=1e-14)
    die = rest_poses(cases["2d6 die of 11 facets"].points)
    assert len(die.normals) == len(die.hull.normals) == 11
    assert len(rest_poses(cases["tetrahedron"].points).hull.vertices) == 4
    dented = rest_poses(cases["5,000 on a dented surface"].points)
    assert 100 < len(dented.hull.vertices) < 1000
    assert len(rest_poses(cases["1,000 on an ellipsoid"].points).hull.vertices) == 1000


@pytest.mark.parametrize(
    ("points", "corners", "query", "gradient"),
    [(4, 4, 2.0, 5.0), (20, 20, 2.0, 5.0), (100, 100, 1.5, 4.0), (1000, 1000, 1.2, 5.0),
     (829, 122, 0.9, 1.2), (5000, 8, 0.9, 1.2)],
)  # fmt: skip
def test_goals_depend_on_what_is_inside(
    points: int, corners: int, query: float, gradient: float
) -> None:
    assert goals(points, corners) == Ratios(query, gradient)


def test_others_times_are_known_by_the_names_of_files() -> None:
    body = make_body(np.random.default_rng(0).normal(size=(9, 3)))
    assert mesh_case("spot.obj", "spot", body).cpp == Ratios(1.9, 2.3)
    other = mesh_case("other.obj", "other", body)
    assert (other.name, other.cpp, len(other.points)) == ("other.obj", Ratios(), 9)


# A row.


def test_a_row_counts_and_measures() -> None:
    asked: list[TrimeshRequest] = []

    def time_trimesh(request: TrimeshRequest) -> tuple[float | None, str]:
        asked.append(request)
        return None, "trimesh failed: no poses"

    case = sphere_case(12, Ratios(3.0))
    found, poses = speed_row(case, ONCE, time_trimesh), rest_poses(case.points)
    assert (found.points, found.hull_vertices, found.rests) == (12, 12, len(poses.normals))
    assert (found.query_ratio_of_cpp, found.gradient_ratio_of_cpp) == (3.0, None)
    assert (found.query_goal, found.gradient_goal) == (2.0, 5.0)
    assert found.gradient_seconds is not None
    assert min(found.scipy_hull_seconds, found.query_seconds, found.gradient_seconds) > 0.0
    assert found.query_ratio == found.query_seconds / found.scipy_hull_seconds
    assert found.gradient_ratio == found.gradient_seconds / found.scipy_hull_seconds
    assert (found.trimesh_seconds, found.trimesh_ratio) == (None, None)
    assert found.note == "trimesh failed: no poses"
    np.testing.assert_array_equal(asked[0].center, poses.center_of_mass)


def test_large_cases_have_no_gradient() -> None:
    found = speed_row(sphere_case(12), ONCE, None, most_points=10)
    assert found.gradient_seconds is found.gradient_ratio is found.gradient_goal is None
    assert found.note == "no gradient for more than 10 points"


def test_the_gradient_is_that_of_the_paper_s_energy() -> None:
    rng = np.random.default_rng(0)
    points, target = sphere_case(12).points, np.array([0.5, 0.3, 0.2])
    gradient = energy_gradient(points, np.eye(3), target)
    objective = Objective(VertexCoordinates(np.zeros(3), 1.0), target, PAPER, None)
    step = 1e-6 * rng.normal(size=points.shape)
    ahead, behind = (
        objective.evaluate((points + s * step).ravel(), np.eye(3)) for s in (1.0, -1.0)
    )
    assert set(ahead.values) == {"dice", "coplanar", "barycenter", "neighbor"}
    assert (gradient * step).sum() == pytest.approx((ahead.value - behind.value) / 2.0, rel=1e-6)


# trimesh.


def fail(request: TrimeshRequest) -> float:
    raise ValueError("no poses")


def sleep(request: TrimeshRequest) -> float:
    time.sleep(60.0)
    return 60.0


def request_of(points: int) -> TrimeshRequest:
    poses = rest_poses(sphere_case(points).points)
    return TrimeshRequest(poses.hull.vertices, poses.hull.triangles, poses.center_of_mass)


def test_trimesh_is_measured_in_a_process_of_its_own() -> None:
    with TrimeshTimer() as timer:
        seconds, why = timer(request_of(8))
        assert why == ""
        assert seconds is not None
        assert 1e-5 < seconds < 10.0
        many = np.arange(3 * (MOST_CORNERS + 1)).reshape(-1, 3)
        large = TrimeshRequest(np.zeros((many.size, 3)), many, np.zeros(3))
        assert timer(large) == (None, "no trimesh for more than 2,000 corners")


def test_trimesh_may_fail_or_hang() -> None:
    with TrimeshTimer(fail) as timer:
        assert timer(request_of(8)) == (None, "trimesh failed: ValueError: no poses")
    with TrimeshTimer(sleep, limit=0.1) as timer:
        assert timer(request_of(8)) == (None, "trimesh stopped after 0.1 s")


# Parts and programs.


def test_parts_of_a_design_are_what_their_names_say() -> None:
    parts = list(speed_parts(ONCE))
    assert len({(part.body, part.part) for part in parts}) == len(parts) == 6
    assert all(part.seconds > 0.0 and part.scipy_hull_seconds > 0.0 for part in parts)
    assert parts[0].ratio == pytest.approx(parts[0].seconds / parts[0].scipy_hull_seconds)
    (_, _, die), (_, points, dense) = part_works()
    assert points.shape == (500, 3)
    # To and fro between two shapes.
    for works in (die, dense):
        known, fresh = works["trial step, edges known"], works["trial step, new hull"]
        assert [known(), known()] == pytest.approx([fresh(), fresh()], rel=1e-12)
    odds = die["trial of the exact method"]()
    jacobian = die["trial and Jacobian of all odds"]()
    assert odds.sum() == pytest.approx(1.0)
    assert jacobian.shape == (11, 44)
    # The odds sum up to 1 wherever the half-spaces are.
    np.testing.assert_allclose(jacobian.sum(axis=0), 0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("cores", "jobs"),
    [(1, [1]), (2, [1, 2]), (4, [1, 2, 4]), (6, [1, 2, 4, 6]), (8, [1, 2, 4, 8])],
)
def test_jobs_double_up_to_the_number_of_cores(cores: int, jobs: list[int]) -> None:
    assert job_counts(cores) == jobs


def test_efficiency_is_throughput_per_job_beside_that_of_one() -> None:
    one = FolderRow.of(1, 1032, 6.0, 32, 1.0, None)
    two = FolderRow.of(2, 1064, 3.8, 64, 1.3, one)
    assert one.efficiency == one.running_efficiency == 1.0
    assert two.running_files_per_second == pytest.approx(400.0)
    assert two.running_efficiency == pytest.approx(1.0)
    assert two.efficiency == pytest.approx((1064 / 3.8) / (2 * 1032 / 6.0))
    assert two.line().split() == ["1064", "meshes,", "2", "jobs", "3.80", "280", "81", "400", "100"]


def test_a_folder_is_measured_by_several_jobs() -> None:
    folders = []

    def seconds_of(folder: Path, jobs: int) -> float:
        files = len(list(folder.iterdir()))
        folders.append((files, jobs))
        return 1.0 + 0.01 * files / jobs

    one, two = throughput(20, [1, 2], rounds=2, rest_seconds=seconds_of)
    few = FEW_FILES
    assert folders == [(few, 1), (few + 20, 1)] * 2 + [(2 * few, 2), (2 * few + 20, 2)] * 2
    rates = one.running_files_per_second, two.running_files_per_second
    assert rates == (pytest.approx(100.0), pytest.approx(200.0))
    assert one.files_per_second == pytest.approx((few + 20) / (1.0 + 0.01 * (few + 20)))


def test_programs_run(tmp_path: Path) -> None:
    (alone,) = throughput(3, [1], rounds=1, few_files=1)
    assert (alone.few_files, alone.files) == (1, 4)
    assert min(alone.seconds, alone.few_seconds) > 0.0
    starts = cold_starts(1)
    assert list(starts) == ["python", "python, import of scipy.spatial", "dicedesign rest FILE"]
    assert 0.0 < starts["python"] < starts["dicedesign rest FILE"]
    with pytest.raises(RuntimeError, match=r"rest no.stl failed:\n.*no such file"):
        wall_seconds(("-m", "dicedesign", "rest", "no.stl"), tmp_path)


def test_memory_is_that_of_new_processes() -> None:
    memory = peak_memory(2000)
    if memory is None:
        pytest.skip("this system does not tell the peak of memory")
    assert memory.points == 2000
    assert 20.0 < memory.points_and_libraries_mb <= memory.query_mb < 1000.0


# The command.

TINY = Extent(1, 0.0, 10, 30, 1, 2000, 0)


def test_the_command_prints_its_tables_and_draws(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mesh, drawn = tmp_path / "points.xyz", tmp_path / "speed.png"
    np.savetxt(mesh, sphere_case(9).points)
    assert run_bench("speed", mesh, "--figure", drawn, extent=TINY) == 0
    out, err = capsys.readouterr()
    assert err == ""
    lines = out.splitlines()
    names = [case.name for case in built_in_cases(10)]
    for line, name in zip(lines[1:], [*names, "points.xyz"], strict=False):
        assert line.startswith(name)
        assert len(line.removeprefix(name).split()) == 14
    assert any(line.startswith("trial and Jacobian of all odds") for line in lines)
    assert any(line.startswith("dicedesign rest FILE") for line in lines)
    assert "peak memory with 2,000 points" in out
    assert lines[-1] == f"wrote {drawn}"
    assert drawn.read_bytes().startswith(b"\x89PNG")


def test_json_holds_all(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_bench("speed", "--json", "--out", tmp_path, extent=TINY) == 0
    record = json.loads(capsys.readouterr().out)
    assert [row["points"] for row in record["rows"]] == [4, 4, 8]
    assert len(record["parts"]) == 6
    assert record["memory"]["points"] == 2000
    assert [row["points"] for row in record["growth"]] == [10, 30]
    assert (tmp_path / "speed.png").exists()


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("missing.obj", None, "no such file"),
        ("notes.txt", "no mesh", "expected a file ending out of"),
        ("bad.obj", "hello\n", "found neither"),
        ("flat.xyz", "0 0 0\n1 0 0\n0 1 0\n1 1 0\n", "4 points on one plane"),
    ],
)
def test_what_is_no_mesh_is_said_at_once(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    name: str,
    content: str | None,
    message: str,
) -> None:
    if content is not None:
        (tmp_path / name).write_text(content)
    assert main(["bench", "speed", str(tmp_path / name)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("dicedesign: ")
    assert message in err
