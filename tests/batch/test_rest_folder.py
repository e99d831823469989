"""`dicedesign rest FOLDER` from the command line."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from common.inline_executor import Inline, Lossy
from common.kernels import compiled_only
from common.processes import FILES, heed_interrupts, kill_at_write, shorten, start_run

from dicedesign.batch import batch
from dicedesign.batch.batch import analyze_files, run_batch
from dicedesign.batch.rest_rows import RestOptions
from dicedesign.batch.rest_table import Entry, RestTable, Stamp, broken_entry
from dicedesign.cli.main import main
from dicedesign.runtime import workers


@pytest.fixture
def analyzed_files(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Run batches in this process, and list the analyzed files."""
    files: list[str] = []

    def record_files(folder: str, stamps: dict[str, Any], *rest: Any) -> Any:
        files.extend(stamps)
        return analyze_files(folder, stamps, *rest)

    @contextmanager
    def local_workers(jobs: int) -> Iterator[Executor]:
        yield Inline()

    monkeypatch.setattr(batch, "analyze_files", record_files)
    monkeypatch.setattr(workers, "local_workers", local_workers)
    return files


def without_seconds(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return [{**row, "seconds": ""} for row in csv.DictReader(file)]


@compiled_only
def test_the_number_of_jobs_has_no_effect(
    meshes: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (meshes / "broken.obj").write_text("v 1\n")
    (meshes / "b" / "part.STEP").write_text("ISO-10303-21;\n")
    monkeypatch.setattr(workers, "ITEMS_PER_TASK", 1)
    for jobs in ("1", "2"):
        out = str(tmp_path / f"{jobs}.csv")
        assert main(["rest", str(meshes), "--jobs", jobs, "--out", out]) == 0
        captured = capsys.readouterr()
        rows = without_seconds(Path(out))
        assert captured.out == f"{out}: 6 files with {len(rows) - 2} resting poses\n"
        assert {row["file"] for row in rows if row["error"]} == {"b/part.STEP", "broken.obj"}
        assert captured.err == (
            "note: 1 files are no meshes\n"
            "note: 2 files could not be analyzed; see the column 'error'\n"
        )
    assert without_seconds(tmp_path / "1.csv") == without_seconds(tmp_path / "2.csv")


def test_only_new_or_changed_files_are_analyzed(
    meshes: Path, tmp_path: Path, analyzed_files: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "t.csv"
    (meshes / "broken.obj").write_text("v 1\n")
    rest = ["rest", str(meshes), "--out", str(out)]
    assert main(rest) == 0
    assert len(analyzed_files) == 7
    first = out.read_bytes()
    analyzed_files.clear()
    capsys.readouterr()
    assert main(rest) == 0
    assert analyzed_files == []
    assert out.read_bytes() == first
    assert f"note: 7 files were already in {out}\n" in capsys.readouterr().err

    later = (meshes / "a.stl").stat().st_mtime_ns + 1
    os.utime(meshes / "a.stl", ns=(later, later))
    (meshes / "broken.obj").write_bytes((meshes / "b" / "box.obj").read_bytes())
    (meshes / "new.obj").write_bytes((meshes / "b" / "box.obj").read_bytes())
    (meshes / "c.off").unlink()
    assert main(rest) == 0
    assert analyzed_files == ["a.stl", "broken.obj", "new.obj"]
    captured = capsys.readouterr()
    assert f"note: 1 files of {out} are gone, and so are their rows\n" in captured.err
    assert "could not be analyzed" not in captured.err
    resumed = without_seconds(out)
    main([*rest[:-1], str(tmp_path / "fresh.csv")])
    assert resumed == without_seconds(tmp_path / "fresh.csv")


@pytest.mark.parametrize(
    ("option", "same", "error_text"),
    [
        (["--com", "0.1,0,0"], ["--com", "1e-1,0.0,0"], "--com {}, got one with 0.1,0.0,0.0"),
        (
            ["--coplanar-tolerance", "1e-3"],
            ["--coplanar-tolerance", "0.001"],
            "--coplanar-tolerance {}, got one with 0.001",
        ),
    ],
)
def test_a_table_has_one_set_of_options(
    meshes: Path,
    tmp_path: Path,
    analyzed_files: list[str],
    capsys: pytest.CaptureFixture[str],
    option: list[str],
    same: list[str],
    error_text: str,
) -> None:
    out = tmp_path / "t.csv"
    rest = ["rest", str(meshes), "--out", str(out)]
    main([*rest, *option])
    before = out.read_bytes()
    assert main(rest) == 2
    wanted = error_text.format("left out")
    error = f"dicedesign: {out}: expected a table made with {wanted}; choose another with --out\n"
    assert capsys.readouterr().err.endswith(error)
    main([*rest, *same])
    assert len(analyzed_files) == 6
    assert out.read_bytes() == before


def test_folders_without_meshes_and_tables_of_other_folders(
    meshes: Path, tmp_path: Path, analyzed_files: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    out, empty = tmp_path / "t.csv", tmp_path / "empty"
    empty.mkdir()
    (empty / "README").touch()
    assert main(["rest", str(empty), "--out", str(out)]) == 2
    error = capsys.readouterr().err
    assert error.startswith(
        f"dicedesign: {empty}: expected a folder with meshes, files ending in ."
    )
    assert not out.exists()
    assert main(["rest", str(meshes), "--out", str(out)]) == 0
    before = out.read_bytes()
    (empty / "broken.obj").touch()
    assert main(["rest", str(empty), "--out", str(out)]) == 2
    assert "got one of other files, such as 'a.stl'" in capsys.readouterr().err
    assert out.read_bytes() == before
    # No file can be analyzed.
    other = tmp_path / "other.csv"
    assert main(["rest", str(empty), "--out", str(other)]) == 1
    assert capsys.readouterr().out == f"{other}: 0 files with 0 resting poses\n"
    # Options for folders are refused for one mesh.
    assert main(["rest", str(meshes / "a.stl"), "--jobs", "2"]) == 2
    assert "--jobs: expected a folder of meshes, got " in capsys.readouterr().err


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGKILL])
def test_a_killed_run_resumes(
    meshes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], end: signal.Signals
) -> None:
    """Ctrl-C interrupts every process of the terminal's group."""
    out = tmp_path / "t.csv"
    process, rest = start_run(meshes, out, process_group=0, preexec_fn=heed_interrupts)
    os.killpg(process.pid, end)
    _, error_text = process.communicate(timeout=30.0)
    if end is signal.SIGINT:
        assert process.returncode == 130
        assert error_text.endswith("dicedesign: interrupted; nothing half-written was left\n")
        assert "Traceback" not in error_text
        assert not list(tmp_path.glob(".*.part"))
    with out.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert 0 < len({row["file"] for row in rows}) < FILES
    shorten(meshes)
    assert main(rest) == 0
    assert "files were already in" in capsys.readouterr().err
    # Equal run times show that these files were not analyzed again.
    with out.open(newline="") as file:
        whole = list(csv.DictReader(file))
    assert len({row["file"] for row in whole}) == 106
    assert all(row in whole for row in rows if row["file"] < "0100")


def test_a_killed_run_resumes_with_equal_results(meshes: Path, tmp_path: Path) -> None:
    """The kills come while tables with some rows are written."""
    whole, parts = tmp_path / "whole.csv", tmp_path / "parts.csv"
    rest = ["rest", str(meshes), "--jobs", "1", "--out"]
    assert main([*rest, str(whole)]) == 0
    for left, rows in ((3, 1), (4, 3)):
        kill_at_write([*rest, str(parts)], left)
        assert len(RestTable.read(parts)) == rows
    assert main([*rest, str(parts)]) == 0
    assert without_seconds(parts) == without_seconds(whole)
    assert not list(tmp_path.glob(".*.part"))


def test_only_the_file_that_kills_workers_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    def succeed(_: str, stamps: dict[str, Stamp], *__: Any) -> dict[str, Entry]:
        return {file: Entry(stamp, f"{file}\n", 1) for file, stamp in stamps.items()}

    monkeypatch.setattr(batch, "analyze_files", succeed)
    stamps = {f"{i}.stl": Stamp(100, 1) for i in range(6)}
    entries: dict[str, Entry] = {}
    lossy = Lossy(lambda count, folder, files, *_: "4.stl" in files)
    run_batch("there", stamps, lossy, 2, RestOptions(), on_entries=entries.update)
    reason = (
        "4.stl: expected workers that stay, but all 3 that analyzed it were lost; see whether "
        "memory suffices"
    )
    assert entries.pop("4.stl") == broken_entry("4.stl", stamps.pop("4.stl"), reason)
    assert entries == succeed("", stamps)


def test_workers_load_nothing_heavy(meshes: Path) -> None:
    heavy = {"torch", "manifold3d", "matplotlib", "pydantic", "fontTools", "tqdm", "distributed"}
    for file, more in (("a.stl", {"trimesh"}), ("b/hull.PLY", set())):
        script = (
            "import json, sys; from dicedesign.batch.batch import analyze_files;"
            "from dicedesign.batch.rest_rows import RestOptions;"
            "from dicedesign.batch.rest_table import Stamp;"
            f"entries = analyze_files({str(meshes)!r}, {{{file!r}: Stamp(1, 1)}}, RestOptions());"
            f"assert entries[{file!r}].rests > 0;"
            "print(json.dumps([name for name, module in sys.modules.items() if module]))"
        )
        loaded = set(json.loads(subprocess.check_output([sys.executable, "-c", script])))
        assert loaded & (heavy | more) == set()
