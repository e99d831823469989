"""Momentum models in files: what is refused, and that all others give odds."""

from __future__ import annotations

import copy
import json
from contextlib import nullcontext
from typing import Any

import numpy as np
import pytest
from common.kernels import without_kernels
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.solid import solid_inertia
from dicedesign.rest.poses import rest_poses
from dicedesign.throws.momentum.momentum_model import (
    RANGES,
    WEIGHTS,
    MomentumModel,
    model_of,
    plain_model,
)
from dicedesign.throws.momentum.momentum_odds import hull_odds
from dicedesign.throws.tables import TABLE_NAMES, table_entries

PLAIN = table_entries("board-game")["momentum"]


def changed(path: str, value: object) -> dict[str, Any]:
    """A good model with another entry; a number in a path counts rows, and None takes it out."""
    plain = copy.deepcopy(PLAIN)
    *way, last = (int(step) if step.isdigit() else step for step in path.split("."))
    part: Any = plain
    for step in way:
        part = part[step]
    if value is None:
        del part[last]
    else:
        part[last] = value
    return plain


@pytest.mark.parametrize(
    ("path", "value", "named"),
    [
        ("hot", 1e308, "hot: .* got 1e.308"),
        ("hot", float("nan"), "hot: .* got nan"),
        ("hot", 10**400, "hot: .* got 1000"),
        ("hot", "1.5", "hot: .* got '1.5'"),
        ("hot", True, "hot: .* got True"),
        ("hot", [1.0], r"hot: .* got \(1,\)"),
        ("hot", None, "hot: .* got None"),
        ("cooling", -1.0, "cooling: .* got -1"),
        ("carry_barrier", -1.0, "carry_barrier: .* got -1"),
        ("carry_barrier", 1e308, r"carry_barrier: .* got 1e\+308"),
        ("passes", None, "passes: .* got NoneType"),
        ("passes", 1, "passes: .* got int"),
        ("passes.bias", None, "passes: .*bias.*, got mean, deviation"),
        ("passes.more", [1.0], "passes: .* got .* more"),
        ("passes.deviation.3", 0.0, "passes.deviation: .* got 0"),
        ("passes.deviation.3", 1e-300, "passes.deviation: .* got 1e-300"),
        ("passes.linear.2.1", 1e300, r"passes.linear: .* got 1e\+300"),
        ("passes.linear.2.1", float("-inf"), "passes.linear: .* got -inf"),
        ("passes.linear.2", [1.0], "passes.linear: .* rows of the same length"),
        ("carries.linear.0", None, r"carries.linear: .* \(14, 3\), got \(13, 3\)"),
        ("carries.shift.0", None, r"carries.inward: .* \(14, 11\), got \(14, 12\)"),
        ("carries.shift", [], r"carries.inward: .* \(14, 0\), got \(14, 12\)"),
        ("carries.outward", 1.0, r"carries.outward: .* got \(\)"),
        ("slopes", [], "slopes: .* got list"),
        ("slopes.numbers", [0.0, 0.0], r"slopes.numbers: .* \(3,\), got \(2,\)"),
        ("slopes.numbers.0", 1e9, r"slopes.numbers: .* got 1e\+09"),
        ("slopes.passes.0", None, r"slopes.passes: .* \(30, 4\), got \(29, 4\)"),
    ],
)
def test_a_model_that_is_none_is_refused(path: str, value: object, named: str) -> None:
    # As it comes from a file.
    plain = json.loads(json.dumps(changed(path, value)))
    with pytest.raises(InputError, match=f"^momentum model: {named}"):
        model_of(plain)


@pytest.mark.parametrize("name", [name for name in TABLE_NAMES if name != "carpet"])
def test_models_are_written_as_they_were_read(name: str) -> None:
    plain = table_entries(name)["momentum"]
    again = plain_model(model_of(plain))
    assert again == {key: plain[key] for key in again}


def test_a_model_that_training_led_far_away_can_be_read() -> None:
    model = model_of(PLAIN)
    far = MomentumModel(-1e9, -3.0, 1e9, model.transitions, model.carries, model.slopes)
    near = model_of(plain_model(far))
    assert (near.hot, near.cooling, near.carry_barrier) == (
        RANGES["hot"][0],
        RANGES["cooling"][0],
        RANGES["carry_barrier"][1],
    )


def _hull_and_rests(seed: int, count: int, flatness: float) -> tuple[Any, ...]:
    points = np.random.default_rng(seed).normal(size=(count, 3)) * [1.0, 1.0, flatness]
    hull = convex_hull(points)
    side = rest_poses(points).basins[0]
    odds = side.areas / (4.0 * np.pi)
    return hull, side.paths, hull.centroid, solid_inertia(hull.vertices, hull.triangles), odds


BODIES = [_hull_and_rests(1, 8, 1.0), _hull_and_rests(2, 30, 1.0), _hull_and_rests(3, 12, 0.05)]


def _numbers(name: str) -> st.SearchStrategy[float]:
    least, most = RANGES.get(name, WEIGHTS)
    if name == "deviation":
        return st.floats(np.log10(least), np.log10(most)).map(
            lambda power: min(max(10.0**power, least), most)
        )
    return st.one_of(st.sampled_from([least, most]), st.floats(least, most))


@st.composite
def models(draw: st.DrawFn) -> dict[str, Any]:
    """Any model within its ranges: each array has some few numbers, at random places."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))

    def drawn(name: str, part: Any) -> Any:
        if isinstance(part, dict):
            return {key: drawn(key, value) for key, value in part.items()}
        some = draw(st.lists(_numbers(name), min_size=1, max_size=4))
        return rng.choice(some, size=np.shape(part)).tolist()

    return {key: drawn(key, PLAIN[key]) for key in PLAIN if key != "table"}


# A model holds a thousand numbers.
@settings(suppress_health_check=[HealthCheck.too_slow])
@given(models(), st.sampled_from([0.0, 0.2, -0.2]))
def test_every_model_within_its_ranges_gives_odds(plain: dict[str, Any], change: float) -> None:
    model = model_of(plain).at(change)
    for way in (nullcontext, without_kernels):
        for body in BODIES:
            with way(), np.errstate(over="raise", invalid="raise", divide="raise"):
                odds = hull_odds(*body, model)
            assert np.isfinite(odds).all()
            assert odds.min() > -1e-12
            assert odds.sum() == pytest.approx(1.0, abs=1e-9)
