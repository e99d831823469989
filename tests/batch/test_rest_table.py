"""The table of a folder against the answers to its files one by one."""

from __future__ import annotations

import csv
import os
import time
from pathlib import Path

import numpy as np
import pytest

from dicedesign.batch.analyse import analyse_files
from dicedesign.batch.folder import list_folder
from dicedesign.batch.rest_table import RestTable
from dicedesign.batch.rows import COLUMNS, STAMPED, Entry, Stamp, broken_entry
from dicedesign.errors import InputError, OutputError
from dicedesign.geometry.meshes import reading as mesh_file
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.rest.poses import rest_poses
from dicedesign.runtime.checkpoint import INTERVAL

FILES = ["a.stl", "b.xyz", "b/box.obj", "b/hull.PLY", "c.off", "open, as it is.obj"]


def analysed(folder: Path) -> dict[str, Entry]:
    stamps = {file: Stamp(*state) for file, state in list_folder(folder).meshes.items()}
    return analyse_files(str(folder), stamps)


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_which_files_are_meshes(meshes: Path) -> None:
    found = list_folder(meshes)
    assert list(found.meshes) == FILES
    assert found.others == 1
    for file, (size, modified) in found.meshes.items():
        status = (meshes / file).stat()
        assert (size, modified) == (status.st_size, status.st_mtime_ns)


def test_rows_are_the_rests_of_each_file(meshes: Path, tmp_path: Path) -> None:
    RestTable(tmp_path / "t.csv", analysed(meshes))
    rows = rows_of(tmp_path / "t.csv")
    assert list(rows[0]) == list(COLUMNS)
    assert list(dict.fromkeys(row["file"] for row in rows)) == FILES
    for file in FILES:
        poses = rest_poses(read_body(meshes / file))
        own = [row for row in rows if row["file"] == file]
        assert [row["rest"] for row in own] == [str(i + 1) for i in range(len(poses.normals))]
        for name, expected in (
            ("probability", poses.probabilities),
            ("normal_x", poses.normals[:, 0]),
            ("normal_y", poses.normals[:, 1]),
            ("normal_z", poses.normals[:, 2]),
            ("area", poses.areas),
            ("margin_deg", np.degrees(poses.margins)),
        ):
            assert [float(row[name]) for row in own] == expected.tolist(), name
        center = [float(own[0][f"center_of_mass_{axis}"]) for axis in "xyz"]
        assert center == poses.center_of_mass.tolist()
        for row in own:
            assert row["rests"] == str(len(own))
            assert row["center_of_mass_source"] == poses.center_of_mass_source
            assert row["hull_vertices"] == str(len(poses.hull.vertices))
            assert row["notes"] == " | ".join(poses.notes)
            assert row["error"] == ""
            assert 0.0 < float(row["seconds"]) < 60.0
    assert any(row["notes"] for row in rows)


def test_a_center_and_a_tolerance_are_taken(meshes: Path) -> None:
    entries = analyse_files(str(meshes), {"a.stl": Stamp(1, 1)}, (0.1, 0.2, 0.3), 1e-3)
    (row, *_) = csv.reader(entries["a.stl"].text.splitlines())
    expected = rest_poses(read_body(meshes / "a.stl"), (0.1, 0.2, 0.3), coplanar_tolerance=1e-3)
    assert float(row[list(COLUMNS).index("probability")]) == expected.probabilities[0]
    assert row[list(COLUMNS).index("center_of_mass_source")] == "given"


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("empty.obj", b"", "expected a mesh or point file, got an empty one"),
        ("words.obj", b"v one two\n\nthree", "line 1: expected three coordinates"),
        ("cut.stl", b"\0" * 90, "expected"),
        ("flat.xyz", b"0 0 0\n1 0 0\n0 1 0\n1 1 0\n", "got 4 points on one plane"),
        ("nan.xyz", b"0 0 nan\n1 0 0\n0 1 0\n1 1 1\n", "expected finite coordinates"),
        ("noise.ply", b"ply\n\xff\xfe\n", "expected a .ply file, got one that cannot be read"),
        ("noise.glb", bytes(range(256)), "expected a .glb file, got one that cannot be read"),
    ],
)
def test_a_broken_file_has_one_row(tmp_path: Path, name: str, content: bytes, said: str) -> None:
    (tmp_path / name).write_bytes(content)
    entries = analysed(tmp_path)
    assert entries[name].rests == 0
    RestTable(tmp_path / "t.csv", entries)
    (row,) = rows_of(tmp_path / "t.csv")
    assert row["file"] == name
    assert said in row["error"]
    assert str(tmp_path) not in row["error"]
    assert "\n" not in row["error"]
    assert row["rests"] == "0"
    kept = (*STAMPED, "file", "rests", "seconds", "error")
    assert {value for column, value in row.items() if column not in kept} == {""}


