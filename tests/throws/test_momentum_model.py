"""Momentum models: files, ranges, tables that they know."""

from __future__ import annotations

import copy
import json
from contextlib import nullcontext
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from common.kernels import compiled_only, without_kernels
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from benchmarks.training.random_dice import RandomDie, random_die
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.solid import solid_inertia
from dicedesign.rest.poses import rest_poses
from dicedesign.throws.distances import total_variation
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
from dicedesign.throws.momentum_odds import hull_odds, momentum_odds
from dicedesign.throws.simulation import simulate
from dicedesign.throws.table_terms import (
    CHANGES,
    GENERAL,
    MOST_OTHERS,
    TABLE_TERMS,
    dimensionless,
    other_tables,
    scaled,
)
from dicedesign.throws.tables import TABLE_NAMES, Table, table_named

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
@settings(suppress_health_check=[HealthCheck.too_slow], max_examples=15)
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


MINE = Table("mine", 0.5, 0.5, 0.2, 0.5, 20.0)


def test_without_a_posterior_they_are_livelier_and_duller() -> None:
    assert [one.restitution for one in other_tables(MINE)] == pytest.approx([0.6, 0.4])
    assert other_tables(replace(MINE, restitution=0.0)) == ()


def test_few_of_a_posterior_are_near_all_the_others() -> None:
    """Nearly as near as the best choice of all."""
    rng = np.random.default_rng(0)
    posterior = [GENERAL.drawn(MINE, rng) for _ in range(12)]
    numbers = np.array([scaled(dimensionless(one)) for one in posterior])
    numbers /= numbers.std(axis=0)
    apart = np.linalg.norm(numbers[:, None] - numbers, axis=2)

    def distance(chosen: tuple[int, ...]) -> float:
        return float(apart[list(chosen)].min(axis=0).sum())

    found = other_tables(MINE, posterior)
    best = min(distance(chosen) for chosen in combinations(range(12), MOST_OTHERS))
    assert distance(tuple(posterior.index(one) for one in found)) < 1.15 * best
    assert other_tables(MINE, posterior[:2]) in (tuple(posterior[:2]), tuple(posterior[1::-1]))


pytestmark = compiled_only


@pytest.fixture(scope="module")
def dice() -> list[RandomDie]:
    """The models are made of dice of seed 0."""
    return [random_die(number, 1, (7, 13)) for number in range(4, 10)]


@pytest.mark.parametrize("name", [name for name in TABLE_NAMES if name != "carpet"])
def test_odds_are_nearer_to_throws_than_those_without_momentum(
    dice: list[RandomDie], name: str
) -> None:
    apart = []
    for die in dice:
        throws = simulate(die.body, table_named(name), 1000, 3)
        frequencies = throws.counts / throws.counts.sum()
        found = momentum_odds(die.poses, die.body, momentum_model(name))
        apart.append(
            [total_variation(frequencies, odds) for odds in (die.poses.probabilities, found)]
        )
    geometric, momentum = np.mean(apart, axis=0)
    assert geometric > 0.1
    # The model of paper, whose drops are least like the others', is the least of them.
    assert momentum < (0.85 if name == "paper" else 0.45) * geometric


def test_the_model_knows_what_a_livelier_table_does(dice: list[RandomDie]) -> None:
    table, model = table_named("board-game"), momentum_model("board-game")
    assert model is not None
    seen, expected = [], []
    for die in dice[:4]:
        livelier = [table.livelier(change) for change in CHANGES]
        throws = [simulate(die.body, one, 1000, 5) for one in livelier]
        up, down = (one.counts / one.counts.sum() for one in throws)
        seen.append(up - down)
        up, down = (momentum_odds(die.poses, die.body, model.on(one)) for one in livelier)
        expected.append(up - down)
    assert np.corrcoef(np.concatenate(seen), np.concatenate(expected))[0, 1] > 0.5
