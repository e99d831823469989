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
)

GOOD = {
    "name": "lino",
    "restitution": 0.4,
    "friction": 0.2,
    "height": 0.2,
    "speed": 0.1,
    "spin": 5.0,
}

ROW = {key: GOOD[key] for key in ("restitution", "friction", "height", "speed", "spin")}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "lino.json"
    path.write_text(json.dumps(GOOD))
    return path


@pytest.mark.parametrize("name", TABLE_NAMES)
def test_shipped_tables(name: str) -> None:
    """Each has a source, and may have other throw distributions, unless it has drag."""
    own = load_table(name)
    assert own.name == name
    assert own.source != "given"
    if own.drag > 0.0:
        with pytest.raises(InputError, match="momentum"):
            load_table(f"{name}:cup")
        return
    for hand, way in HANDS.items():
        table = load_table(f"{name}:{hand}")
        throws = {key: getattr(way, key) for key in ("height", "speed", "spin")}
        assert table == replace(own, name=table.name, source=table.source, **throws)
        assert table.hand is way
        assert own.source in table.source
        assert way.source in table.source


def test_a_table_in_a_file(path: Path) -> None:
    table = load_table(str(path))
    assert table == Table(**GOOD)
    assert (table.size, table.drag) == (0.025, 0.0)
    assert mixture_tables(str(path)) == (table,)
    with_hand = load_table(f"{path}:tower")
    assert (with_hand.name, with_hand.hand) == ("lino:tower", HANDS["tower"])
    path.write_text(json.dumps(table.as_dict() | {"size": 0.05}))
    assert load_table(str(path)) == replace(table, size=0.05)
    with pytest.raises(InputError, match=r"no larger than the least drop height of 0.04 m"):
        load_table(f"{path}:tower")


def test_tables_of_a_mixture(path: Path) -> None:
    rows = [ROW | {"height": [0.1, 0.3], "spin": [1, 9]}, ROW | {"friction": 0.4, "height": 0.3}]
    path.write_text(json.dumps({**GOOD, "size": 0.03, "mixture": rows}))
    assert load_table(str(path)) == Table(**GOOD, size=0.03)
    tables = mixture_tables(str(path))
    for number, (table, row) in enumerate(zip(tables, rows, strict=True), start=1):
        assert table == Table(**{**GOOD, **row, "size": 0.03, "name": f"lino {number} of 2"})
    assert mixture_entries(tables) == rows
    # A named hand takes the place of each, and equal tables are one.
    cup = HANDS["cup"]
    surfaces = [(one.restitution, one.friction) for one in mixture_tables(f"{path}:cup")]
    assert surfaces == [(0.4, 0.2), (0.4, 0.4)]
    path.write_text(json.dumps({**GOOD, "mixture": [ROW, {**ROW, "height": 0.5}]}))
    (table,) = mixture_tables(f"{path}:cup")
    assert (table.height, table.speed, table.spin) == (cup.height, cup.speed, cup.spin)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"restitution": 1.0}, "expected a restitution of 0 .dead. to 0.95, got 1.0; correct it"),
        ({"spin": "fast"}, "expected a number or a range .least, most. as spin, got 'fast'"),
        ({"height": (0.3, 0.2)}, "range of height from less to more, got .0.3, 0.2."),
        ({"spin": (0.0, float("nan"))}, "expected a spin of 0 to 1000 rad/s, got nan"),
        ({"speed": [0.1, 0.2, 0.3]}, r"as speed, got \[0.1, 0.2, 0.3\]; correct it"),
        ({"restitution": (0.4, 0.5)}, "expected a number as restitution, got .0.4, 0.5."),
        ({"height": (0.02, 0.2)}, "a die no larger than the least drop height of 0.02 m"),
        ({"size": 0.21}, "no larger than the drop height of 0.2 m, got one of 0.21 m"),
    ],
)
def test_numbers_out_of_range(changes: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Table(**{**GOOD, **changes})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"spin": None}, "spin"),
        ({"color": 1}, "color"),
        ({"mixture": []}, "mixture"),
        ({"mixture": [{"spin": 1}]}, "mixture"),
    ],
)
def test_invalid_files(path: Path, changes: dict, message: str) -> None:
    path.write_text(json.dumps({**GOOD, **changes}))
    with pytest.raises(InputError, match=message):
        mixture_tables(str(path))
    path.write_text("{")
    with pytest.raises(InputError, match="JSON"):
        mixture_tables(str(path))


@pytest.mark.parametrize(
    ("height", "lifted"),
    [
        (0.1, 0.1),
        (0.03, 0.035),
        ((0.03, 0.09), (0.035, 0.09)),
        ((0.02, 0.03), 0.035),
        ((0.02, 0.035), 0.035),
        (0.0, 0.0),
    ],
)
def test_a_large_die_is_released_from_at_least_its_size(height: Any, lifted: Any) -> None:
    table = Table("low", 0.5, 0.5, height, 0.1, 1.0, size=0.02)
    assert table.for_size_above(0.035) == replace(table, height=lifted, size=0.035)


def test_the_energy_of_a_throw_is_that_of_a_ball() -> None:
    table = Table("t", 0.5, 0.5, 0.1, [0.2, 0.4], 20.0, size=0.03)
    joules_per_kg = 9.81 * 0.1 + 0.5 * 0.3**2 + 0.5 * 0.4 * 0.015**2 * 20.0**2
    assert table.energy == pytest.approx(joules_per_kg / (9.81 * 0.03))
