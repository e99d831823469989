"""Derivatives of probabilities against differences in 60 digits, what happens at events, and how
long they take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING, ClassVar

from dicedesign.bench.frame import BENCHES, Bench, Items, Run
from dicedesign.bench.options import Amount
from dicedesign.bench.rows import Row, column

if TYPE_CHECKING:
    from dicedesign.bench.measures.gradients.gradient_errors import GradientRow
    from dicedesign.bench.measures.gradients.polygon_gradients import PolygonRow

__all__ = ["EventsRow", "Extent", "HullsRow", "PolygonsRow"]


@dataclass(frozen=True)
class Extent:
    """How much is measured.

    Attributes
    ----------
    hulls: random hulls of triangles.
    solids, polyhedra: named bodies of polygons, None for all, and random ones.
    bodies: random bodies that are looked at for events.
    growths: at how many bodies glance and graze.
    seconds: for about which each body is timed.
    """

    hulls: int
    solids: int | None
    polyhedra: int
    bodies: int
    growths: int
    seconds: float


@dataclass(frozen=True)
class HullsRow(Row):
    """Random hulls of one kind: how many, quantiles of their relative errors, the largest of the
    Jacobian's, the largest error over its limit, and how many are beyond it."""

    table: ClassVar[str | None] = None

    name: str = column("random hulls", -30)
    hulls: int = column("hulls", 11)
    median: float = column("median", 11, ".1e")
    most: float = column("90 %", 11, ".1e")
    worst: float = column("worst", 11, ".1e")
    jacobian: float = column("Jacobian", 11, ".1e")
    of_limit: float = column("of limit", 11, ".2f")
    failed: int = column("not ok", 11)

    @classmethod
    def of(cls, name: str, rows: Sequence[GradientRow]) -> HullsRow:
        """Of at least one hull."""
        import numpy as np

        median, most, worst = np.quantile([row.error for row in rows], (0.5, 0.9, 1.0)).tolist()
        jacobian = max(row.jacobian_error for row in rows)
        of_limit = max(max(row.error, row.jacobian_error) / row.limit for row in rows)
        return cls(name, len(rows), median, most, worst, jacobian, of_limit, _failed(rows))


@dataclass(frozen=True)
class PolygonsRow(Row):
    """Bodies of polygons of one kind: how many, the most sides of a facet, the largest errors as in
    `polygon_gradients.PolygonRow`, and how many are beyond a limit."""

    table: ClassVar[str | None] = None

    name: str = column("polygons", -30)
    bodies: int = column("bodies", 11)
    sides: int = column("sides", 11)
    error: float = column("gradient", 11, ".1e")
    jacobian: float = column("Jacobian", 11, ".1e")
    broken: float | None = column("broken", 11, ".1e")
    half_spaces: float | None = column("half-sp.", 11, ".1e")
    failed: int = column("not ok", 11)

    @classmethod
    def of(cls, name: str, rows: Sequence[PolygonRow]) -> PolygonsRow:
        """Of at least one body."""
        broken = [row.broken for row in rows if row.broken is not None]
        half_spaces = [row.half_spaces for row in rows if row.half_spaces is not None]
        return cls(
            name,
            len(rows),
            max(row.sides for row in rows),
            max(row.error for row in rows),
            max(row.jacobian for row in rows),
            max(broken, default=None),
            max(half_spaces, default=None),
            sum(not row.ok for row in rows),
        )


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
    from dicedesign.bench.measures.gradients.gradient_errors import (
        compare_gradients,
        exponent,
        glancing_rows,
        grazing_rows,
        is_sound,
    )
    from dicedesign.bench.measures.gradients.gradient_speed import gradient_times

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
    yield ""
    polygons_good = yield from _polygons_rows(run)
    is_good, exponents = sound and polygons_good, {}
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
    run.begin("times")
    yield ""
    yield from gradient_times(extent.seconds)
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


def _polygons_rows(run: Run) -> Items:
    from dicedesign.bench.measures.gradients.polygon_gradients import (
        polygon_bodies,
        polygon_row,
        random_polyhedron,
    )

    groups: dict[str, list[PolygonRow]] = {}
    for name, body in islice(polygon_bodies(), run.extent.solids):
        run.begin(name)
        for uniform in (True, False):
            group = groups.setdefault(name.removesuffix(", turned"), [])
            group.append(polygon_row(name, body, uniform=uniform))
    run.begin("random polyhedra")
    for number in range(run.extent.polyhedra):
        uniform = number % 2 == 0
        group = groups.setdefault(f"random, {'uniform' if uniform else 'given center'}", [])
        body = random_polyhedron(number)
        group.append(polygon_row(f"random {number}", body, uniform=uniform, seed=number))
    rows = [row for group in groups.values() for row in group]
    for name, group in [*groups.items(), ("all", rows)]:
        yield PolygonsRow.of(name, group)
    yield {"polygons": rows}
    return all(row.ok for row in rows)


def _events_rows(bodies: int) -> Items:
    from dicedesign.bench.measures.designs.decision_events import BODIES, EVENTS, find_events

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
        "random hulls, on bodies with facets of many sides, in half-spaces too, on bodies with "
        "glancing paths, and just before and after the events at which probabilities or gradients "
        "jump; and time them. Exit code 0 if every verdict is ok, else 1.",
        rows=_rows,
        full=Extent(hulls=1000, solids=None, polyhedra=200, bodies=30, growths=14, seconds=1.0),
        quick=Extent(hulls=100, solids=12, polyhedra=20, bodies=3, growths=6, seconds=0.1),
        amounts=(Amount("hulls", "N", "random hulls"),),
        packages=("numpy", "scipy", "torch", "mpmath"),
        unit="hulls",
    )
)
