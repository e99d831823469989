"""The speed bench: what it measures, its arithmetic, and the command."""

from __future__ import annotations

import json
import time
from pathlib import Path

import numpy as np
import pytest

from dicedesign import rest_poses
from dicedesign.bench import speed_growth as growth
from dicedesign.bench.measures import design_steps as speed_parts
from dicedesign.bench.measures import processes as stopwatch
from dicedesign.bench.measures import programs as speed_programs
from dicedesign.bench.measures.other_methods import MOST_CORNERS, Request, TrimeshTimer
from dicedesign.bench.measures.processes import in_turn
from dicedesign.bench.measures.programs import (
    Memory,
    Throughput,
    cold_starts,
    job_counts,
    peak_memory,
    throughput,
)
from dicedesign.bench.measures.query_speed import (
    PAPER,
    Effort,
    SpeedRow,
    energy_gradient,
    speed_row,
)
from dicedesign.bench.reference.speed_cases import (
    Ratios,
    built_in_cases,
    goals,
    mesh_case,
    sphere_case,
)
from dicedesign.bench.speed import QUICK
from dicedesign.bench.speed_growth import SIZES, growth_figure, growth_rows
from dicedesign.cli.main import main
from dicedesign.design.coordinates.vertices import VertexCoordinates
from dicedesign.design.energy.objective import Objective
from dicedesign.geometry.meshes.body import make_body

ONCE = Effort(rounds=1, seconds=0.0)

KEYS = {
    "case",
    "points",
    "hull_vertices",
    "rests",
    "scipy_hull_seconds",
    "query_seconds",
    "query_ratio",
    "query_goal",
    "query_ratio_of_cpp",
    "gradient_seconds",
    "gradient_ratio",
    "gradient_goal",
    "gradient_ratio_of_cpp",
    "trimesh_seconds",
    "trimesh_ratio",
    "note",
}


def row(**changes: object) -> SpeedRow:
    values: dict[str, object] = {
        "name": "die",
        "points": 11,
        "corners": 11,
        "rests": 11,
        "hull_seconds": 2e-5,
        "query_seconds": 3e-5,
        "gradient_seconds": 8e-5,
        "trimesh_seconds": 2e-3,
        "goal": Ratios(2.0, 5.0),
        "cpp": Ratios(None, 9.0),
    }
    return SpeedRow(**{**values, **changes})


# The clock.


def test_all_calls_of_a_turn_count_but_the_first(monkeypatch: pytest.MonkeyPatch) -> None:
    order, clock = [], [0.0]
    monkeypatch.setattr(stopwatch.time, "process_time", lambda: clock[0])

    def busy(name: str, seconds: float) -> None:
        # Caches that the other one filled cost the first call a tenth of a second.
        clock[0] += seconds if order and order[-1] == name else 0.1
        order.append(name)

    actions = [lambda: busy("a", 1e-3), lambda: busy("b", 4e-3)]
    short, long = in_turn(actions, 0.0, rounds=3, row=2.5e-3)
    assert (short, long) == (pytest.approx(1e-3), pytest.approx(4e-3))
    # A first round of one call each; then three of an uncounted one and what fills the row.
    assert (order.count("a"), order.count("b")) == (1 + 3 * 4, 1 + 3 * 2)
    order.clear()
    assert in_turn(actions, 0.0, rounds=20)[0] >= 1e-3
    assert len(order) == 2 * (1 + 20)


# The cases.


def test_the_built_in_cases_are_what_their_names_say() -> None:
    cases = {case.name: case for case in built_in_cases()}
    quick = [case.name for case in built_in_cases(quick=True)]
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


def test_ratios_are_multiples_of_the_hull_s_time() -> None:
    full = row()
    assert full.ratios == Ratios(pytest.approx(1.5), pytest.approx(4.0))
    assert full.trimesh_ratio == pytest.approx(100.0)
    plain = full.plain()
    assert set(plain) == KEYS
    assert (plain["query_goal"], plain["gradient_ratio_of_cpp"]) == (2.0, 9.0)
    bare = row(gradient_seconds=None, trimesh_seconds=None, note="left out").plain()
    assert bare["gradient_ratio"] is bare["trimesh_ratio"] is None
    assert bare["query_ratio"] == pytest.approx(1.5)


def test_a_row_counts_and_measures() -> None:
    asked: list[Request] = []

    def time_trimesh(request: Request) -> tuple[float | None, str]:
        asked.append(request)
        return None, "trimesh failed: no poses"

    case = sphere_case(12, Ratios(3.0))
    found, poses = speed_row(case, ONCE, time_trimesh), rest_poses(case.points)
    assert (found.points, found.corners, found.rests) == (12, 12, len(poses.normals))
    assert found.cpp == Ratios(3.0)
    assert min(found.hull_seconds, found.query_seconds, found.gradient_seconds or 0.0) > 0.0
    assert (found.trimesh_seconds, found.note) == (None, "trimesh failed: no poses")
    np.testing.assert_array_equal(asked[0].center, poses.center_of_mass)


