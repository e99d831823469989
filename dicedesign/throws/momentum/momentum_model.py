"""The parameters of the momentum model, fitted to one table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from types import ModuleType
from typing import Any, Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.momentum.transition_features import CARRY_FEATURES, PASS_FEATURES
from dicedesign.throws.tables import table_entries, table_named

__all__ = [
    "CARRY_OUTPUTS",
    "PASS_OUTPUTS",
    "MomentumModel",
    "Network",
    "Slopes",
    "model_of",
    "momentum_model",
]

PASS_OUTPUTS: Final = 4
"""Logarithm of the rate of a pass, in three terms of a quadratic in time, and of its stretch."""

CARRY_OUTPUTS: Final = 3
"""Logarithm of the rate of a carry, in three terms."""


@dataclass(frozen=True)
class Network:
    """A linear map plus one hidden layer of hyperbolic tangents, of features that are brought to
    mean 0 and standard deviation 1 first.

    Attributes
    ----------
    mean, deviation: (d,); linear: (d, o); bias: (o,); inward: (d, h); shift: (h,);
    outward: (h, o).
    """

    mean: Any
    deviation: Any
    linear: Any
    bias: Any
    inward: Any
    shift: Any
    outward: Any

    def __call__(self, table: Any, xp: ModuleType) -> Any:
        """Outputs (n, o) for features (n, d)."""
        scaled = (table - self.mean) / self.deviation
        hidden = xp.tanh(scaled @ self.inward + self.shift)
        return scaled @ self.linear + self.bias + hidden @ self.outward

    def unscaled(self) -> tuple[Floats, ...]:
        """The maps and their constants, of NumPy, that take features as they are."""
        linear, inward = (part / self.deviation[:, None] for part in (self.linear, self.inward))
        bias, shift = self.bias - self.mean @ linear, self.shift - self.mean @ inward
        return linear, bias, inward, shift, self.outward


@dataclass(frozen=True)
class Slopes:
    """Derivatives of a model's numbers in the table's restitution, over the restitution itself.

    Attributes
    ----------
    numbers: (3,) of `hot`, `cooling` and `carry_barrier`. passes, carries: (1 + d, o) of a
        network's bias, in the first row, and of its linear map.
    """

    numbers: Any
    passes: Any
    carries: Any


@dataclass(frozen=True)
class MomentumModel:
    """Parameters of the model, NumPy or torch.

    Attributes
    ----------
    hot: logarithm of the temperature at first, in radii. cooling: logarithm of its decrease.
    carry_barrier: weight of the second barrier of a carry.
    passes, carries: networks of `PASS_OUTPUTS` and `CARRY_OUTPUTS`.
    slopes: how all these change with the table.
    """

    hot: Any
    cooling: Any
    carry_barrier: Any
    passes: Network
    carries: Network
    slopes: Slopes

    def converted(self, convert: Callable[[Any], Any]) -> MomentumModel:
        """The same with other arrays."""
        hot, cooling, carry = (convert(x) for x in (self.hot, self.cooling, self.carry_barrier))
        passes, carries = (
            Network(*(convert(array) for array in vars(network).values()))
            for network in (self.passes, self.carries)
        )
        slopes = Slopes(*(convert(array) for array in vars(self.slopes).values()))
        return MomentumModel(hot, cooling, carry, passes, carries, slopes)

    def at(self, change: float) -> MomentumModel:
        """The model of a table whose restitution is higher by this part, which is small."""
        slopes = self.slopes
        hot, cooling, carry = change * slopes.numbers
        passes, carries = (
            replace(
                network,
                bias=network.bias + change * slope[0],
                linear=network.linear + change * slope[1:],
            )
            for network, slope in ((self.passes, slopes.passes), (self.carries, slopes.carries))
        )
        return MomentumModel(
            self.hot + hot,
            self.cooling + cooling,
            self.carry_barrier + carry,
            passes,
            carries,
            slopes,
        )

    @cached_property
    def flat(self) -> tuple[Floats, Integers]:
        """All numbers of a model in NumPy in one array, as kernels take them, and (2,) how many
        hidden units the networks have."""
        networks = self.passes, self.carries
        numbers = [np.array([self.hot, self.cooling, self.carry_barrier])]
        numbers += [part.ravel() for network in networks for part in network.unscaled()]
        return np.concatenate(numbers), np.array([len(network.shift) for network in networks])


def momentum_model(table: str) -> MomentumModel | None:
    """The model of a table by its name, or from a JSON file by its path; None for tables with drag,
    on which there is no momentum.

    Raises
    ------
    InputError: there is no such table, or none of its momentum model.
    """
    if table_named(table).drag > 0.0:
        return None
    entries = table_entries(table)
    if "momentum" not in entries:
        raise InputError(
            f"--table {table}: expected a table with a momentum model, got one without; make one "
            "with `dicedesign table learn`"
        )
    try:
        return model_of(entries["momentum"])
    except InputError as error:
        raise InputError(f"--table {table}: {error}") from error


def model_of(plain: dict[str, Any]) -> MomentumModel:
    """A model from plain data, as in a table's file.

    Raises
    ------
    InputError: something is missing, is no finite number, or has another shape than in `Network`.
    """
    try:
        hot, cooling, carry = (
            np.float64(plain[key]) for key in ("hot", "cooling", "carry_barrier")
        )
        if not np.isfinite([hot, cooling, carry]).all():
            raise ValueError("not all numbers are finite")
        passes = _network(plain["passes"], len(PASS_FEATURES), PASS_OUTPUTS)
        carries = _network(plain["carries"], len(CARRY_FEATURES), CARRY_OUTPUTS)
        slopes = _slopes(plain["slopes"])
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"momentum model: expected what `dicedesign table learn` writes, but {error!r}; make "
            "the table's model again"
        ) from error
    return MomentumModel(hot, cooling, carry, passes, carries, slopes)


def _network(plain: dict[str, Any], columns: int, outputs: int) -> Network:
    network = Network(**{key: np.array(value, dtype=np.float64) for key, value in plain.items()})
    units = network.shift.size
    expected = [(columns,)] * 2 + [(columns, outputs), (outputs,), (columns, units), (units,)]
    _check_arrays(network, [*expected, (units, outputs)])
    return network


def _slopes(plain: dict[str, Any]) -> Slopes:
    slopes = Slopes(**{key: np.array(value, dtype=np.float64) for key, value in plain.items()})
    passes, carries = (
        (1 + len(PASS_FEATURES), PASS_OUTPUTS),
        (1 + len(CARRY_FEATURES), CARRY_OUTPUTS),
    )
    _check_arrays(slopes, [(3,), passes, carries])
    return slopes


def _check_arrays(part: Network | Slopes, expected: list[tuple[int, ...]]) -> None:
    arrays = vars(part).values()
    found = [array.shape for array in arrays]
    if found != expected:
        raise ValueError(f"arrays of shapes {expected} came as {found}")
    if not all(np.isfinite(array).all() for array in arrays):
        raise ValueError("not all numbers are finite")
