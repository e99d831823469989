"""The momentum model's parameters: models of many tables and of one, what they depend on of a
table, and their files.

A die of any size thrown by a table is the same as one of another size whose heights, speeds and
spins are as large compared with its size and gravity. So five dimensionless numbers tell a table.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cache, cached_property
from itertools import compress
from types import ModuleType
from typing import Any, Final

import numpy as np

from dicedesign.errors import InputError, named
from dicedesign.kernels import ops as kernels
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.engines import GRAVITY
from dicedesign.throws.tables import Table, least_of, load_table, read_packaged, table_entries
from dicedesign.throws.tables import scale as spread_by
from dicedesign.throws.transition_features import CARRY_FEATURES, SMOOTHING, TRANSITION_FEATURES
from dicedesign.tolerances import ROUNDING

TABLE_NUMBERS: Final = ("restitution", "friction", "height", "speed", "spin")
"""Parameters of a table that throws depend on, besides the size."""

TABLE_TERMS: Final = 21
"""Terms of a quadratic polynomial in the table's numbers."""

CENTERS: Final = np.array([0.4, -1.0, 1.6, 0.8, 0.9])
"""About which the scaled numbers are taken,"""

EXTENTS: Final = np.array([0.4, 1.3, 1.4, 0.8, 0.9])
"""and over what, so that those of usual tables are within -1 and 1."""

ROUNDED: Final = 1e-5

UNITS: Final = {"height": " m", "speed": " m/s", "spin": " rad/s"}


def dimensionless(table: Table) -> Floats:
    """(5,) restitution, friction, height over size, speed over the root of gravity times size, spin
    times the root of size over gravity; of a range its mean."""
    middles = [np.mean(getattr(table, name)) for name in TABLE_NUMBERS]
    return np.array(middles) / _units(table.size)


def table_terms(table: Table) -> Floats:
    """(`TABLE_TERMS`,) what a model's numbers are linear in: 1, the `scale_numbers` numbers of a
    table and their products by twos. Its friction and height are above 0."""
    numbers = np.array([1.0, *scale_numbers(dimensionless(table))])
    return np.outer(numbers, numbers)[np.triu_indices(len(numbers))]


def scale_numbers(numbers: Floats) -> Floats:
    """(..., 5) scaled numbers of `dimensionless`: logarithms of friction and height, log(1 + x) of
    speeds and spins."""
    restitution, friction, height, speed, spin = np.moveaxis(numbers, -1, 0)
    free = restitution, np.log(friction), np.log(height), np.log1p(speed), np.log1p(spin)
    scaled: Floats = (np.stack(free, axis=-1) - CENTERS) / EXTENTS
    return scaled


def _units(size: float) -> Floats:
    """(5,) of the numbers, for dice of a size in m."""
    return np.array([1.0, 1.0, size, math.sqrt(GRAVITY * size), math.sqrt(GRAVITY / size)])


@dataclass(frozen=True)
class TableRange:
    """Tables, those within a box of the numbers of `dimensionless`.

    Attributes
    ----------
    least, most: (5,) of each number; friction and height are above 0.
    """

    least: Floats
    most: Floats

    def nearest(self, table: Table) -> Table:
        """The table, or one with the numbers that are beyond the range at its end."""
        return move_table(table, np.clip(dimensionless(table), self.least, self.most))

    def require(self, table: Table, remedy: str) -> None:
        """Raise InputError, which names the parameter, for a table beyond the range."""
        units, numbers = _units(table.size), dimensionless(table)
        for place, name in enumerate(TABLE_NUMBERS):
            least, most = self.least[place], self.most[place]
            # What files have is rounded.
            slack = ROUNDED * most
            if not least - slack <= numbers[place] <= most + slack:
                low, high = least * units[place], most * units[place]
                raise InputError(
                    f"table {table.name}: expected a {name} of {low:.3g} to {high:.3g}"
                    f"{UNITS.get(name, '')} for dice of {1e3 * table.size:g} mm, as its momentum "
                    f"model knows, got {numbers[place] * units[place]:.3g}; {remedy}"
                )


