"""Ctrl-C, SIGTERM and SIGHUP end a command with a checkpoint, or without a trace."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import pytest
from common.bodies import write_mesh
from common.bumpy import bumpy_sphere

from dicedesign.cli.main import main
from dicedesign.results.folder import open_results_folder
from dicedesign.runtime.checkpoint import is_checkpoint
from dicedesign.runtime.interrupts import Interrupt, signals_interrupt
from dicedesign.runtime.workers import progress_bar

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such signals")

CODES = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGHUP: 129}
"""Exit codes after signals, as shells have them."""

SEARCH = """name: long
target: {fair: 4}
start: {mesh: {path: ball.obj}}
method: {concave: {attempts: 10000, displacement: 1.0e-9}}
engrave: false
figures: false
report: false
"""
"""Search that meets no goal."""


def start(folder: Path, line: str) -> subprocess.Popen[str]:
    """Start a command in a process group of its own, in which no signal is ignored."""

    def heed_signals() -> None:
        for number in CODES:
            signal.signal(number, signal.SIG_DFL)

    return subprocess.Popen(
        [sys.executable, "-m", "dicedesign", *line.split()],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        process_group=0,
        preexec_fn=heed_signals,
    )


def end_when(process: subprocess.Popen[str], path: Path, sent: signal.Signals) -> str:
    """Send a signal to all processes of a group as soon as a path exists; return its stderr."""
    limit = time.monotonic() + 120.0
    while not path.exists() and process.poll() is None and time.monotonic() < limit:
        time.sleep(0.02)
    os.killpg(process.pid, sent)
    _, errors = process.communicate(timeout=60.0)
    assert process.returncode == CODES[sent], errors
    assert "Traceback" not in errors
    return errors


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    surface = bumpy_sphere(1)
    write_mesh(tmp_path / "ball.obj", surface.points, surface.triangles)
    (tmp_path / "long.yaml").write_text(SEARCH)
    return tmp_path


@pytest.mark.parametrize("sent", CODES)
def test_a_search_leaves_its_checkpoint(folder: Path, sent: signal.Signals) -> None:
    out = folder / "new" / "die"
    errors = end_when(start(folder, f"run long.yaml --out {out}"), out / "checkpoint.npz", sent)
    assert "--resume" in errors
    assert [path.name for path in out.iterdir()] == ["checkpoint.npz"]
    assert is_checkpoint(out / "checkpoint.npz")


@pytest.mark.parametrize("sent", CODES)
def test_an_empty_folder_is_removed(folder: Path, sent: signal.Signals) -> None:
    """The signal comes while the design has nothing to keep."""
    end_when(start(folder, "design 3:5:7:11:13 --out new/die"), folder / "new" / "die", sent)
    assert not (folder / "new").exists()


@pytest.mark.parametrize(("sent", "code"), CODES.items())
def test_an_interrupt_that_a_library_turns_into_another_error(
    sent: signal.Signals, code: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted() -> None:
        try:
            signal.raise_signal(sent)
        except KeyboardInterrupt:
            raise TypeError("no common type") from None

    monkeypatch.setattr("dicedesign.cli.main.check_memory", interrupted)
    # The tests themselves may run where the signal is ignored.
    before = signal.signal(sent, signal.SIG_DFL)
    try:
        assert main(["rest", "brick.stl"]) == code
    finally:
        signal.signal(sent, before)


def test_an_interrupt_at_any_line_leaves_no_folder(tmp_path: Path) -> None:
    """A signal comes at each line that runs while a folder of results is opened."""
    line = 0
    modules = ("contextlib.py", "pathlib.py", "shutil.py")
    folder = tmp_path / "new" / "die"
    while signal_at_line(line, modules, lambda: open_results_folder(folder, ["die.stl"])):
        assert not (tmp_path / "new").exists(), f"after line {line}"
        line += 1
    assert line > 100


def test_an_interrupt_at_any_line_leaves_no_broken_progress_bar(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A signal comes at each line that runs while a bar is made."""
    line, broken = 0, list[object]()
    monkeypatch.setattr(sys, "unraisablehook", broken.append)
    while signal_at_line(line, ("std.py",), lambda: progress_bar("meshes", 7)):
        gc.collect(0)
        line += 1
    assert line > 50
    assert broken == []


def signal_at_line(
    line: int, modules: Sequence[str], enter: Callable[[], AbstractContextManager[object]]
) -> bool:
    """Enter a context with a signal at a line, counted from 0, of this product and of modules that
    it calls; return whether there was such a line before it was entered."""
    lines = 0

    def trace(frame: FrameType, event: str, _: object) -> Callable[..., Any] | None:
        nonlocal lines
        path = Path(frame.f_code.co_filename)
        if "dicedesign" not in path.parts and path.name not in modules:
            return None
        if event == "line":
            lines += 1
            if lines > line:
                sys.settrace(None)
                signal.raise_signal(signal.SIGTERM)
        return trace

    with signals_interrupt():
        sys.settrace(trace)
        try:
            with enter():
                sys.settrace(None)
                raise KeyError
        except (Interrupt, KeyError) as error:
            return isinstance(error, Interrupt)
        finally:
            sys.settrace(None)


@pytest.mark.parametrize("sent", CODES)
def test_workers_end_without_a_word(
    folder: Path, sent: signal.Signals, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A terminal sends Ctrl-C and SIGHUP to the workers too, also while they start."""
    (folder / "meshes").mkdir()
    rng = np.random.default_rng(0)
    for number in range(100):
        text = "".join(f"{x} {y} {z}\n" for x, y, z in rng.normal(size=(500, 3)))
        (folder / "meshes" / f"{number}.xyz").write_text(text)
    table = folder / "table.csv"
    end_when(start(folder, "rest meshes --out table.csv --jobs 2"), table, sent)
    monkeypatch.chdir(folder)
    for path in list((folder / "meshes").iterdir())[3:]:
        path.unlink()
    assert main(["rest", "meshes", "--out", "table.csv", "--jobs", "1"]) == 0
