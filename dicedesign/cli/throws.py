"""`dicedesign throw`: simulated throws of a die."""

from __future__ import annotations

import os
import time
from dataclasses import asdict
from typing import Any

import numpy as np

from dicedesign.cli.commands import ThrowArguments
from dicedesign.cli.options import (
    direction,
    find_poses,
    percent_intervals,
    plain_rows,
    print_json,
    print_notes,
    text_table,
    workers_of,
)
from dicedesign.errors import InputError, named, printable
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.rest.outcomes import asymmetry, facet_of_rest
from dicedesign.rest.poses import RestPoses
from dicedesign.results.folder import read_result
from dicedesign.runtime.arrays import exact_intervals
from dicedesign.throws.distances import measure_variation
from dicedesign.throws.goodness_of_fit import chi_square
from dicedesign.throws.momentum_model import momentum_model
from dicedesign.throws.momentum_probabilities import momentum_probabilities
from dicedesign.throws.rigid_body import rigid_body
from dicedesign.throws.simulation import Throws, check_throws, simulate
from dicedesign.throws.tables import load_table, mixture_tables, with_hand

CONFIDENCE = 0.95

MM_PER_METER = 1e3


def throw(options: ThrowArguments) -> int:
    """Print how often each rest comes up."""
    size = None if options.size is None else options.size / MM_PER_METER
    with named("--table"):
        name = with_hand(options.table, options.hand)
        table, tables = load_table(name), mixture_tables(name)
    model = None
    try:
        model = momentum_model(name)
    except InputError as error:
        print_notes(f"without probabilities by the momentum model, as {error}")
    check_throws(options.drops, options.seed, options.engine)
    labels = None
    if os.path.isdir(options.die):
        mesh, poses, labels = _read_finished(options)
    else:
        mesh, poses = find_poses(read_body(options.die, options.item), options.com)
    body = rigid_body(mesh, poses)
    if labels is not None and size is None:
        # Files of finished dice are in millimeters.
        size = 2.0 * body.radius / MM_PER_METER
    table, tables = table.for_size(size), tuple(one.for_size_above(size) for one in tables)
    started = time.perf_counter()
    momentum = None if model is None else momentum_probabilities(poses, body, model)
    with workers_of(options, "drops", options.drops) as workers:
        throws = simulate(
            body,
            tables,
            options.drops,
            options.seed,
            engine=options.engine,
            workers=workers.executor,
            progress=workers.bar.update,
        )
    seconds = time.perf_counter() - started
    columns: dict[str, Any] = {
        "label": labels,
        "normal": poses.normals,
        "count": throws.counts,
        "frequency": throws.frequencies,
        "interval": None,
        "geometric": poses.probabilities,
        "momentum": momentum,
    }
    summary = _judge_throws(throws, poses, columns) | {"table": table.as_dict()}
    if options.json:
        print_json(summary | {"seconds": seconds})
    else:
        heading = (
            f"{printable(options.die)}: {throws.drops} drops on {table.name}, "
            f"{1e3 * table.size:g} mm, engine {throws.engine}, {seconds:.1f} s\n"
        )
        print(heading, *_describe(columns, summary), sep="\n")
    if throws.unresolved == throws.drops:
        print_notes(
            f"none of {throws.drops} drops came to rest on {table.name}: raise its friction, or "
            "lower its restitution, speed or spin"
        )
        return 1
    return 0


def _read_finished(options: ThrowArguments) -> tuple[Body, RestPoses, list[str | None]]:
    """Read the plain solid of a finished die, and the labels of its rests."""
    die = read_result(options.die)
    print_notes(*die.changes())
    center = np.array(die.center_of_mass)
    body, poses = find_poses(read_body(die.plain_file), options.com, center=center)
    normals = np.array([normal for _, normal in die.outcome_normals]).reshape(-1, 3)
    facets = facet_of_rest(poses.normals, normals).tolist()
    return body, poses, [None if facet < 0 else die.outcome_normals[facet][0] for facet in facets]


def _judge_throws(throws: Throws, poses: RestPoses, columns: dict[str, Any]) -> dict[str, Any]:
    """Answer as plain data; adds the intervals to the columns of rests.

    Frequencies are relative to the drops that came to rest. Without any, they and the total
    variation are None.
    """
    counts, probabilities = throws.counts, poses.probabilities
    variation = test = None
    if counts.any():
        variation = asdict(measure_variation(counts, probabilities, CONFIDENCE))
        if throws.rests > 1:
            test = asdict(chi_square(counts, probabilities))
    else:
        columns["frequency"] = [None] * throws.rests
    columns["interval"] = exact_intervals(counts, counts.sum(), CONFIDENCE)
    return {
        "drops": throws.drops,
        "unresolved": throws.unresolved,
        "engine": throws.engine,
        "seed": throws.seed,
        "rests": plain_rows(columns),
        "total_variation": variation,
        "chi_square": test,
        "asymmetry": asymmetry(poses),
    }


def _describe(columns: dict[str, Any], summary: dict[str, Any]) -> list[str]:
    level = f"{100 * CONFIDENCE:g} %"
    labels, momentum = columns["label"], columns["momentum"]
    frequencies = [np.nan if part is None else 100 * part for part in columns["frequency"]]
    lines = [
        text_table(
            ("rest", "d", range(1, len(columns["count"]) + 1)),
            ("label", ">", labels and [label or "-" for label in labels]),
            ("count", "d", columns["count"]),
            ("frequency %", ".3f", frequencies),
            (f"{level} interval", ">", percent_intervals(columns["interval"])),
            ("geometric %", ".3f", 100 * columns["geometric"]),
            ("momentum %", ".3f", None if momentum is None else 100 * momentum),
            ("facet normal (down)", "", map(direction, columns["normal"])),
        ),
        "",
    ]
    if summary["unresolved"]:
        lines.append(f"unresolved: {summary['unresolved']} drops ended on no facet in time")
    variation = summary["total_variation"]
    if variation is not None:
        low, high = variation["interval"]
        lines.append(
            f"total variation from the probabilities without momentum {variation['value']:.4f}, "
            f"{level} interval {low:.4f} to {high:.4f}; noise floor {variation['noise_floor']:.4f}"
        )
    test = summary["chi_square"]
    if test is not None:
        lines.append(
            f"chi-square against them {test['statistic']:.4g} on {test['degrees']} degrees of "
            f"freedom, p = {test['p_value']:.2g}; asymmetry rho {summary['asymmetry']:.3g}"
        )
    return lines
