"""`dicedesign rest` and `drop`: the rests of a mesh or of all meshes of a folder, and a roll."""

from __future__ import annotations

import argparse
import math
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dicedesign.cli.options import (
    add_body_options,
    add_worker_options,
    center_of_mass,
    check_worker_options,
    direction,
    print_json,
    read_poses,
    vector,
    workers_of,
)
from dicedesign.errors import InputError, named
from dicedesign.runtime.files import atomic_write
from dicedesign.runtime.text import printable, text_table

if TYPE_CHECKING:
    from dicedesign.batch.batch import Center
    from dicedesign.batch.rest_table import Entry, RestTable, Stamp
    from dicedesign.rest.poses import RestPoses
    from dicedesign.runtime.arrays import Floats


def add_rest_parser(commands: Any) -> None:
    """Add `dicedesign rest` to argparse's `commands`."""
    parser = commands.add_parser(
        "rest",
        help="list the resting poses of a mesh with their probabilities",
        description="List the resting poses of a mesh or point cloud with their probabilities. A "
        "folder in place of MESH stands for all meshes in it; their rests go to the table --out, "
        "and the same command goes on where an earlier one ended.",
    )
    add_body_options(parser)
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument(
        "--table",
        metavar="NAME|FILE.json",
        help="of a mesh: also the odds when it is thrown onto a table, by the momentum model: "
        "board-game, hard-wood, paper, carpet, or the file of a table; with "
        "another way to throw after a colon, as in board-game:cup",
    )
    parser.add_argument(
        "--prior",
        metavar="PRIOR",
        help="of a mesh: its odds where not all sides are equally likely to be down at first: "
        "vmf:x,y,z:CONCENTRATION, half:x,y,z, cap:x,y,z:ANGLE in degrees, or samples:FILE.csv; "
        "x,y,z point down, in the mesh's frame",
    )
    parser.add_argument(
        "--figure", type=Path, metavar="FILE.png", help="draw the Morse-Smale complex"
    )
    parser.add_argument(
        "--heights",
        type=Path,
        metavar="FILE.png",
        help="draw how high the center of mass is over the directions that may point down",
    )
    add_folder_options(parser)
    parser.set_defaults(command=_run_rest)


def rest_summary(poses: RestPoses, thrown: Floats | None = None) -> dict[str, Any]:
    """The answer as plain data. thrown: (k,) odds of a thrown body, where they were asked for."""
    return {
        "center_of_mass": poses.center_of_mass.tolist(),
        "center_of_mass_source": poses.center_of_mass_source,
        "hull": {"vertices": len(poses.hull.vertices), "facets": len(poses.hull.normals)},
        "rests": [
            {
                "normal": poses.normals[i].tolist(),
                "probability": float(poses.probabilities[i]),
                **({} if poses.errors is None else {"error": float(poses.errors[i])}),
                **({} if thrown is None else {"thrown": float(thrown[i])}),
                "transform": poses.transforms[i].tolist(),
                "area": float(poses.areas[i]),
                "margin_deg": math.degrees(poses.margins[i]),
            }
            for i in range(len(poses.probabilities))
        ],
        "seconds": poses.seconds,
    }


def _run_rest(options: argparse.Namespace) -> int:
    if os.path.isdir(options.mesh):
        return rest_folder(options, center_of_mass(options.com))
    refuse_folder_options(options)
    center = center_of_mass(options.com)
    body, poses = read_poses(options.mesh, center, options.coplanar_tolerance, options.part)
    if options.prior is not None:
        poses = _under_prior(options, poses)
    thrown = None
    if options.table is not None:
        from dicedesign.throws.momentum_model import momentum_model
        from dicedesign.throws.momentum_odds import momentum_odds
        from dicedesign.throws.rigid_body import rigid_body

        with named("--table"):
            model = momentum_model(options.table)
        thrown = momentum_odds(poses, rigid_body(body, poses), model)
    if options.figure is not None:
        from dicedesign.report.gauss_map import gauss_map_figure

        atomic_write(options.figure, gauss_map_figure(poses).png())
    if options.heights is not None:
        from dicedesign.report.gauss_map import heights_figure

        atomic_write(options.heights, heights_figure(poses).png())
    if options.json:
        print_json(rest_summary(poses, thrown))
    else:
        print(_rest_table(options, poses, thrown))
    return 0


