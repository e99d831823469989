"""Parameters of the momentum model, for all tables of a range or for one, and their files.

A throw depends on restitution and friction, and on height, speed and spin relative to the size of
the die and gravity: five dimensionless numbers.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import compress
from types import ModuleType
from typing import Any

import numpy as np

from dicedesign.errors import InputError, named
from dicedesign.kernels import ops as kernels
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.tables import (
    GRAVITY,
    TABLE_NUMBERS,
    Table,
    least_of,
    load_table,
    mixture_tables,
    read_packaged,
    table_entries,
)
from dicedesign.throws.tables import scale as scale_spread
from dicedesign.throws.transition_features import CARRY_FEATURES, SMOOTHING, TRANSITION_FEATURES
from dicedesign.tolerances import ROUNDING

TABLE_TERMS = 21
"""Number of terms of a quadratic polynomial in the table's numbers."""

CENTERS = np.array([0.4, -1.0, 1.6, 0.8, 0.9])
"""Centers of the scaled numbers."""

EXTENTS = np.array([0.4, 1.3, 1.4, 0.8, 0.9])
"""Units of the scaled numbers; usual tables are within -1 and 1."""

ROUNDED = 1e-5
"""Relative rounding of the range in a file."""

UNITS = {"height": " m", "speed": " m/s", "spin": " rad/s"}


def dimensionless(table: Table) -> Floats:
    """(5,) restitution, friction, height over size, speed over the root of gravity times size, spin
    times the root of size over gravity; the mean of a range."""
    middles = [np.mean(getattr(table, name)) for name in TABLE_NUMBERS]
    return np.array(middles) / _units(table.size)


def table_terms(table: Table) -> Floats:
    """(`TABLE_TERMS`,) terms in which a model is linear: 1, the `scale_numbers` of a table, and
    their pairwise products. Friction and height must be above 0."""
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
    """(5,) units of the numbers, for dice of a size in m."""
    return np.array([1.0, 1.0, size, math.sqrt(GRAVITY * size), math.sqrt(GRAVITY / size)])


@dataclass(frozen=True)
class TableRange:
    """Box of tables in the numbers of `dimensionless`.

    Attributes
    ----------
    least, most: (5,) of each number; friction and height are above 0.
    """

    least: Floats
    most: Floats

    def nearest(self, table: Table) -> Table:
        """Nearest table in the range, with numbers outside of it moved to its end."""
        return move_table(table, np.clip(dimensionless(table), self.least, self.most))

    def require(self, table: Table, remedy: str) -> None:
        """Raise InputError, naming the parameter, for a table outside of the range."""
        units, numbers = _units(table.size), dimensionless(table)
        for place, name in enumerate(TABLE_NUMBERS):
            least, most = self.least[place], self.most[place]
            slack = ROUNDED * most
            if not least - slack <= numbers[place] <= most + slack:
                low, high = least * units[place], most * units[place]
                raise InputError(
                    f"table {table.name}: expected a {name} of {low:.3g} to {high:.3g}"
                    f"{UNITS.get(name, '')} for dice of {1e3 * table.size:g} mm, as its momentum "
                    f"model knows, got {numbers[place] * units[place]:.3g}; {remedy}"
                )


def move_table(table: Table, numbers: Floats) -> Table:
    """Table with other dimensionless numbers (5,); ranges keep their width relative to the mean."""
    values = dict(zip(TABLE_NUMBERS, (numbers * _units(table.size)).tolist(), strict=True))
    changed: dict[str, Any] = {}
    for name in compress(TABLE_NUMBERS, numbers != dimensionless(table)):
        spread, value = getattr(table, name), values[name]
        is_wide = isinstance(spread, tuple)
        changed[name] = scale_spread(spread, value / float(np.mean(spread))) if is_wide else value
    if least_of(changed.get("height", table.height)) < table.size:
        # A die falls from no less than its size.
        changed["height"] = max(values["height"], table.size)
    return replace(table, **changed)


LEAST_DEVIATION = 1e-9
"""Smallest standard deviation of a feature or a table's number; below it is rounding."""


MAX_REPRESENTATIVES = 4
"""Number of tables that represent a mixture in the momentum model. With 4, the probabilities of
random dice differ from the mean over all tables by less than a third of what nine in ten tables
differ."""


