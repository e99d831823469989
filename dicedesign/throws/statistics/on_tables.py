"""Total variation of one die on many tables, from few throws onto each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.statistics.bias import Bias
from dicedesign.throws.statistics.total_variation import total_variation

__all__ = ["OFTEN", "TableVariations", "variations_on_tables"]

OFTEN: Final = 0.9
"""Part of the tables that a die is to be right on."""

DEVIATIONS: Final = (1.0, 0.1)
"""Of what the model gets wrong: in common, and by each measure of a table. Large enough for throws
to have their say, so that what is found is not nearer to the model than the die."""

SERIES: Final = 40
"""Series of throws that are drawn to see what chance alone does."""

SEED: Final = 0


@dataclass(frozen=True)
class TableVariations:
    """How far a die's odds are from the target on each of many tables.

    Attributes
    ----------
    values: (n,) total variation on each. often: what they do not exceed on nine tables in ten;
        worst: the largest.
    chance_often, chance_worst: what these would be on the mean of a perfect die, judged by as many
        throws.
    """

    values: tuple[float, ...]
    often: float
    worst: float
    chance_often: float
    chance_worst: float


@dataclass(frozen=True)
class Series:
    """Throws onto one table.

    Attributes
    ----------
    odds: (k,) in a model. counts: (k,) of the outcomes.
    """

    odds: Floats
    counts: Integers


def variations_on_tables(
    target: Floats, measures: Floats, others: Sequence[Series], meant: Series
) -> TableVariations:
    """The total variation of a die on other tables than the one that is meant, from throws onto
    all.

    On each table the logarithms of its odds over those in a model are taken to be linear in what
    measures the table. So throws onto all tables tell of each, and few of each will do.

    Parameters
    ----------
    target: (k,) wanted odds. measures: (n, d) of the others, 0 for the table that is meant.
    others: n series of throws; meant: those onto the table that is meant.
    """
    found = _odds_on_tables(measures, others, meant)
    values = [total_variation(odds, target) for odds in found]
    rng, chance = np.random.default_rng(SEED), []
    here = meant.counts / meant.counts.sum()
    for _ in range(SERIES):
        drawn = [_drawn(one, odds, rng) for one, odds in zip(others, found, strict=True)]
        again = _odds_on_tables(measures, drawn, _drawn(meant, here, rng))
        chance.append([total_variation(a, b) for a, b in zip(again, found, strict=True)])
    return TableVariations(
        tuple(values),
        float(np.quantile(values, OFTEN)),
        max(values),
        float(np.quantile(chance, OFTEN, axis=1).mean()),
        float(np.max(chance, axis=1).mean()),
    )


def _drawn(series: Series, odds: Floats, rng: np.random.Generator) -> Series:
    """As many throws of a die with odds (k,)."""
    return Series(series.odds, rng.multinomial(series.counts.sum(), odds))


def _odds_on_tables(measures: Floats, others: Sequence[Series], meant: Series) -> list[Floats]:
    """The most likely odds (k,) on each of the other tables."""
    deviations = np.repeat(DEVIATIONS, [1, measures.shape[1]])
    bias, rows = Bias(deviations[None]), np.insert(measures, 0, 1.0, axis=1)
    bias.learn(np.eye(rows.shape[1])[0], meant.odds, meant.counts)
    for row, series in zip(rows, others, strict=True):
        bias.learn(row, series.odds, series.counts)
    return [bias.belief(row, one.odds).odds for row, one in zip(rows, others, strict=True)]
