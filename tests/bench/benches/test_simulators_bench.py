"""The bench of simulators: its dice, what it counts, its pairs, the command."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from common.benches import run_bench
from common.inline_executor import Inline
from common.kernels import compiled_only
from common.thrown import box, thrown

from dicedesign.bench.benches.simulators import Extent, pair_rows
from dicedesign.bench.measures.throws.simulator_agreement import (
    PAIRS,
    WAYS,
    NamedDie,
    ThrownWays,
    Way,
    given_die,
    random_dice,
    throw_in_ways,
)
from dicedesign.cli.main import main
from dicedesign.learning.random_dice import DICE_KINDS
from dicedesign.throws.engines import native
from dicedesign.throws.tables import table_named

BOARD = table_named("board-game")


def test_random_dice_are_of_all_kinds_in_turn() -> None:
    names = [die.name for die in random_dice(7)]
    kinds = {name.rsplit(" ", 1)[0] for name in names}
    assert len(kinds) == len(names)
    assert kinds <= set(DICE_KINDS)


def test_dice_of_recipes_and_meshes(tmp_path: Path) -> None:
    recipe = tmp_path / "coin.yaml"
    recipe.write_text("name: coin\ntarget: {probabilities: [0.5, 0.25, 0.25]}\n")
    mesh = tmp_path / "box.obj"
    trimesh.creation.box((1.0, 1.1, 1.25)).export(mesh)
    coin, cuboid = given_die(recipe), given_die(mesh)
    assert (coin.name, len(coin.body.rest_heights)) == ("coin", 3)
    assert cuboid.name == "box.obj"
    np.testing.assert_allclose(
        np.sort(cuboid.body.moments * cuboid.body.radius**2),
        np.sort([(1.1**2 + 1.25**2), (1.0 + 1.25**2), (1.0 + 1.1**2)]) / 12.0,
    )


@compiled_only
def test_each_way_has_throws_of_its_own() -> None:
    """All drops are counted once, and the same ones again give the same."""
    dice = [NamedDie("a", thrown(box(1.0, 1.1, 1.3))[0]), NamedDie("a", thrown(box(1, 1, 3))[0])]

    def nowhere(*arguments: object, **options: object) -> np.ndarray:
        rests = native.throw_states(*arguments, **options)  # type: ignore[arg-type]
        return np.where(rests == 0, -1, rests)

    ways = [WAYS[0], WAYS[1], Way("half the step", "odd", nowhere)]
    drops = {"native": 1100, "odd": 150}
    first, second = throw_in_ways(dice, ways, drops, BOARD, Inline())
    for one in (first, second):
        assert {name: int(counts.sum()) for name, counts in one.counts.items()} == {
            "native": 1100,
            "native again": 1100,
            "half the step": 150,
        }
        odd = one.counts["half the step"]
        assert odd[0] == 0
        assert odd[-1] > 0
        assert len(odd) == 7
        assert (one.counts["native"] != one.counts["native again"]).any()
        assert not one.variation("native", "native again").beyond_chance
    (again,) = throw_in_ways(dice[:1], ways[:1], drops, BOARD, Inline())
    np.testing.assert_array_equal(again.counts["native"], first.counts["native"])


def test_rests_that_nobody_can_tell_apart_are_one() -> None:
    """A pyramid over a square that was folded by a hair, so that it lies on either half."""
    base = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]
    for fold, outcomes in ((0.01, 5), (0.1, 6)):
        points = np.array([*base, [0.0, 0.0, 1.5]])
        points[0, 2] = points[2, 2] = -fold
        body, _ = thrown(points)
        die = NamedDie("pyramid", body)
        assert len(body.rest_heights) == 6
        assert len(set(die.outcome_of_rest.tolist())) == outcomes


def test_pairs_over_dice() -> None:
    names = [way.name for way in WAYS]
    right = {name: np.array([500, 500, 7]) for name in names}
    off = right | {"Bullet": np.array([700, 300, 0]), "MuJoCo": np.array([520, 480, 0])}
    rows = {
        (row.first, row.second): row
        for row in pair_rows([ThrownWays("right", right), ThrownWays("off", off)])
    }
    assert list(rows) == list(PAIRS)
    bullet = rows["native", "Bullet"]
    assert (bullet.mean, bullet.worst) == pytest.approx((0.1, 0.2))
    assert (bullet.beyond, bullet.dice, bullet.worst_die.strip()) == (1, 2, "off")
    assert bullet.drops == (1007, 1007)
    assert 0.0 < bullet.chance < bullet.limit < 0.1
    assert rows["native", "native again"].beyond == 0
    # What an engine that is not installed would be compared with is left out.
    del off["MuJoCo"]
    assert len(list(pair_rows([ThrownWays("off", off)]))) == len(PAIRS) - 2


@compiled_only
def test_the_command_prints_tables_and_json(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mesh = tmp_path / "box.obj"
    trimesh.creation.box((1.0, 1.1, 1.25)).export(mesh)
    assert run_bench("simulators", mesh, "--out", tmp_path, extent=Extent(1, 40, 3)) == 0
    text = capsys.readouterr().out
    record = json.loads((tmp_path / "simulators.json").read_text())
    assert record["table"]["name"] == "board-game"
    assert record["dice"][0]["name"] == "box.obj"
    assert sum(record["dice"][0]["counts"]["native"]) == 40
    assert {pair["dice"] for pair in record["pairs"]} == {2}
    assert "native    half the step" in text


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--table", "velvet"], "table velvet: expected board-game"),
        (["none.stl"], "none.stl: no such file"),
        (["--other-drops", "0"], "--other-drops: expected at least 1, got 0"),
    ],
)
def test_bad_input_is_said_plainly(
    options: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bench", "simulators", "--quick", *options]) == 2
    assert message in capsys.readouterr().err
