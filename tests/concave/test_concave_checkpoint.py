"""What is kept of a search, and what is not taken for it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dicedesign.concave.result import ConcaveProgress, ConcaveStep, FilledHull
from dicedesign.concave.search import checkpoint_bytes, read_checkpoint
from dicedesign.errors import InputError
from dicedesign.results.parts import Draft

SEARCH = {"target": "[0.5, 0.5]", "surface": "abc"}


def progress(with_best: bool) -> ConcaveProgress:
    random = np.random.default_rng(5)
    best = FilledHull(
        attempt=3,
        points=random.normal(size=(50, 3)),
        hull_points=random.normal(size=(20, 3)),
        center_of_mass=random.normal(size=3),
        directions=random.normal(size=(2, 3)),
        error=1e-300,
        displacement=0.1 + 0.2,
        apart_deg=100.0 / 3.0,
        margin_deg=1.0 / 7.0,
        self_intersections=7,
    )
    steps = (ConcaveStep(3, "hull", 0.1, 1.0 / 3.0, 0.25), ConcaveStep(3, "fill", 0.2, 0.0, None))
    tried = Draft(3, 0.1, 1e-300, 0.1 + 0.2, 100.0 / 3.0, 1.0 / 7.0, 7)
    return ConcaveProgress(
        5, 12.7, best if with_best else None, (tried,) if with_best else (), steps
    )


@pytest.mark.parametrize("with_best", [True, False])
def test_everything_comes_back_to_the_last_bit(with_best: bool, tmp_path: Path) -> None:
    path, given = tmp_path / "checkpoint.npz", progress(with_best)
    path.write_bytes(checkpoint_bytes(given, SEARCH))
    found = read_checkpoint(path, SEARCH)
    assert (found.attempts, found.seconds, found.history) == (5, 12.7, given.history)
    assert found.tried == given.tried
    assert (found.best is not None) == with_best
    if given.best is not None:
        for name, value in vars(given.best).items():
            np.testing.assert_array_equal(getattr(found.best, name), value)


@pytest.mark.parametrize("kind", sorted(SEARCH))
def test_that_of_another_search_is_refused(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "checkpoint.npz"
    path.write_bytes(checkpoint_bytes(progress(True), SEARCH))
    with pytest.raises(InputError, match=f"expected a checkpoint of this {kind}, got one of anoth"):
        read_checkpoint(path, {**SEARCH, kind: "other"})


def test_a_missing_or_damaged_one_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "checkpoint.npz"
    with pytest.raises(InputError, match="got none; run without --resume to begin"):
        read_checkpoint(path, SEARCH)
    whole = checkpoint_bytes(progress(True), SEARCH)
    others = []
    for content in ({"points": np.zeros(3)}, {"about": np.array([{}], dtype=object)}):
        np.savez(path, **content)
        others.append(path.read_bytes())
    for damaged in (b"", b"PK", whole[:700], whole[:-40], *others):
        path.write_bytes(damaged)
        with pytest.raises(InputError, match="got a file that cannot be read as one"):
            read_checkpoint(path, SEARCH)