def _represent_tables(tables: Sequence[Table]) -> tuple[list[int], Floats]:
    """Places of at most `MAX_REPRESENTATIVES` tables that represent equally likely ones, and their
    weights, with the sum 1: greedy medoids, and the shares of the tables nearest to each."""
    measures = table_measures(tables)
    apart = np.linalg.norm(measures[:, None] - measures, axis=2)
    nearest, chosen = np.full(len(tables), np.inf), list[int]()
    while len(chosen) < min(MAX_REPRESENTATIVES, len(tables)):
        left = np.minimum(nearest, apart).sum(axis=1)
        left[chosen] = np.inf
        chosen.append(int(left.argmin()))
        nearest = np.minimum(nearest, apart[chosen[-1]])
    nearest_of = apart[:, chosen].argmin(axis=1)
    return chosen, np.bincount(nearest_of, minlength=len(chosen)) / len(tables)


def table_measures(tables: Sequence[Table]) -> Floats:
    """(t, d) measures of tables: differences of their `scale_numbers` from the mean, relative to
    the root mean square; without the numbers in which no table differs."""
    numbers = np.array([scale_numbers(dimensionless(table)) for table in tables])
    gaps = numbers - numbers.mean(axis=0)
    spread = np.sqrt((gaps**2).mean(axis=0))
    differing = spread > LEAST_DEVIATION
    measures: Floats = gaps[:, differing] / spread[differing]
    return measures


@dataclass(frozen=True)
class Network:
    """Linear map plus one hidden layer of hyperbolic tangents, of features that are scaled to mean
    0 and standard deviation 1.

    Attributes
    ----------
    mean, deviation: (d,); linear: (d, o); bias: (o,); inward: (d, h); shift: (h,);
    outward: (h, o). Bias and shift may be (n, o) and (n, h), one row for each row of features.
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
        """Linear map, bias, inward map, shift and outward map for unscaled features, in NumPy."""
        linear, inward = (part / self.deviation[:, None] for part in (self.linear, self.inward))
        bias, shift = self.bias - self.mean @ linear, self.shift - self.mean @ inward
        return linear, bias, inward, shift, self.outward


TRANSITION_OUTPUTS = 4
"""Logarithms of the rate of a transition, in three terms of a quadratic in time, and of its
stretch."""

CARRY_OUTPUTS = 3
"""Logarithm of the rate of a carry, in three terms."""

WEIGHTS = (-1e3, 1e3)
"""Range of a model's numbers that are not in `RANGES`."""

RANGES = {
    "deviation": (LEAST_DEVIATION, 1e3),
    "restitution": (0.0, 0.95),
    "friction": (1e-3, 10.0),
    "height": (1.0, 1e5),
    "speed": (0.0, 1e5),
    "spin": (0.0, 1e5),
}
"""Ranges of some of a model's numbers, by name: far wider than any table needs, but within them all
probabilities are finite with the sum 1."""


@dataclass(frozen=True)
class GeneralModel:
    """Parameters of the momentum model for all tables of a range, NumPy or torch. Parameters that
    depend on the table are linear in its `table_terms` and have a row for each term.

    Attributes
    ----------
    range: tables for which the model holds.
    numbers: (t, 3) of `MomentumModel.hot`, `cooling` and `carry_barrier`.
    transitions, carries: networks of `TRANSITION_OUTPUTS` and `CARRY_OUTPUTS`, with biases (t, o)
        and shifts (t, h).
    """

    range: TableRange
    numbers: Any
    transitions: Network
    carries: Network


def general_model_of(plain: Any) -> GeneralModel:
    """Model from plain data of a file.

    Raises
    ------
    InputError: an entry is missing, has another shape than in `GeneralModel` and `Network`, or a
        number outside of its range in `RANGES`, else `WEIGHTS`.
    """

    def value_at(path: str) -> Any:
        value = plain
        for key in path.split("."):
            value = value.get(key) if isinstance(value, dict) else None
        return value

    def entry(path: str, *shape: int) -> Floats:
        value = value_at(path)
        try:
            array = np.array(value, dtype=np.float64)
        except (TypeError, ValueError):
            array = np.array(np.nan)
        least, most = RANGES.get(path.rpartition(".")[-1], WEIGHTS)
        if array.shape != shape or not ((least <= array) & (array <= most)).all():
            raise InputError(
                f"momentum model: {path}: expected numbers of shape {shape} from {least:g} to "
                f"{most:g}, got {value!r:.60}; make the table's model again with "
                "`python -m benchmarks train` in a checkout"
            )
        return array

    def network(key: str, columns: int, outputs: int) -> Network:
        outward = value_at(f"{key}.outward")
        hidden = len(outward) if isinstance(outward, list) else 0
        return Network(
            mean=entry(f"{key}.mean", columns),
            deviation=entry(f"{key}.deviation", columns),
            linear=entry(f"{key}.linear", columns, outputs),
            bias=entry(f"{key}.bias", TABLE_TERMS, outputs),
            inward=entry(f"{key}.inward", columns, hidden),
            shift=entry(f"{key}.shift", TABLE_TERMS, hidden),
            outward=entry(f"{key}.outward", hidden, outputs),
        )

    limits = np.array([entry(f"range.{name}", 2) for name in TABLE_NUMBERS])
    return GeneralModel(
        TableRange(*limits.T),
        entry("numbers", TABLE_TERMS, 3),
        network("transitions", TRANSITION_FEATURES, TRANSITION_OUTPUTS),
        network("carries", CARRY_FEATURES, CARRY_OUTPUTS),
    )


