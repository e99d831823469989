"""Table of a folder, as CSV and Parquet, against the rests of each file."""

from __future__ import annotations

import csv
import os
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
import pytest
from pyarrow import parquet

from dicedesign.batch.batch import analyze_files, list_folder
from dicedesign.batch.rest_table import (
    COLUMNS,
    STAMPED,
    Entry,
    RestTable,
    Stamp,
    broken_entry,
    table_format,
)
from dicedesign.errors import InputError, OutputError
from dicedesign.geometry.meshes import reading
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.rest.poses import rest_poses
from dicedesign.runtime.checkpoint import INTERVAL

FILES = ["a.stl", "b.xyz", "b/box.obj", "b/hull.PLY", "c.off", "open, as it is.obj"]

TYPES: dict[str, Any] = {"text": str, "whole": int, "real": float}


def analyze(folder: Path) -> dict[str, Entry]:
    stamps = {file: Stamp(*state) for file, state in list_folder(folder).meshes.items()}
    return analyze_files(str(folder), stamps)


def rows_of(path: Path) -> list[dict[str, Any]]:
    """Rows of either format, with None for missing numbers."""
    if path.suffix == ".parquet":
        return parquet.read_table(path).to_pylist()
    with path.open(newline="") as file:
        return [
            {
                name: TYPES[COLUMNS[name]](text) if text or COLUMNS[name] == "text" else None
                for name, text in row.items()
            }
            for row in csv.DictReader(file)
        ]


def test_which_files_are_meshes(meshes: Path) -> None:
    listing = list_folder(meshes)
    assert list(listing.meshes) == FILES
    assert listing.others == 1
    status = (meshes / "a.stl").stat()
    assert listing.meshes["a.stl"] == (status.st_size, status.st_mtime_ns)


def test_rows_are_the_rests_of_each_file(meshes: Path, tmp_path: Path) -> None:
    entries = analyze(meshes)
    for name in ("t.csv", "t.parquet"):
        RestTable(tmp_path / name, entries)
        assert RestTable.read(tmp_path / name) == entries
    rows = rows_of(tmp_path / "t.csv")
    assert rows == rows_of(tmp_path / "t.parquet")
    assert list(rows[0]) == list(COLUMNS)
    assert list(dict.fromkeys(row["file"] for row in rows)) == FILES
    for file in FILES:
        poses = rest_poses(read_body(meshes / file))
        own = [row for row in rows if row["file"] == file]
        count = len(poses.normals)
        for name, expected in (
            ("rest", np.arange(1, count + 1)),
            ("probability", poses.probabilities),
            ("normal_x", poses.normals[:, 0]),
            ("normal_y", poses.normals[:, 1]),
            ("normal_z", poses.normals[:, 2]),
            ("area", poses.areas),
            ("margin_deg", np.degrees(poses.margins)),
        ):
            assert [row[name] for row in own] == expected.tolist(), name
        for row in own:
            center = [row[f"center_of_mass_{axis}"] for axis in "xyz"]
            assert center == poses.center_of_mass.tolist()
            assert (row["rests"], row["center_of_mass_source"], row["hull_vertices"]) == (
                count,
                poses.center_of_mass_source,
                len(poses.hull.vertices),
            )
            assert (row["notes"], row["error"]) == (" | ".join(poses.notes), "")
            assert 0.0 < row["seconds"] < 60.0
    assert any(row["notes"] for row in rows)
    types = {"text": pyarrow.string(), "whole": pyarrow.int64(), "real": pyarrow.float64()}
    expected = pyarrow.schema([(name, types[kind]) for name, kind in COLUMNS.items()])
    assert parquet.read_schema(tmp_path / "t.parquet").remove_metadata() == expected


