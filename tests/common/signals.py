"""Signals of child processes."""

from __future__ import annotations

import signal


def heed_interrupts() -> None:
    """To be called in a child: what was started in the background of a shell would ignore them."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
