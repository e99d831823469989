"""Many throws of one body, by whatever number of workers."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from common.inline_executor import Lossy
from common.kernels import compiled_only
from common.thrown import random_body

from dicedesign.runtime.workers import local_workers
from dicedesign.throws.rigid_body import PAPER_DIRECTIONS
from dicedesign.throws.simulation import simulate
from dicedesign.throws.tables import table_named

BOARD, CARPET = table_named("board-game"), table_named("carpet")


@compiled_only
def test_the_same_in_any_number_of_workers() -> None:
    body, _ = random_body(1)
    alone = simulate(body, CARPET, 1100, 5)
    with local_workers(2) as workers:
        together = simulate(body, CARPET, 1100, 5, workers=workers)
    np.testing.assert_array_equal(together.outcomes, alone.outcomes)
    with ThreadPoolExecutor(3) as workers:
        together = simulate(body, CARPET, 1100, 5, workers=workers)
    np.testing.assert_array_equal(together.outcomes, alone.outcomes)
    assert not np.array_equal(simulate(body, CARPET, 1100, 6).outcomes, alone.outcomes)


@compiled_only
def test_what_lost_workers_left_is_thrown_again() -> None:
    body, _ = random_body(1)
    lossy = Lossy(lambda count: count in (1, 2, 3))
    np.testing.assert_array_equal(
        simulate(body, CARPET, 600, workers=lossy).outcomes, simulate(body, CARPET, 600).outcomes
    )


@compiled_only
def test_the_papers_orientations() -> None:
    body, poses = random_body(1)
    throws = simulate(body, CARPET, PAPER_DIRECTIONS, orientations="icosahedron")
    assert throws.frequencies.sum() == pytest.approx(1.0)
    # A grid is better than chance.
    errors = throws.frequencies - poses.probabilities
    chance = np.sqrt(poses.probabilities * (1.0 - poses.probabilities) / PAPER_DIRECTIONS)
    assert np.sqrt((errors**2).mean()) < 0.7 * np.sqrt((chance**2).mean())
