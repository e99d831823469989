"""The parameters of the momentum model, fitted to one table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from types import ModuleType
from typing import Any, Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.kernels import ops as kernels
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.momentum.transition_features import (
    CARRY_FEATURES,
    SMOOTHING,
    TRANSITION_FEATURES,
)
from dicedesign.throws.tables import table_entries, table_named
from dicedesign.tolerances import ROUNDING

__all__ = [
    "CARRIES",
    "CARRY_OUTPUTS",
    "IMPACTS",
    "MOST_RATE",
    "MOST_STRETCH",
    "NO_BARRIER",
    "TRANSITION_OUTPUTS",
    "MomentumModel",
    "Network",
    "Slopes",
    "model_of",
    "momentum_model",
    "plain_model",
]

TRANSITION_OUTPUTS: Final = 4
"""Logarithms of the rate of a transition, in three terms of a quadratic in time, and of its
stretch."""

CARRY_OUTPUTS: Final = 3
"""Logarithm of the rate of a carry, in three terms."""

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

TRANSITIONS_KEY: Final = "passes"
"""Name of transitions in files."""

DIGITS: Final = 6
"""Significant digits of a model in a file."""


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
    numbers: (3,) of `hot`, `cooling` and `carry_barrier`. transitions, carries: (1 + d, o) of a
        network's bias, in the first row, and of its linear map.
    """

    numbers: Any
    transitions: Any
    carries: Any


@dataclass(frozen=True)
class MomentumModel(kernels.Handled):
    """Parameters of the model, NumPy or torch.

    Attributes
    ----------
    hot: logarithm of the temperature at first, in radii. cooling: logarithm of its decrease.
    carry_barrier: weight of the second barrier of a carry.
    transitions, carries: networks of `TRANSITION_OUTPUTS` and `CARRY_OUTPUTS`.
    slopes: how all these change with the table.
    """

    hot: Any
    cooling: Any
    carry_barrier: Any
    transitions: Network
    carries: Network
    slopes: Slopes

    def converted(self, convert: Callable[[Any], Any]) -> MomentumModel:
        """The same with other arrays."""
        hot, cooling, carry = (convert(x) for x in (self.hot, self.cooling, self.carry_barrier))
        transitions, carries = (
            Network(*(convert(array) for array in vars(network).values()))
            for network in (self.transitions, self.carries)
        )
        slopes = Slopes(*(convert(array) for array in vars(self.slopes).values()))
        return MomentumModel(hot, cooling, carry, transitions, carries, slopes)

    def at(self, change: float) -> MomentumModel:
        """The model of a table whose restitution is higher by this part, which is small."""
        slopes = self.slopes
        hot, cooling, carry = change * slopes.numbers
        transitions, carries = (
            replace(
                network,
                bias=network.bias + change * slope[0],
                linear=network.linear + change * slope[1:],
            )
            for network, slope in (
                (self.transitions, slopes.transitions),
                (self.carries, slopes.carries),
            )
        )
        return MomentumModel(
            self.hot + hot,
            self.cooling + cooling,
            self.carry_barrier + carry,
            transitions,
            carries,
            slopes,
        )

    @cached_property
    def handle(self) -> Any:
        """This model as kernels take it, in NumPy."""
        networks = self.transitions, self.carries
        numbers = [np.array([self.hot, self.cooling, self.carry_barrier])]
        numbers += [part.ravel() for network in networks for part in network.unscaled()]
        return kernels.new_handle(
            "Momentum",
            np.concatenate(numbers),
            [len(network.shift) for network in networks],
            (IMPACTS, CARRIES),
            (MOST_RATE, MOST_STRETCH, NO_BARRIER, *SMOOTHING, ROUNDING),
        )


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
            f"table {table}: expected a table with a momentum model, got one without; make one "
            "with `dicedesign table learn`"
        )
    try:
        return model_of(entries["momentum"])
    except InputError as error:
        raise InputError(f"table {table}: {error}") from error


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
        transitions = _network(plain[TRANSITIONS_KEY], len(TRANSITION_FEATURES), TRANSITION_OUTPUTS)
        carries = _network(plain["carries"], len(CARRY_FEATURES), CARRY_OUTPUTS)
        slopes = Slopes(**_arrays(plain["slopes"]))
        shapes = [(1 + len(part.linear), len(part.bias)) for part in (transitions, carries)]
        _check_arrays(slopes, [(3,), *shapes])
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"momentum model: expected what `dicedesign table learn` writes, but {error!r}; make "
            "the table's model again"
        ) from error
    return MomentumModel(hot, cooling, carry, transitions, carries, slopes)


def _network(plain: dict[str, Any], columns: int, outputs: int) -> Network:
    network = Network(**_arrays(plain))
    units = network.shift.size
    expected = [(columns,)] * 2 + [(columns, outputs), (outputs,), (columns, units), (units,)]
    _check_arrays(network, [*expected, (units, outputs)])
    return network


def _arrays(plain: dict[str, Any]) -> dict[str, Floats]:
    """The entries of a network or of slopes, by the names of their attributes."""
    return {
        "transitions" if key == TRANSITIONS_KEY else key: np.array(value, dtype=np.float64)
        for key, value in plain.items()
    }


def plain_model(model: MomentumModel) -> dict[str, Any]:
    """A model as plain data for a table's file, with `DIGITS` digits; the inverse of `model_of`."""

    def plain(part: Any) -> Any:
        if isinstance(part, Network | Slopes):
            return {
                TRANSITIONS_KEY if key == "transitions" else key: plain(array.tolist())
                for key, array in vars(part).items()
            }
        if isinstance(part, list):
            return [plain(entry) for entry in part]
        return float(f"{float(part):.{DIGITS}g}")

    parts = {name: getattr(model, name) for name in ("hot", "cooling", "carry_barrier")}
    parts |= {TRANSITIONS_KEY: model.transitions, "carries": model.carries, "slopes": model.slopes}
    return {name: plain(part) for name, part in parts.items()}


def _check_arrays(part: Network | Slopes, expected: list[tuple[int, ...]]) -> None:
    arrays = vars(part).values()
    shapes = [array.shape for array in arrays]
    if shapes != expected:
        raise ValueError(f"arrays of shapes {expected} came as {shapes}")
    if not all(np.isfinite(array).all() for array in arrays):
        raise ValueError("not all numbers are finite")
