"""What all tests share."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
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


@pytest.fixture
def random_points() -> Callable[..., np.ndarray]:
    """Points (n, 3) near an ellipsoid: most of them are corners of their hull. A round one has
    many rests, a long one has few and paths that cross up to four edges."""

    def make(seed: int, count: int, stretch: tuple[float, ...] = (1.0, 0.5, 2.0)) -> np.ndarray:
        rng = np.random.default_rng(seed)
        points = rng.normal(size=(count, 3))
        points /= np.linalg.norm(points, axis=1)[:, None]
        return points * rng.uniform(0.8, 1.2, size=(count, 1)) * stretch

    return make
