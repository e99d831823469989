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
from common.inline_executor import Inline
from common.killed import kill_at_write
from common.long_run import FILES, begun, shorten
from common.signals import heed_interrupts

from dicedesign.batch import file_batches as running
from dicedesign.batch.analyse import analyse_files
from dicedesign.batch.rest_table import RestTable
from dicedesign.cli.main import main
from dicedesign.runtime import workers

Count = list[str]


@pytest.fixture
def done(monkeypatch: pytest.MonkeyPatch) -> Count:
    """Runs batches in this process, and lists the files that are analysed."""
    files: Count = []

    def counted(folder: str, stamps: dict[str, Any], *rest: Any) -> Any:
        files.extend(stamps)
        return analyse_files(folder, stamps, *rest)

    @contextmanager
    def local_workers(jobs: int) -> Iterator[Executor]:
        assert jobs >= 1
        yield Inline()

    monkeypatch.setattr(running, "analyse_files", counted)
    monkeypatch.setattr(workers, "local_workers", local_workers)
    return files


def without_seconds(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return [{**row, "seconds": ""} for row in csv.DictReader(file)]


def test_jobs_do_not_matter(
    meshes: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (meshes / "broken.obj").write_text("v 1\n")
    monkeypatch.setattr(running, "FILES_PER_TASK", 1)
    for jobs in ("1", "2"):
        out = str(tmp_path / f"{jobs}.csv")
        assert main(["rest", str(meshes), "--jobs", jobs, "--out", out]) == 0
        captured = capsys.readouterr()
        rows = without_seconds(Path(out))
        assert captured.out == f"{out}: 6 files with {len(rows) - 1} resting poses\n"
        assert captured.err == (
            "note: 1 files are no meshes\n"
            "note: 1 files could not be analysed; see the column 'error'\n"
        )
    assert without_seconds(tmp_path / "1.csv") == without_seconds(tmp_path / "2.csv")


def test_only_what_is_new_or_changed_is_analysed(
    meshes: Path, tmp_path: Path, done: Count, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "t.csv"
    (meshes / "broken.obj").write_text("v 1\n")
    rest = ["rest", str(meshes), "--out", str(out)]
    assert main(rest) == 0
    assert len(done) == 7
    first = out.read_bytes()
    done.clear()
    capsys.readouterr()
    assert main(rest) == 0
    assert done == []
    assert out.read_bytes() == first
    assert f"note: 7 files were already in {out}\n" in capsys.readouterr().err

    later = (meshes / "a.stl").stat().st_mtime_ns + 1
    os.utime(meshes / "a.stl", ns=(later, later))
    (meshes / "broken.obj").write_bytes((meshes / "b" / "box.obj").read_bytes())
    (meshes / "new.obj").write_bytes((meshes / "b" / "box.obj").read_bytes())
    (meshes / "c.off").unlink()
    assert main(rest) == 0
    assert done == ["a.stl", "broken.obj", "new.obj"]
    captured = capsys.readouterr()
    assert f"note: 1 files of {out} are gone, and so are their rows\n" in captured.err
    assert "could not be analysed" not in captured.err
    resumed = without_seconds(out)
    main([*rest[:-1], str(tmp_path / "fresh.csv")])
    assert resumed == without_seconds(tmp_path / "fresh.csv")


@pytest.mark.parametrize(
    ("option", "same", "said"),
    [
        (
            ["--com", "0.1,0,0"],
            ["--com", "1e-1,0.0,0"],
            "--com left out, got one with 0.1,0.0,0.0; choose another with --out",
        ),
        (
            ["--com", "hull"],
            ["--com", "hull"],
            "--com left out, got one with hull; choose another with --out",
        ),
        (
            ["--coplanar-tolerance", "1e-3"],
            ["--coplanar-tolerance", "0.001"],
            "--coplanar-tolerance left out, got one with 0.001; choose another with --out",
        ),
        (
            [],
            [],
            "--com hull, got one with it left out; choose another with --out",
        ),
    ],
)
def test_a_table_answers_one_question(
    meshes: Path,
    tmp_path: Path,
    done: Count,
    capsys: pytest.CaptureFixture[str],
    option: list[str],
    same: list[str],
    said: str,
) -> None:
    out = tmp_path / "t.csv"
    rest = ["rest", str(meshes), "--out", str(out)]
    main([*rest, *option])
    assert len(done) == 6
    before = out.read_bytes()
    assert main([*rest, *(["--com", "hull"] if not option else [])]) == 2
    error = f"dicedesign: {out}: expected a table made with {said}\n"
    assert capsys.readouterr().err.endswith(error)
    main([*rest, *same])
    assert len(done) == 6
    assert out.read_bytes() == before


def test_nothing_that_could_be_analysed(
    tmp_path: Path, done: Count, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.stl").touch()
    out = tmp_path / "t.csv"
    assert main(["rest", str(tmp_path), "--out", str(out)]) == 1
    captured = capsys.readouterr()
    assert captured.out == f"{out}: 0 files with 0 resting poses\n"
    assert captured.err == "note: 1 files could not be analysed; see the column 'error'\n"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "--out: expected the path of a table that ends in .csv or .parquet, got None"),
        (["--out", "t.xlsx"], "--out: expected the path of a table that ends in .csv or .parquet,"),
        (
            ["--out", "t.csv", "--coplanar-tolerance", "-1"],
            "--coplanar-tolerance: expected a number in [0, 1), got -1.0",
        ),
        (["--out", "t.csv", "--coplanar-tolerance", "nan"], "--coplanar-tolerance: expected a num"),
        (["--out", "gone/t.csv"], "gone/t.csv: expected to write a file in an existing"),
        (["--out", "meshes/b.xyz/t.csv"], "meshes/b.xyz/t.csv: expected to write a file"),
        (["--out", "t.csv", "--json"], "--json: expected one mesh, got the folder meshes"),
        (["--out", "t.csv", "--figure", "f.png"], "--figure: expected one mesh, got the folder"),
        (["--out", "t.csv", "--heights", "f.png"], "--heights: expected one mesh, got the folder"),
        (["--out", "t.csv", "--jobs", "0"], "--jobs: expected a whole number above 0, got 0"),
        (["--out", "t.csv", "--scheduler", "far"], "--scheduler: expected an address such as tcp"),
        (["--out", "t.csv", "--com", "1,2"], "--com: expected three numbers x,y,z, got '1,2'"),
        (["--out", "other.csv"], "other.csv: expected a table of an earlier run or no file, but"),
    ],
)
def test_bad_input_is_one_line(
    meshes: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    message: str,
) -> None:
    monkeypatch.chdir(meshes.parent)
    Path("other.csv").write_text("something else\n")
    assert main(["rest", "meshes", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    last = captured.err.splitlines()[-1]
    assert last.startswith(f"dicedesign: {message}")
    assert [line for line in captured.err.splitlines() if not line.startswith("note: ")] == [last]
    assert sorted(path.name for path in Path().iterdir()) == ["meshes", "other.csv"]
    assert Path("other.csv").read_text() == "something else\n"


def test_folders_without_meshes_and_tables_of_other_folders(
    meshes: Path, tmp_path: Path, done: Count, capsys: pytest.CaptureFixture[str]
) -> None:
    out, empty = tmp_path / "t.csv", tmp_path / "empty"
    empty.mkdir()
    (empty / "README").touch()
    assert main(["rest", str(empty), "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"dicedesign: {empty}: expected a folder with meshes, files ending in .")
    assert "got 1 other files" in said
    assert not out.exists()

    assert main(["rest", str(meshes), "--out", str(out)]) == 0
    before = out.read_bytes()
    (empty / "box.obj").write_bytes((meshes / "b" / "box.obj").read_bytes())
    assert main(["rest", str(empty), "--out", str(out)]) == 2
    assert "got one of other files, such as 'a.stl'" in capsys.readouterr().err
    assert out.read_bytes() == before


@pytest.mark.parametrize("option", [["--out", "t.csv"], ["--jobs", "2"], ["--scheduler", "x"]])
def test_one_mesh_takes_no_option_of_a_folder(
    meshes: Path, capsys: pytest.CaptureFixture[str], option: list[str]
) -> None:
    assert main(["rest", str(meshes / "a.stl"), *option]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"dicedesign: {option[0]}: expected a folder of meshes, got ")


def test_an_interrupt_keeps_what_was_done(
    meshes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As by Ctrl-C, which every process of the terminal's group gets."""
    out = tmp_path / "t.csv"
    process, rest = begun(meshes, out, process_group=0, preexec_fn=heed_interrupts)
    os.killpg(process.pid, signal.SIGINT)
    _, said = process.communicate(timeout=30.0)
    assert process.returncode == 130
    assert said.endswith("dicedesign: interrupted; nothing half-written was left\n")
    assert "Traceback" not in said
    assert not list(tmp_path.glob(".*.part"))

    kept = without_seconds(out)
    assert len({row["file"] for row in kept}) < FILES
    shorten(meshes)
    assert main(rest) == 0
    assert "files were already in" in capsys.readouterr().err
    whole = without_seconds(out)
    assert len({row["file"] for row in whole}) == 106
    assert len(kept) >= 64 * 6
    assert all(row in whole for row in kept if row["file"] < "0100")


def test_a_table_made_in_spite_of_kills_is_the_same(
    meshes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """While tables with some rows are written."""
    whole, parts = tmp_path / "whole.csv", tmp_path / "parts.csv"
    rest = ["rest", str(meshes), "--jobs", "1", "--out"]
    assert main([*rest, str(whole)]) == 0
    for left, kept in ((3, 1), (4, 3)):
        kill_at_write([*rest, str(parts)], left)
        assert len(RestTable.read(parts)) == kept
    capsys.readouterr()
    assert main([*rest, str(parts)]) == 0
    assert f"note: 3 files were already in {parts}\n" in capsys.readouterr().err
    assert without_seconds(parts) == without_seconds(whole)
    assert not list(tmp_path.glob(".*.part"))


def test_workers_load_nothing_heavy(meshes: Path) -> None:
    heavy = {"torch", "manifold3d", "matplotlib", "pydantic", "fontTools", "tqdm", "distributed"}
    for file, more in (("a.stl", {"trimesh"}), ("b/hull.PLY", set())):
        script = (
            "import json, sys; from dicedesign.batch.analyse import analyse_files;"
            "from dicedesign.batch.rows import Stamp;"
            f"entries = analyse_files({str(meshes)!r}, {{{file!r}: Stamp(1, 1)}});"
            f"assert entries[{file!r}].rests > 0;"
            "print(json.dumps([name for name, module in sys.modules.items() if module]))"
        )
        command = [sys.executable, "-c", script]
        loaded = set(json.loads(subprocess.check_output(command)))
        assert loaded & (heavy | more) == set()
        assert ("trimesh" in loaded) == (not more)
        floors = {name.split(".")[1] for name in loaded if name.startswith("dicedesign.")}
        assert floors <= {"batch", "rest", "geometry", "kernels", "runtime", "errors", "tolerances"}


def test_the_command_itself_loads_nothing_heavy(meshes: Path) -> None:
    script = (
        "import sys; from dicedesign.cli.main import main; code = main(sys.argv[1:]);"
        "print({'torch', 'manifold3d', 'matplotlib', 'pydantic', 'optuna'} & set(sys.modules));"
        "sys.exit(code)"
    )
    command = [sys.executable, "-c", script, "rest", str(meshes), "--jobs", "1", "--out", "t.csv"]
    said = subprocess.check_output(command, cwd=meshes, text=True)
    assert said.endswith("\nset()\n")
