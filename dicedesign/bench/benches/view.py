"""Updates per second of the page while a center of mass is dragged, in headless Chromium."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from dicedesign.bench.frame import BENCHES, Bench, Item, Run
from dicedesign.bench.rows import Row, column, hidden

AXES: Final = (1.0, 1.2, 0.85)
"""Of the ellipsoid on which the corners are."""


@dataclass(frozen=True)
class Extent:
    """Corners of the hulls, and for how many seconds each is dragged."""

    corners: tuple[int, ...]
    seconds: float


@dataclass(frozen=True)
class DragRow(Row):
    """One body."""

    corners: int = column("corners", 8)
    rests: int = column("rests", 6)
    updates: float = column("updates/s", 10, ".1f")
    frames: float = column("frames/s", 9, ".1f")
    median_gap: float = column("median ms", 10, ".1f")
    late_gap: float = column("95 % ms", 8, ".1f")
    model: float = column("model ms", 9, ".2f")
    moves: int = hidden()


def drag_rows(run: Run) -> Iterator[Item]:
    """A row for each hull."""
    from dicedesign.bench.measures.headless_browser import headless_browser, missing_browser
    from dicedesign.bench.measures.page_drags import drag_rates
    from dicedesign.geometry.meshes.body import make_body
    from dicedesign.geometry.sphere import even_directions
    from dicedesign.view.bodies.viewed_body import ViewedBody

    missing = missing_browser()
    if missing is not None:
        yield f"skipped: expected a browser to measure in, got none: {missing} is not installed"
        return
    with headless_browser() as browser:
        for corners in run.extent.corners:
            viewed = ViewedBody.of(make_body(even_directions(corners) * AXES))
            started = time.perf_counter()
            aside = 1e-3 * np.ptp(viewed.hull.vertices, axis=0)
            for step in range(10):
                viewed.with_center(viewed.center + step * aside)
            model = (time.perf_counter() - started) / 10.0
            rates = drag_rates(browser, viewed, run.extent.seconds)
            run.advance()
            gaps = rates.gaps if len(rates.gaps) else np.array([np.nan])
            yield DragRow(
                corners=len(viewed.hull.vertices),
                rests=len(viewed.poses.facets),
                updates=rates.updates / rates.seconds,
                frames=rates.frames / rates.seconds,
                median_gap=float(np.median(gaps)),
                late_gap=float(np.quantile(gaps, 0.95)),
                model=1e3 * model,
                moves=rates.moves,
            )


BENCHES.register(
    Bench(
        name="view",
        line="updates per second of the page while a center of mass is dragged",
        description="Drag the center of mass of hulls to and fro with the mouse, in Chromium "
        "without a graphics card, and count the changes that it shows and frames that it draws. "
        "'model' is the time for the hull's rests and odds alone. Needs the extra 'view', "
        "playwright and Chromium; without them it says so.",
        rows=drag_rows,
        full=Extent(corners=(8, 100, 1000, 4000), seconds=8.0),
        quick=Extent(corners=(100,), seconds=2.0),
        packages=("viser",),
        unit="bodies",
    )
)
