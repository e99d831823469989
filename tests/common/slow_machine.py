"""Clock that jumps ahead at each reading, as on a very slow machine."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count

import pytest


@contextmanager
def slow_machine() -> Iterator[None]:
    """Advance the clock by 11 days at each reading."""
    ticks = count(0.0, 1e6)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(time, "perf_counter", lambda: next(ticks))
        yield