def move_table(table: Table, numbers: Floats) -> Table:
    """A table with those numbers that differ from its own; ranges stay as wide as they are
    compared with their mean."""
    values = dict(zip(TABLE_NUMBERS, (numbers * _units(table.size)).tolist(), strict=True))
    changed: dict[str, Any] = {}
    for name in compress(TABLE_NUMBERS, numbers != dimensionless(table)):
        spread, value = getattr(table, name), values[name]
        is_wide = isinstance(spread, tuple)
        changed[name] = spread_by(spread, value / float(np.mean(spread))) if is_wide else value
    if least_of(changed.get("height", table.height)) < table.size:
        # A die falls from no less than its size.
        changed["height"] = max(values["height"], table.size)
    return replace(table, **changed)


CHANGES: Final = (0.2, -0.2)
"""Parts by which the restitution of a livelier and of a duller table is higher. Of all that makes a
throw it is what changes the probabilities most."""

MOST_OTHERS: Final = 4
"""Tables that stand for a posterior."""


def other_tables(table: Table, posterior: Sequence[Table] = ()) -> tuple[Table, ...]:
    """Few tables that stand for what the table may be instead: of a posterior those that its others
    are nearest to, without one a livelier and a duller table. None where nothing bounces."""
    if not posterior:
        livelier = (table.livelier(change) for change in CHANGES)
        return tuple(other for other in livelier if other != table)
    numbers = np.array([scale_numbers(dimensionless(one)) for one in posterior])
    spread = numbers.std(axis=0)
    numbers = numbers / np.where(spread > 0.0, spread, 1.0)
    apart = np.linalg.norm(numbers[:, None] - numbers, axis=2)
    nearest = np.full(len(posterior), np.inf)
    chosen: list[int] = []
    while len(chosen) < min(MOST_OTHERS, len(posterior)):
        left = np.minimum(nearest, apart).sum(axis=1)
        left[chosen] = np.inf
        chosen.append(int(left.argmin()))
        nearest = np.minimum(nearest, apart[chosen[-1]])
    return tuple(posterior[place] for place in chosen)


def table_measures(table: Table, others: Sequence[Table]) -> Floats:
    """(n, d) of other tables, 0 for the table itself: differences in what the momentum model knows
    of them (`scale_numbers`), each over the root of its mean square; those in which none differs
    are left out."""
    if not others:
        return np.zeros((0, 0))
    own = scale_numbers(dimensionless(table))
    gaps = np.array([scale_numbers(dimensionless(other)) for other in others]) - own
    spread = np.sqrt((gaps**2).mean(axis=0))
    differing = spread > 0.0
    measures: Floats = gaps[:, differing] / spread[differing]
    return measures


LEAST_DEVIATION: Final = 1e-9
"""Of a feature: finer is rounding."""


@dataclass(frozen=True)
class Network:
    """A linear map plus one hidden layer of hyperbolic tangents, of features that are brought to
    mean 0 and standard deviation 1 first.

    Attributes
    ----------
    mean, deviation: (d,); linear: (d, o); bias: (o,); inward: (d, h); shift: (h,);
    outward: (h, o). Deviations are `LEAST_DEVIATION` to 1000, all others -1000 to 1000. Bias and
    shift may be (n, o) and (n, h), for each of the features (n, d) that it is asked about.
    """

    mean: Any
    deviation: Any
    linear: Any
    bias: Any
    inward: Any
    shift: Any
    outward: Any

    def __call__(self, features: Any, xp: ModuleType) -> Any:
        """Outputs (n, o) for features (n, d)."""
        scaled = (features - self.mean) / self.deviation
        hidden = xp.tanh(scaled @ self.inward + self.shift)
        return scaled @ self.linear + self.bias + hidden @ self.outward

    def unscale(self) -> tuple[Floats, ...]:
        """The maps and their constants, of NumPy, that take features as they are."""
        linear, inward = (part / self.deviation[:, None] for part in (self.linear, self.inward))
        bias, shift = self.bias - self.mean @ linear, self.shift - self.mean @ inward
        return linear, bias, inward, shift, self.outward


TRANSITION_OUTPUTS: Final = 4
"""Logarithms of the rate of a transition, in three terms of a quadratic in time, and of its
stretch."""

CARRY_OUTPUTS: Final = 3
"""Logarithm of the rate of a carry, in three terms."""

