"""Throws of many shapes together: distances between models, and correlations with asymmetry."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from dicedesign.bench.measures.throws.simulator_odds import ENGINE_NAMES, ShapeOdds
from dicedesign.bench.reference.published_distances import PRINTED_CORRELATIONS, PublishedDistances
from dicedesign.bench.rows import Row, column, hidden
from dicedesign.throws.correlation import Correlation, correlation
from dicedesign.throws.odds_comparison import Distance

__all__ = [
    "EngineTotals",
    "PublishedCorrelation",
    "Summary",
    "compared",
    "engine_totals",
    "measured",
    "published_correlations",
    "summaries",
]


def measured(distance: Distance) -> str:
    """A distance with its sampling error."""
    return f"{distance.value:.3f}±{distance.error:.3f}"


@dataclass(frozen=True)
class EngineTotals(Row):
    """One simulator on one table: all its drops, how many of them ended on no facet, the largest
    part of one shape's that did, drops a second and the seconds of one core that they took."""

    table: ClassVar[str | None] = "engines"

    on: str = column("table", -12)
    engine: str = column("simulator", -12, ENGINE_NAMES.__getitem__)
    drops: int = column("drops", 9)
    unresolved: int = column("unresolved", 12)
    largest_share: float = column("most of a shape", 17, ".1%")
    drops_per_second: float = column("drops a second", 16, ".0f")
    seconds: float = hidden()


@dataclass(frozen=True)
class Summary(Row):
    """Two models' odds of all shapes that both know about, on one table.

    Attributes
    ----------
    on: name of the table; models: the names of the two; shapes: how many.
    wasserstein, total_variation: means over the shapes, of the sampling error and of the noise
        floor too, which also stand alone.
    correlation: of the Wasserstein distance with the asymmetry rho.
    """

    table: ClassVar[str | None] = "summaries"

    on: str = column("table", -12)
    models: tuple[str, str] = column("", -28, " vs ".join)
    shapes: int = column("shapes", 8)
    wasserstein: Distance = column("W", 14, measured)
    wasserstein_floor: float = column("floor", 8, ".3f")
    total_variation: Distance = column("TV", 14, measured)
    total_variation_floor: float = column("floor", 8, ".3f")
    correlation: Correlation = column("r", 0, str)


@dataclass(frozen=True)
class PublishedCorrelation:
    """What the paper's text says of two models, and what its rows say, if they are at hand."""

    models: str
    printed: float
    printed_p_value: float
    recomputed: Correlation | None

    def __str__(self) -> str:
        again = self.recomputed
        rows_say = "" if again is None else f"; its {again.pairs} shapes give {again}"
        p_value = f"{self.printed_p_value:.1g}"
        return f"  {self.models}: printed r = {self.printed:.2f}, p = {p_value}{rows_say}"


def summaries(shapes: Sequence[ShapeOdds]) -> Iterator[Summary]:
    """For each table and each two models. Raises InputError: as `correlation`."""
    for table in shapes[0].tables:
        for models in compared(shapes, table):
            having = [shape for shape in shapes if models in shape.tables[table].comparisons]
            both = [shape.tables[table].comparisons[models] for shape in having]
            distances = np.array([comparison.wasserstein.value for comparison in both])
            wasserstein = _mean([comparison.wasserstein for comparison in both])
            variation = _mean([comparison.total_variation for comparison in both])
            yield Summary(
                on=table,
                models=models,
                shapes=len(having),
                wasserstein=wasserstein,
                wasserstein_floor=wasserstein.noise_floor,
                total_variation=variation,
                total_variation_floor=variation.noise_floor,
                correlation=correlation(np.array([s.asymmetry for s in having]), distances),
            )


def compared(shapes: Sequence[ShapeOdds], table: str) -> list[tuple[str, str]]:
    """Each two models that some shape has been given by."""
    return list(dict.fromkeys(both for shape in shapes for both in shape.tables[table].comparisons))


def _mean(distances: Sequence[Distance]) -> Distance:
    rows = [(d.value, d.error, d.noise_floor) for d in distances]
    return Distance(*np.mean(rows, axis=0).tolist())


def engine_totals(shapes: Sequence[ShapeOdds]) -> Iterator[EngineTotals]:
    """For each table and each simulator that threw there."""
    for name, table in shapes[0].tables.items():
        for engine in table.throws:
            throws = [shape.tables[name].throws[engine] for shape in shapes]
            drops, seconds = sum(t.drops for t in throws), sum(t.seconds for t in throws)
            yield EngineTotals(
                on=name,
                engine=engine,
                drops=drops,
                unresolved=sum(t.unresolved for t in throws),
                largest_share=max(t.unresolved / t.drops for t in throws),
                drops_per_second=drops / seconds,
                seconds=seconds,
            )


def published_correlations(published: PublishedDistances | None) -> list[PublishedCorrelation]:
    """The paper's correlations of W with rho, for each two models."""
    return [
        PublishedCorrelation(
            models,
            *printed,
            None
            if published is None
            else correlation(published.asymmetry, published.distances[models]),
        )
        for models, printed in PRINTED_CORRELATIONS.items()
    ]
