"""Time and memory of the stages of a run."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Final, Literal


@dataclass
class Clock:
    """The stages that ran, in order.

    Attributes
    ----------
    stages: of each its "name", "seconds" of wall-clock time, and "peak_mb": the most memory that
        the process held during it, all libraries included, in units of 10^6 bytes; None where the
        system does not tell.
    peak_since: "stage", or "start" where the system cannot restart the count for each stage: then
        "peak_mb" is the most since the process started.
    on_stage: told the name of each stage as it begins.
    """

    stages: list[dict[str, Any]] = field(default_factory=list)
    peak_since: Literal["stage", "start"] = "stage"
    on_stage: Callable[[str], None] | None = None

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Measure what runs under it, once it has ended well."""
        if self.on_stage is not None:
            self.on_stage(name)
        self.peak_since = "stage" if reset_peak() else "start"
        started = time.perf_counter()
        yield
        seconds, peak = time.perf_counter() - started, peak_megabytes()
        self.stages.append(
            {
                "name": name,
                "seconds": round(seconds, 4),
                "peak_mb": None if peak is None else round(peak, 1),
            }
        )


_RESTART: Final = "/proc/self/clear_refs"

_STATUS: Final = "/proc/self/status"

_RESTART_PEAK: Final = b"5"
"""Written to `_RESTART` it makes the peak what is held now; see proc(5)."""

_MEGABYTE: Final = 1e6


def reset_peak() -> bool:
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
    the last successful `reset_peak` or else since the process started. None where the system does
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
