"""One thread for tensors this small, and random bodies for every test of the design floor."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import torch

torch.set_num_threads(1)


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
