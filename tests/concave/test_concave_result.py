"""What counts for one die over another, and what is kept of a search."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dicedesign.concave.options import ConcaveOptions
from dicedesign.concave.result import (
    ConcaveProgress,
    ConcaveStep,
    FilledHull,
    missing,
    rank,
)
from dicedesign.concave.search import checkpoint_bytes, read_checkpoint
from dicedesign.errors import InputError
from dicedesign.results.parts import Draft

OPTIONS = ConcaveOptions(tolerance=0.01, apart_deg=40.0, margin_deg=10.0)


def die(**changes: float) -> FilledHull:
    """Just as wanted."""
    made = FilledHull(
        attempt=1,
        points=np.zeros((4, 3)),
        hull_points=np.zeros((4, 3)),
        center_of_mass=np.zeros(3),
        directions=np.zeros((2, 3)),
        error=0.01,
        displacement=0.03,
        apart_deg=40.0,
        margin_deg=10.0,
        self_intersections=0,
    )
    return replace(made, **changes)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("error", (0.01, 0.010001, 0.012, 0.5)),
        ("apart_deg", (40.0, 39.999, 20.0, 0.0)),
        ("margin_deg", (10.0, 9.999, 3.0, 0.0)),
        ("self_intersections", (0, 1, 7, 1000)),
    ],
)
def test_what_is_farther_off_lacks_more(name: str, values: tuple[float, ...]) -> None:
    found = [missing(die(**{name: value}), OPTIONS) for value in values]
    assert found[0] == 0.0
    assert (np.diff(found) > 0.0).all()


def test_what_is_off_in_several_ways_lacks_all_of_it() -> None:
    ways: list[dict[str, float]] = [{"error": 0.03}, {"apart_deg": 10.0}, {"margin_deg": 5.0}]
    alone = [missing(die(**way), OPTIONS) for way in ways]
    np.testing.assert_allclose(alone, [2.0, 0.75, 0.5])
    together = {name: value for way in ways for name, value in way.items()}
    assert missing(die(**together), OPTIONS) == pytest.approx(sum(alone))


def test_a_die_as_wanted_is_better_than_a_nearer_one_that_is_not() -> None:
    far = die(displacement=0.2)
    for change in (
        {"error": 0.0101},
        {"apart_deg": 39.9},
        {"margin_deg": 9.9},
        {"self_intersections": 1},
    ):
        near = die(displacement=0.001, **change)
        assert rank(far, OPTIONS) < rank(near, OPTIONS)
    assert rank(die(displacement=0.02), OPTIONS) < rank(far, OPTIONS)
    # Neither is as wanted: the one that lacks less.
    assert rank(die(apart_deg=30.0, displacement=0.2), OPTIONS) < rank(die(apart_deg=20.0), OPTIONS)


def test_of_dice_as_wanted_the_one_that_is_easier_to_read_may_be_farther_off() -> None:
    hard, easy = die(displacement=0.03), die(displacement=0.04, apart_deg=90.0, margin_deg=30.0)
    assert rank(easy, OPTIONS) < rank(hard, OPTIONS)
    assert rank(die(displacement=0.01), OPTIONS) < rank(easy, OPTIONS)


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