def test_a_fault_of_ours_and_a_link_to_nowhere_cost_one_row(
    meshes: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def faulty(path: Path) -> object:
        return 1 // 0 if path.name == "box.obj" else read_body(path)

    monkeypatch.setattr(mesh_file, "read_body", faulty)
    (meshes / "far.stl").symlink_to(meshes / "gone.stl")
    broken = {file: entry.text for file, entry in analysed(meshes).items() if entry.rests == 0}
    assert sorted(broken) == ["b/box.obj", "far.stl"]
    assert "ZeroDivisionError" in broken["b/box.obj"]
    assert "far.stl: no such file" in broken["far.stl"]


def test_a_table_reads_back_as_it_was(meshes: Path, tmp_path: Path) -> None:
    (meshes / 'wrong, and\n"quoted".obj').write_text("v 1\n")
    (meshes / os.fsdecode(b"caf\xe9.stl")).write_bytes(b"")
    (meshes / "carriage\rreturn.obj").write_bytes((meshes / "b" / "box.obj").read_bytes())
    entries = analysed(meshes)
    assert len(entries) == 9
    RestTable(tmp_path / "t.csv", entries)
    assert RestTable.read(tmp_path / "t.csv") == entries
    assert RestTable.read(tmp_path / "missing.csv") == {}


def test_a_file_with_rows_missing_is_not_in_the_table(meshes: Path, tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    RestTable(path, analysed(meshes))
    lines = path.read_text().splitlines(keepends=True)
    gone = next(i for i, line in enumerate(lines) if line.startswith("c.off,2,"))
    path.write_text("".join(lines[:gone] + lines[gone + 1 :]))
    assert sorted(RestTable.read(path)) == [file for file in FILES if file != "c.off"]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "its columns are others"),
        ("file,error\na.stl,\n", "its columns are others"),
        (",".join(COLUMNS) + "\na.stl,1\n", f"line 2 has 2 columns of {len(COLUMNS)}"),
        (",".join(COLUMNS) + "\n" + "x," * (len(COLUMNS) - 1) + "x\n", "invalid literal"),
    ],
)
def test_other_files_are_no_table(tmp_path: Path, content: str, said: str) -> None:
    path = tmp_path / "t.csv"
    path.write_text(content)
    with pytest.raises(InputError, match=f"expected a table of an earlier run .*{said}.*--out"):
        RestTable.read(path)
    (tmp_path / "d.csv").mkdir()
    with pytest.raises(InputError, match="got a directory"):
        RestTable.read(tmp_path / "d.csv")


def test_the_table_is_written_at_once_at_intervals_and_at_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, now = tmp_path / "t.csv", [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    entries = [{f"{i}.stl": broken_entry(f"{i}.stl", Stamp(1, 1), "x")} for i in range(4)]

    def saved() -> int:
        return len(RestTable.read(path))

    with RestTable(path, {}) as kept:
        assert path.read_text() == ",".join(COLUMNS) + "\n"
        kept.add(entries[2])
        assert saved() == 0
        now[0] += INTERVAL
        kept.add(entries[1])
        assert saved() == 2
        kept.add(entries[0])
        assert saved() == 2
    assert saved() == 3

    def interrupted() -> None:
        with RestTable(path, kept.entries) as again:
            again.add(entries[3])
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert list(RestTable.read(path)) == [f"{i}.stl" for i in range(4)]
    assert [file.name for file in tmp_path.iterdir()] == ["t.csv"]


def test_a_table_that_cannot_be_written_is_noticed_at_once(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="expected to write a file in an existing"):
        RestTable(tmp_path / "missing" / "t.csv", {})


def test_another_run_on_the_same_table_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    entries = [{f"{i}.stl": broken_entry(f"{i}.stl", Stamp(1, 1), "x")} for i in range(2)]
    one = RestTable(path, {})
    one.add(entries[0])
    with RestTable(path, RestTable.read(path)) as other:
        with pytest.raises(OutputError, match=r"t.csv: expected a table that only this run writes"):
            one.save()
        other.add(entries[1])
    assert RestTable.read(path) == entries[1]
    path.unlink()
    one.save()
    assert RestTable.read(path) == entries[0]
