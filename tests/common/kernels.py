"""Tests with and without the compiled kernels.

`@compiled_only` marks tests that need kernels. `with without_kernels():` does what is inside as on
a machine where they could not be built; as a decorator, `@without_kernels()` does a whole test so.
`pytest --without-kernels` runs all tests that way.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from dicedesign.cli.options import MISSING_KERNELS
from dicedesign.kernels import ops

compiled_only = pytest.mark.skipif(not ops.available(), reason="no compiled kernels")


def usual_notes() -> str:
    """What a long command says on stderr that has nothing to say."""
    return "" if ops.available() else f"note: {MISSING_KERNELS}\n"


@contextmanager
def without_kernels() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ops, "compiled", None)
        yield
