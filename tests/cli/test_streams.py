"""Closed and full streams, encodings with few characters, and unexpected errors."""

from __future__ import annotations

import os
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path

import pytest
from common.finished_run import box_file
from common.kernels import without_kernels

from dicedesign.cli.main import main
from dicedesign.cli.options import MISSING_KERNELS
from dicedesign.kernels import ops as kernels


def said_by(command: str, folder: Path, **environment: str) -> subprocess.CompletedProcess[bytes]:
    """What a shell's command does, with $DICE for this program."""
    variables = {**os.environ, "DICE": f"{sys.executable} -m dicedesign", **environment}
    shell = ["sh", "-c", command]
    return subprocess.run(
        shell, cwd=folder, env=variables, capture_output=True, timeout=120, check=False
    )


@pytest.mark.parametrize("buffering", ["", "1"])
def test_an_output_that_is_full_is_told(tmp_path: Path, buffering: str) -> None:
    box_file(tmp_path, name="box.stl")
    ended = said_by("$DICE rest box.stl > /dev/full", tmp_path, PYTHONUNBUFFERED=buffering)
    assert ended.returncode == 2
    assert ended.stderr.startswith(b"dicedesign: stdout: expected an output that takes what is")
    assert ended.stderr.count(b"\n") == 1


def test_streams_that_are_closed_take_nothing_else_along(tmp_path: Path) -> None:
    """A file that is opened next would get their number, and what is printed."""
    box_file(tmp_path, name="box.stl")
    ended = said_by("$DICE rest box.stl --figure f.png >&- 2>&- <&-", tmp_path)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, b"", b"")
    assert (tmp_path / "f.png").read_bytes().startswith(b"\x89PNG")
    ended = said_by("$DICE rest none.stl 2>&-", tmp_path)
    assert (ended.returncode, ended.stdout) == (2, b"")


def test_names_that_no_letter_of_the_output_can_write(tmp_path: Path) -> None:
    box_file(tmp_path, name="box.stl").rename(tmp_path / "b\xf6x.stl")
    ended = said_by("$DICE rest b\xf6x.stl", tmp_path, PYTHONIOENCODING="ascii")
    assert (ended.returncode, ended.stderr) == (0, b"")
    assert ended.stdout.startswith(rb"b\xf6x.stl: 6 resting poses")
    os.rename(tmp_path / "b\xf6x.stl", os.path.join(os.fsencode(tmp_path), b"b\xff.stl"))
    ended = said_by('$DICE rest b*.stl; $DICE rest "$(printf "c\\377\\nd.stl")"', tmp_path)
    assert ended.returncode == 2
    assert b"6 resting poses" in ended.stdout
    assert ended.stderr == b"dicedesign: c\\udcff\\nd.stl: no such file; check the path\n"


def test_what_nobody_foresaw_has_its_own_code_and_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    box = str(box_file(tmp_path, name="box.stl"))

    def broken(*arguments: object, **options: object) -> None:
        raise ZeroDivisionError("a\nbug")

    monkeypatch.setattr("dicedesign.rest.poses.rest_poses", broken)
    assert main(["rest", box]) == 3
    said = capsys.readouterr().err
    assert said.startswith("dicedesign: unexpected error, ZeroDivisionError: a\\nbug; ")
    assert said.count("\n") == 1
    for arguments in (["--debug", "rest", box], ["rest", box, "--debug"]):
        with pytest.raises(ZeroDivisionError, match="a\nbug"):
            main(arguments)


def test_too_little_memory_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(*arguments: object, **options: object) -> None:
        raise MemoryError

    monkeypatch.setattr("dicedesign.rest.poses.rest_poses", full)
    assert main(["rest", str(box_file(tmp_path, name="box.stl"))]) == 2
    assert capsys.readouterr().err.startswith("dicedesign: memory: expected enough")


def test_the_version_says_whether_there_are_kernels(capsys: pytest.CaptureFixture[str]) -> None:
    for way, said in ((nullcontext, "with compiled"), (without_kernels, "without compiled")):
        expected = said if kernels.available() else "without compiled"
        with way(), pytest.raises(SystemExit) as ended:
            main(["--version"])
        assert ended.value.code == 0
        assert f", {expected} kernels" in capsys.readouterr().out


def test_a_long_command_says_once_that_kernels_are_missing(tmp_path: Path) -> None:
    (tmp_path / "without").mkdir()
    (tmp_path / "without" / "dicedesign_kernels.py").write_text("INTERFACE = 0\n")
    path = os.pathsep.join([str(tmp_path / "without"), *filter(None, sys.path)])
    (tmp_path / "meshes").mkdir()
    for name in ("a.stl", "b.stl"):
        box_file(tmp_path / "meshes", name=name)
    rest = "$DICE rest meshes --jobs 2 --out"
    ended = said_by(f"{rest} t.csv", tmp_path, PYTHONPATH=path)
    assert ended.returncode == 0
    assert ended.stderr.decode() == f"note: {MISSING_KERNELS}\n"
    # What takes no time, says nothing, nor does it where nobody listens.
    ended = said_by("$DICE rest meshes/a.stl && $DICE --version", tmp_path, PYTHONPATH=path)
    assert (ended.returncode, ended.stderr) == (0, b"")
    for closed in ("2>&-", "2>/dev/full"):
        ended = said_by(f"{rest} u{closed[-1]}.csv {closed}", tmp_path, PYTHONPATH=path)
        assert (ended.returncode, ended.stderr) == (0, b"")
