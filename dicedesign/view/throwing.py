"""Throws of a body for the page, and one sentence on what they show."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping
from typing import Any

import numpy as np

from dicedesign.errors import InputError
from dicedesign.geometry.sphere import unit_vectors
from dicedesign.results.parts import ThrowForecast
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.goodness_of_fit import chi_square
from dicedesign.throws.simulation import simulate, throw_film
from dicedesign.throws.tables import TABLE_NAMES, mixture_tables
from dicedesign.view.motion import film_motion, release_motion
from dicedesign.view.viewed_body import ViewedBody

__all__ = ["judge_throws", "pack_numbers", "throw_body"]

MAX_THROWS = 1000
"""Most throws of one request."""

FEW_THROWS = 20
"""Number of throws from which on they are judged."""

UNUSUAL, WRONG = 0.05, 1e-3
"""Probabilities of a chi-square test below which throws are unusual, or contradict the target."""


def pack_numbers(values: Any, kind: str) -> str:
    """Base64 text of numbers in a little-endian type of numpy, such as "<f4"."""
    return b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode()


def throw_body(viewed: ViewedBody, query: Mapping[str, Any]) -> dict[str, Any]:
    """Throw a body, or set it down: counts by row, and the motion of the last time.

    query: "count" from 1 to `MAX_THROWS`, "seed" from 0, and "table", None to set it down. A table
    that stands for several hands gets throws by all of them. Dice are in millimeters; other bodies
    have the size of the table's own die, as their unit is unknown.
    """
    count, seed, table = int(query["count"]), int(query["seed"]), query["table"]
    if not 1 <= count <= MAX_THROWS or seed < 0:
        raise InputError(f"count: expected 1 to {MAX_THROWS:,}, got {count}; change it")
    poses, rng = viewed.poses, np.random.default_rng(seed)
    if table is None:
        downs = unit_vectors(rng.normal(size=(count, 3)))
        motion, last = release_motion(poses, downs[-1])
        rests = np.append(poses.morse.basins_of(downs[:-1]), last)
        counts = np.bincount(rests, minlength=len(poses.facets))
    else:
        if table not in TABLE_NAMES:
            raise InputError(
                f"table: expected {', '.join(TABLE_NAMES)}, got {table!r}; take one of these"
            )
        tables = mixture_tables(table)
        if viewed.outcomes is not None:
            size = 2e-3 * viewed.rigid.radius
            tables = tuple(one.for_size_above(size) for one in tables)
        film = throw_film(viewed.rigid, tables[int(rng.integers(len(tables)))], seed, candidates=1)
        motion, last = film_motion(film), film.rest
        counts = np.zeros(len(poses.facets), dtype=np.int64)
        if count > 1:
            counts += simulate(viewed.rigid, tables, count - 1, seed).counts
        if last >= 0:
            counts[last] += 1
    rows = viewed.row_of_rest
    return {
        "counts": np.bincount(rows, counts, len(viewed.rows)).astype(np.int64).tolist(),
        "outcome": -1 if last < 0 else int(rows[last]),
        "down": None if last < 0 else poses.normals[last].tolist(),
        "motion": {
            "seconds": motion.seconds.tolist(),
            "positions": pack_numbers(motion.positions, "<f4"),
            "quaternions": pack_numbers(motion.quaternions, "<f4"),
        },
    }


def judge_throws(
    counts: Integers, target: Floats, labels: tuple[str, ...], forecast: ThrowForecast | None
) -> dict[str, Any]:
    """Style and sentence on counts (k,) of throws of a die with a target (k,).

    forecast: what is known about the die when thrown; None if it was set down, or nothing is.
    """
    throws = int(counts.sum())
    if throws == 0:
        return {"style": "info", "text": "No throws yet. The marks show what to expect."}
    if throws < FEW_THROWS:
        times = "throw" if throws == 1 else "throws"
        few = f"{throws} {times} so far: too few to tell. Throw 100."
        return {"style": "info", "text": few}
    p_value = chi_square(counts, target).p_value
    is_off = forecast is not None and forecast.is_off(tuple(target.tolist()))
    if p_value < WRONG:
        worst = int(np.argmax(np.abs(counts - throws * target) / np.sqrt(target)))
        advice = " Set it down gently, or pick a die that is right on a table." if is_off else ""
        return {
            "style": "bad",
            "text": f"Not as designed: {labels[worst]} came up {counts[worst]} times; expect "
            f"{throws * target[worst]:.0f}.{advice}",
        }
    if forecast is not None and is_off:
        got = np.array(forecast.probabilities)
        most = int(np.argmax(np.abs(got / target - 1.0)))
        return {
            "style": "warn",
            "text": "Too few throws to show it, but thrown, this die is off: in the long run "
            f"{labels[most]} comes up in {100 * got[most]:.2g} %, not {100 * target[most]:.2g} %.",
        }
    rate = 100.0 * p_value
    if p_value < UNUSUAL:
        often = "less than 1" if rate < 1.0 else f"only {rate:.0f}"
        return {
            "style": "warn",
            "text": f"Unusual: a perfect die strays this far in {often} of 100 such series. Throw "
            "100 more to be sure.",
        }
    often = "nearly all" if rate >= 99.0 else f"{rate:.0f} of 100"
    return {
        "style": "ok",
        "text": f"As expected: even a perfect die strays this far in {often} such series.",
    }
