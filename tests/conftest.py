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


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--without-kernels",
        action="store_true",
        help="as on a machine where the compiled kernels could not be built",
    )


def pytest_configure(config: pytest.Config) -> None:
    if config.getoption("--without-kernels"):
        sys.modules["dicedesign_kernels"] = None  # type: ignore[assignment]


@pytest.fixture(scope="session")
def repository() -> Path:
    """The folder with recipes and README."""
    return ROOT