def test_large_cases_have_no_gradient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dicedesign.bench.measures.query_speed.MANY", 10)
    found = speed_row(sphere_case(12), ONCE, None)
    assert found.gradient_seconds is None
    assert found.goal.gradient is None
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


def fail(request: Request) -> float:
    raise ValueError("no poses")


def sleep(request: Request) -> float:
    time.sleep(60.0)
    return 60.0


def request_of(points: int) -> Request:
    poses = rest_poses(sphere_case(points).points)
    return Request(poses.hull.vertices, poses.hull.triangles, poses.center_of_mass)


def test_trimesh_is_measured_in_a_process_of_its_own() -> None:
    with TrimeshTimer() as timer:
        seconds, why = timer(request_of(8))
        assert why == ""
        assert seconds is not None
        assert 1e-5 < seconds < 10.0
        many = np.arange(3 * (MOST_CORNERS + 1)).reshape(-1, 3)
        large = Request(np.zeros((many.size, 3)), many, np.zeros(3))
        assert timer(large) == (None, "no trimesh for more than 2,000 corners")


def test_trimesh_may_fail_or_hang() -> None:
    with TrimeshTimer(fail) as timer:
        assert timer(request_of(8)) == (None, "trimesh failed: ValueError: no poses")
    with TrimeshTimer(sleep, limit=0.1) as timer:
        assert timer(request_of(8)) == (None, "trimesh stopped after 0.1 s")


# Parts and programs.


def test_parts_of_a_design_are_what_their_names_say(monkeypatch: pytest.MonkeyPatch) -> None:
    memories = []
    original = speed_parts.in_turn

    def spy(actions, *arguments, **options):
        times = original(actions, *arguments, **options)
        memories.append([action() for action in actions[1:]])
        return times

    monkeypatch.setattr(speed_parts, "in_turn", spy)
    parts = list(speed_parts.speed_parts(ONCE))
    assert len({(part.body, part.part) for part in parts}) == len(parts) == 6
    assert all(part.seconds > 0.0 and part.hull_seconds > 0.0 for part in parts)
    assert parts[0].plain()["ratio"] == pytest.approx(parts[0].seconds / parts[0].hull_seconds)
    (_, _, odds, jacobian), _ = memories
    assert odds.shape == (11,)
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
    one, two = Throughput(1, 1032, 6.0, 32, 1.0), Throughput(2, 1064, 3.8, 64, 1.3)
    assert one.plain(one)["efficiency"] == one.plain(one)["running_efficiency"] == 1.0
    plain = two.plain(one)
    assert plain["running_files_per_second"] == pytest.approx(400.0)
    assert plain["running_efficiency"] == pytest.approx(1.0)
    assert plain["efficiency"] == pytest.approx((1064 / 3.8) / (2 * 1032 / 6.0))


def test_a_folder_is_measured_by_several_jobs(monkeypatch: pytest.MonkeyPatch) -> None:
    told, folders = [], []

    def seconds_of(arguments: tuple[str, ...], folder: Path) -> float:
        files = len(list(folder.iterdir()))
        folders.append((files, int(arguments[-1])))
        return 1.0 + 0.01 * files / folders[-1][1]

    monkeypatch.setattr(speed_programs, "_wall_seconds", seconds_of)
    one, two = throughput([1, 2], files=20, rounds=2, on_jobs=told.append)
    assert told == [1, 2]
    assert folders == [(32, 1), (52, 1)] * 2 + [(64, 2), (84, 2)] * 2
    assert (one.running_rate, two.running_rate) == (pytest.approx(100.0), pytest.approx(200.0))
    assert one.rate == pytest.approx(52 / 1.52)


def test_programs_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(speed_programs, "FEW_FILES", 1)
    (alone,) = throughput([1], files=3, rounds=1)
    assert (alone.few_files, alone.files) == (1, 4)
    assert min(alone.seconds, alone.few_seconds) > 0.0
    starts = cold_starts(1)
    assert list(starts) == ["python", "python, import of scipy.spatial", "dicedesign rest FILE"]
    assert 0.0 < starts["python"] < starts["dicedesign rest FILE"]
    monkeypatch.setattr(speed_programs, "_COLD", {"none": ("-m", "dicedesign", "rest", "no.stl")})
    with pytest.raises(RuntimeError, match=r"rest no.stl failed:\n.*no such file"):
        cold_starts(1)


