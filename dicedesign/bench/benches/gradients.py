"""Derivatives of probabilities against differences in 60 digits, and what happens at events."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from dicedesign.bench.frame import BENCHES, Bench, Items, Run
from dicedesign.bench.options import Amount
from dicedesign.bench.rows import Row, column

if TYPE_CHECKING:
    from dicedesign.bench.measures.gradient_errors import GradientRow

__all__ = ["EventsRow", "Extent", "HullsRow"]


@dataclass(frozen=True)
class Extent:
    """How many random hulls there are, how many random bodies are looked at for events, and at how
    many growths bodies glance and graze."""

    hulls: int
    bodies: int
    growths: int


@dataclass(frozen=True)
class HullsRow(Row):
    """Random hulls of one kind: how many, quantiles of their relative errors, the largest error
    over its limit, and how many are beyond it."""

    table: ClassVar[str | None] = None

    name: str = column("random hulls", -30)
    hulls: int = column("hulls", 11)
    median: float = column("median", 11, ".1e")
    most: float = column("90 %", 11, ".1e")
    worst: float = column("worst", 11, ".1e")
    of_limit: float = column("of limit", 11, ".2f")
    failed: int = column("not ok", 11)

    @classmethod
    def of(cls, name: str, rows: Sequence[GradientRow]) -> HullsRow:
        """Of at least one hull."""
        import numpy as np

        median, most, worst = np.quantile([row.error for row in rows], (0.5, 0.9, 1.0)).tolist()
        of_limit = max(row.error / row.limit for row in rows)
        return cls(name, len(rows), median, most, worst, of_limit, _failed(rows))


@dataclass(frozen=True)
class EventsRow(Row):
    """Events of one kind: how many were met, at how many of them odds jump, only their slope does,
    and nothing; the largest slope and error beside them, and how many are not as they should be."""

    table: ClassVar[str | None] = None

    kind: str = column("event", -32)
    met: int = column("met", 11)
    jumps: int = column("odds jump", 11)
    kinks: int = column("only slope", 11)
    smooth: int = column("smooth", 11)
    slope: float = column("slope to", 11, ".1e")
    error: float = column("error", 11, ".1e")
    failed: int = column("not ok", 11)


def _rows(run: Run) -> Items:
    from dicedesign.bench.measures.gradient_errors import (
        compare_gradients,
        exponent,
        glancing_rows,
        grazing_rows,
        is_sound,
    )

    extent: Extent = run.extent
    run.begin("random hulls")
    hulls = []
    for row in compare_gradients(extent.hulls):
        run.advance()
        hulls.append(row)
    sound = is_sound(hulls)
    yield {"hulls": hulls}
    yield from _hulls_rows(hulls)
    yield "verdict: ok" if sound else "verdict: NOT OK"
    is_good, exponents = sound, {}
    for name, paths in (("glancing", glancing_rows), ("grazing", grazing_rows)):
        run.begin(f"{name} paths")
        rows = list(paths(extent.growths))
        exponents[name] = exponent(rows)
        is_good = is_good and _failed(rows) == 0
        yield f"\n{name} paths"
        yield from rows
        yield f"the gradient grows like (r_p . v)^{exponents[name]:.4f}, not ok: {_failed(rows)}"
        yield {name: rows}
    run.begin("events")
    yield ""
    events_good = yield from _events_rows(extent.bodies)
    is_good = is_good and events_good
    yield {"exponents": exponents, "ok": is_good}
    return is_good


def _hulls_rows(rows: Sequence[GradientRow]) -> Items:
    groups: dict[str, list[GradientRow]] = {}
    for row in rows:
        how = "uniform" if row.uniform else "given center"
        groups.setdefault(f"{row.name.rpartition(' ')[0]}, {how}", []).append(row)
    for name, group in [*sorted(groups.items()), ("all", list(rows))]:
        yield HullsRow.of(name, group)
    worst = max(rows, key=lambda row: row.error)
    yield (
        f"worst: {worst.name}, {worst.corners} corners, {worst.rests} rests, error "
        f"{worst.error:.1e}, r_p . v from {worst.growth:.2g}, slant from {worst.slant:.2g}"
    )
    return True


def _events_rows(bodies: int) -> Items:
    from dicedesign.bench.measures.decision_events import BODIES, EVENTS, find_events

    events = list(find_events(BODIES[:bodies]))
    for kind in EVENTS:
        met = [event for event in events if event.kind == kind]
        jumps, kinks = sum(event.jumps for event in met), sum(event.kinks for event in met)
        yield EventsRow(
            kind,
            len(met),
            jumps,
            kinks,
            len(met) - jumps - kinks,
            max((max(event.slopes) for event in met), default=0.0),
            max((event.error for event in met), default=0.0),
            sum(not event.ok for event in met),
        )
    yield {"events": events}
    return all(event.ok for event in events)


def _failed(rows: Sequence[GradientRow]) -> int:
    return sum(not row.ok for row in rows)


BENCHES.register(
    Bench(
        name="gradients",
        line="derivatives of probabilities against 60-digit differences",
        description="Compare derivatives of probabilities with differences of a 60-digit model on "
        "random hulls, on bodies with glancing paths, and just before and after the events at "
        "which probabilities or gradients jump. Exit code 0 if every verdict is ok, else 1.",
        rows=_rows,
        full=Extent(hulls=1000, bodies=30, growths=14),
        quick=Extent(hulls=100, bodies=3, growths=6),
        amounts=(Amount("hulls", "N", "random hulls"),),
        packages=("numpy", "scipy", "torch", "mpmath"),
        unit="hulls",
    )
)
