"""Ranking of concave dice, and checkpoints of a search."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dicedesign.concave.options import ConcaveOptions
from dicedesign.concave.result import ConcaveProgress, FilledHull, missing, rank
from dicedesign.concave.search import checkpoint_bytes, read_checkpoint
from dicedesign.errors import InputError
from dicedesign.results.parts import Draft
from dicedesign.results.result import Step

OPTIONS = ConcaveOptions(tolerance=0.01, apart_deg=40.0, margin_deg=10.0)
DIE = Draft(
    1, None, error=0.01, displacement=0.03, apart_deg=40.0, margin_deg=10.0, self_intersections=0
)
"""Die that just meets all limits."""


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("error", (0.01, 0.010001, 0.012, 0.5)),
        ("apart_deg", (40.0, 39.999, 20.0, 0.0)),
        ("margin_deg", (10.0, 9.999, 3.0, 0.0)),
        ("self_intersections", (0, 1, 7, 1000)),
    ],
)
def test_larger_violations_rank_lower(name: str, values: tuple[float, ...]) -> None:
    dice = [replace(DIE, **{name: value}) for value in values]
    violations = [missing(die, OPTIONS) for die in dice]
    assert violations[0] == 0.0
    assert (np.diff(violations) > 0.0).all()
    # Any converged die is better than a die with a violation, however small its displacement.
    far = replace(DIE, displacement=0.2)
    for die in dice[1:]:
        assert rank(far, OPTIONS) < rank(replace(die, displacement=0.001), OPTIONS)


def test_violations_add_up() -> None:
    changes: list[dict[str, float]] = [{"error": 0.03}, {"apart_deg": 10.0}, {"margin_deg": 5.0}]
    single = [missing(replace(DIE, **change), OPTIONS) for change in changes]
    np.testing.assert_allclose(single, [2.0, 0.75, 0.5])
    both = {name: value for change in changes for name, value in change.items()}
    assert missing(replace(DIE, **both), OPTIONS) == pytest.approx(sum(single))


def order(*changes: dict[str, float]) -> list[int]:
    """Places of dice from the best to the worst."""
    ranks = [rank(replace(DIE, **change), OPTIONS) for change in changes]
    return sorted(range(len(ranks)), key=ranks.__getitem__)


def test_angles_and_prints_outweigh_some_displacement() -> None:
    far = {"displacement": 0.04, "apart_deg": 90.0, "margin_deg": 30.0}
    assert order({"displacement": 0.01}, far, {}) == [0, 1, 2]
    # Prints beyond their limit do at no displacement, and a file that is wrong is worse still.
    assert order(
        {"prints": 0.029, "displacement": 0.01},
        {"prints": 0.01, "displacement": 0.035},
        {"prints": 0.029},
        {"prints": 0.01, "displacement": 0.5},
        {"prints": 0.031, "displacement": 0.001},
        {"prints": 1.0, "displacement": 0.001},
        {"error": 0.011},
    ) == list(range(7))
    # Prints that are good enough are equal.
    good = [replace(DIE, prints=prints) for prints in (0.001, 0.01)]
    assert rank(good[0], OPTIONS) == rank(good[1], OPTIONS)


SEARCH = {"target": "[0.5, 0.5]", "surface": "abc"}


def make_progress() -> ConcaveProgress:
    random = np.random.default_rng(5)
    draft = Draft(3, 0.1, 1e-300, 0.1 + 0.2, 100.0 / 3.0, 1.0 / 7.0, 7)
    arrays = (random.normal(size=shape) for shape in ((50, 3), (20, 3), 3, (2, 3)))
    steps = (
        Step(0, 0.1, 1.0 / 3.0, 0.25, stage="hull", attempt=3),
        Step(1, 0.2, 0.0, None, stage="fill", attempt=3),
    )
    return ConcaveProgress(5, 12.7, FilledHull(draft, *arrays), (draft,), steps)


def test_a_checkpoint_is_read_back_to_the_last_bit(tmp_path: Path) -> None:
    path, whole = tmp_path / "checkpoint.npz", make_progress()
    for given in (whole, replace(whole, best=None, tried=())):
        path.write_bytes(checkpoint_bytes(given, SEARCH))
        read = read_checkpoint(path, SEARCH)
        assert replace(read, best=None) == replace(given, best=None)
        assert (read.best is None) == (given.best is None)
        for name, value in vars(given.best).items() if given.best else ():
            np.testing.assert_array_equal(getattr(read.best, name), value)


def test_missing_damaged_and_foreign_checkpoints_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "checkpoint.npz"
    with pytest.raises(InputError, match="got none; run without --resume to start"):
        read_checkpoint(path, SEARCH)
    whole = checkpoint_bytes(make_progress(), SEARCH)
    path.write_bytes(whole)
    for kind in SEARCH:
        text = f"expected a checkpoint of this {kind}, got one of another"
        with pytest.raises(InputError, match=text):
            read_checkpoint(path, {**SEARCH, kind: "other"})
    others = []
    for content in ({"points": np.zeros(3)}, {"about": np.array([{}], dtype=object)}):
        np.savez(path, **content)
        others.append(path.read_bytes())
    for damaged in (b"", b"PK", whole[:700], whole[:-40], *others):
        path.write_bytes(damaged)
        with pytest.raises(InputError, match="got a file that cannot be read as one"):
            read_checkpoint(path, SEARCH)
