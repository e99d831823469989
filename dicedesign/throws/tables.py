"""Tables: surfaces on which dice land, and the distribution of throws onto them."""

from __future__ import annotations

import json
import reprlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from dicedesign.errors import InputError, named
from dicedesign.runtime.files import read_text

if TYPE_CHECKING:
    from dicedesign.runtime.arrays import Floats


Spread: TypeAlias = float | tuple[float, float]
"""A number for all throws; or a range (least, most), from which each throw draws uniformly and
independently."""


def least_of(spread: Spread) -> float:
    """Least value of any throw."""
    return float(np.min(spread))


def most_of(spread: Spread) -> float:
    """Largest value of any throw."""
    return float(np.max(spread))


def scale(spread: Spread, factor: float) -> Spread:
    """Product of every value and a number above 0."""
    if isinstance(spread, tuple):
        return factor * spread[0], factor * spread[1]
    return factor * spread


def draw(spread: Spread, count: int, rng: np.random.Generator) -> float | Floats:
    """Values (count,) drawn from a range, or the number itself."""
    return rng.uniform(*spread, count) if isinstance(spread, tuple) else spread


@dataclass(frozen=True)
class Hand:
    """A throw distribution: height, speed and spin; the start orientation is uniform.

    Attributes
    ----------
    line: description for tables.
    height, speed, spin: see `Table`.
    phrase: manner of throwing, after "Throw it ...".
    source: source of the numbers.
    """

    name: str
    line: str
    height: Spread
    speed: Spread
    spin: Spread
    phrase: str
    source: str


SPREADS = ("height", "speed", "spin")
"""Parameters of a throw, which may be ranges."""

TABLE_NUMBERS = ("restitution", "friction", *SPREADS)
"""Parameters on which throws depend, besides the size of the die."""


def read_packaged(name: str) -> str:
    """Text of a file that comes with the package."""
    return resources.files("dicedesign.throws").joinpath(f"named/{name}.json").read_text()


