"""`dicedesign bench gradients`: derivatives of probabilities against 60-digit differences."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, TypeVar

from dicedesign.cli.benches.reporting import add_json_option, json_text
from dicedesign.errors import InputError

if TYPE_CHECKING:
    from dicedesign.bench.gradients import GradientRow
    from dicedesign.bench.measures.decision_events import Event

__all__ = ["add_parser"]

T = TypeVar("T")


def add_parser(benches: Any) -> None:
    """Add the bench to argparse's `benches`."""
    parser = benches.add_parser(
        "gradients",
        help="derivatives of probabilities against 60-digit differences",
        description="Compare derivatives of probabilities with differences of a 60-digit model on "
        "random hulls, on bodies with glancing paths, and just before and after the events at "
        "which probabilities or gradients jump. Exit code 0 if every verdict is ok, else 1.",
    )
    parser.add_argument(
        "--hulls", type=int, default=1000, metavar="N", help="random hulls (default: 1000)"
    )
    add_json_option(parser)
    parser.set_defaults(command=_run)


def _run(options: argparse.Namespace) -> int:
    from dicedesign.bench.gradients import (
        compare_gradients,
        exponent,
        glancing_rows,
        grazing_rows,
        is_sound,
    )
    from dicedesign.bench.machine import machine_description
    from dicedesign.bench.measures.decision_events import BODIES, find_events

    if options.hulls < 1:
        raise InputError(f"--hulls: expected at least 1, got {options.hulls}; give more")
    hulls = _gather(compare_gradients(options.hulls), "random hulls", options.hulls)
    glancing = _gather(glancing_rows(), "glancing paths")
    grazing = _gather(grazing_rows(), "grazing paths")
    events = _gather(find_events(BODIES), "events")
    sound = is_sound(hulls)
    ok = sound and all(row.ok for row in (*glancing, *grazing)) and all(e.ok for e in events)
    exponents = {"glancing": exponent(glancing), "grazing": exponent(grazing)}
    if options.json:
        tables: dict[str, Sequence[GradientRow] | Sequence[Event]] = {
            "hulls": hulls,
            "glancing": glancing,
            "grazing": grazing,
            "events": events,
        }
        answer: dict[str, Any] = {
            name: [{**asdict(row), "ok": row.ok} for row in rows] for name, rows in tables.items()
        }
        described = machine_description("numpy", "scipy", "torch", "mpmath")
        print(json_text({**described, **answer, "exponents": exponents, "ok": ok}))
        return 0 if ok else 1
    _print_hulls(hulls, sound)
    for name, rows in (("glancing", glancing), ("grazing", grazing)):
        print()
        _print_growths(rows, f"{name} path", exponents[name])
    print()
    _print_events(events)
    return 0 if ok else 1


def _gather(rows: Iterable[T], what: str, total: int | None = None) -> list[T]:
    from tqdm import tqdm

    hidden = not sys.stderr.isatty()
    return list(tqdm(rows, what, total, file=sys.stderr, disable=hidden, leave=False))


def _print_hulls(rows: list[GradientRow], sound: bool) -> None:
    import numpy as np

    groups: dict[str, list[GradientRow]] = {}
    for row in rows:
        how = "uniform" if row.uniform else "given center"
        groups.setdefault(f"{row.name.rpartition(' ')[0]}, {how}", []).append(row)
    _print_line(("random hulls", 30), "hulls", "median", "90 %", "worst", "of limit", "not ok")
    for name, group in [*sorted(groups.items()), ("all", rows)]:
        errors = [row.error for row in group]
        _print_line(
            (name, 30),
            str(len(group)),
            *(f"{np.quantile(errors, part):.1e}" for part in (0.5, 0.9, 1.0)),
            f"{max(row.error / row.limit for row in group):.2f}",
            str(sum(not row.ok for row in group)),
        )
    worst = max(rows, key=lambda row: row.error)
    print(
        f"worst: {worst.name}, {worst.corners} corners, {worst.rests} rests, error "
        f"{worst.error:.1e}, limit {worst.limit:.1e}, condition {worst.condition:.2g}, of the "
        f"gradient {worst.gradient_condition:.2g}, r_p . v from {worst.growth:.2g}, slant from "
        f"{worst.slant:.2g}"
    )
    print("verdict: ok" if sound else "verdict: NOT OK")


def _print_growths(rows: list[GradientRow], name: str, exponent: float) -> None:
    _print_line(
        (name, 26), "r_p . v", "slant", "gradient", "x r_p . v", "error", "limit", "condition"
    )
    for row in rows:
        numbers = (row.slant, row.size, row.size * abs(row.growth), row.error, row.limit)
        _print_line(
            (row.name, 26), *(f"{value:.1e}" for value in (row.growth, *numbers, row.condition))
        )
    print(f"the gradient grows like (r_p . v)^{exponent:.4f}, not ok: {_failed(rows)}")


def _print_events(events: list[Event]) -> None:
    from dicedesign.bench.measures.decision_events import EVENTS

    _print_line(
        ("event", 32), "met", "odds jump", "only slope", "smooth", "slope to", "error", "not ok"
    )
    for kind in EVENTS:
        met = [event for event in events if event.kind == kind]
        jumps, kinks = sum(event.jumps for event in met), sum(event.kinks for event in met)
        _print_line(
            (kind, 32),
            *(str(value) for value in (len(met), jumps, kinks, len(met) - jumps - kinks)),
            f"{max((max(event.slopes) for event in met), default=0.0):.1e}",
            f"{max((event.error for event in met), default=0.0):.1e}",
            str(_failed(met)),
        )


def _failed(rows: Sequence[GradientRow] | Sequence[Event]) -> int:
    return sum(not row.ok for row in rows)


def _print_line(first: tuple[str, int], *values: str) -> None:
    text, width = first
    print(f"{text:<{width}}" + "".join(f"{value:>11}" for value in values), flush=True)
