"""`dicedesign rest` and `drop`: the rests of a mesh or of all meshes of a folder, and a roll."""

from __future__ import annotations

import csv
import math
import os
from collections.abc import Iterable
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dicedesign.batch.rest_rows import GivenMass, RestOptions, facet_columns, mass_values
from dicedesign.cli.commands import DropArguments, RestArguments
from dicedesign.cli.options import (
    center_of_mass,
    direction,
    find_poses,
    numbers,
    percents,
    plain_rows,
    print_json,
    print_notes,
    require_figure,
    text_table,
    workers_of,
)
from dicedesign.errors import DiceError, InputError, named, printable
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.geometry.robots.bodies import ROBOT_ENDINGS, list_bodies
from dicedesign.geometry.robots.links import NamedBody
from dicedesign.runtime.csv_cells import plain_cell
from dicedesign.runtime.files import atomic_write, read_text

if TYPE_CHECKING:
    from dicedesign.batch.rest_table import Entry, RestTable, Stamp


def list_rests(options: RestArguments) -> int:
    """Print the rests of meshes, or write them into a table. A bad body among several is noted."""
    meshes = options.meshes
    if options.out is not None or (os.path.isdir(meshes[0]) and len(meshes) == 1):
        return _write_table(options)
    for name in ("jobs", "scheduler"):
        if getattr(options, name) is not None:
            raise InputError(
                f"--{name}: expected a folder of meshes, got {meshes[0]}; leave --{name} out, or "
                "name a folder or a table with --out"
            )
    require_figure(options, options.figure)
    settings = _settings(options, map(str, meshes))
    bodies = [
        (mesh, source)
        for mesh in meshes
        for source in list_bodies(mesh, options.item, options.largest_part)
    ]
    if len(bodies) > 1 and options.figure is not None:
        raise InputError(
            f"--figure: expected one mesh, got {len(bodies)}; draw one after the other"
        )
    records: list[dict[str, Any]] = []
    failures: list[str] = []
    for mesh, source in bodies:
        label = {"file": str(mesh)} | ({"body": source.name} if source.name else {})
        try:
            name = f"link {source.name}" if mesh.suffix.lower() in ROBOT_ENDINGS else source.name
            with named(f"{mesh}: {name}") if source.name else nullcontext():
                record, text = _describe_body(options, settings, mesh, source)
        except DiceError as error:
            if len(bodies) == 1:
                raise
            failures.append(str(error))
            records.append({**label, "error": str(error)})
            continue
        if not options.json:
            print(f"\n{text}" if any("rests" in each for each in records) else text)
        records.append(record if len(bodies) == 1 else {**label, **record})
    if options.json:
        print_json(records[0] if len(records) == 1 else records)
    # An invalid option is one failure.
    print_notes(*dict.fromkeys(failures))
    return 2 if failures else 0


def _settings(options: RestArguments, files: Iterable[str]) -> RestOptions:
    """Options of the analysis of files. Raises InputError."""
    density, tolerance = options.density, options.coplanar_tolerance
    if not (density is None or 0.0 < density < math.inf):
        raise InputError(f"--density: expected g/cm3 above 0, got {density:g}; correct it")
    if not (tolerance is None or 0.0 <= tolerance < 1.0):
        raise InputError(
            f"--coplanar-tolerance: expected a number in [0, 1), got {tolerance}; leave it out for "
            "the default"
        )
    masses = {} if options.masses is None else _read_masses(options.masses)
    unknown = min(masses.keys() - set(files), default=None)
    if unknown is not None:
        raise InputError(
            f"{options.masses}: expected files that are analyzed, got {unknown!a}; write them as "
            "in the column 'file' of the table"
        )
    com = center_of_mass(options.com)
    return RestOptions(com, tolerance, density, options.all_facets, masses)


def _read_masses(path: Path) -> dict[str, GivenMass]:
    """Centers of mass and densities by file from a CSV file. Raises InputError."""
    rows = csv.DictReader(read_text(path, "a table of masses").splitlines(), strict=True)
    masses: dict[str, GivenMass] = {}
    columns = ("file", *"xyz", "density")
    try:
        if "file" not in (names := rows.fieldnames or []) or not set(names) <= set(columns):
            raise ValueError(f"the columns {','.join(map(str, names))}")
        for row in rows:
            file, *texts = (plain_cell((row.get(name) or "").strip()) for name in columns)
            x, y, z, density = (float(text) if text else None for text in texts)
            known = [number for number in (x, y, z, density) if number is not None]
            place = None if x is None or y is None or z is None else (x, y, z)
            if (
                (file in masses or None in row)
                or (place is None and any(texts[:3]))
                or not all(map(math.isfinite, known))
                or (density is not None and density <= 0.0)
            ):
                raise ValueError(f"line {rows.line_num} with {file!a} and {known}")
            masses[file] = GivenMass(place, density)
    except (ValueError, csv.Error) as error:
        raise InputError(
            f"{path}: expected columns file and x,y,z or density, with one line of numbers for a "
            f"file and densities above 0, got {error}; correct it"
        ) from error
    return masses


