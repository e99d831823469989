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
from dicedesign.throws.tables import Table, load_table, mixture_tables

PLAIN = plain_model(general_model())
TABLE = load_table("board-game")


@pytest.mark.parametrize(
    ("part", "key", "entry"),
    [
        ("numbers", None, [1.0]),
        ("numbers", None, [[1e308] * 3] * TABLE_TERMS),
        ("range", None, {}),
        ("range", "restitution", [0.0, 1.0]),
        ("transitions", None, None),
        ("transitions", "deviation", [1e-300] * 29),
        ("carries", "outward", PLAIN["carries"]["outward"][1:]),
    ],
)
def test_invalid_models_are_refused(part: str, key: str | None, entry: Any) -> None:
    change = {part: entry if key is None else PLAIN[part] | {key: entry}}
    with pytest.raises(InputError, match=f"^momentum model: {part}"):
        general_model_of(json.loads(json.dumps(PLAIN | change)))


def test_dimensionless_numbers() -> None:
    """Dice of twice the size fall equally from twice the height, and so on."""
    table, root = Table("x", 0.5, 0.3, 0.2, 0.7, 20.0, size=0.02), np.sqrt(2.0)
    double = Table("y", 0.5, 0.3, (0.2, 0.6), 0.7 * root, (0.0, 40.0 / root), size=0.04)
    np.testing.assert_allclose(dimensionless(table), dimensionless(double), rtol=1e-12)
    speed = 0.7 / np.sqrt(9.81 * 0.02)
    np.testing.assert_allclose(dimensionless(table)[:4], [0.5, 0.3, 10.0, speed], rtol=1e-12)


def test_a_table_beyond_the_range_is_refused(tmp_path: Path) -> None:
    """A model in the table's file takes the place of the general one."""
    table, own = Table("mine", 0.5, 0.5, 0.2, 0.5, 20.0), copy.deepcopy(PLAIN)
    own["range"]["spin"] = [0.0, 1.1]
    own["numbers"][0][0] += 0.5
    path = tmp_path / "mine.json"
    path.write_text(json.dumps(table.as_dict() | {"momentum": own}))
    model = momentum_model(str(path))
    assert model is not None
    assert model.models[0].hot == pytest.approx(MomentumModel.of(general_model(), table).hot + 0.5)
    for changes, message in (
        ({"restitution": 0.95}, "restitution of 0 to 0.9 .*25 mm.*0.95"),
        ({"height": 0.7, "size": 0.02}, "height of 0.024 to 0.64 m .*20 mm"),
        ({"spin": 23.0, "momentum": own}, r"spin of 0 to 21\.8 rad/s"),
    ):
        path.write_text(json.dumps(table.as_dict() | changes))
        with pytest.raises(InputError, match=f"^table mine: .*{message}"):
            momentum_model(str(path))


@pytest.mark.parametrize("seed", range(6))
def test_every_model_within_its_ranges_gives_probabilities(seed: int) -> None:
    """Each array has a few different numbers in random places, such as the ends of its range."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(12, 3)) * [1.0, 1.0, rng.choice([0.05, 1.0])]
    hull, side = convex_hull(points), rest_poses(points).basins[0]
    inertia = hull.surface.inertia
    body = hull, side.paths, hull.centroid, inertia, side.areas / (4.0 * np.pi)

    def draw(name: str, part: Any) -> Any:
        if isinstance(part, dict):
            return {key: draw(key, value) for key, value in part.items()}
        least, most = RANGES.get(name, WEIGHTS)
        values = rng.choice([least, most, *np.geomspace(1e-9, most, 5)], size=rng.integers(1, 5))
        return rng.choice(values, size=np.shape(part)).tolist()

    plain = {key: draw(key, part) for key, part in PLAIN.items()} | {"range": PLAIN["range"]}
    model = MomentumModel.of(general_model_of(plain), draw_table(GENERAL, TABLE, rng))
    for context in (nullcontext, without_kernels):
        with context(), np.errstate(over="raise", invalid="raise", divide="raise"):
            probabilities = hull_probabilities(*body, model)
        assert np.isfinite(probabilities).all()
        assert probabilities.min() > -1e-12
        assert probabilities.sum() == pytest.approx(1.0, abs=1e-9)


@pytest.fixture(scope="module")
def dice() -> list[RandomDie]:
    """Random dice of another seed than the training dice; none of them rolls for long."""
    return [random_die(number, 1, (7, 13)) for number in (4, 6, 7, 8)]


@compiled_only
@pytest.mark.parametrize(("name", "ratio"), [("board-game", 0.45), ("paper", 0.85)])
def test_probabilities_are_nearer_to_throws_than_those_without_momentum(
    dice: list[RandomDie], name: str, ratio: float
) -> None:
    """The model of paper, whose drops differ most from the others, is the least accurate."""
    mixture, without, by_model = momentum_model(name), [], []
    for die in dice:
        thrown = simulate(die.body, mixture_tables(name), 1200, 3).frequencies
        momentum = momentum_probabilities(die.poses, die.body, mixture)
        without.append(total_variation(thrown, die.poses.probabilities))
        by_model.append(total_variation(thrown, momentum))
    assert np.mean(without) > 0.1
    assert np.mean(by_model) < ratio * np.mean(without)


@compiled_only
def test_the_model_predicts_the_effect_of_a_livelier_table(dice: list[RandomDie]) -> None:
    mixture = momentum_model("board-game")
    assert mixture is not None
    effects = []
    for die in dice[1:3]:
        probabilities = []
        for restitution in (0.8, 0.0):
            table = replace(TABLE, restitution=restitution)
            thrown = simulate(die.body, table, 1500, 5).frequencies
            by_model = momentum_probabilities(die.poses, die.body, mixture.near(table))
            probabilities.append([thrown, by_model])
        effects.append(np.subtract(*probabilities))
    assert np.corrcoef(np.concatenate(effects, axis=1))[0, 1] > 0.5


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


def test_tables_of_a_mixture_count_as_often_as_they_are_listed(
    dice: list[RandomDie], tmp_path: Path
) -> None:
    path, row = tmp_path / "mine.json", {"height": 0.2, "speed": 0.5, "spin": 20.0}
    lively, dead = ({**row, "restitution": e, "friction": 0.3} for e in (0.7, 0.1))
    path.write_text(json.dumps({"name": "mine", **lively, "mixture": [lively, *[dead] * 7]}))
    mixture = momentum_model(str(path))
    assert mixture is not None
    for die in dice[:2]:
        first, second = (
            momentum_probabilities(die.poses, die.body, mixture.near(Table("x", **each)))
            for each in (lively, dead)
        )
        assert total_variation(first, second) > 0.02
        expected = first / 8.0 + 7.0 * second / 8.0
        mean = momentum_probabilities(die.poses, die.body, mixture)
        np.testing.assert_allclose(mean, expected, atol=1e-12)
