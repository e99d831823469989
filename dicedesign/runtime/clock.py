"""Run time and memory of the stages of a run."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Literal


@dataclass
class Clock:
    """Stages of a run, in order.

    Attributes
    ----------
    stages: for each stage "name", "seconds" of wall-clock time, and "peak_mb", the peak memory of
        the process in 10^6 bytes, None if the system does not report it.
    peak_since: "stage", or "start" if the system cannot reset the peak; then "peak_mb" is the peak
        since the process started.
    on_stage: called with the name of each stage when it starts.
    """

    stages: list[dict[str, Any]] = field(default_factory=list)
    peak_since: Literal["stage", "start"] = "stage"
    on_stage: Callable[[str], None] | None = None

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Measure a block, and record it if it succeeds."""
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


_CLEAR_REFS = "/proc/self/clear_refs"
"""Writing 5 to it resets the peak; see proc(5)."""

_STATUS = "/proc/self/status"


def reset_peak() -> bool:
    """Reset the peak memory. Returns False if the system does not allow that, as outside of Linux
    or with a read-only /proc; the peak then counts from the start of the process."""
    try:
        # An unbuffered file reports errors at once.
        with open(_CLEAR_REFS, "wb", buffering=0) as file:
            file.write(b"5")
    except OSError:
        return False
    return True


def peak_megabytes() -> float | None:
    """Peak resident memory of the process in 10^6 bytes, since the last successful `reset_peak` or
    else since the process started. None if the system does not report it, as outside of Linux."""
    try:
        with open(_STATUS, encoding="utf-8") as status:
            for line in status:
                if line.startswith("VmHWM:"):
                    return int(line.split()[1]) * 1024 / 1e6
    except OSError:
        pass
    return None
