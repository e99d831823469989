"""Odds other than those of a body let go without momentum and with any side down alike."""

from __future__ import annotations

from typing import Protocol

from torch import Tensor

from dicedesign.errors import InputError
from dicedesign.gradient.prior_odds import OddsUnderPrior
from dicedesign.gradient.rest_odds import RestEvaluation
from dicedesign.gradient.thrown_odds import ThrownOdds
from dicedesign.rest.prior import Prior
from dicedesign.runtime.arrays import Floats

__all__ = ["OddsModel", "odds_model"]


class OddsModel(Protocol):
    """Odds of the rests of a hull, in the order of `RestEvaluation.paths.rests`, as numbers, with
    gradients, and with the derivatives of all at once."""

    def odds(self, rests: RestEvaluation) -> Floats:
        """(k,) summing to 1."""

    def tensor(self, rests: RestEvaluation) -> Tensor:
        """(k,) the same, with gradients."""

    def jacobian(self, rests: RestEvaluation) -> Floats:
        """(k, 3 n) derivatives in the hull's vertices, with which the center of mass of a uniform
        solid moves."""


def odds_model(table: str | None, prior: Prior | str | None) -> OddsModel | None:
    """The model of the odds of a body that is thrown onto a table, or let go under a prior; None
    for neither. Raises InputError for both."""
    if table is not None and prior is not None:
        raise InputError(
            "prior: expected none with a table, onto which bodies are thrown with any side down "
            "alike, got both; leave one of them out"
        )
    if prior is not None:
        return OddsUnderPrior.of(prior)
    return None if table is None else ThrownOdds.on(table)
