"""Momentum models: files, ranges, and accuracy on several tables."""

from __future__ import annotations

import copy
import json
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from common.kernels import compiled_only, without_kernels

from benchmarks.random_dice import RandomDie, random_die
from benchmarks.train import GENERAL, draw_table, plain_model
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.triangles import solid_inertia
from dicedesign.rest.poses import rest_poses
from dicedesign.throws.distances import total_variation
from dicedesign.throws.momentum_model import (
    RANGES,
    TABLE_TERMS,
    WEIGHTS,
    MomentumModel,
    dimensionless,
    general_model,
    general_model_of,
    momentum_model,
)
from dicedesign.throws.momentum_probabilities import hull_probabilities, momentum_probabilities
from dicedesign.throws.simulation import simulate
from dicedesign.throws.tables import TABLE_NAMES, Table, load_table, mixture_tables

PLAIN = plain_model(general_model())
UNITS = len(PLAIN["carries"]["outward"])
TABLE = load_table("board-game")


def change_entry(path: str, value: object) -> dict[str, Any]:
    """Valid model with another entry; a number in a path is a row, and None removes the entry."""
    plain = copy.deepcopy(PLAIN)
    *keys, last = (int(step) if step.isdigit() else step for step in path.split("."))
    part: Any = plain
    for key in keys:
        part = part[key]
    if value is None:
        del part[last]
    else:
        part[last] = value
    return plain


@pytest.mark.parametrize(
    ("path", "value", "named"),
    [
        ("numbers.0.0", 1e308, r"numbers: expected numbers of shape \(21, 3\) from -1000 to 1000"),
        ("numbers", [1.0], rf"numbers: .* shape \({TABLE_TERMS}, 3\) .* got \[1.0\]"),
        ("range.spin", None, "range.spin: .* got None"),
        ("range.restitution", [0.0, 1.0], "range.restitution: .* got .0.0, 1.0."),
        ("transitions", None, "transitions.mean: .* got None"),
        ("transitions.deviation.3", 1e-300, "transitions.deviation: .* from 1e-09 to 1000"),
        ("carries.linear.0", None, r"carries.linear: .* shape \(14, 3\)"),
        ("carries.outward.0", None, rf"carries.inward: .* shape \(14, {UNITS - 1}\)"),
    ],
)
def test_invalid_models_are_refused(path: str, value: object, named: str) -> None:
    plain = json.loads(json.dumps(change_entry(path, value)))
    with pytest.raises(InputError, match=f"^momentum model: {named}"):
        general_model_of(plain)


def test_dimensionless_numbers() -> None:
    """Dice of twice the size fall equally from twice the height, and so on."""
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
        ({"restitution": 0.95}, "restitution of 0 to 0.9 for dice of 25 mm, .*, got 0.95; make"),
        ({"height": 0.7, "size": 0.02}, "height of 0.024 to 0.64 m for dice of 20 mm"),
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


def test_a_table_s_own_model_takes_precedence(tmp_path: Path) -> None:
    table = Table("mine", 0.5, 0.5, 0.2, 0.5, 20.0)
    path = tmp_path / "mine.json"
    own = copy.deepcopy(PLAIN)
    own["range"]["spin"] = [0.0, 1.5]
    own["numbers"][0][0] += 0.5
    path.write_text(json.dumps({**table.as_dict(), "momentum": own}))
    model = momentum_model(str(path))
    assert model is not None
    (mine,) = model.models
    assert mine.hot == pytest.approx(MomentumModel.of(general_model(), table).hot + 0.5)
    with pytest.raises(InputError, match=r"spin of 0 to 29\.7 rad/s"):
        MomentumModel.of(mine.general, replace(table, spin=30.0))


def _hull_and_rests(seed: int, count: int, flatness: float) -> tuple[Any, ...]:
    points = np.random.default_rng(seed).normal(size=(count, 3)) * [1.0, 1.0, flatness]
    hull = convex_hull(points)
    side = rest_poses(points).basins[0]
    probabilities = side.areas / (4.0 * np.pi)
    return (
        hull,
        side.paths,
        hull.centroid,
        solid_inertia(hull.vertices, hull.triangles),
        probabilities,
    )