def _under_prior(options: argparse.Namespace, poses: RestPoses) -> RestPoses:
    """The rests with the odds that `--prior` asks for."""
    from dicedesign.rest.density_priors import VonMisesFisher
    from dicedesign.rest.prior import SampledDirections, read_prior

    if options.table is not None:
        raise InputError(
            "--prior: expected none with --table, onto which bodies are thrown with any side down "
            "alike, got both; leave one of them out"
        )
    prior = read_prior(options.prior)
    if isinstance(prior, SampledDirections):
        near = VonMisesFisher.fitted(prior.directions)
        axis = ",".join(f"{x:.6g}" for x in near.axis)
        print(
            f"note: the density of one axis nearest to the samples is vmf:{axis}:"
            f"{near.concentration:.6g}",
            file=sys.stderr,
        )
    return poses.under(prior)


def _rest_table(options: argparse.Namespace, poses: RestPoses, thrown: Floats | None) -> str:
    columns = {
        ("rest", "d"): range(1, len(poses.probabilities) + 1),
        ("probability", ">"): _percent(poses.probabilities, ".5f"),
        ("thrown", ">"): _percent(thrown, ".5f"),
        ("error", ">"): _percent(poses.errors, ".1e"),
        ("facet normal (down)", ""): map(direction, poses.normals),
        ("area", ".4g"): poses.areas,
        ("margin", ">"): [f"{math.degrees(margin):.2f} deg" for margin in poses.margins],
    }
    shown = {column: values for column, values in columns.items() if values is not None}
    center = ", ".join(f"{x:.6g}" for x in poses.center_of_mass)
    return "\n".join(
        [
            f"{printable(options.mesh)}: {len(poses.probabilities)} resting poses, hull of "
            f"{len(poses.hull.vertices)} vertices and {len(poses.hull.normals)} facets, "
            f"{1e3 * sum(poses.seconds.values()):.1f} ms",
            f"center of mass ({center}), {poses.center_of_mass_source}",
            *([] if options.prior is None else [f"under the prior {printable(options.prior)}"]),
            "",
            *text_table(list(shown), zip(*shown.values(), strict=True)),
        ]
    )


def _percent(parts: Floats | None, form: str) -> list[str] | None:
    return None if parts is None else [f"{100 * part:{form}} %" for part in parts]


def add_folder_options(parser: argparse.ArgumentParser) -> None:
    """Options that go with a folder only."""
    parser.add_argument(
        "--out",
        type=Path,
        metavar="TABLE",
        help="of a folder: the table to write or go on, ending in .csv or .parquet, which needs "
        "the extra 'parquet'",
    )
    add_worker_options(
        parser,
        "processes side by side (default: one for each core, or each thread of the cluster, whose "
        "workers see the same files)",
        "of a folder: ",
    )


def refuse_folder_options(options: argparse.Namespace) -> None:
    """Raises InputError for options that go with a folder only."""
    for name in ("out", "jobs", "scheduler"):
        if getattr(options, name) is not None:
            raise InputError(
                f"--{name}: expected a folder of meshes, got {options.mesh}; leave --{name} out "
                "or name a folder"
            )


def rest_folder(options: argparse.Namespace, center_of_mass: Center) -> int:
    """Analyse the meshes of a folder; returns the exit code."""
    # Imported here, as one mesh and other commands do without.
    from dicedesign.batch.folder import list_folder
    from dicedesign.batch.rest_table import RestTable, Stamp, table_format

    if options.table is not None:
        raise InputError(
            f"--table: expected one mesh, got the folder {options.mesh}; leave --table out, or "
            "name a mesh"
        )
    _check_folder_options(options)
    folder, path, tolerance = options.mesh, options.out, options.coplanar_tolerance
    # Better known before the work than after.
    table_format(path)
    files = list_folder(folder)
    com = (
        ",".join(map(repr, center_of_mass)) if isinstance(center_of_mass, tuple) else center_of_mass
    )
    asked = (com or "", "" if tolerance is None else repr(tolerance))
    stamps = {file: Stamp(*state, *asked) for file, state in files.meshes.items()}
    before = RestTable.read(path)
    _check_table(options, before, stamps)
    kept = {file: before[file] for file in stamps if file in before}
    kept = {file: entry for file, entry in kept.items() if entry.stamp == stamps[file]}
    for count, what in (
        (files.others, "files are no meshes"),
        (len(kept), f"files were already in {path}"),
        (len(before.keys() - stamps.keys()), f"files of {path} are gone, and so are their rows"),
    ):
        if count:
            print(f"note: {count} {printable(what)}", file=sys.stderr)
    with RestTable(path, kept) as table:
        pending = {file: stamp for file, stamp in stamps.items() if file not in kept}
        if pending:
            _analyse_pending(table, pending, options, center_of_mass)
    return _print_summary(table)