def _describe_body(
    options: RestArguments, settings: RestOptions, mesh: Path, source: NamedBody
) -> tuple[dict[str, Any], str]:
    """Rests of a body as plain data, and as text."""
    com, density = options.com, settings.of_file(str(mesh))[1]
    given = settings.masses.get(str(mesh))
    known = None if given is None else given.center_of_mass
    body, poses = find_poses(
        source.read(),
        com if known is None else None,
        options.coplanar_tolerance,
        options.part,
        center=known,
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
        from dicedesign.report.gauss_map import gauss_map
        from dicedesign.report.sheet import figure_bytes

        atomic_write(options.figure, figure_bytes(gauss_map(poses), options.figure.suffix))
    columns = facet_columns(poses, False)
    mass = mass_values(source, body, poses, density)
    record = {
        "center_of_mass": poses.center_of_mass.tolist(),
        "center_of_mass_source": poses.center_of_mass_source,
        "hull": {"vertices": len(poses.hull.vertices), "facets": len(poses.hull.normals)},
        "unit": source.unit,
        **mass,
        "rests": plain_rows({**columns, "error": poses.errors, "thrown": thrown}),
        "seconds": poses.seconds,
    }
    center = ", ".join(f"{x:.6g}" for x in poses.center_of_mass)
    name = f", {printable(source.name)}" if source.name else ""
    text = (
        f"{printable(mesh)}{name}: {len(poses.probabilities)} resting poses, hull of "
        f"{len(poses.hull.vertices)} vertices and {len(poses.hull.normals)} facets, "
        f"{1e3 * sum(poses.seconds.values()):.1f} ms\n"
        f"center of mass ({center}), {poses.center_of_mass_source}"
    )
    if options.prior is not None:
        text += f"\nunder the prior {printable(options.prior)}"
    if mass["mass_g"] is not None:
        volume, grams, *moments = (f"{value:.6g}" for value in list(mass.values())[:5])
        inertia = ", ".join(moments)
        text += f"\nvolume {volume} mm3, mass {grams} g, principal inertia {inertia} g mm2"
    text += "\n\n" + text_table(
        ("rest", "d", columns["rest"]),
        ("probability", ">", percents(poses.probabilities, ".5f")),
        ("thrown", ">", percents(thrown, ".5f")),
        ("error", ">", percents(poses.errors, ".1e")),
        ("facet normal (down)", "", map(direction, poses.normals)),
        ("area", ".4g", poses.areas),
        ("margin", ">", [f"{margin:.2f} deg" for margin in columns["margin_deg"]]),
    )
    if options.all_facets:
        columns = facet_columns(poses, True)
        record["facets"] = plain_rows(columns)
        text += "\n\n" + text_table(
            ("facet", "d", columns["facet"]),
            ("rolls to rest", "d", columns["rolls_to"]),
            ("facet normal", "", map(direction, columns["normal"])),
            ("depth of center", ".4g", columns["depth"]),
        )
    return record, text


def _write_table(options: RestArguments) -> int:
    """Analyze the meshes of a folder, or those named."""
    # Printed rests need none of these.
    from dicedesign.batch.batch import file_state, list_folder, run_batch
    from dicedesign.batch.rest_table import RestTable, make_stamp, table_format

    path, folder = options.out, options.meshes[0]
    is_folder = os.path.isdir(folder) and len(options.meshes) == 1
    for name in ("table", "json", "figure", "prior", "part", "item", "largest_part"):
        if getattr(options, name) not in (None, False, ()):
            option = "--" + name.replace("_", "-")
            got = f"the folder {folder}" if is_folder else f"--out {path}"
            raise InputError(
                f"{option}: expected one mesh, got {got}; name a file, or leave {option} out"
            )
    # A wrong ending fails before the work.
    table_format(path)
    assert path is not None
    if is_folder:
        files, others = (listing := list_folder(folder)).meshes, listing.others
    else:
        folder, others = Path(), 0
        files = {str(mesh): file_state(mesh) for mesh in options.meshes}
    settings = _settings(options, files)
    stamps = {file: make_stamp(file, state, settings) for file, state in files.items()}
    before = RestTable.read(path)
    _check_table(options, before, stamps)
    unchanged = {file: before[file] for file in stamps if file in before}
    unchanged = {
        file: entry
        for file, entry in unchanged.items()
        # Meshes of robots may have changed.
        if entry.stamp == stamps[file] and Path(file).suffix.lower() not in ROBOT_ENDINGS
    }
    for count, what in (
        (others, "files are no meshes"),
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
                    settings,
                    on_entries=on_entries,
                )
    code = _print_counts(table)
    return code if is_folder or not any(each.failures for each in table.entries.values()) else 2


def _check_table(
    options: RestArguments, before: dict[str, Entry], stamps: dict[str, Stamp]
) -> None:
    """Raise InputError for a table with other options, or of another folder."""
    stamp = next(iter(stamps.values()))
    for entry in before.values():
        for name in ("com", "coplanar_tolerance", "density", "all_facets"):
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
    entries = table.entries.values()
    analyzed, count = sum(entry.rests > 0 for entry in entries), sum(each.rests for each in entries)
    print(f"{printable(table.path)}: {analyzed} files with {count} resting poses")
    if failed := sum(entry.failures for entry in entries):
        what = "files" if failed == len(entries) - analyzed else "bodies"
        print_notes(f"{failed} {what} could not be analyzed; see the column 'error'")
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
    _, poses = find_poses(
        read_body(options.mesh, options.item, keep_largest=options.largest_part),
        options.com,
        options.coplanar_tolerance,
        options.part,
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
