"""Impacts of single vertices in each simulator against closed forms, and its throws per second."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from itertools import product

import numpy as np

from benchmarks.frame import Report, time_in_turn
from dicedesign import InputError, load_table, rigid_body
from dicedesign.extensions import ENGINES, Engine
from dicedesign.throws.rigid_body import release_states
from examples.mujoco_engine import MUJOCO
from tests.reference.impacts import planar_impulse
from tests.reference.strikes import STRIKES, Strike, faceted_ball, lean, needle

SLIPS = (0.0, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
"""In units of the approach."""

FRICTIONS = (0.0, 0.15, 0.3, 0.6, 0.9)

RESTITUTIONS = (0.0, 0.25, 0.5, 0.75, 0.95)

NEEDLE_ANGLES = (0.35, 0.8, -0.8)
"""Of a needle that hits the table with one end, to the vertical, in radians."""

CUBOID = np.array(list(product((-1.0, 1.0), (-1.15, 1.15), (-1.3, 1.3))))
"""Corners of the die whose throws are timed."""

SLOW_PART = 0.02
"""Part of the throws that is timed of simulators other than the package's own."""


def compare_contacts(options: argparse.Namespace, report: Report) -> None:
    """A row for each simulator and body: how far the speed of a bounce and the friction are from
    the closed form, per approach and per normal impulse; then throws per second."""
    engines = list(installed())
    row = report.table(
        "contacts",
        "engine 9s | body 6s | impacts 7d | worst restitution 17.4f | mean 7.4f | "
        "worst friction 14.4f | mean friction 13.4f",
    )
    for engine in engines:
        for name, (body, vertex), angles in (
            ("ball", faceted_ball(), (0.0,)),
            ("needle", needle(), NEEDLE_ANGLES),
        ):
            errors = np.array(
                [
                    deviation(engine, Strike(body, vertex, lean(body, vertex, angle), *impact))
                    for angle in angles
                    for impact in impacts(options.quick)
                ]
            )
            worst, mean = errors.max(axis=0), errors.mean(axis=0)
            row(engine.title, name, len(errors), worst[0], mean[0], worst[1], mean[1])
    time_throws(engines, options, report)


def installed() -> Iterator[Engine]:
    """Simulators whose impacts can be measured."""
    for engine in (*ENGINES, MUJOCO):
        with suppress(InputError):
            engine.require()
            if engine.name in STRIKES:
                yield engine


def impacts(is_quick: bool) -> Iterator[tuple[np.ndarray, float, float]]:
    """Slips (2,), restitutions and frictions."""
    each = 2 if is_quick else 1
    for slip, restitution, friction in product(
        SLIPS[::each], RESTITUTIONS[::each], FRICTIONS[::each]
    ):
        yield np.array([slip, 0.0]), restitution, friction


def deviation(engine: Engine, strike: Strike) -> tuple[float, float]:
    """Difference of the speed after an impact, per approach, and of friction's impulse, per normal
    impulse, from the closed form."""
    wanted = planar_impulse(strike.response, strike.velocity, strike.restitution, strike.friction)
    impulse = STRIKES[engine.name](strike)
    bounce = strike.response[2] @ (impulse - wanted) / -strike.velocity[2]
    return abs(float(bounce)), abs(float(impulse[0] - wanted[0])) / wanted[2]


def time_throws(engines: list[Engine], options: argparse.Namespace, report: Report) -> None:
    """Throws of a cuboid per second on one core, in turn."""
    table, body = load_table(options.table), rigid_body(CUBOID)
    drops = options.drops or (500 if options.quick else 5_000)
    counts = [
        drops if engine.name == "native" else max(int(SLOW_PART * drops), 1) for engine in engines
    ]
    works = [
        partial(
            engine.throw_states,
            body,
            table,
            release_states(body, table, count, np.random.default_rng(0)),
        )
        for engine, count in zip(engines, counts, strict=True)
    ]
    seconds = time_in_turn(works, 0.0, rounds=3, row=2e-3)
    row = report.table("speed of throws", "engine 9s | throws/s 8.0f | of native 9.2f")
    rates = [count / each for count, each in zip(counts, seconds, strict=True)]
    named = dict(zip([engine.name for engine in engines], rates, strict=True))
    for engine, rate in zip(engines, rates, strict=True):
        row(engine.title, rate, rate / named.get("native", np.nan))