BODIES = [_hull_and_rests(1, 8, 1.0), _hull_and_rests(2, 30, 1.0), _hull_and_rests(3, 12, 0.05)]


@pytest.mark.parametrize("seed", range(15))
def test_every_model_within_its_ranges_gives_probabilities(seed: int) -> None:
    """Each array has a few different numbers in random places, such as the ends of its range."""
    rng = np.random.default_rng(seed)

    def draw(name: str, part: Any) -> Any:
        if isinstance(part, dict):
            return {key: draw(key, value) for key, value in part.items()}
        least, most = RANGES.get(name, WEIGHTS)
        between = np.geomspace if name == "deviation" else np.linspace
        values = rng.choice([*between(least, most, 7), 0.5], size=rng.integers(1, 5))
        return rng.choice(values, size=np.shape(part)).tolist()

    plain = {key: PLAIN[key] if key == "range" else draw(key, PLAIN[key]) for key in PLAIN}
    table = draw_table(GENERAL, TABLE, rng)
    model = MomentumModel.of(general_model_of(plain), table)
    for context in (nullcontext, without_kernels):
        for body in BODIES:
            with context(), np.errstate(over="raise", invalid="raise", divide="raise"):
                probabilities = hull_probabilities(*body, model)
            assert np.isfinite(probabilities).all()
            assert probabilities.min() > -1e-12
            assert probabilities.sum() == pytest.approx(1.0, abs=1e-9)


pytestmark = compiled_only


@pytest.fixture(scope="module")
def dice() -> list[RandomDie]:
    """Random dice of another seed than the training dice."""
    return [random_die(number, 1, (7, 13)) for number in range(4, 10)]


@pytest.mark.parametrize("name", [name for name in TABLE_NAMES if name != "carpet"])
def test_probabilities_are_nearer_to_throws_than_those_without_momentum(
    dice: list[RandomDie], name: str
) -> None:
    apart = []
    for die in dice:
        throws = simulate(die.body, mixture_tables(name), 4000, 3)
        frequencies = throws.counts / throws.counts.sum()
        momentum = momentum_probabilities(die.poses, die.body, momentum_model(name))
        apart.append(
            [
                total_variation(frequencies, probabilities)
                for probabilities in (die.poses.probabilities, momentum)
            ]
        )
    geometric, momentum = np.mean(apart, axis=0)
    assert geometric > 0.1
    # The model of paper, whose drops differ most from the others, is the least accurate.
    assert momentum < (0.85 if name == "paper" else 0.45) * geometric


def test_the_model_predicts_the_effect_of_a_livelier_table(dice: list[RandomDie]) -> None:
    table, mixture = load_table("board-game"), momentum_model("board-game")
    assert mixture is not None
    simulated, predicted = [], []
    for die in dice[:4]:
        pair = [replace(table, restitution=restitution) for restitution in (0.8, 0.2)]
        throws = [simulate(die.body, one, 4000, 5) for one in pair]
        up, down = (one.counts / one.counts.sum() for one in throws)
        simulated.append(up - down)
        up, down = (momentum_probabilities(die.poses, die.body, mixture.near(one)) for one in pair)
        predicted.append(up - down)
    assert np.corrcoef(np.concatenate(simulated), np.concatenate(predicted))[0, 1] > 0.5


def test_few_tables_represent_a_mixture(dice: list[RandomDie]) -> None:
    """Against the mean over all of its tables."""
    tables, mixture = mixture_tables("board-game"), momentum_model("board-game")
    assert mixture is not None
    assert len(mixture.models) == 4
    assert mixture.weights.sum() == pytest.approx(1.0)
    gaps, spreads = [], []
    for die in dice:
        each = [momentum_probabilities(die.poses, die.body, mixture.near(one)) for one in tables]
        few = momentum_probabilities(die.poses, die.body, mixture)
        gaps.append(total_variation(few, np.mean(each, axis=0)))
        spreads.append(np.quantile([total_variation(one, few) for one in each], 0.9))
    # The model itself is off by 0.03 on average.
    assert np.mean(gaps) < min(0.03, 0.3 * np.mean(spreads))
