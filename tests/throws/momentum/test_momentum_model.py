"""Momentum models in files: what is refused, and that all others give odds."""

from __future__ import annotations

import copy
import json
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
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
from dicedesign.throws.momentum_model import (
    NUMBERS,
    RANGES,
    WEIGHTS,
    MomentumModel,
    general_model,
    general_model_of,
    momentum_model,
    plain_model,
)
from dicedesign.throws.momentum_odds import hull_odds
from dicedesign.throws.table_terms import GENERAL, TABLE_TERMS, dimensionless, table_terms
from dicedesign.throws.tables import Table, table_named

PLAIN = plain_model(general_model())
UNITS = len(PLAIN["carries"]["outward"])
TABLE = table_named("board-game")


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
        ("numbers.0.0", 1e308, "numbers: .* got 1e.308"),
        ("numbers.0.0", float("nan"), "numbers: .* got nan"),
        ("numbers.0.0", 10**400, "numbers: .* got "),
        ("numbers", "1.5", "numbers: .* got '1.5'"),
        ("numbers", True, "numbers: .* got True"),
        ("numbers", [1.0], rf"numbers: .* \({TABLE_TERMS}, 3\), got \(1,\)"),
        ("numbers", None, "numbers: .* got None"),
        ("range", None, "range: .* got NoneType"),
        ("range.spin", None, "range: .*restitution.*, got restitution, friction, height, speed;"),
        ("range.spin", [1.0], r"range.spin: .* \(2,\), got \(1,\)"),
        ("range.spin", [2.0, 1.0], "range.spin: expected the lower limit first, got 2, 1"),
        ("range.friction", [0.0, 1.0], "range.friction: .* got 0"),
        ("range.restitution", [0.0, 1.0], "range.restitution: .* got 1"),
        ("transitions", None, "transitions: .* got NoneType"),
        ("transitions", 1, "transitions: .* got int"),
        ("transitions.bias", None, "transitions: .*bias.*, got mean, deviation"),
        ("transitions.more", [1.0], "transitions: .* got .* more"),
        ("transitions.deviation.3", 0.0, "transitions.deviation: .* got 0"),
        ("transitions.deviation.3", 1e-300, "transitions.deviation: .* got 1e-300"),
        ("transitions.linear.2.1", 1e300, r"transitions.linear: .* got 1e\+300"),
        ("transitions.linear.2.1", float("-inf"), "transitions.linear: .* got -inf"),
        ("transitions.linear.2", [1.0], "transitions.linear: .* rows of the same length"),
        ("carries.linear.0", None, r"carries.linear: .* \(14, 3\), got \(13, 3\)"),
        ("carries.outward.0", None, rf"carries.inward: .* \(14, {UNITS - 1}\), got"),
        ("carries.outward", [], rf"carries.inward: .* \(14, 0\), got \(14, {UNITS}\)"),
        ("carries.outward", 1.0, r"carries.inward: .* \(14, 0\), got"),
    ],
)
def test_a_model_that_is_none_is_refused(path: str, value: object, named: str) -> None:
    # As it comes from a file.
    plain = json.loads(json.dumps(changed(path, value)))
    with pytest.raises(InputError, match=f"^momentum model: {named}"):
        general_model_of(plain)


def test_models_are_written_as_they_were_read() -> None:
    assert plain_model(general_model_of(PLAIN)) == PLAIN


def test_what_training_led_far_away_is_kept_within_bounds() -> None:
    general = general_model()
    numbers = np.zeros((TABLE_TERMS, 3))
    numbers[0] = -1e9, -3.0, 1e9
    far = general_model_of(plain_model(replace(general, numbers=numbers)))
    assert far.numbers[0].tolist() == [-1e3, -3.0, 1e3]
    model = MomentumModel.of(far, TABLE)
    assert [model.hot, model.cooling, model.carry_barrier] == [-20.0, 0.0, 100.0]
    assert (NUMBERS[:, 0] <= NUMBERS[:, 1]).all()


def test_a_table_counts_by_numbers_that_have_no_unit() -> None:
    """Dice of twice the size fall in the same way from twice the height, and so on."""
    table = Table("x", 0.5, 0.3, 0.2, 0.7, 20.0, size=0.02)
    root = np.sqrt(2.0)
    double = Table("y", 0.5, 0.3, 0.4, 0.7 * root, 20.0 / root, size=0.04)
    np.testing.assert_allclose(dimensionless(table), dimensionless(double), rtol=1e-12)
    speed = 0.7 / np.sqrt(9.81 * 0.02)
    np.testing.assert_allclose(dimensionless(table)[:4], [0.5, 0.3, 10.0, speed], rtol=1e-12)
    spread = replace(table, height=(0.1, 0.3), speed=(0.0, 1.4), spin=(10.0, 30.0))
    np.testing.assert_allclose(dimensionless(spread), dimensionless(table), rtol=1e-12)


