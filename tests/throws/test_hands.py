"""Named ways to throw, on tables by name and of files."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from common.kernels import compiled_only
from common.thrown import box, thrown

from dicedesign.errors import InputError
from dicedesign.throws.momentum_model import MomentumModel, general_model, momentum_model
from dicedesign.throws.simulation import simulate
from dicedesign.throws.tables import (
    HANDS,
    TABLE_NAMES,
    least_of,
    most_of,
    table_named,
    with_hand,
)

LINO = {"name": "lino", "restitution": 0.4, "friction": 0.2}
CUP = HANDS["cup"]


@pytest.mark.parametrize("hand", HANDS)
def test_a_hand_changes_the_throw_and_nothing_else(hand: str) -> None:
    for name in set(TABLE_NAMES) - {"carpet"}:
        own = table_named(name)
        table = own.thrown_by(hand)
        assert table.hand is HANDS[hand]
        assert (
            replace(
                table,
                name=own.name,
                height=own.height,
                speed=own.speed,
                spin=own.spin,
                source=own.source,
            )
            == own
        )
        # It goes by its name wherever tables do.
        assert table.name == with_hand(name, hand) == f"{name}:{hand}"
        assert table_named(table.name) == table
        # Where the numbers are from is told.
        assert own.source in table.source
        assert HANDS[hand].source in table.source


@pytest.mark.parametrize("hand", HANDS)
def test_hands_are_such_as_people_have(hand: str) -> None:
    """A die of 25 mm falls for a part of a second, and turns about as fast as it would roll or
    faster, but not ten times as fast."""
    way = HANDS[hand]
    assert least_of(way.height) >= 0.025
    assert most_of(way.height) <= 0.5
    rolling = [end / 0.0125 for end in (least_of(way.speed), most_of(way.speed))]
    for spin, rolled in zip((least_of(way.spin), most_of(way.spin)), rolling, strict=True):
        assert 0.1 * rolled < spin < 10.0 * rolled


def test_a_table_of_no_hand() -> None:
    assert table_named("board-game").hand is None
    assert with_hand("board-game", None) == "board-game"


def test_a_hand_in_a_file(tmp_path: Path) -> None:
    path = tmp_path / "lino.json"
    path.write_text(json.dumps({**LINO, "hand": "cup", "size": 0.03}))
    table = table_named(str(path))
    assert (table.height, table.speed, table.spin) == (CUP.height, CUP.speed, CUP.spin)
    assert (table.name, table.size, table.hand) == ("lino", 0.03, CUP)
    assert CUP.source in table.source
    # Another one takes its place.
    thrown = table_named(f"{path}:tower")
    assert (thrown.name, thrown.hand) == ("lino:tower", HANDS["tower"])
    # What is written is read as the same table.
    path.write_text(json.dumps(table.as_dict()))
    assert table_named(str(path)) == table


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"hand": "foot"}, "lino.json: hand: expected cup, hand, tower, got 'foot'; take one"),
        ({"hand": ["cup"]}, r"lino.json: hand: expected cup, hand, tower, got \['cup'\]; correct"),
        ({"hand": "cup", "spin": 3.0}, "or hand in place of height, speed, spin.* got .*hand, sp"),
        ({"hand": "tower", "size": 0.05}, "no larger than the least drop height of 0.04 m"),
    ],
)
def test_files_with_a_hand_that_cannot_be(tmp_path: Path, changes: dict, message: str) -> None:
    path = tmp_path / "lino.json"
    path.write_text(json.dumps({**LINO, **changes}))
    with pytest.raises(InputError, match=message):
        table_named(str(path))


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("board-game:foot", "table board-game:foot: hand: expected cup, hand, tower, got 'foot'"),
        ("board-game:", "table board-game:: hand: expected cup, hand, tower, got ''"),
        ("felt:cup", "table felt:cup: expected board-game, hard-wood, carpet, paper or the path"),
        ("board-game:cup:hand", "table board-game:cup:hand: expected board-game, hard-wood"),
        ("carpet:cup", "table carpet: expected a table on which dice have momentum for the hand c"),
    ],
)
def test_names_with_a_hand_that_cannot_be(name: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        table_named(name)


@pytest.mark.parametrize("hand", HANDS)
def test_the_momentum_model_knows_the_hand(hand: str) -> None:
    """It is asked for the middle of what the hand does."""
    own = table_named("board-game").thrown_by(hand)
    middles = {name: float(np.mean(getattr(own, name))) for name in ("height", "speed", "spin")}
    known = momentum_model(f"board-game:{hand}")
    of_middles = MomentumModel.of(general_model(), replace(own, **middles))
    assert known is not None
    assert (known.hot, known.cooling) == (of_middles.hot, of_middles.cooling)


@compiled_only
@pytest.mark.parametrize("hand", HANDS)
def test_a_cube_is_fair_in_any_hand(hand: str) -> None:
    body, _ = thrown(box(1.0, 1.0, 1.0))
    throws = simulate(body, table_named(f"board-game:{hand}"), 600, seed=4)
    assert throws.unresolved == 0
    expected = 100.0
    assert ((throws.counts - expected) ** 2 / expected).sum() < 20.5  # 99.9 % of chi-square 5
    assert np.all(throws.counts > 60)
