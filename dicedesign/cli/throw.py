"""`dicedesign throw`: simulated throws of a die onto a table."""

from __future__ import annotations

import argparse
import math
import os
import sys
import time
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from dicedesign.cli.options import (
    add_engine_option,
    add_json_option,
    add_value,
    add_worker_options,
    center_of_mass,
    check_worker_options,
    direction,
    numbers,
    percent_interval,
    print_json,
    read_poses,
    workers_of,
)
from dicedesign.errors import InputError, named
from dicedesign.runtime.text import printable, text_table

if TYPE_CHECKING:
    from dicedesign.geometry.meshes.body import Body
    from dicedesign.rest.poses import RestPoses
    from dicedesign.runtime.arrays import Floats
    from dicedesign.throws.rigid_body import Orientations
    from dicedesign.throws.simulation import Throws

DROPS: Final = 10_000

CONFIDENCE: Final = 0.95

MM_PER_METRE: Final = 1e3


def add_parser(commands: Any) -> None:
    """Add the subcommand to argparse's `commands`."""
    parser = commands.add_parser(
        "throw",
        help="throw a die onto a simulated table",
        description="Throw a die many times onto a simulated table, and compare how often each "
        "rest comes up with its geometric odds, those without momentum.",
    )
    add_value(parser, "die", "DIE", "mesh, or folder that `dicedesign run` left", Path)
    add_value(
        parser,
        "--drops",
        "N",
        f"how many throws (default: {DROPS}, of the paper's orientations one of each)",
        int,
    )
    add_engine_option(parser)
    add_value(
        parser,
        "--table",
        "NAME|FILE.json",
        "board-game, hard-wood, carpet (no momentum), paper (the paper's drops), or a file "
        "with the same entries as theirs (default: board-game)",
        default="board-game",
    )
    add_value(
        parser, "--hand", "NAME", "throw in another way than the table says: cup, hand or tower"
    )
    add_value(
        parser,
        "--orientations",
        "KIND",
        "at which the die is let go: uniform, at random; or icosahedron, the paper's, each "
        "counted by the area around it (default: uniform; on the table paper icosahedron)",
    )
    add_value(
        parser,
        "--size",
        "MM",
        "of the die, twice the largest distance of a point from its center of mass (default: "
        "of a folder, the die's own; of a mesh, the table's, 25)",
        float,
    )
    add_value(
        parser,
        "--com",
        "x,y,z|hull",
        "center of mass, as in `dicedesign rest` (default: of the uniform solid; of a folder, "
        "that of its design)",
    )
    add_value(
        parser,
        "--inertia",
        "xx,yy,zz,xy,xz,yz",
        "tensor of inertia about the center of mass over the mass, in the mesh's unit squared "
        "(default: of the uniform solid)",
    )
    add_value(parser, "--seed", "S", "of random numbers (default: 0)", int, 0)
    add_worker_options(
        parser,
        "how many tasks at a time (default: one for each core); does not change the results",
    )
    add_json_option(parser)
    parser.set_defaults(command=_throw)


def _throw(options: argparse.Namespace) -> int:
    # Imported here, as other commands do without.
    from dicedesign.throws.momentum_model import momentum_model
    from dicedesign.throws.momentum_odds import momentum_odds
    from dicedesign.throws.rigid_body import PAPER_DIRECTIONS, rigid_body
    from dicedesign.throws.simulation import check_throws, simulate
    from dicedesign.throws.tables import table_named, with_hand

    size = None if options.size is None else options.size / MM_PER_METRE
    with named("--table"):
        name = with_hand(options.table, options.hand)
        table = table_named(name)
    model = None
    try:
        model = momentum_model(name)
    except InputError as error:
        print(f"note: without odds by the momentum model, as {printable(error)}", file=sys.stderr)
    table = table.sized(size)
    usual: Orientations = "icosahedron" if name == "paper" else "uniform"
    orientations = usual if options.orientations is None else options.orientations
    drops = options.drops
    if drops is None:
        drops = PAPER_DIRECTIONS if orientations == "icosahedron" else DROPS
    check_throws(drops, options.seed, options.engine, orientations)
    check_worker_options(options)
    labels = None
    if os.path.isdir(options.die):
        mesh, poses, labels = _finished(options)
    else:
        mesh, poses = read_poses(options.die, center_of_mass(options.com))
    body = rigid_body(mesh, poses, _tensor(options.inertia))
    if labels is not None and size is None:
        # Its files are in millimetres.
        table = table.sized(2.0 * body.radius / MM_PER_METRE)
    started = time.perf_counter()
    momentum = None if model is None else momentum_odds(poses, body, model)
    with workers_of(options, "drops", drops) as workers:
        throws = simulate(
            body,
            table,
            drops,
            options.seed,
            engine=options.engine,
            orientations=orientations,
            workers=workers.executor,
            progress=workers.advance,
            on_quiet=workers.on_quiet,
        )
    seconds = time.perf_counter() - started
    summary = throw_summary(throws, poses, orientations, labels, momentum) | {"seconds": seconds}
    if options.json:
        print_json(summary)
    else:
        print("\n".join(_text(options.die, summary)))
    return 0