def test_terms_are_all_quadratic_polynomials_of_the_scaled_numbers() -> None:
    rng = np.random.default_rng(0)
    rows = np.array([table_terms(GENERAL.drawn(TABLE, rng)) for _ in range(60)])
    assert np.linalg.matrix_rank(rows) == TABLE_TERMS == 21
    numbers = rows[:, 1:6]
    assert np.abs(numbers).max() < 1.7
    weights = rng.normal(size=(5, 5))
    wanted = 1.0 + numbers @ weights[0] + np.einsum("ni,ij,nj->n", numbers, weights, numbers)
    fitted = rows @ np.linalg.lstsq(rows, wanted, rcond=None)[0]
    np.testing.assert_allclose(fitted, wanted, atol=1e-9)


def test_a_model_of_another_table_is_that_which_the_file_gives() -> None:
    other = table_named("hard-wood")
    model, direct = momentum_model("board-game"), momentum_model("hard-wood")
    assert model is not None
    assert direct is not None
    moved = model.on(other)
    # The third one has two rests, which all tables make even.
    for body in BODIES[:2]:
        odds = hull_odds(*body, moved)
        np.testing.assert_array_equal(odds, hull_odds(*body, direct))
        assert np.abs(odds - hull_odds(*body, model)).max() > 1e-3
        np.testing.assert_array_equal(hull_odds(*body, moved.on(TABLE)), hull_odds(*body, model))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"restitution": 0.9}, "restitution of 0 to 0.85 for dice of 25 mm, .*, got 0.9; make"),
        ({"friction": 0.04}, "friction of 0.05 to 1.5 for dice .*, got 0.04; make a model of its"),
        ({"height": 0.9}, "height of 0.03 to 0.8 m for dice of 25 mm, .*, got 0.9; make a model"),
        ({"height": 0.7, "size": 0.02}, "height of 0.024 to 0.64 m for dice of 20 mm"),
        ({"speed": 4.0}, "speed of 0 to 2.97 m/s for dice of 25 mm, .*, got 4; make a model of"),
        (
            {"spin": 200.0},
            "spin of 0 to 178 rad/s for dice of 25 mm, .* got 200; .* benchmarks train",
        ),
    ],
)
def test_a_table_beyond_the_range_is_refused(
    changes: dict[str, float], message: str, tmp_path: Path
) -> None:
    path = tmp_path / "mine.json"
    table = Table("mine", 0.5, 0.5, 0.2, 0.5, 20.0)
    path.write_text(json.dumps(table.as_dict()))
    model = momentum_model(str(path))
    assert model is not None
    path.write_text(json.dumps({**table.as_dict(), **changes}))
    with pytest.raises(InputError, match=f"^table mine: expected a {message}"):
        momentum_model(str(path))
    far = replace(table, **changes)
    near = GENERAL.nearest(far)
    (name, *_) = changes
    assert getattr(near, name) != getattr(far, name)
    assert replace(near, **{name: getattr(far, name)}) == far
    model.on(near)


def test_a_model_of_the_table_s_own_goes_before_that_of_all(tmp_path: Path) -> None:
    table = Table("mine", 0.5, 0.5, 0.2, 0.5, 20.0)
    path = tmp_path / "mine.json"
    own = copy.deepcopy(PLAIN)
    own["range"]["spin"] = [0.0, 1.5]
    own["numbers"][0][0] += 0.5
    path.write_text(json.dumps({**table.as_dict(), "momentum": own}))
    model = momentum_model(str(path))
    assert model is not None
    assert model.hot == pytest.approx(MomentumModel.of(general_model(), table).hot + 0.5)
    with pytest.raises(InputError, match=r"spin of 0 to 29\.7 rad/s"):
        model.on(replace(table, spin=30.0))


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

    return {key: PLAIN[key] if key == "range" else drawn(key, PLAIN[key]) for key in PLAIN}


# A model holds a thousand numbers.
@settings(suppress_health_check=[HealthCheck.too_slow])
@given(models(), st.integers(0, 2**32))
def test_every_model_within_its_ranges_gives_odds(plain: dict[str, Any], seed: int) -> None:
    table = GENERAL.drawn(TABLE, np.random.default_rng(seed))
    model = MomentumModel.of(general_model_of(plain), table)
    for way in (nullcontext, without_kernels):
        for body in BODIES:
            with way(), np.errstate(over="raise", invalid="raise", divide="raise"):
                odds = hull_odds(*body, model)
            assert np.isfinite(odds).all()
            assert odds.min() > -1e-12
            assert odds.sum() == pytest.approx(1.0, abs=1e-9)