def _frozen(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


HANDS = {
    name: Hand(name, **{key: _frozen(value) for key, value in entries.items()})
    for name, entries in json.loads(read_packaged("hands")).items()
}
"""Named throw distributions."""


def hand_named(name: str) -> Hand:
    """Throw distribution of a name. Raises InputError for an unknown name."""
    if name not in HANDS:
        raise InputError(f"hand: expected {', '.join(HANDS)}, got {name!r}; take one of them")
    return HANDS[name]


TABLE_NAMES = ("board-game", "hard-wood", "carpet", "paper")
"""Tables that come with the package, one file each."""

MOST_RESTITUTION = 0.95

LEAST_SIZE = 1e-4

MOST_SIZE = 10.0
"""Largest size of dice, in m."""

_LIMITS = {
    "restitution": (0.0, MOST_RESTITUTION, "0 (dead) to 0.95"),
    "friction": (0.0, 10.0, "0 to 10"),
    "height": (0.0, 100.0, "0 to 100 m"),
    "speed": (0.0, 100.0, "0 to 100 m/s"),
    "spin": (0.0, 1000.0, "0 to 1000 rad/s"),
    "size": (LEAST_SIZE, MOST_SIZE, "0.0001 to 10 m"),
    "drag": (0.0, 1e4, "0 to 10000 1/s"),
}

GRAVITY = 9.81
"""Acceleration in m/s^2."""

BALL = 0.1
"""Moment of inertia of a ball over its mass and squared diameter."""

_EXTRA_ENTRIES = {"mixture", "momentum"}
"""Entries of a file that are no parameters of its table."""


@dataclass(frozen=True)
class Table:
    """Parameters of throws of dice of one size onto a plane.

    Attributes
    ----------
    name: used in reports.
    restitution: share of its normal speed that a point keeps when it hits the table, 0 to 0.95.
    friction: Coulomb's coefficient.
    height: height of the die's lowest point over the table at release, in m; 0 sets the die down.
        Otherwise at least the size of the die.
    speed: along the table at release, in m/s.
    spin: angular speed at release, in rad/s, about a random axis.
    size: of the die, in m: twice the largest distance of a point from its center of mass.
    drag: rate of loss of spin in 1/s, for a die with equal moments of inertia; above 0 only for
        throws without momentum.
    source: source of the numbers.

    Height, speed and spin are numbers or ranges (least, most), see `Spread`.

    Raises InputError: a number is outside of its limits, a range is reversed or empty, or the die
    is larger than the least height.
    """

    name: str
    restitution: float
    friction: float
    height: Spread
    speed: Spread
    spin: Spread
    size: float = 0.025
    drag: float = 0.0
    source: str = "given"

    def __post_init__(self) -> None:
        for text in (self.name, self.source):
            if not isinstance(text, str):
                raise InputError(
                    f"table: expected texts as name and source, got {text!r}; correct it"
                )
        for name in _LIMITS:
            object.__setattr__(self, name, self._check(name, getattr(self, name)))
        if most_of(self.height) > 0.0 and least_of(self.height) < self.size:
            least = "least " * isinstance(self.height, tuple)
            raise InputError(
                f"table {self.name}: expected a die no larger than the {least}drop height of "
                f"{least_of(self.height):g} m, got one of {self.size:g} m; let it fall from higher "
                "or make it smaller"
            )

    def _check(self, name: str, value: Any) -> Spread:
        """A number, or a range as list or tuple, within its limits."""
        owner, (least, most, words) = f"table {self.name}", _LIMITS[name]
        is_range = name in SPREADS and isinstance(value, list | tuple) and len(value) == 2
        ends = value if is_range else [value]
        if not all(isinstance(x, int | float) and not isinstance(x, bool) for x in ends):
            wanted = "a number" + " or a range [least, most]" * (name in SPREADS)
            raise InputError(f"{owner}: expected {wanted} as {name}, got {value!r}; correct it")
        for end in ends:
            if not least <= end <= most:
                raise InputError(f"{owner}: expected a {name} of {words}, got {end}; correct it")
        if is_range and ends[0] >= ends[1]:
            raise InputError(
                f"{owner}: expected a range of {name} from less to more, got [{ends[0]}, "
                f"{ends[1]}]; "
                + ("turn it round" if ends[0] > ends[1] else "give the number alone")
            )
        return tuple(ends) if is_range else value

    def for_size(self, size: float | None) -> Table:
        """Table for a die of a size in m; None keeps the table's own."""
        return self if size is None else replace(self, size=size)

    def for_size_above(self, size: float | None) -> Table:
        """Table for a die of a size in m, released no lower than its size; None keeps the table's
        own."""
        height = self.height
        if size is not None and most_of(height) > 0.0 and least_of(height) < size:
            height = (size, most_of(height)) if most_of(height) > size else size
        return replace(self, height=height).for_size(size)

    def with_hand(self, hand: str) -> Table:
        """Table with another throw distribution, one of `HANDS`.

        Raises InputError: the name is unknown, the die is larger than the least height, or the
        table has drag.
        """
        way = hand_named(hand)
        source = f"{self.source}; {way.phrase}, {way.source}"
        if self.drag > 0.0:
            raise InputError(
                f"table {self.name}: expected a table on which dice have momentum for the hand "
                f"{hand}, got one with drag; leave the hand out, or take another table"
            )
        return replace(self, name=f"{self.name}:{hand}", source=source, **_motion(way))

    @property
    def energy(self) -> float:
        """Energy of a mean throw at release over weight and size of the die, as of a ball."""
        height, speed, spin = (float(np.mean(getattr(self, name))) for name in SPREADS)
        squares = speed**2 + BALL * (self.size * spin) ** 2
        return (height + squares / (2.0 * GRAVITY)) / self.size

    @property
    def hand(self) -> Hand | None:
        """The throw distribution of `HANDS` with this height, speed and spin, if any."""
        own = _motion(self)
        return next((way for way in HANDS.values() if _motion(way) == own), None)

    def as_dict(self) -> dict[str, Any]:
        """Table as plain data, with ranges as lists."""
        plain = asdict(self)
        return {key: list(x) if isinstance(x, tuple) else x for key, x in plain.items()}


def _motion(thrown: Hand | Table) -> dict[str, Any]:
    return {key: getattr(thrown, key) for key in SPREADS}


def load_table(name: str) -> Table:
    """Table by its name, or from a JSON file by its path (ending in .json). A suffix with one of
    `HANDS`, as in "board-game:cup", selects another throw distribution.

    Raises
    ------
    InputError: the table or the throw distribution is unknown, or the file cannot be read or is not
        a table.
    """
    return _table(table_entries(name))


def mixture_tables(name: str) -> tuple[Table, ...]:
    """Equally likely tables of a mixture: of several hands, or of a fit's posterior. The table
    alone if its file has none.

    The entry "mixture" of the file lists objects with restitution, friction, height, speed and
    spin, numbers or ranges; the other parameters are the table's.

    Raises InputError as `load_table`, or if the entry is not such a list.
    """
    entries = table_entries(name)
    table = _table(entries)
    if "mixture" not in entries:
        return (table,)
    listed = entries["mixture"]
    if not (
        isinstance(listed, list)
        and listed
        and all(isinstance(row, dict) and set(row) == set(TABLE_NUMBERS) for row in listed)
    ):
        raise InputError(
            f"table {name}: expected as mixture a list of at least one object with "
            f"{', '.join(TABLE_NUMBERS)}; make it again with `python -m benchmarks "
            "table`, or remove mixture from the file"
        )
    return tuple(
        replace(table, **row, name=f"{table.name} {number} of {len(listed)}")
        for number, row in enumerate(listed, start=1)
    )


def mixture_entries(tables: Sequence[Table]) -> list[dict[str, Any]]:
    """Entry "mixture" of a file, for equally likely tables."""
    return [{key: table.as_dict()[key] for key in TABLE_NUMBERS} for table in tables]


def _table(entries: dict[str, Any]) -> Table:
    return Table(**{key: entries[key] for key in entries.keys() - _EXTRA_ENTRIES})


def with_hand(name: str, hand: str | None) -> str:
    """Name of a table with another throw distribution, for `load_table`; None keeps its own."""
    return name if hand is None else f"{name}:{hand}"


def table_entries(name: str) -> dict[str, Any]:
    """Entries of the file of a table: the attributes of `Table`, perhaps "mixture", see
    `mixture_tables`, and "momentum", a momentum model. Raises InputError as `load_table`."""
    place, _, hand = name.rpartition(":")
    if place not in TABLE_NAMES and not place.endswith(".json"):
        return _entries_of_file(name)
    entries = _entries_of_file(place)
    with named(f"table {name}"):
        thrown = _table(entries).with_hand(hand)
    if isinstance(entries.get("mixture"), list):
        motion, listed = _motion(thrown), entries["mixture"]
        rows = [row | motion if isinstance(row, dict) else row for row in listed]
        # Without their hands, several tables may be one.
        entries["mixture"] = [row for index, row in enumerate(rows) if row not in rows[:index]]
    return {**entries, **thrown.as_dict()}


def _entries_of_file(name: str) -> dict[str, Any]:
    if name in TABLE_NAMES:
        text = read_packaged(name)
    elif name.endswith(".json"):
        text = read_text(Path(name), "a JSON file of a table")
    else:
        raise InputError(
            f"table {name}: expected {', '.join(TABLE_NAMES)} or the path of a table's .json "
            "file; take one of them"
        )
    try:
        entries = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"table {name}: expected JSON, but {error}; correct it") from error
    known = {field.name for field in fields(Table)}
    needed = known - {"size", "drag", "source"}
    if not isinstance(entries, dict) or not needed <= set(entries) <= known | _EXTRA_ENTRIES:
        got = (
            reprlib.repr(", ".join(entries))
            if isinstance(entries, dict)
            else type(entries).__name__
        )
        raise InputError(
            f"table {name}: expected an object with {', '.join(sorted(needed))} and at most size, "
            f"drag, source, mixture and momentum, got {got}; correct it"
        )
    return entries
