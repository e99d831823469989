"""How much memory the process has held at most, as the operating system counts it."""

from __future__ import annotations

import os
import sys
from typing import Final

__all__ = ["peak_megabytes", "restart_peak"]

_RESTART: Final = "/proc/self/clear_refs"
_STATUS: Final = "/proc/self/status"

_RESTART_PEAK: Final = b"5"
"""What to write to `_RESTART` so that the peak becomes what is held now; see proc(5)."""

_MEGABYTE: Final = 1e6


def restart_peak() -> bool:
    """Let the peak count from now on. False where the system does not allow that, as outside of
    Linux or with a read-only /proc; then it goes on counting from the start of the process."""
    try:
        # Without creating a file where there is none.
        handle = os.open(_RESTART, os.O_WRONLY)
        try:
            os.write(handle, _RESTART_PEAK)
        finally:
            os.close(handle)
    except OSError:
        return False
    return True


def peak_megabytes() -> float | None:
    """Largest resident memory of the process, all libraries included, in units of 10^6 bytes, since
    the last successful `restart_peak` or else since the process started. None where the system does
    not tell."""
    try:
        with open(_STATUS, "rb") as status:
            for line in status:
                if line.startswith(b"VmHWM:"):
                    return int(line.split()[1]) * 1024 / _MEGABYTE
    except (OSError, ValueError, IndexError):
        pass
    return _largest_ever()


def _largest_ever() -> float | None:
    try:
        import resource
    except ImportError:
        return None
    largest = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return largest * (1 if sys.platform == "darwin" else 1024) / _MEGABYTE
