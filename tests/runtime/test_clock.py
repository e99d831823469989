"""Peak memory against the system's other counter, and systems without it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dicedesign.runtime import clock
from dicedesign.runtime.clock import peak_megabytes, reset_peak

resource = pytest.importorskip("resource")


def ever() -> float:
    """Peak since the process started, in 10^6 bytes."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6


def test_a_reset_peak_forgets_freed_memory() -> None:
    if not reset_peak():
        pytest.skip("this system cannot reset the peak")
    before = peak_megabytes()
    block = np.ones(25_000_000)
    during = peak_megabytes()
    assert during <= ever() + 2.0
    del block
    after = peak_megabytes()
    assert reset_peak()
    after_reset = peak_megabytes()
    assert during - before == pytest.approx(200.0, abs=5.0)
    assert after == pytest.approx(during, abs=2.0)
    assert after_reset == pytest.approx(before, abs=5.0)


def test_without_proc_there_is_no_peak(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("_CLEAR_REFS", "_STATUS"):
        monkeypatch.setattr(clock, name, str(tmp_path / "missing" / "file"))
    assert not reset_peak()
    assert peak_megabytes() is None
