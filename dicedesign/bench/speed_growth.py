"""Run times that grow with the number of points on a sphere."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Final

from dicedesign.bench.measures.query_speed import Effort, SpeedRow, TimeTrimesh, speed_row
from dicedesign.bench.reference.speed_cases import sphere_case

if TYPE_CHECKING:
    from dicedesign.report.charts.paper import Paper

__all__ = ["SIZES", "growth_figure", "growth_rows"]

SIZES: Final = (10, 30, 100, 300, 1000, 3000, 10_000, 30_000, 100_000, 300_000, 1_000_000)

_EFFORTS: Final = (
    (1000, Effort(rounds=20, seconds=0.2)),
    (30_000, Effort(rounds=5, seconds=0.0)),
    (100_000, Effort(rounds=3, seconds=0.0)),
    (1_000_000, Effort(rounds=1, seconds=0.0)),
)
"""How long is measured for up to so many points."""


def growth_rows(
    sizes: Sequence[int],
    time_trimesh: TimeTrimesh | None,
    on_size: Callable[[int], None] = lambda size: None,
) -> Iterator[SpeedRow]:
    """A row for each number of points, at most a million; on_size: is told each beforehand."""
    for size in sizes:
        on_size(size)
        effort = next(effort for most, effort in _EFFORTS if size <= most)
        yield speed_row(sphere_case(size), effort, time_trimesh)


def growth_figure(rows: Sequence[SpeedRow], described: Mapping[str, str]) -> Paper:
    """Seconds against points, on logarithmic axes; described: see `machine_description`."""
    from dicedesign.report.charts.series import Curve
    from dicedesign.report.charts.time_curves import time_against_size_figure

    columns: tuple[tuple[str, Callable[[SpeedRow], float | None]], ...] = (
        ("scipy.spatial.ConvexHull", lambda row: row.hull_seconds),
        ("all resting probabilities, hull included", lambda row: row.query_seconds),
        ("energy and gradient, hull included", lambda row: row.gradient_seconds),
        ("trimesh, stable poses, hull included", lambda row: row.trimesh_seconds),
    )
    curves = []
    for label, seconds_of in columns:
        taken = {row.points: seconds_of(row) for row in rows}
        known = {points: seconds for points, seconds in taken.items() if seconds is not None}
        if known:
            curves.append(Curve(list(known), list(known.values()), label=label))
    note = (
        f"{described['machine']}; processor time, one thread; dicedesign "
        f"{described['dicedesign']}, {described['date']}"
    )
    return time_against_size_figure(curves, "Random points on a sphere", "points", note)
