"""The parameters of the momentum model on one table."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, cached_property
from importlib import resources
from typing import Any, Final

import numpy as np

from dicedesign.errors import named
from dicedesign.kernels import ops as kernels
from dicedesign.throws.momentum.general_model import GeneralModel, general_model_of
from dicedesign.throws.momentum.network import Network
from dicedesign.throws.momentum.table_terms import table_terms
from dicedesign.throws.momentum.transition_features import SMOOTHING
from dicedesign.throws.tables import Table, table_entries, table_named
from dicedesign.tolerances import ROUNDING

__all__ = [
    "CARRIES",
    "IMPACTS",
    "MOST_RATE",
    "MOST_STRETCH",
    "NO_BARRIER",
    "NUMBERS",
    "MomentumModel",
    "general_model",
    "momentum_model",
]

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
        """That of a table. Raises InputError: the table is not in the model's range."""
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

    def on(self, table: Table) -> MomentumModel:
        """The model of another table. Raises InputError: it is not in the model's range."""
        return self.of(self.general, table)

    def near(self, table: Table) -> MomentumModel:
        """That of another table, or of the nearest one that the model knows."""
        return self.on(self.general.range.nearest(table))

    def converted(self, convert: Callable[[Any], Any]) -> MomentumModel:
        """The same with other arrays."""
        hot, cooling, carry = (convert(x) for x in (self.hot, self.cooling, self.carry_barrier))
        transitions, carries = (
            Network(*(convert(array) for array in vars(network).values()))
            for network in (self.transitions, self.carries)
        )
        return MomentumModel(hot, cooling, carry, transitions, carries, self.general)

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
    """The model of a table by its name, or from a JSON file by its path: the table's own, else that
    of all tables; None for tables with drag, on which there is no momentum.

    Raises
    ------
    InputError: there is no such table, its own model is none, or it is not in the model's range.
    """
    thrown = table_named(table)
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
    text = resources.files("dicedesign.throws").joinpath("named/momentum.json").read_text()
    return general_model_of(json.loads(text))
