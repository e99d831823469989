"""The peak of memory: against the system's other way of counting it, and where it cannot be had."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import pytest

from dicedesign.runtime import clock as peak_memory
from dicedesign.runtime.clock import peak_megabytes, reset_peak

resource = pytest.importorskip("resource")


def ever() -> float:
    """What the system says was the most since the process started."""
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6


def test_the_peak_rises_with_what_is_held() -> None:
    reset_peak()
    before = peak_megabytes()
    block = np.ones(25_000_000)
    during = peak_megabytes()
    assert block.nbytes == 200_000_000
    assert before is not None
    assert during is not None
    assert during >= before
    assert during <= ever() + 2.0


def test_a_restarted_peak_forgets_what_was_given_back() -> None:
    if not reset_peak():
        pytest.skip("this system does not restart the peak")
    before = peak_megabytes()
    block = np.ones(25_000_000)
    during = peak_megabytes()
    del block
    after = peak_megabytes()
    assert reset_peak()
    restarted = peak_megabytes()
    assert during - before == pytest.approx(200.0, abs=5.0)
    assert after == pytest.approx(during, abs=2.0)
    assert restarted == pytest.approx(before, abs=5.0)


@pytest.mark.parametrize(
    "status", [None, b"", b"Name:\tpython\n", b"VmHWM:\n", b"VmHWM: many kB\n"]
)
def test_without_proc_the_peak_is_that_since_the_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, status: bytes | None
) -> None:
    monkeypatch.setattr(peak_memory, "_RESTART", str(tmp_path / "clear_refs"))
    monkeypatch.setattr(peak_memory, "_STATUS", str(tmp_path / "status"))
    if status is not None:
        (tmp_path / "status").write_bytes(status)
    assert not reset_peak()
    assert not (tmp_path / "clear_refs").exists()
    assert peak_megabytes() == pytest.approx(ever(), rel=0.01)


def test_a_refused_write_is_no_restart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(peak_memory, "_RESTART", str(tmp_path))
    assert not reset_peak()

    def refuse(*arguments: object) -> int:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.undo()
    monkeypatch.setattr(os, "write", refuse)
    assert not reset_peak()


def test_where_nobody_counts_there_is_no_peak(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(peak_memory, "_STATUS", str(tmp_path / "status"))
    monkeypatch.setitem(sys.modules, "resource", None)
    assert peak_megabytes() is None
