"""What the throws of many shapes say together: distances, correlations, a record and a figure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from dicedesign.bench.measures.simulator_odds import TABLES, ShapeOdds
from dicedesign.bench.reference.published_distances import PRINTED_CORRELATIONS, PublishedDistances
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.statistics.correlation import Correlation, correlation
from dicedesign.throws.statistics.odds_comparison import Distance

if TYPE_CHECKING:
    from dicedesign.report.charts.paper import Paper

__all__ = [
    "EngineTotals",
    "PublishedCorrelation",
    "Summary",
    "engine_totals",
    "published_correlations",
    "shape_record",
    "summaries",
    "table_figure",
]


@dataclass(frozen=True)
class Summary:
    """Two models' odds of all shapes that both know about, on one table.

    Attributes
    ----------
    table: its name; models: the names of the two; shapes: how many.
    wasserstein, total_variation: means over the shapes, of the sampling error and of the noise
        floor too.
    correlation: of the Wasserstein distance with the asymmetry rho.
    """

    table: str
    models: tuple[str, str]
    shapes: int
    wasserstein: Distance
    total_variation: Distance
    correlation: Correlation


@dataclass(frozen=True)
class EngineTotals:
    """One simulator on one table: all its drops, how many of them ended on no facet, the largest
    part of one shape's that did, and the seconds of one core that they took."""

    table: str
    engine: str
    drops: int
    unresolved: int
    largest_share: float
    seconds: float


@dataclass(frozen=True)
class PublishedCorrelation:
    """What the paper's text says of two models, and what its rows say, if they are at hand."""

    models: str
    printed: float
    printed_p_value: float
    recomputed: Correlation | None


def summaries(shapes: Sequence[ShapeOdds]) -> Iterator[Summary]:
    """For each table and each two models. Raises InputError: as `correlation`."""
    for table in TABLES:
        for models in _compared(shapes, table):
            having = [shape for shape in shapes if models in shape.tables[table].comparisons]
            found = [shape.tables[table].comparisons[models] for shape in having]
            distances = np.array([comparison.wasserstein.value for comparison in found])
            yield Summary(
                table,
                models,
                len(having),
                _mean([comparison.wasserstein for comparison in found]),
                _mean([comparison.total_variation for comparison in found]),
                correlation(np.array([shape.asymmetry for shape in having]), distances),
            )


def _compared(shapes: Sequence[ShapeOdds], table: str) -> list[tuple[str, str]]:
    """Each two models that some shape has been given by."""
    return list(dict.fromkeys(both for shape in shapes for both in shape.tables[table].comparisons))


def _mean(distances: Sequence[Distance]) -> Distance:
    rows = [(d.value, d.error, d.noise_floor) for d in distances]
    return Distance(*np.mean(rows, axis=0).tolist())


def engine_totals(shapes: Sequence[ShapeOdds]) -> Iterator[EngineTotals]:
    """For each table and each simulator that threw there."""
    for table in TABLES:
        for engine in shapes[0].tables[table].throws:
            throws = [shape.tables[table].throws[engine] for shape in shapes]
            yield EngineTotals(
                table,
                engine,
                sum(t.drops for t in throws),
                sum(t.unresolved for t in throws),
                max(t.unresolved / t.drops for t in throws),
                sum(t.seconds for t in throws),
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


def shape_record(shape: ShapeOdds) -> dict[str, Any]:
    """A shape as plain data."""
    record = asdict(shape)
    for name, table in shape.tables.items():
        record["tables"][name]["comparisons"] = [
            {"models": list(models), **asdict(comparison)}
            for models, comparison in table.comparisons.items()
        ]
    return record


def table_figure(
    shapes: Sequence[ShapeOdds], published: PublishedDistances | None, drops: str
) -> Paper:
    """The distances of each two models against the asymmetry of the shapes: a panel for each table,
    and one for the paper's own shapes if they are given.

    drops: what there were of each shape, in words. Shapes of which some model knows nothing are
    left out. Raises InputError: as `correlation`.

    Source: figure 10.
    """
    from dicedesign.report.charts.picture_grid import picture_grid
    from dicedesign.report.charts.scatter import asymmetry_scatter_figure

    panels = []
    for table in TABLES:
        models = _compared(shapes, table)
        having = [s for s in shapes if s.tables[table].comparisons.keys() >= set(models)]
        panels.append(
            asymmetry_scatter_figure(
                np.array([shape.asymmetry for shape in having]),
                {" vs ".join(both): _distances(having, table, both) for both in models},
                f"{len(having)} shapes, table {table}",
                f"drops of each shape: {drops}",
            )
        )
    if published is not None:
        panels.append(
            asymmetry_scatter_figure(
                published.asymmetry,
                published.distances,
                f"the paper's {len(published.asymmetry)} shapes",
                "as published with the paper (its figure 10)",
            )
        )
    return picture_grid([panel.pixels() for panel in panels], [""] * len(panels), len(TABLES))


def _distances(shapes: Sequence[ShapeOdds], table: str, models: tuple[str, str]) -> Floats:
    return np.array([shape.tables[table].comparisons[models].wasserstein.value for shape in shapes])
