"""Closed and full streams, encodings, names of files, unexpected errors, and aligned columns."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest
from common.bodies import write_mesh
from common.finished import box_file
from common.kernels import without_kernels
from common.parsed_html import parse_page

from dicedesign.cli.main import main
from dicedesign.cli.options import MISSING_KERNELS, text_table
from dicedesign.errors import printable
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.kernels import ops as kernels
from dicedesign.recipe.reading import read_recipe


def run_shell(command: str, folder: Path, **environment: str) -> subprocess.CompletedProcess[bytes]:
    """Run a shell command, with $DICE for this program."""
    variables = {**os.environ, "DICE": f"{sys.executable} -m dicedesign", **environment}
    shell = ["sh", "-c", command]
    return subprocess.run(
        shell, cwd=folder, env=variables, capture_output=True, timeout=120, check=False
    )


@pytest.mark.parametrize("buffering", ["", "1"])
def test_a_full_output_is_an_error(tmp_path: Path, buffering: str) -> None:
    box_file(tmp_path, name="box.stl")
    ended = run_shell("$DICE rest box.stl > /dev/full", tmp_path, PYTHONUNBUFFERED=buffering)
    assert ended.returncode == 2
    assert ended.stderr.startswith(b"dicedesign: stdout: expected an output that takes what is")
    assert ended.stderr.count(b"\n") == 1


def test_closed_streams_do_no_harm(tmp_path: Path) -> None:
    """Otherwise the next file would get their number and the output."""
    box_file(tmp_path, name="box.stl")
    ended = run_shell("$DICE rest box.stl --figure f.png >&- 2>&- <&-", tmp_path)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, b"", b"")
    assert (tmp_path / "f.png").read_bytes().startswith(b"\x89PNG")
    ended = run_shell("$DICE rest none.stl 2>&-", tmp_path)
    assert (ended.returncode, ended.stdout) == (2, b"")


def test_unprintable_names_are_escaped(tmp_path: Path) -> None:
    box_file(tmp_path, name="box.stl").rename(tmp_path / "b\xf6x.stl")
    ended = run_shell("$DICE rest b\xf6x.stl", tmp_path, PYTHONIOENCODING="ascii")
    assert (ended.returncode, ended.stderr) == (0, b"")
    assert ended.stdout.startswith(rb"b\xf6x.stl: 6 resting poses")
    os.rename(tmp_path / "b\xf6x.stl", os.path.join(os.fsencode(tmp_path), b"b\xff.stl"))
    ended = run_shell('$DICE rest b*.stl; $DICE rest "$(printf "c\\377\\nd.stl")"', tmp_path)
    assert ended.returncode == 2
    assert b"6 resting poses" in ended.stdout
    assert ended.stderr == b"dicedesign: c\\udcff\\nd.stl: no such file; check the path\n"


def test_an_unexpected_error_has_its_own_code_and_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    box = str(box_file(tmp_path, name="box.stl"))

    def broken(*arguments: object, **options: object) -> None:
        raise ZeroDivisionError("a\nbug")

    monkeypatch.setattr("dicedesign.rest.poses.rest_poses", broken)
    assert main(["rest", box]) == 3
    message = capsys.readouterr().err
    assert message.startswith("dicedesign: unexpected error, ZeroDivisionError: a\\nbug; ")
    assert message.count("\n") == 1
    for arguments in (["--debug", "rest", box], ["rest", box, "--debug"]):
        with pytest.raises(ZeroDivisionError, match="a\nbug"):
            main(arguments)


def test_too_little_memory_is_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(*arguments: object, **options: object) -> None:
        raise MemoryError

    monkeypatch.setattr("dicedesign.rest.poses.rest_poses", full)
    assert main(["rest", str(box_file(tmp_path, name="box.stl"))]) == 2
    assert capsys.readouterr().err.startswith("dicedesign: memory: expected enough")


def test_the_version_reports_the_kernels(capsys: pytest.CaptureFixture[str]) -> None:
    for context, message in ((nullcontext, "with compiled"), (without_kernels, "without compiled")):
        expected = message if kernels.available() else "without compiled"
        with context(), pytest.raises(SystemExit) as ended:
            main(["--version"])
        assert ended.value.code == 0
        assert f", {expected} kernels" in capsys.readouterr().out


def test_missing_kernels_are_noted_once(tmp_path: Path) -> None:
    (tmp_path / "without").mkdir()
    (tmp_path / "without" / "dicedesign_kernels.py").write_text("INTERFACE = 0\n")
    path = os.pathsep.join([str(tmp_path / "without"), *filter(None, sys.path)])
    (tmp_path / "meshes").mkdir()
    for name in ("a.stl", "b.stl"):
        box_file(tmp_path / "meshes", name=name)
    rest = "$DICE rest meshes --jobs 2 --out"
    ended = run_shell(f"{rest} t.csv", tmp_path, PYTHONPATH=path)
    assert ended.returncode == 0
    assert ended.stderr.decode() == f"note: {MISSING_KERNELS}\n"
    # Quick commands print no note, and a closed stderr is no error.
    ended = run_shell("$DICE rest meshes/a.stl && $DICE --version", tmp_path, PYTHONPATH=path)
    assert (ended.returncode, ended.stderr) == (0, b"")
    ended = run_shell(f"{rest} u.csv 2>/dev/full", tmp_path, PYTHONPATH=path)
    assert (ended.returncode, ended.stderr) == (0, b"")


RECIPE = "name: a\ntarget: {fair: 4}\nsize_mm: 30\nfigures: false\nstart: {mesh: {path: %s}}\n"

NAMES = [os.fsdecode(b"m\xff.stl"), "m\n<b>&.stl", "\x1b[31m.stl"]


def tetrahedron(path: Path) -> Path:
    hull = convex_hull(np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], dtype=float))
    plain = path.with_name("plain.stl")
    write_mesh(plain, hull.vertices, hull.triangles)
    plain.rename(path)
    return path


@pytest.mark.parametrize("name", NAMES)
def test_the_first_line_has_a_printable_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    assert main(["rest", str(tetrahedron(tmp_path / name))]) == 0
    first = capsys.readouterr().out.splitlines()[0]
    assert first.startswith(f"{tmp_path}/{printable(name)}: 4 resting poses")
    assert printable(name).isprintable()


def test_a_recipe_from_a_folder_that_is_not_utf8(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / os.fsdecode(b"d\xff")
    folder.mkdir()
    tetrahedron(folder / "m.stl")
    (folder / "r.yaml").write_text(RECIPE % "m.stl")
    assert main(["run", str(folder / "r.yaml"), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert r"d\udcff/r.yaml: start.mesh.path: expected a text in UTF-8, got '" in error
    assert error.count("\n") == 1


def test_files_of_a_run_are_utf8(tmp_path: Path) -> None:
    mesh = tetrahedron(tmp_path / "m\n<b>&.stl")
    recipe = tmp_path / "r.yaml"
    recipe.write_text(RECIPE % json.dumps(mesh.name))
    out = tmp_path / os.fsdecode(b"out\xff")
    assert main(["run", str(recipe), "--out", str(out)]) == 0
    assert read_recipe(out / "recipe.yaml").as_dict()["start"] == {
        "mesh": {"path": str(mesh), "repair": False, "item": None}
    }
    json.loads((out / "result.json").read_bytes().decode("utf-8"))
    parse_page((out / "report.html").read_bytes().decode("utf-8"))


def test_texts_begin_at_the_left_and_numbers_end_at_the_right() -> None:
    table = text_table(
        ("name", "", ["one", "fifteen"]),
        ("count", "d", [np.int64(7), 12345678]),
        ("left out", "d", None),
        ("part", ".2f", [0.5, np.float64(10)]),
        ("limits", ">", ["1 to 2", "-"]),
        ("", "", ["x", ""]),
    )
    assert table.splitlines() == [
        "name        count   part  limits",
        "one             7   0.50  1 to 2  x",
        "fifteen  12345678  10.00       -",
    ]
