"""What counts for one die over another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dicedesign.concave.options import ConcaveOptions
from dicedesign.concave.result import FilledHull, doubts, missing, rank

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


def test_nothing_is_missing_at_the_limits() -> None:
    assert missing(die(), OPTIONS) == 0.0
    assert missing(die(error=0.0, apart_deg=170.0, margin_deg=80.0), OPTIONS) == 0.0


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


def test_angles_that_are_not_asked_for_are_not_missed() -> None:
    free = replace(OPTIONS, apart_deg=0.0, margin_deg=0.0)
    assert missing(die(apart_deg=0.0, margin_deg=0.0), free) == 0.0
    assert doubts(0.0, 0.0, free) == 0.0


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


def test_doubts_fall_from_one_for_each_angle_to_none() -> None:
    assert doubts(40.0, 10.0, OPTIONS) == 2.0
    assert doubts(40.0, 80.0, OPTIONS) == 1.0
    assert doubts(170.0, 10.0, OPTIONS) == 1.0
    assert doubts(170.0, 80.0, OPTIONS) == 0.0
    falling = [doubts(apart, 80.0, OPTIONS) for apart in np.linspace(40.0, 100.0, 13)]
    assert (np.diff(falling) <= 0.0).all()
    assert len(set(falling)) > 3
    # Beyond what will do, below it, no further doubts: those lack something.
    assert doubts(10.0, 80.0, OPTIONS) == 1.0