IMPACTS = 12
"""Number of impacts in which a die may leave its basin."""

CARRIES = 3
"""Largest number of carries after an impact."""

MAX_LOG_RATE = 8.0
"""Upper bound of the logarithm of the rates of transitions and carries; they are practically
certain then."""

MAX_LOG_STRETCH = 3.0
"""Upper bound of the logarithm of the factor of a transition's barrier."""

NO_BARRIER = 0.003
"""Barrier relative to the radius below which leaving a rest becomes certain."""

NUMBERS = np.array([(-20.0, 20.0), (0.0, 20.0), (0.0, 100.0)])
"""Range of `hot`, `cooling` and `carry_barrier`, to which they are clipped."""


@dataclass(frozen=True)
class MomentumModel(kernels.Handled):
    """Parameters of the momentum model for one table, NumPy or torch.

    Attributes
    ----------
    hot: logarithm of the initial temperature, in radii, -20 to 20. cooling: decrease of the
        logarithm, 0 to 20. carry_barrier: weight of the second barrier of a carry, 0 to 100.
    transitions, carries: networks of `TRANSITION_OUTPUTS` and `CARRY_OUTPUTS`.
    general: the model of all tables that this one comes from, in NumPy.
    """

    hot: Any
    cooling: Any
    carry_barrier: Any
    transitions: Network
    carries: Network
    general: GeneralModel

    @classmethod
    def of(cls, general: GeneralModel, table: Table) -> MomentumModel:
        """Model of a table. Raises InputError if the table is outside of the model's range."""
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
        """Model of another table, or of the nearest table in the range."""
        return self.of(self.general, self.general.range.nearest(table))

    def convert(self, convert: Callable[[Any], Any]) -> MomentumModel:
        """Model with converted arrays."""
        numbers = self.hot, self.cooling, self.carry_barrier
        hot, cooling, carry_barrier = map(convert, numbers)
        transitions, carries = (
            Network(*map(convert, vars(network).values()))
            for network in (self.transitions, self.carries)
        )
        return MomentumModel(hot, cooling, carry_barrier, transitions, carries, self.general)

    @cached_property
    def handle(self) -> Any:
        """Handle of this model for the kernels, in NumPy."""
        networks = self.transitions, self.carries
        numbers = [np.array([self.hot, self.cooling, self.carry_barrier])]
        numbers += [part.ravel() for network in networks for part in network.unscale()]
        return kernels.new_handle(
            "Momentum",
            np.concatenate(numbers),
            [len(network.shift) for network in networks],
            (IMPACTS, CARRIES),
            (MAX_LOG_RATE, MAX_LOG_STRETCH, NO_BARRIER, *SMOOTHING, ROUNDING),
        )


@dataclass(frozen=True)
class MomentumMixture:
    """Momentum models of the tables that represent a mixture.

    Attributes
    ----------
    models: (m,) of each table; weights: (m,) of their probabilities, with the sum 1.
    """

    models: tuple[MomentumModel, ...]
    weights: Floats

    @classmethod
    def alone(cls, model: MomentumModel) -> MomentumMixture:
        """Mixture of one model."""
        return cls((model,), np.ones(1))

    def near(self, table: Table) -> MomentumMixture:
        """Mixture of one table, or of the nearest table in the range."""
        return MomentumMixture.alone(self.models[0].near(table))


def momentum_model(table: str) -> MomentumMixture | None:
    """Momentum model of a table, by its name or the path of a JSON file: the model in its file,
    else the general one; None for tables with drag. Tables of its mixture that are outside of the
    model's range are moved to its end.

    Raises
    ------
    InputError: there is no such table, the model in its file is invalid, or the table is outside of
        the model's range.
    """
    thrown = load_table(table)
    if thrown.drag > 0.0:
        return None
    entries = table_entries(table)
    with named(f"table {table}"):
        own = entries.get("momentum")
        general = general_model() if own is None else general_model_of(own)
    model, tables = MomentumModel.of(general, thrown), mixture_tables(table)
    places, weights = _represent_tables(tables)
    return MomentumMixture(tuple(model.near(tables[place]) for place in places), weights)


@cache
def general_model() -> GeneralModel:
    """Model of all tables that comes with the package."""
    return general_model_of(json.loads(read_packaged("momentum")))
