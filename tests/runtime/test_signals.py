"""Signals are blocked while processes start, and no longer."""

from __future__ import annotations

import signal
import sys

import pytest

from dicedesign.runtime.interrupts import ENDING, block_signals

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such signals")


def blocked() -> set[signal.Signals]:
    return {signal.Signals(number) for number in signal.pthread_sigmask(signal.SIG_BLOCK, [])}


def test_ending_signals_are_blocked_within_the_block_alone() -> None:
    before = blocked()
    assert not before & set(ENDING)
    with block_signals():
        assert blocked() == before | set(ENDING)
    with pytest.raises(ValueError, match="no"), block_signals():
        raise ValueError("no")
    assert blocked() == before


def test_without_masks_nothing_is_blocked(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on Windows."""
    with monkeypatch.context() as patch:
        patch.delattr(signal, "pthread_sigmask")
        with block_signals():
            pass