def _tensor(text: str | None) -> list[list[float]] | None:
    if text is None:
        return None
    xx, yy, zz, xy, xz, yz = numbers("--inertia", text, "xx,yy,zz,xy,xz,yz")
    return [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]


def _finished(options: argparse.Namespace) -> tuple[Body, RestPoses, list[str | None]]:
    """A die that was designed here, without its marks, and the labels of its rests."""
    import numpy as np

    from dicedesign.rest.outcomes import facet_of_rest
    from dicedesign.results.folder import read_result

    die = read_result(options.die)
    center = np.array(die.center_of_mass) if options.com is None else center_of_mass(options.com)
    body, poses = read_poses(die.plain_file, center)
    normals = np.array([normal for _, normal in die.shown]).reshape(-1, 3)
    facets = facet_of_rest(poses.normals, normals).tolist()
    return body, poses, [None if facet < 0 else die.shown[facet][0] for facet in facets]


def throw_summary(
    throws: Throws,
    poses: RestPoses,
    orientations: Orientations,
    labels: list[str | None] | None = None,
    momentum: Floats | None = None,
) -> dict[str, Any]:
    """The answer as plain data. labels: (k,) of the rests, None for a rest or a die without;
    momentum: (k,) odds by the momentum model, where the table has one.

    Frequencies are those among the drops that were resolved; None, as the distances, if none was.
    """
    import numpy as np

    from dicedesign.rest.outcomes import asymmetry
    from dicedesign.runtime.arrays import exact_intervals
    from dicedesign.throws.distances import effective_counts, measure_transport, measure_variation
    from dicedesign.throws.goodness_of_fit import chi_square

    landed = throws.outcomes >= 0
    variation = transport = test = None
    if landed.any():
        came = effective_counts(throws.outcomes[landed], throws.weights[landed], throws.rests)
        odds = poses.probabilities
        variation = asdict(measure_variation(came, odds, CONFIDENCE))
        transport = asdict(measure_transport(poses.normals, came, odds, CONFIDENCE))
        if throws.rests > 1:
            test = asdict(chi_square(came, odds))
    else:
        came = np.zeros(throws.rests)
    intervals = exact_intervals(came, float(came.sum()), CONFIDENCE)
    rests = [
        {
            "normal": poses.normals[i].tolist(),
            "count": int(throws.counts[i]),
            "frequency": float(throws.frequencies[i]) if landed.any() else None,
            "interval": intervals[i].tolist(),
            "geometric": float(poses.probabilities[i]),
            **({} if momentum is None else {"momentum": float(momentum[i])}),
        }
        for i in range(throws.rests)
    ]
    if labels is not None:
        rests = [{"label": label, **rest} for label, rest in zip(labels, rests, strict=True)]
    return {
        "drops": throws.drops,
        "unresolved": throws.unresolved,
        "table": throws.table.as_dict(),
        "engine": throws.engine,
        "seed": throws.seed,
        "orientations": orientations,
        "rests": rests,
        "total_variation": variation,
        "wasserstein": transport,
        "chi_square": test,
        "asymmetry": asymmetry(poses),
    }


def _text(die: Path, summary: dict[str, Any]) -> list[str]:
    table, rests, level = summary["table"], summary["rests"], f"{100 * CONFIDENCE:g} %"
    columns = {
        ("rest", "d"): [i + 1 for i in range(len(rests))],
        ("label", ">"): [rest.get("label") or "-" for rest in rests],
        ("count", "d"): [rest["count"] for rest in rests],
        ("frequency %", ".3f"): [
            math.nan if rest["frequency"] is None else 100 * rest["frequency"] for rest in rests
        ],
        (f"{level} interval", ">"): [percent_interval(rest["interval"]) for rest in rests],
        ("geometric %", ".3f"): [100 * rest["geometric"] for rest in rests],
        ("momentum %", ".3f"): [100 * rest.get("momentum", math.nan) for rest in rests],
        ("facet normal (down)", ""): [direction(rest["normal"]) for rest in rests],
    }
    for name, column in (("label", ("label", ">")), ("momentum", ("momentum %", ".3f"))):
        if name not in rests[0]:
            del columns[column]
    lines = [
        f"{printable(die)}: {summary['drops']} drops on {table['name']}, "
        f"{1e3 * table['size']:g} mm, engine {summary['engine']}, {summary['seconds']:.1f} s",
        "",
        *text_table(list(columns), zip(*columns.values(), strict=True)),
        "",
    ]
    if summary["unresolved"]:
        lines.append(f"unresolved: {summary['unresolved']} drops ended on no facet in time")
    for name, what in (
        ("total_variation", "total variation from the odds without momentum"),
        ("wasserstein", "Wasserstein distance from them, in radians,"),
    ):
        distance = summary[name]
        if distance is not None:
            low, high = distance["interval"]
            lines.append(
                f"{what} {distance['value']:.4f}, {level} interval {low:.4f} to {high:.4f}; noise "
                f"floor {distance['noise_floor']:.4f}"
            )
    test = summary["chi_square"]
    if test is not None:
        lines.append(
            f"chi-square against them {test['statistic']:.4g} on {test['degrees']} degrees of "
            f"freedom, p = {test['p_value']:.2g}; asymmetry rho {summary['asymmetry']:.3g}"
        )
    return lines