def test_memory_is_that_of_new_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(speed_programs, "_POINTS", speed_programs._POINTS.replace("100000", "2000"))
    memory = peak_memory()
    if memory is None:
        pytest.skip("this system does not tell the peak of memory")
    assert 20.0 < memory.before <= memory.query < 1000.0
    peaks = iter([[(0.1, 90.0), (1.0, 150.0), (3.0, 250.0)], [(0.1, None)] * 3])
    monkeypatch.setattr(speed_programs, "in_new_process", lambda *arguments: next(peaks))
    assert peak_memory() == Memory(100_000, 90.0, 150.0, 250.0)
    assert peak_memory() is None


# Growth.


def test_growth_is_a_row_for_each_size(monkeypatch: pytest.MonkeyPatch) -> None:
    efforts = []

    def fake(case, effort, time_trimesh):
        efforts.append(effort.rounds)
        n = len(case.points)
        trimesh = 1e-3 * n if n <= 1000 else None
        return row(points=n, hull_seconds=1e-6 * n, trimesh_seconds=trimesh)

    monkeypatch.setattr(growth, "speed_row", fake)
    told: list[int] = []
    rows = list(growth_rows((10, 1000, 3000, 100_000), None, told.append))
    assert told == [10, 1000, 3000, 100_000]
    assert efforts == [20, 20, 5, 3]
    assert (SIZES[0], SIZES[-1]) == (10, 10**6)
    described = {"machine": "Linux x86_64, 2 cores", "dicedesign": "0.1.0", "date": "2026-11-21"}
    figure = growth_figure(rows, described)
    assert {"scipy.spatial.ConvexHull", "trimesh, stable poses, hull included"} <= set(figure.texts)
    note = figure.texts[-1]
    assert all(part in note for part in described.values())
    bare = [row(points=10, trimesh_seconds=None)]
    assert not any("trimesh" in text for text in growth_figure(bare, described).texts)


# The command.


def test_a_quick_run_prints_its_tables_and_draws(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(growth, "SIZES", (10, 30, 10**6))
    mesh, drawn = tmp_path / "points.xyz", tmp_path / "speed.png"
    np.savetxt(mesh, sphere_case(9).points)
    assert main(["bench", "speed", str(mesh), "--quick", "--figure", str(drawn)]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    lines = out.splitlines()
    names = [case.name for case in built_in_cases(quick=True)]
    for line, name in zip(lines[1:], [*names, "points.xyz"], strict=False):
        assert line.startswith(name)
        assert len(line.removeprefix(name).split()) == 14
    assert any(line.startswith("trial and Jacobian of all odds") for line in lines)
    assert any(line.startswith("dicedesign rest FILE") for line in lines)
    assert lines[-1] == f"wrote {drawn}"
    assert drawn.read_bytes().startswith(b"\x89PNG")


def test_json_holds_all_of_a_full_run(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    few = [sphere_case(8)]
    monkeypatch.setattr(
        "dicedesign.bench.reference.speed_cases.built_in_cases", lambda quick: iter(few)
    )
    monkeypatch.setattr("dicedesign.bench.speed.FULL", QUICK)
    alone = Throughput(1, 1032, 6.0, 32, 1.0)
    monkeypatch.setattr(speed_programs, "throughput", lambda on_jobs: iter([alone]))
    monkeypatch.setattr(speed_programs, "peak_memory", lambda: Memory(10**5, 90.0, 150.0, 250.0))
    monkeypatch.setattr(speed_programs, "cold_starts", lambda rounds: {"python": 0.1 * rounds})
    assert main(["bench", "speed", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert {"date", "machine", "python", "dicedesign", "scipy", "torch", "trimesh"} <= set(record)
    (first,) = record["rows"]
    assert set(first) == KEYS
    assert first["query_ratio"] == pytest.approx(
        first["query_seconds"] / first["scipy_hull_seconds"]
    )
    assert len(record["parts"]) == 6
    assert record["cold_start_seconds"] == {"python": 0.5}
    assert record["memory"]["query_mb"] == 250.0
    assert record["throughput"][0]["running_files_per_second"] == 200.0
    assert "growth" not in record
    assert main(["bench", "speed"]) == 0
    out = capsys.readouterr().out
    assert "250 MB with the query" in out
    assert "1032 meshes, 1 jobs" in out


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


def test_a_figure_needs_a_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for path in (tmp_path / "none" / "speed.png", tmp_path):
        assert main(["bench", "speed", "--figure", str(path)]) == 2
        assert "--figure: expected a file in a folder that exists" in capsys.readouterr().err
