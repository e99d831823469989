"""The parameters of the momentum model, fitted to one table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cached_property
from types import ModuleType
from typing import Any, Final

import numpy as np

from dicedesign.errors import InputError, named
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
    "LEAST_DEVIATION",
    "MOST_RATE",
    "MOST_STRETCH",
    "NO_BARRIER",
    "RANGES",
    "TRANSITION_OUTPUTS",
    "WEIGHTS",
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

LEAST_DEVIATION: Final = 1e-9
"""Of a feature: finer is rounding."""

WEIGHTS: Final = (-1e3, 1e3)
"""Range of a model's numbers but those of `RANGES`. The weights that training punishes are below a
third of it, as it begins with a loss below 14."""

RANGES: Final = {
    "hot": (-20.0, 20.0),
    "cooling": (0.0, 20.0),
    "carry_barrier": (0.0, 100.0),
    "deviation": (LEAST_DEVIATION, 1e3),
}
"""Of some of a model's numbers, by name: far beyond what any table comes to, and within it all
odds are finite with the sum 1."""


@dataclass(frozen=True)
class Network:
    """A linear map plus one hidden layer of hyperbolic tangents, of features that are brought to
    mean 0 and standard deviation 1 first.

    Attributes
    ----------
    mean, deviation: (d,); linear: (d, o); bias: (o,); inward: (d, h); shift: (h,);
    outward: (h, o). Deviations are `LEAST_DEVIATION` to 1000, all others -1000 to 1000.
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
    hot: logarithm of the temperature at first, in radii, -20 to 20. cooling: logarithm of its
        decrease, 0 to 20. carry_barrier: weight of the second barrier of a carry, 0 to 100.
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
    with named(f"table {table}"):
        return model_of(entries["momentum"])


def model_of(plain: Any) -> MomentumModel:
    """A model from plain data, as in a table's file.

    Raises
    ------
    InputError: something is missing, is no number in its range of `RANGES`, else in `WEIGHTS`, or
        has another shape than in `Network`.
    """
    if not isinstance(plain, dict):
        raise InputError(
            f"momentum: expected an object with the numbers of a model, got {plain!r:.40}; "
            "make one with `dicedesign table learn`"
        )
    hot, cooling, carry = (
        np.float64(_array(plain, key, ())) for key in ("hot", "cooling", "carry_barrier")
    )
    transitions = _network(plain, TRANSITIONS_KEY, len(TRANSITION_FEATURES), TRANSITION_OUTPUTS)
    carries = _network(plain, "carries", len(CARRY_FEATURES), CARRY_OUTPUTS)
    slopes = _part(plain, "slopes", ("numbers", TRANSITIONS_KEY, "carries"))
    return MomentumModel(
        hot,
        cooling,
        carry,
        transitions,
        carries,
        Slopes(
            _array(slopes, "slopes.numbers", (3,)),
            _array(slopes, f"slopes.{TRANSITIONS_KEY}", _slopes_shape(transitions)),
            _array(slopes, "slopes.carries", _slopes_shape(carries)),
        ),
    )


def _network(plain: dict[str, Any], key: str, columns: int, outputs: int) -> Network:
    entries = _part(plain, key, tuple(field.name for field in fields(Network)))
    units = _array(entries, f"{key}.shift", None).size
    shapes: dict[str, tuple[int, ...]] = {
        "mean": (columns,),
        "deviation": (columns,),
        "linear": (columns, outputs),
        "bias": (outputs,),
        "inward": (columns, units),
        "shift": (units,),
        "outward": (units, outputs),
    }
    return Network(
        **{name: _array(entries, f"{key}.{name}", shape) for name, shape in shapes.items()}
    )


def _slopes_shape(network: Network) -> tuple[int, int]:
    return 1 + len(network.linear), len(network.bias)


def _part(plain: dict[str, Any], key: str, names: tuple[str, ...]) -> dict[str, Any]:
    """The entries of a network or of slopes."""
    part = plain.get(key)
    if not isinstance(part, dict) or set(part) != set(names):
        got = ", ".join(part) if isinstance(part, dict) else type(part).__name__
        raise _wrong(key, f"an object with {', '.join(names)}", got)
    return part


def _array(plain: dict[str, Any], path: str, shape: tuple[int, ...] | None) -> Floats:
    """The numbers of an entry, named by its whole path, in any shape for None."""
    name = path.rpartition(".")[-1]
    try:
        array = np.array(plain.get(name))
    except ValueError:
        raise _wrong(path, "rows of the same length", "others") from None
    if array.dtype.kind not in "iuf":
        raise _wrong(path, "numbers", f"{plain.get(name)!r:.60}")
    if shape is not None and array.shape != shape:
        raise _wrong(path, f"numbers of shape {shape}", f"{array.shape}")
    least, most = RANGES.get(name, WEIGHTS)
    outside = array[~((least <= array) & (array <= most))]
    if outside.size:
        raise _wrong(path, f"numbers from {least:g} to {most:g}", f"{outside.flat[0]:g}")
    return array.astype(np.float64)


def _wrong(path: str, expected: str, got: str) -> InputError:
    return InputError(
        f"momentum model: {path}: expected {expected}, got {got}; make the table's model again "
        "with `dicedesign table learn`"
    )


def plain_model(model: MomentumModel) -> dict[str, Any]:
    """A model as plain data for a table's file, with `DIGITS` digits and every number in its range;
    the inverse of `model_of`."""

    def plain(part: Any, name: str) -> Any:
        if isinstance(part, Network | Slopes):
            return {
                TRANSITIONS_KEY if key == "transitions" else key: plain(array.tolist(), key)
                for key, array in vars(part).items()
            }
        if isinstance(part, list):
            return [plain(entry, name) for entry in part]
        least, most = RANGES.get(name, WEIGHTS)
        return float(f"{min(max(float(part), least), most):.{DIGITS}g}")

    parts = {name: getattr(model, name) for name in ("hot", "cooling", "carry_barrier")}
    parts |= {TRANSITIONS_KEY: model.transitions, "carries": model.carries, "slopes": model.slopes}
    return {name: plain(part, name) for name, part in parts.items()}
