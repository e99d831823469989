"""Tables in Parquet against those in CSV, read by pyarrow and by Python's csv."""

from __future__ import annotations

import csv
import os
import signal
import sys
from pathlib import Path
from typing import Any

import pyarrow
import pytest
from common.long_run import FILES, begun, shorten
from pyarrow import parquet

from dicedesign.batch.analyse import analyse_files
from dicedesign.batch.folder import list_folder
from dicedesign.batch.rest_table import RestTable
from dicedesign.batch.rows import COLUMNS, Entry, Stamp
from dicedesign.cli.main import main
from dicedesign.errors import InputError

NUMBERS = {"whole": int, "real": float}
"""What Python has for the columns that are no text."""


def analysed(folder: Path) -> dict[str, Entry]:
    stamps = {file: Stamp(*state) for file, state in list_folder(folder).meshes.items()}
    return analyse_files(str(folder), stamps)


def rows_of(path: Path) -> list[dict[str, Any]]:
    """Rows of either format, with None for numbers that are left out."""
    if path.suffix == ".parquet":
        return parquet.read_table(path).to_pylist()
    with path.open(newline="") as file:
        rows: list[dict[str, Any]] = list(csv.DictReader(file))
    for row in rows:
        for name, kind in COLUMNS.items():
            if kind in NUMBERS:
                row[name] = NUMBERS[kind](row[name]) if row[name] else None
    return rows


def without_seconds(path: Path) -> list[dict[str, Any]]:
    return [{**row, "seconds": None} for row in rows_of(path)]


@pytest.fixture
def odd(meshes: Path) -> Path:
    """The folder, with a broken file of an odd name."""
    (meshes / 'wrong, and\n"quoted"\r.obj').write_text("v 1\n")
    (meshes / "größe.obj").write_bytes((meshes / "b" / "box.obj").read_bytes())
    return meshes


def test_both_formats_hold_the_same_table(odd: Path, tmp_path: Path) -> None:
    entries = analysed(odd)
    for name in ("t.csv", "t.parquet"):
        RestTable(tmp_path / name, entries)
        assert RestTable.read(tmp_path / name) == entries
    rows = rows_of(tmp_path / "t.parquet")
    assert rows == rows_of(tmp_path / "t.csv")
    assert list(rows[0]) == list(COLUMNS)
    assert len({row["file"] for row in rows}) == 8
    (broken,) = (row for row in rows if row["error"])
    assert broken["rests"] == 0
    assert broken["probability"] is None
    assert broken["notes"] == ""


def test_columns_have_types(odd: Path, tmp_path: Path) -> None:
    path = tmp_path / "t.parquet"
    types = {"text": pyarrow.string(), "whole": pyarrow.int64(), "real": pyarrow.float64()}
    expected = pyarrow.schema([(name, types[kind]) for name, kind in COLUMNS.items()])
    for entries in ({}, analysed(odd)):
        RestTable(path, entries)
        assert parquet.read_schema(path).remove_metadata() == expected
        assert RestTable.read(path) == entries


def test_jobs_and_formats_do_not_matter(odd: Path, tmp_path: Path) -> None:
    outs = [tmp_path / "0.csv", tmp_path / "1.parquet", tmp_path / "2.PARQUET"]
    for jobs, out in zip("112", outs, strict=True):
        assert main(["rest", str(odd), "--jobs", jobs, "--out", str(out)]) == 0
    outs[2] = outs[2].rename(tmp_path / "3.parquet")
    first, *others = (without_seconds(out) for out in outs)
    assert all(other == first for other in others)


def test_a_run_that_was_killed_goes_on(
    meshes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "t.parquet"
    process, rest = begun(meshes, out)
    process.send_signal(signal.SIGKILL)
    process.communicate()

    kept = rows_of(out)
    files = {row["file"] for row in kept}
    assert 0 < len(files) < FILES
    shorten(meshes)
    later = (meshes / "a.stl").stat().st_mtime_ns + 1
    os.utime(meshes / "a.stl", ns=(later, later))
    assert main(rest) == 0
    there = {path.relative_to(meshes).as_posix() for path in meshes.rglob("*.*")}
    again = len(files & (there - {"a.stl"}))
    assert f"note: {again} files were already in {out}\n" in capsys.readouterr().err
    whole = rows_of(out)
    # What was kept is kept with the time that it took then, so it was not done again.
    assert all(row in whole for row in kept if row["file"] in there - {"a.stl"})
    main([*rest[:-1], str(tmp_path / "fresh.csv")])
    assert without_seconds(out) == without_seconds(tmp_path / "fresh.csv")


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "it is no Parquet file that can be read"),
        (b"something else\n" * 100, "it is no Parquet file that can be read"),
        (None, "its columns are others"),
    ],
)
def test_other_files_are_no_table(tmp_path: Path, content: bytes | None, said: str) -> None:
    path = tmp_path / "t.parquet"
    if content is None:
        parquet.write_table(pyarrow.table({name: ["1"] for name in COLUMNS}), path)
    else:
        path.write_bytes(content)
    with pytest.raises(InputError, match=f"expected a table of an earlier run .*{said}.*--out"):
        RestTable.read(path)


@pytest.mark.parametrize("name", ["t.csv", "t.parquet"])
def test_names_that_are_not_utf8_are_written_as_escapes(
    meshes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    box = (meshes / "b" / "box.obj").read_bytes()
    (meshes / os.fsdecode(b"caf\xe9.obj")).write_bytes(box)
    (meshes / os.fsdecode(b"\xff, broken\n.stl")).write_bytes(b"")
    out = tmp_path / name
    rest = ["rest", str(meshes), "--out", str(out), "--jobs", "1"]
    assert main(rest) == 0
    rows = rows_of(out)
    assert {r"caf\udce9.obj", "\\udcff, broken\n.stl"} <= {row["file"] for row in rows}
    (broken,) = (row for row in rows if "broken" in row["file"])
    assert broken["error"].startswith("\\udcff, broken .stl: expected")
    # They are found again, and names that look like escapes are others.
    (meshes / r"caf\udce9.obj").write_bytes(box)
    (meshes / r"caf\\udce9.obj").write_bytes(box)
    assert main(rest) == 0
    rows = rows_of(out)
    assert len({row["file"] for row in rows}) == len(list_folder(meshes).meshes)
    capsys.readouterr()
    assert main(rest) == 0
    assert (
        f"note: {len(list_folder(meshes).meshes)} files were already in" in capsys.readouterr().err
    )
    assert rows_of(out) == rows


def test_a_missing_extra_is_named(
    meshes: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    out = tmp_path / "t.parquet"
    assert main(["rest", str(meshes), "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"dicedesign: --out {out}: expected the optional extra 'parquet', but ")
    assert said.endswith("; pip install 'dicedesign[parquet]'\n")
    assert not out.exists()