WEIGHTS: Final = (-1e3, 1e3)
"""Range of a model's numbers but those of `RANGES`. The weights that training punishes are below a
third of it, as it begins with a loss below 14."""

RANGES: Final = {
    "deviation": (LEAST_DEVIATION, 1e3),
    "restitution": (0.0, 0.95),
    "friction": (1e-3, 10.0),
    "height": (1.0, 1e5),
    "speed": (0.0, 1e5),
    "spin": (0.0, 1e5),
}
"""Of some of a model's numbers, by name: far beyond what any table comes to, and within it all
probabilities are finite with the sum 1."""


@dataclass(frozen=True)
class GeneralModel:
    """Parameters of momentum models of all tables of a range, NumPy or torch. What depends on the
    table is linear in its `table_terms`, and has a row for each of these.

    Attributes
    ----------
    range: in which the models hold.
    numbers: (t, 3) of `MomentumModel.hot`, `cooling` and `carry_barrier`.
    transitions, carries: networks of `TRANSITION_OUTPUTS` and `CARRY_OUTPUTS`, with biases (t, o)
        and shifts (t, h).
    """

    range: TableRange
    numbers: Any
    transitions: Network
    carries: Network


def general_model_of(plain: Any) -> GeneralModel:
    """A model from plain data, as in a file.

    Raises
    ------
    InputError: something is missing, is no number in its range of `RANGES`, else in `WEIGHTS`, or
        has another shape than in `GeneralModel` and `Network`.
    """
    if not isinstance(plain, dict):
        raise InputError(
            f"momentum: expected an object with the numbers of a model, got {plain!r:.40}; "
            "train one with `python -m benchmarks train` in a checkout"
        )
    entries = _part(plain, "range", TABLE_NUMBERS)
    limits = np.array([_array(entries, f"range.{name}", (2,)) for name in TABLE_NUMBERS])
    for name, (least, most) in zip(TABLE_NUMBERS, limits, strict=True):
        if least > most:
            raise _wrong(f"range.{name}", "the lower limit first", f"{least:g}, {most:g}")
    return GeneralModel(
        TableRange(*limits.T),
        _array(plain, "numbers", (TABLE_TERMS, 3)),
        _network(plain, "transitions", TRANSITION_FEATURES, TRANSITION_OUTPUTS),
        _network(plain, "carries", CARRY_FEATURES, CARRY_OUTPUTS),
    )


def _network(plain: dict[str, Any], key: str, columns: int, outputs: int) -> Network:
    names = tuple(field.name for field in fields(Network))
    entries = _part(plain, key, names)
    hidden = len(entries["outward"]) if isinstance(entries["outward"], list) else 0
    shapes = [(columns,), (columns,), (columns, outputs), (TABLE_TERMS, outputs)]
    shapes += [(columns, hidden), (TABLE_TERMS, hidden), (hidden, outputs)]
    each = zip(names, shapes, strict=True)
    return Network(*(_array(entries, f"{key}.{name}", shape) for name, shape in each))


def _part(plain: dict[str, Any], key: str, names: tuple[str, ...]) -> dict[str, Any]:
    """The entries of a network or of a range."""
    part = plain.get(key)
    if not isinstance(part, dict) or set(part) != set(names):
        got = ", ".join(part) if isinstance(part, dict) else type(part).__name__
        raise _wrong(key, f"an object with {', '.join(names)}", got)
    return part


def _array(plain: dict[str, Any], path: str, shape: tuple[int, ...]) -> Floats:
    """The numbers of an entry, named by its whole path."""
    name = path.rpartition(".")[-1]
    try:
        array = np.array(plain.get(name))
    except ValueError:
        raise _wrong(path, "rows of the same length", "others") from None
    if array.dtype.kind not in "iuf":
        raise _wrong(path, "numbers", f"{plain.get(name)!r:.60}")
    if array.shape != shape:
        raise _wrong(path, f"numbers of shape {shape}", f"{array.shape}")
    least, most = RANGES.get(name, WEIGHTS)
    outside = array[~((least <= array) & (array <= most))]
    if outside.size:
        raise _wrong(path, f"numbers from {least:g} to {most:g}", f"{outside.flat[0]:g}")
    return array.astype(np.float64)


