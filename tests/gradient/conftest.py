"""With the compiled kernels and without."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

import pytest
from common.kernels import without_kernels

WAYS = {"kernels": nullcontext, "without kernels": without_kernels}


@pytest.fixture(params=WAYS)
def way(request: pytest.FixtureRequest) -> Callable[[], AbstractContextManager[None]]:
    return WAYS[request.param]