def _check_folder_options(options: argparse.Namespace) -> None:
    for name in ("json", "figure", "heights", "prior", "part"):
        if getattr(options, name) not in (None, False, []):
            raise InputError(
                f"--{name}: expected one mesh, got the folder {options.mesh}; name a file, or "
                f"leave --{name} out"
            )
    tolerance = options.coplanar_tolerance
    if not (tolerance is None or 0.0 <= tolerance < 1.0):
        raise InputError(
            f"--coplanar-tolerance: expected a number in [0, 1), got {tolerance}; leave it out for "
            "the default"
        )
    check_worker_options(options)


def _check_table(
    options: argparse.Namespace, before: dict[str, Entry], stamps: dict[str, Stamp]
) -> None:
    """Rows that answer another question, or are of another folder, are neither kept nor lost."""
    asked = next(iter(stamps.values()))
    for entry in before.values():
        for name in ("com", "coplanar_tolerance"):
            was, now = getattr(entry.stamp, name), getattr(asked, name)
            if was != now:
                option = "--" + name.replace("_", "-")
                raise InputError(
                    f"{options.out}: expected a table made with {option} {now or 'left out'}, got "
                    f"one with {was or 'it left out'}; choose another with --out"
                )
    if before and before.keys().isdisjoint(stamps):
        raise InputError(
            f"{options.out}: expected a table of {options.mesh}, got one of other files, such as "
            f"{min(before)!r}; choose another with --out"
        )


def _analyse_pending(
    table: RestTable, pending: dict[str, Stamp], options: argparse.Namespace, center_of_mass: Center
) -> None:
    # Imported only where a file is left to analyse.
    from dicedesign.batch.batch import run_batch

    done = len(table.entries)
    with workers_of(options, "files", done + len(pending), done) as workers:

        def on_entries(entries: dict[str, Entry]) -> None:
            table.add(entries)
            workers.advance(len(entries))

        run_batch(
            str(options.mesh.resolve()),
            pending,
            workers.executor,
            workers.jobs,
            center_of_mass,
            options.coplanar_tolerance,
            on_entries=on_entries,
            on_quiet=workers.on_quiet,
        )


def _print_summary(table: RestTable) -> int:
    counts = [entry.rests for entry in table.entries.values()]
    analysed, broken = sum(count > 0 for count in counts), counts.count(0)
    print(f"{printable(table.path)}: {analysed} files with {sum(counts)} resting poses")
    if broken:
        print(
            f"note: {broken} files could not be analysed; see the column 'error'", file=sys.stderr
        )
    return 0 if analysed else 1


def add_drop_parser(commands: Any) -> None:
    """Add `dicedesign drop` to argparse's `commands`."""
    parser = commands.add_parser(
        "drop",
        help="follow a body from one orientation to rest",
        description="Follow a body that is let go at one orientation until it rests.",
    )
    add_body_options(parser)
    parser.add_argument(
        "--down",
        required=True,
        metavar="x,y,z",
        help="direction in the body's frame that points down at first",
    )
    parser.add_argument(
        "--max-angle-deg", type=float, metavar="A", help="split rotations larger than this"
    )
    parser.add_argument(
        "--figure",
        type=Path,
        metavar="FILE.png",
        help="draw the moments in which the contact changes, and the path over the Gauss map",
    )
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.set_defaults(command=_run_drop)


def _run_drop(options: argparse.Namespace) -> int:
    # Imported here, as other commands do without.
    from dicedesign.rest.roll import SMALLEST_ANGLE, roll_steps

    down = vector("--down", options.down)
    largest = None
    if options.max_angle_deg is not None:
        largest = math.radians(options.max_angle_deg)
        if not largest >= SMALLEST_ANGLE:
            raise InputError(
                f"--max-angle-deg: expected at least {math.degrees(SMALLEST_ANGLE):.2g}, got "
                f"{options.max_angle_deg:g}; take a larger angle"
            )
    center = center_of_mass(options.com)
    body, poses = read_poses(options.mesh, center, options.coplanar_tolerance, options.part)
    equilibria = poses.morse.equilibria
    steps = roll_steps(equilibria, down, largest)
    if options.figure is not None:
        from dicedesign.report.body_drawings import drop_figure
        from dicedesign.report.body_figures import drawn_surface

        surface = drawn_surface(body.points, body.triangles, poses.hull)
        atomic_write(options.figure, drop_figure(surface, poses, down).png())
    if options.json:
        source = equilibria.hull.source
        plain = [
            {
                "down": step.down.tolist(),
                "contact": step.contact,
                "points": source[list(step.vertices)].tolist(),
                "height": step.height,
                "transform": step.transform.tolist(),
            }
            for step in steps
        ]
        print_json({"steps": plain})
    else:
        columns = [("step", "d"), ("contact", ""), ("height of center", ".8g")]
        rows = [
            [i, step.contact, step.height, direction(step.down)] for i, step in enumerate(steps)
        ]
        print("\n".join(text_table([*columns, ("direction down", "")], rows)))
    return 0