def _wrong(path: str, expected: str, got: str) -> InputError:
    return InputError(
        f"momentum model: {path}: expected {expected}, got {got}; make the table's model again "
        "with `python -m benchmarks train` in a checkout"
    )


IMPACTS: Final = 12
"""Impacts in which a die may leave its basin."""

CARRIES: Final = 3
"""Carries, at most, after one of them."""

MOST_RATE: Final = 8.0
"""Logarithm of the rates of transitions and carries, at most; a die as good as certainly goes
then."""

MOST_STRETCH: Final = 3.0
"""Logarithm of the factor that a transition's features may put before its barrier, at most."""

NO_BARRIER: Final = 0.003
"""Barrier over the radius below which a rest is left the more surely the lower it is."""

NUMBERS: Final = np.array([(-20.0, 20.0), (0.0, 20.0), (0.0, 100.0)])
"""Range of `hot`, `cooling` and `carry_barrier`: beyond it they are taken at its ends."""


@dataclass(frozen=True)
class MomentumModel(kernels.Handled):
    """Parameters of the model on one table, NumPy or torch.

    Attributes
    ----------
    hot: logarithm of the temperature at first, in radii, -20 to 20. cooling: logarithm of its
        decrease, 0 to 20. carry_barrier: weight of the second barrier of a carry, 0 to 100.
    transitions, carries: networks of `TRANSITION_OUTPUTS` and `CARRY_OUTPUTS`.
    general: NumPy, whose model on this table it is.
    """

    hot: Any
    cooling: Any
    carry_barrier: Any
    transitions: Network
    carries: Network
    general: GeneralModel

    @classmethod
    def of(cls, general: GeneralModel, table: Table) -> MomentumModel:
        """Model of a table. Raises InputError: the table is not in the model's range."""
        general.range.require(
            table, "make a model of its own with `python -m benchmarks train` in a checkout"
        )
        terms = table_terms(table)
        hot, cooling, carry_barrier = np.clip(terms @ general.numbers, *NUMBERS.T)
        transitions, carries = (
            replace(network, bias=terms @ network.bias, shift=terms @ network.shift)
            for network in (general.transitions, general.carries)
        )
        return cls(hot, cooling, carry_barrier, transitions, carries, general)

    def near(self, table: Table) -> MomentumModel:
        """Model of another table, or of the nearest one in its range."""
        return self.of(self.general, self.general.range.nearest(table))

    def convert(self, convert: Callable[[Any], Any]) -> MomentumModel:
        """Model with its arrays converted."""
        numbers = self.hot, self.cooling, self.carry_barrier
        hot, cooling, carry_barrier = map(convert, numbers)
        transitions, carries = (
            Network(*map(convert, vars(network).values()))
            for network in (self.transitions, self.carries)
        )
        return MomentumModel(hot, cooling, carry_barrier, transitions, carries, self.general)

    @cached_property
    def handle(self) -> Any:
        """This model as kernels take it, in NumPy."""
        networks = self.transitions, self.carries
        numbers = [np.array([self.hot, self.cooling, self.carry_barrier])]
        numbers += [part.ravel() for network in networks for part in network.unscale()]
        return kernels.new_handle(
            "Momentum",
            np.concatenate(numbers),
            [len(network.shift) for network in networks],
            (IMPACTS, CARRIES),
            (MOST_RATE, MOST_STRETCH, NO_BARRIER, *SMOOTHING, ROUNDING),
        )


def momentum_model(table: str) -> MomentumModel | None:
    """Momentum model of a table, by its name or the path of a JSON file: the table's own, else the
    general one; None for tables with drag.

    Raises
    ------
    InputError: there is no such table, its own model is none, or it is not in the model's range.
    """
    thrown = load_table(table)
    if thrown.drag > 0.0:
        return None
    entries = table_entries(table)
    with named(f"table {table}"):
        own = entries.get("momentum")
        general = general_model() if own is None else general_model_of(own)
    return MomentumModel.of(general, thrown)


@cache
def general_model() -> GeneralModel:
    """The model of all tables that comes with the package."""
    return general_model_of(json.loads(read_packaged("momentum")))
