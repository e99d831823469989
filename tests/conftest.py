"""What all tests share."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

# Small tensors and matrices: threads only get into each other's way.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))


@pytest.fixture(scope="session")
def repository() -> Path:
    """The folder with recipes and README."""
    return ROOT
