"""Tests with and without the compiled kernels.

`@compiled_only` marks tests that need kernels. `without_kernels()`, also a decorator,
disables them. `pytest --without-kernels` runs all tests without kernels.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from dicedesign.cli.options import MISSING_KERNELS
from dicedesign.kernels import ops

compiled_only = pytest.mark.skipif(not ops.available(), reason="no compiled kernels")


def usual_notes() -> str:
    """Notes of a long command on stderr that reports nothing else."""
    return "" if ops.available() else f"note: {MISSING_KERNELS}\n"


@contextmanager
def without_kernels() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ops, "compiled", None)
        yield
