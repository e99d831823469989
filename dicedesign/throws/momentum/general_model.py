"""Parameters of momentum models of many tables, and their plain data as in files."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.momentum.network import LEAST_DEVIATION, Network
from dicedesign.throws.momentum.table_terms import TABLE_NUMBERS, TABLE_TERMS, TableRange
from dicedesign.throws.momentum.transition_features import CARRY_FEATURES, TRANSITION_FEATURES

__all__ = [
    "CARRY_OUTPUTS",
    "RANGES",
    "TRANSITION_OUTPUTS",
    "WEIGHTS",
    "GeneralModel",
    "general_model_of",
    "plain_model",
]

TRANSITION_OUTPUTS: Final = 4
"""Logarithms of the rate of a transition, in three terms of a quadratic in time, and of its
stretch."""

CARRY_OUTPUTS: Final = 3
"""Logarithm of the rate of a carry, in three terms."""

DIGITS: Final = 6
"""Significant digits of a model in a file."""

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
odds are finite with the sum 1."""


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
    return GeneralModel(
        _range(plain),
        _array(plain, "numbers", (TABLE_TERMS, 3)),
        _network(plain, "transitions", len(TRANSITION_FEATURES), TRANSITION_OUTPUTS),
        _network(plain, "carries", len(CARRY_FEATURES), CARRY_OUTPUTS),
    )


def plain_model(model: GeneralModel) -> dict[str, Any]:
    """A model as plain data for a file, with `DIGITS` digits and every number in its range; the
    inverse of `general_model_of`."""

    def plain(part: Any, name: str) -> Any:
        if isinstance(part, list):
            return [plain(entry, name) for entry in part]
        least, most = RANGES.get(name, WEIGHTS)
        return float(f"{min(max(float(part), least), most):.{DIGITS}g}")

    limits = np.stack([model.range.least, model.range.most], axis=1).tolist()
    return {
        "range": {name: plain(of, name) for name, of in zip(TABLE_NUMBERS, limits, strict=True)},
        "numbers": plain(model.numbers.tolist(), "numbers"),
        **{
            key: {name: plain(array.tolist(), name) for name, array in vars(network).items()}
            for key, network in (("transitions", model.transitions), ("carries", model.carries))
        },
    }


def _range(plain: dict[str, Any]) -> TableRange:
    entries = _part(plain, "range", TABLE_NUMBERS)
    limits = [_array(entries, f"range.{name}", (2,)) for name in TABLE_NUMBERS]
    for name, (least, most) in zip(TABLE_NUMBERS, limits, strict=True):
        if least > most:
            raise _wrong(f"range.{name}", "the lower limit first", f"{least:g}, {most:g}")
    least, most = np.transpose(limits)
    return TableRange(least, most)


def _network(plain: dict[str, Any], key: str, columns: int, outputs: int) -> Network:
    entries = _part(plain, key, tuple(field.name for field in fields(Network)))
    units = _array(entries, f"{key}.outward", None).shape[:1]
    hidden = units[0] if units else 0
    shapes: dict[str, tuple[int, ...]] = {
        "mean": (columns,),
        "deviation": (columns,),
        "linear": (columns, outputs),
        "bias": (TABLE_TERMS, outputs),
        "inward": (columns, hidden),
        "shift": (TABLE_TERMS, hidden),
        "outward": (hidden, outputs),
    }
    return Network(
        **{name: _array(entries, f"{key}.{name}", shape) for name, shape in shapes.items()}
    )


def _part(plain: dict[str, Any], key: str, names: tuple[str, ...]) -> dict[str, Any]:
    """The entries of a network or of a range."""
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
        "with `python -m benchmarks train` in a checkout"
    )
