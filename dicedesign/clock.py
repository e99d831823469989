"""What the stages of a run take."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Literal

from dicedesign.peak_memory import peak_megabytes, restart_peak

__all__ = ["Clock"]


@dataclass
class Clock:
    """The stages that ran, in order.

    Attributes
    ----------
    stages: of each its "name", "seconds" of wall-clock time, and "peak_mb": the most memory that
        the process held during it, all libraries included, in units of 10^6 bytes; None where the
        system does not tell.
    peak_since: "stage", or "start" where the system cannot count anew for each stage: then
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
        self.peak_since = "stage" if restart_peak() else "start"
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
