"""A machine on which everything takes long: its clock leaps whenever it is read."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count

import pytest


@contextmanager
def slow_machine() -> Iterator[None]:
    """What is inside runs by a clock on which a fortnight goes by between two looks at it."""
    ticks = count(0.0, 1e6)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(time, "perf_counter", lambda: next(ticks))
        yield
