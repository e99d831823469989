"""Signals of child processes."""

from __future__ import annotations

import signal


def heed_interrupts() -> None:
    """Restore interrupts in a child process; background processes of a shell ignore them."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
