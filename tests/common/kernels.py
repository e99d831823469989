"""Tests with and without the compiled kernels, and on a slow machine.

`@compiled_only` marks tests that need kernels. `without_kernels()`, also a decorator,
disables them. `pytest --without-kernels` runs all tests without kernels.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count

import pytest

from dicedesign.kernels import ops

compiled_only = pytest.mark.skipif(not ops.available(), reason="no compiled kernels")


@contextmanager
def without_kernels() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ops, "compiled", None)
        yield


@contextmanager
def slow_machine() -> Iterator[None]:
    """Advance the clock by 11 days at each reading."""
    ticks = count(0.0, 1e6)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(time, "perf_counter", lambda: next(ticks))
        yield
