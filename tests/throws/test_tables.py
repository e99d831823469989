"""Tables of the package and in files, and named throw distributions."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from dicedesign.errors import InputError
from dicedesign.throws.tables import (
    HANDS,
    TABLE_NAMES,
    Table,
    load_table,
    mixture_entries,
    mixture_tables,
    with_hand,
)

GOOD = {
    "name": "lino",
    "restitution": 0.4,
    "friction": 0.2,
    "height": 0.2,
    "speed": 0.1,
    "spin": 5.0,
}


@pytest.mark.parametrize("name", TABLE_NAMES)
def test_shipped_tables(name: str) -> None:
    table = load_table(name)
    assert table.name == name
    assert table.source != "given"


def test_a_table_in_a_file(tmp_path: Path) -> None:
    path = tmp_path / "lino.json"
    path.write_text(json.dumps(GOOD))
    table = load_table(str(path))
    assert table == Table(**GOOD)
    assert (table.size, table.drag) == (0.025, 0.0)
    path.write_text(json.dumps(table.as_dict()))
    assert load_table(str(path)) == table


def test_tables_of_a_mixture(tmp_path: Path) -> None:
    path = tmp_path / "lino.json"
    path.write_text(json.dumps(GOOD))
    assert mixture_tables(str(path)) == (Table(**GOOD),)
    rows = [
        {"restitution": 0.3, "friction": 0.1, "height": [0.1, 0.3], "speed": 0.2, "spin": [1, 9]},
        {"restitution": 0.5, "friction": 0.4, "height": 0.3, "speed": [0.1, 0.2], "spin": 4.0},
    ]
    path.write_text(json.dumps({**GOOD, "size": 0.03, "mixture": rows}))
    assert load_table(str(path)) == Table(**GOOD, size=0.03)
    tables = mixture_tables(str(path))
    for number, (table, row) in enumerate(zip(tables, rows, strict=True), start=1):
        assert table == Table(**{**GOOD, **row, "size": 0.03, "name": f"lino {number} of 2"})
    assert mixture_entries(tables) == rows


@pytest.mark.parametrize("mixture", [{}, [3], [{"restitution": 0.3}]])
def test_invalid_mixtures(mixture: object, tmp_path: Path) -> None:
    path = tmp_path / "lino.json"
    path.write_text(json.dumps({**GOOD, "mixture": mixture}))
    with pytest.raises(
        InputError, match="expected as mixture a list of at least one object with rest"
    ):
        mixture_tables(str(path))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"restitution": 1.0}, "expected a restitution of 0 .dead. to 0.95, got 1.0; correct it"),
        ({"spin": "fast"}, "expected a number or a range .least, most. as spin, got 'fast'"),
        ({"height": (0.3, 0.2)}, "range of height from less to more, got .0.3, 0.2.; turn it"),
        ({"spin": (0.0, float("nan"))}, "expected a spin of 0 to 1000 rad/s, got nan"),
        ({"speed": [0.1, 0.2, 0.3]}, r"as speed, got \[0.1, 0.2, 0.3\]; correct it"),
        ({"restitution": (0.4, 0.5)}, "expected a number as restitution, got .0.4, 0.5."),
        (
            {"height": (0.02, 0.2)},
            "a die no larger than the least drop height of 0.02 m, got one of 0.025 m",
        ),
        (
            {"size": 0.21},
            "table lino: expected a die no larger than the drop height of 0.2 m, got one of 0.21 "
            "m; let it fall from higher or make it smaller",
        ),
    ],
)
def test_numbers_out_of_range(changes: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Table(**{**GOOD, **changes})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "expected JSON, but Expecting property name"),
        ('{"name": "x"}', "got name; correct it"),
        (json.dumps({**GOOD, "color": 1}), "got name, .*, color; correct it"),
    ],
)
def test_invalid_files(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "table.json"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        load_table(str(path))


@pytest.mark.parametrize(
    ("height", "lifted"),
    [(0.1, 0.1), (0.03, 0.035), ((0.03, 0.09), (0.035, 0.09)), ((0.02, 0.03), 0.035), (0.0, 0.0)],
)
def test_a_large_die_is_released_from_at_least_its_size(height: Any, lifted: Any) -> None:
    table = Table("low", 0.5, 0.5, height, 0.1, 1.0, size=0.02)
    assert table.for_size_above(0.035) == replace(table, height=lifted, size=0.035)


@pytest.mark.parametrize("hand", HANDS)
def test_a_throw_distribution_changes_only_the_throw(hand: str) -> None:
    for name in set(TABLE_NAMES) - {"carpet"}:
        own = load_table(name)
        table = own.with_hand(hand)
        assert table.hand is HANDS[hand]
        unchanged = {
            key: getattr(own, key) for key in ("name", "height", "speed", "spin", "source")
        }
        assert replace(table, **unchanged) == own
        assert table.name == with_hand(name, hand) == f"{name}:{hand}"
        assert load_table(table.name) == table
        assert own.source in table.source
        assert HANDS[hand].source in table.source


def test_a_hand_on_a_table_of_a_file(tmp_path: Path) -> None:
    path = tmp_path / "lino.json"
    path.write_text(json.dumps(GOOD))
    table = load_table(f"{path}:tower")
    assert (table.name, table.hand) == ("lino:tower", HANDS["tower"])
    path.write_text(json.dumps({**GOOD, "size": 0.05}))
    with pytest.raises(InputError, match=r"no larger than the least drop height of 0.04 m"):
        load_table(f"{path}:tower")


def test_a_named_hand_takes_the_place_of_those_of_a_mixture() -> None:
    tables, cup = mixture_tables("board-game"), HANDS["cup"]
    with_cup = mixture_tables("board-game:cup")
    surfaces = [(one.restitution, one.friction) for one in tables]
    assert [(one.restitution, one.friction) for one in with_cup] == surfaces
    assert {(one.height, one.speed, one.spin) for one in with_cup} == {
        (cup.height, cup.speed, cup.spin)
    }


def test_equal_tables_are_one(tmp_path: Path) -> None:
    path = tmp_path / "lino.json"
    row = {key: GOOD[key] for key in ("restitution", "friction", "height", "speed", "spin")}
    path.write_text(json.dumps({**GOOD, "mixture": [row, {**row, "height": 0.5}]}))
    (table,) = mixture_tables(f"{path}:cup")
    assert table.height == HANDS["cup"].height


def test_the_energy_of_a_throw_is_that_of_a_ball() -> None:
    table = Table("t", 0.5, 0.5, 0.1, [0.2, 0.4], 20.0, size=0.03)
    inertia = 0.4 * 0.015**2
    joules_per_kg = 9.81 * 0.1 + 0.5 * 0.3**2 + 0.5 * inertia * 20.0**2
    assert table.energy == pytest.approx(joules_per_kg / (9.81 * 0.03))