def test_center_and_tolerance_are_used(meshes: Path) -> None:
    entries = analyze_files(str(meshes), {"a.stl": Stamp(1, 1)}, (0.1, 0.2, 0.3), 1e-3)
    (values, *_) = csv.reader(entries["a.stl"].text.splitlines())
    row = dict(zip(COLUMNS, values, strict=True))
    expected = rest_poses(read_body(meshes / "a.stl"), (0.1, 0.2, 0.3), coplanar_tolerance=1e-3)
    assert float(row["probability"]) == expected.probabilities[0]
    assert row["center_of_mass_source"] == "given"


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_broken_files_and_odd_names_have_rows(
    meshes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ending: str
) -> None:
    box = (meshes / "b" / "box.obj").read_bytes()
    for name, content in (
        ("empty.obj", b""),
        ('wrong, and\n"quoted"\r.obj', b"v 1\n"),
        ("noise.glb", bytes(range(256))),
        ("größe.obj", box),
        (os.fsdecode(b"caf\xe9.obj"), box),
        ("ours.obj", box),
    ):
        (meshes / name).write_bytes(content)
    (meshes / "far.stl").symlink_to(meshes / "gone.stl")
    monkeypatch.setattr(
        reading, "read_body", lambda path: 1 // 0 if path.name == "ours.obj" else read_body(path)
    )
    entries = analyze(meshes)
    path = tmp_path / f"t.{ending}"
    RestTable(path, entries)
    # A name with bytes that are not UTF-8 is read back as an escape.
    entries[r"caf\udce9.obj"] = entries.pop(os.fsdecode(b"caf\xe9.obj"))
    assert RestTable.read(path) == entries
    assert len(entries) == 13
    rows = rows_of(path)
    assert {r"caf\udce9.obj", "größe.obj"} < {row["file"] for row in rows}
    broken = {row["file"]: row for row in rows if row["error"]}
    for file, message in (
        ("empty.obj", "expected a mesh or point file, got an empty one"),
        ('wrong, and\n"quoted"\r.obj', "line 1: expected three coordinates"),
        ("noise.glb", "expected a .glb file, got one that cannot be read"),
        ("far.stl", "far.stl: no such file"),
        ("ours.obj", "ZeroDivisionError"),
    ):
        row = broken.pop(file)
        assert message in row["error"]
        assert str(meshes) not in row["error"]
        assert "\n" not in row["error"]
        assert row["rests"] == 0
        table = (*STAMPED, "file", "rests", "seconds", "error")
        assert {value for name, value in row.items() if name not in table} <= {"", None}
    assert broken == {}


def test_files_with_missing_rows_are_skipped(meshes: Path, tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    RestTable(path, analyze(meshes))
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(line for line in lines if not line.startswith("c.off,2,")))
    assert sorted(RestTable.read(path)) == [file for file in FILES if file != "c.off"]
    assert RestTable.read(tmp_path / "missing.csv") == {}


HEADER = ",".join(COLUMNS).encode() + b"\n"


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("t.csv", b"", "its columns are others"),
        ("t.csv", b"file,error\na.stl,\n", "its columns are others"),
        ("t.csv", HEADER + b"a.stl,1\n", f"line 2 has 2 columns of {len(COLUMNS)}"),
        ("t.csv", HEADER + b"x," * (len(COLUMNS) - 1) + b"x\n", "invalid literal"),
        ("t.parquet", b"something else\n", "it is no Parquet file that can be read"),
        ("t.parquet", None, "its columns are others"),
    ],
)
def test_other_files_are_refused(
    tmp_path: Path, name: str, content: bytes | None, message: str
) -> None:
    path = tmp_path / name
    if content is None:
        parquet.write_table(pyarrow.table({name: ["1"] for name in COLUMNS}), path)
    else:
        path.write_bytes(content)
    with pytest.raises(InputError, match=f"expected a table of an earlier run .*{message}.*--out"):
        RestTable.read(path)


def test_the_table_is_saved_at_the_start_at_intervals_and_at_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, now = tmp_path / "t.csv", [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    entries = [{f"{i}.stl": broken_entry(f"{i}.stl", Stamp(1, 1), "x")} for i in range(4)]
    with RestTable(path, {}) as table:
        assert path.read_text() == ",".join(COLUMNS) + "\n"
        table.add(entries[2])
        assert len(RestTable.read(path)) == 0
        now[0] += INTERVAL
        table.add(entries[1])
        assert len(RestTable.read(path)) == 2
        table.add(entries[0])
        assert len(RestTable.read(path)) == 2
    assert len(RestTable.read(path)) == 3

    def interrupt() -> None:
        with RestTable(path, table.entries) as again:
            again.add(entries[3])
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupt()
    assert list(RestTable.read(path)) == [f"{i}.stl" for i in range(4)]
    assert [file.name for file in tmp_path.iterdir()] == ["t.csv"]


def test_failed_writes_are_errors(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(OutputError, match="expected to write a file in an existing"):
        RestTable(tmp_path / "missing" / "t.csv", {})
    # Another run with the same table.
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
    # Parquet without pyarrow.
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(InputError, match=r"--out .*extra 'parquet'.*'dicedesign\[parquet\]'"):
        table_format(tmp_path / "t.parquet")
