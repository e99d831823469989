"""`dicedesign rest` and `drop`: the rests of a mesh or of all meshes of a folder, and a roll."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dicedesign.cli.commands import DropArguments, RestArguments
from dicedesign.cli.options import (
    center_of_mass,
    direction,
    numbers,
    percents,
    plain_rows,
    print_json,
    print_notes,
    read_poses,
    text_table,
    workers_of,
)
from dicedesign.errors import DiceError, InputError, named, printable
from dicedesign.runtime.files import atomic_write

if TYPE_CHECKING:
    from dicedesign.batch.rest_table import Entry, RestTable, Stamp


def list_rests(options: RestArguments) -> int:
    """Print the rests of meshes, or write those of a folder. A bad mesh among several is noted."""
    meshes = options.meshes
    if os.path.isdir(meshes[0]) and len(meshes) == 1:
        return _list_folder(options, meshes[0])
    for name in ("out", "jobs", "scheduler"):
        if getattr(options, name) is not None:
            raise InputError(
                f"--{name}: expected a folder of meshes, got {meshes[0]}; leave --{name} out "
                "or name a folder"
            )
    if len(meshes) > 1 and options.figure is not None:
        raise InputError(
            f"--figure: expected one mesh, got {len(meshes)}; draw one after the other"
        )
    records: list[dict[str, Any]] = []
    failures: list[str] = []
    for mesh in meshes:
        try:
            record, text = _describe_mesh(options, mesh)
        except DiceError as error:
            if len(meshes) == 1:
                raise
            failures.append(str(error))
            records.append({"file": str(mesh), "error": str(error)})
            continue
        if not options.json:
            print(f"\n{text}" if any("rests" in each for each in records) else text)
        records.append(record if len(meshes) == 1 else {"file": str(mesh), **record})
    if options.json:
        print_json(records[0] if len(records) == 1 else records)
    # An invalid option is one failure.
    print_notes(*dict.fromkeys(failures))
    return 2 if failures else 0


def _describe_mesh(options: RestArguments, mesh: Path) -> tuple[dict[str, Any], str]:
    """Rests of a mesh as plain data, and as text."""
    body, poses = read_poses(
        mesh,
        options.com,
        options.coplanar_tolerance,
        options.part,
        largest_part=options.largest_part,
    )
    if options.prior is not None:
        if options.table is not None:
            raise InputError(
                "--prior: expected none with --table, which throws bodies from uniformly random "
                "orientations, got both; leave one of them out"
            )
        poses = poses.under(options.prior)
    thrown = None
    if options.table is not None:
        from dicedesign.throws.momentum_model import momentum_model
        from dicedesign.throws.momentum_probabilities import momentum_probabilities
        from dicedesign.throws.rigid_body import rigid_body

        with named("--table"):
            model = momentum_model(options.table)
        thrown = momentum_probabilities(poses, rigid_body(body, poses), model)
    if options.figure is not None:
        from dicedesign.report.gauss_map import gauss_map_figure

        atomic_write(options.figure, gauss_map_figure(poses).png())
    margins = np.degrees(poses.margins)
    columns: dict[str, Any] = {
        "normal": poses.normals,
        "probability": poses.probabilities,
        "error": poses.errors,
        "thrown": thrown,
        "transform": poses.transforms,
        "area": poses.areas,
        "margin_deg": margins,
    }
    record = {
        "center_of_mass": poses.center_of_mass.tolist(),
        "center_of_mass_source": poses.center_of_mass_source,
        "hull": {"vertices": len(poses.hull.vertices), "facets": len(poses.hull.normals)},
        "rests": plain_rows(columns),
        "seconds": poses.seconds,
    }
    center = ", ".join(f"{x:.6g}" for x in poses.center_of_mass)
    text = (
        f"{printable(mesh)}: {len(poses.probabilities)} resting poses, hull of "
        f"{len(poses.hull.vertices)} vertices and {len(poses.hull.normals)} facets, "
        f"{1e3 * sum(poses.seconds.values()):.1f} ms\n"
        f"center of mass ({center}), {poses.center_of_mass_source}"
    )
    if options.prior is not None:
        text += f"\nunder the prior {printable(options.prior)}"
    table = text_table(
        ("rest", "d", range(1, len(margins) + 1)),
        ("probability", ">", percents(poses.probabilities, ".5f")),
        ("thrown", ">", percents(thrown, ".5f")),
        ("error", ">", percents(poses.errors, ".1e")),
        ("facet normal (down)", "", map(direction, poses.normals)),
        ("area", ".4g", poses.areas),
        ("margin", ">", [f"{margin:.2f} deg" for margin in margins]),
    )
    return record, f"{text}\n\n{table}"


def _list_folder(options: RestArguments, folder: Path) -> int:
    """Analyze the meshes of a folder."""
    # One mesh needs none of these.
    from dicedesign.batch.batch import list_folder, run_batch
    from dicedesign.batch.rest_table import RestTable, Stamp, table_format

    com, tolerance, path = center_of_mass(options.com), options.coplanar_tolerance, options.out
    for name in ("table", "json", "figure", "prior", "part", "largest_part"):
        if getattr(options, name) not in (None, False, ()):
            option = "--" + name.replace("_", "-")
            raise InputError(
                f"{option}: expected one mesh, got the folder {folder}; name a file, or leave "
                f"{option} out"
            )
    if not (tolerance is None or 0.0 <= tolerance < 1.0):
        raise InputError(
            f"--coplanar-tolerance: expected a number in [0, 1), got {tolerance}; leave it out for "
            "the default"
        )
    # A wrong ending fails before the work.
    table_format(path)
    assert path is not None
    files = list_folder(folder)
    com_text = ",".join(map(repr, com)) if isinstance(com, tuple) else com or ""
    settings = com_text, "" if tolerance is None else repr(tolerance)
    stamps = {file: Stamp(*state, *settings) for file, state in files.meshes.items()}
    before = RestTable.read(path)
    _check_table(options, before, stamps)
    unchanged = {file: before[file] for file in stamps if file in before}
    unchanged = {file: entry for file, entry in unchanged.items() if entry.stamp == stamps[file]}
    for count, what in (
        (files.others, "files are no meshes"),
        (len(unchanged), f"files were already in {path}"),
        (len(before.keys() - stamps.keys()), f"files of {path} are gone, and so are their rows"),
    ):
        if count:
            print_notes(f"{count} {what}")
    pending = {file: stamp for file, stamp in stamps.items() if file not in unchanged}
    with RestTable(path, unchanged) as table:
        if pending:
            with workers_of(options, "files", len(stamps), len(unchanged)) as workers:

                def on_entries(entries: dict[str, Entry]) -> None:
                    table.add(entries)
                    workers.bar.update(len(entries))

                run_batch(
                    str(folder.resolve()),
                    pending,
                    workers.executor,
                    workers.jobs,
                    com,
                    tolerance,
                    on_entries=on_entries,
                )
    return _print_counts(table)


def _check_table(
    options: RestArguments, before: dict[str, Entry], stamps: dict[str, Stamp]
) -> None:
    """Raise InputError for a table with other options, or of another folder."""
    stamp = next(iter(stamps.values()))
    for entry in before.values():
        for name in ("com", "coplanar_tolerance"):
            was, now = getattr(entry.stamp, name), getattr(stamp, name)
            if was != now:
                option = "--" + name.replace("_", "-")
                raise InputError(
                    f"{options.out}: expected a table made with {option} {now or 'left out'}, got "
                    f"one with {was or 'it left out'}; choose another with --out"
                )
    if before and before.keys().isdisjoint(stamps):
        raise InputError(
            f"{options.out}: expected a table of {options.meshes[0]}, got one of other files, such "
            f"as {min(before)!r}; choose another with --out"
        )


def _print_counts(table: RestTable) -> int:
    counts = [entry.rests for entry in table.entries.values()]
    analyzed, failed = sum(count > 0 for count in counts), counts.count(0)
    print(f"{printable(table.path)}: {analyzed} files with {sum(counts)} resting poses")
    if failed:
        print_notes(f"{failed} files could not be analyzed; see the column 'error'")
    return 0 if analyzed else 1


def drop(options: DropArguments) -> int:
    """Print the steps of a roll."""
    # `rest` does not need this.
    from dicedesign.rest.roll import SMALLEST_ANGLE, roll_steps

    down = numbers("--down", options.down)
    largest = None
    if options.max_angle_deg is not None:
        largest = math.radians(options.max_angle_deg)
        if not largest >= SMALLEST_ANGLE:
            raise InputError(
                f"--max-angle-deg: expected at least {math.degrees(SMALLEST_ANGLE):.2g}, got "
                f"{options.max_angle_deg:g}; take a larger angle"
            )
    _, poses = read_poses(
        options.mesh,
        options.com,
        options.coplanar_tolerance,
        options.part,
        largest_part=options.largest_part,
    )
    equilibria = poses.morse.equilibria
    steps = roll_steps(equilibria, down, largest)
    columns: dict[str, Any] = {
        "down": [step.down for step in steps],
        "contact": [step.contact for step in steps],
        "points": [equilibria.hull.source[list(step.vertices)] for step in steps],
        "height": [step.height for step in steps],
        "transform": [step.transform for step in steps],
    }
    if options.json:
        print_json({"steps": plain_rows(columns)})
        return 0
    table = text_table(
        ("step", "d", range(len(steps))),
        ("contact", "", columns["contact"]),
        ("height of center", ".8g", columns["height"]),
        ("direction down", "", map(direction, columns["down"])),
    )
    print(table)
    return 0
