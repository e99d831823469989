"""`dicedesign rest` and `drop`: the rests of a mesh or of all meshes of a folder, and a roll."""

from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING, Any

from dicedesign.cli.commands import DropArguments, RestArguments
from dicedesign.cli.options import (
    center_of_mass,
    check_worker_options,
    direction,
    percents,
    plain_rows,
    print_json,
    print_note,
    read_poses,
    text_table,
    vector,
    workers_of,
)
from dicedesign.errors import InputError, named, printable
from dicedesign.rest.poses import RestPoses
from dicedesign.runtime.arrays import Floats
from dicedesign.runtime.files import atomic_write

if TYPE_CHECKING:
    from dicedesign.batch.rest_table import Entry, RestTable, Stamp


def list_rests(options: RestArguments) -> int:
    """Print the rests of a mesh, or write those of a folder."""
    if os.path.isdir(options.mesh):
        return _list_folder(options)
    for name in ("out", "jobs", "scheduler"):
        if getattr(options, name) is not None:
            raise InputError(
                f"--{name}: expected a folder of meshes, got {options.mesh}; leave --{name} out "
                "or name a folder"
            )
    body, poses = read_poses(
        options.mesh, center_of_mass(options.com), options.coplanar_tolerance, options.part
    )
    if options.prior is not None:
        poses = _under_prior(options, options.prior, poses)
    thrown = None
    if options.table is not None:
        from dicedesign.throws.momentum_model import momentum_model
        from dicedesign.throws.momentum_probabilities import momentum_probabilities
        from dicedesign.throws.rigid_body import rigid_body

        with named("--table"):
            model = momentum_model(options.table)
        thrown = momentum_probabilities(poses, rigid_body(body, poses), model)
    if options.figure is not None or options.heights is not None:
        from dicedesign.report.gauss_map import gauss_map_figure, heights_figure

        for path, draw in ((options.figure, gauss_map_figure), (options.heights, heights_figure)):
            if path is not None:
                atomic_write(path, draw(poses).png())
    if options.json:
        print_json(rest_summary(poses, thrown))
        return 0
    center = ", ".join(f"{x:.6g}" for x in poses.center_of_mass)
    print(
        f"{printable(options.mesh)}: {len(poses.probabilities)} resting poses, hull of "
        f"{len(poses.hull.vertices)} vertices and {len(poses.hull.normals)} facets, "
        f"{1e3 * sum(poses.seconds.values()):.1f} ms\n"
        f"center of mass ({center}), {poses.center_of_mass_source}"
    )
    if options.prior is not None:
        print(f"under the prior {printable(options.prior)}")
    margins = [f"{math.degrees(margin):.2f} deg" for margin in poses.margins]
    table = text_table(
        ("rest", "d", range(1, len(margins) + 1)),
        ("probability", ">", percents(poses.probabilities, ".5f")),
        ("thrown", ">", percents(thrown, ".5f")),
        ("error", ">", percents(poses.errors, ".1e")),
        ("facet normal (down)", "", map(direction, poses.normals)),
        ("area", ".4g", poses.areas),
        ("margin", ">", margins),
    )
    print(f"\n{table}")
    return 0


def rest_summary(poses: RestPoses, thrown: Floats | None = None) -> dict[str, Any]:
    """The answer as plain data. thrown: (k,) probabilities of a thrown body, where they were asked
    for."""
    columns = {
        "normal": poses.normals,
        "probability": poses.probabilities,
        "error": poses.errors,
        "thrown": thrown,
        "transform": poses.transforms,
        "area": poses.areas,
        "margin_deg": [math.degrees(margin) for margin in poses.margins],
    }
    return {
        "center_of_mass": poses.center_of_mass.tolist(),
        "center_of_mass_source": poses.center_of_mass_source,
        "hull": {"vertices": len(poses.hull.vertices), "facets": len(poses.hull.normals)},
        "rests": plain_rows(columns),
        "seconds": poses.seconds,
    }


def _under_prior(options: RestArguments, text: str, poses: RestPoses) -> RestPoses:
    """The rests with the probabilities that `--prior` asks for."""
    from dicedesign.rest.density_priors import VonMisesFisher
    from dicedesign.rest.prior import SampledDirections, read_prior

    if options.table is not None:
        raise InputError(
            "--prior: expected none with --table, onto which bodies are thrown with any side down "
            "alike, got both; leave one of them out"
        )
    prior = read_prior(text)
    if isinstance(prior, SampledDirections):
        near = VonMisesFisher.fitted(prior.directions)
        axis = ",".join(f"{x:.6g}" for x in near.axis)
        print_note(
            f"the density of one axis nearest to the samples is vmf:{axis}:{near.concentration:.6g}"
        )
    return poses.under(prior)


def _list_folder(options: RestArguments) -> int:
    """Analyze the meshes of a folder."""
    # Imported here, as one mesh does without.
    from dicedesign.batch.batch import list_folder, run_batch
    from dicedesign.batch.rest_table import RestTable, Stamp, table_format

    com, tolerance, path = center_of_mass(options.com), options.coplanar_tolerance, options.out
    for name in ("table", "json", "figure", "heights", "prior", "part"):
        if getattr(options, name) not in (None, False, ()):
            raise InputError(
                f"--{name}: expected one mesh, got the folder {options.mesh}; name a file, or "
                f"leave --{name} out"
            )
    if not (tolerance is None or 0.0 <= tolerance < 1.0):
        raise InputError(
            f"--coplanar-tolerance: expected a number in [0, 1), got {tolerance}; leave it out for "
            "the default"
        )
    check_worker_options(options)
    # Better known before the work than after.
    table_format(path)
    assert path is not None
    files = list_folder(options.mesh)
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
            print_note(f"{count} {printable(what)}")
    pending = {file: stamp for file, stamp in stamps.items() if file not in unchanged}
    with RestTable(path, unchanged) as table:
        if pending:
            with workers_of(options, "files", len(stamps), len(unchanged)) as workers:

                def on_entries(entries: dict[str, Entry]) -> None:
                    table.add(entries)
                    workers.advance(len(entries))

                run_batch(
                    str(options.mesh.resolve()),
                    pending,
                    workers.executor,
                    workers.jobs,
                    com,
                    tolerance,
                    on_entries=on_entries,
                    on_quiet=workers.on_quiet,
                )
    return _print_counts(table)


def _check_table(
    options: RestArguments, before: dict[str, Entry], stamps: dict[str, Stamp]
) -> None:
    """Rows that answer another question, or are of another folder, are neither kept nor lost."""
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
            f"{options.out}: expected a table of {options.mesh}, got one of other files, such as "
            f"{min(before)!r}; choose another with --out"
        )


def _print_counts(table: RestTable) -> int:
    counts = [entry.rests for entry in table.entries.values()]
    analyzed, broken = sum(count > 0 for count in counts), counts.count(0)
    print(f"{printable(table.path)}: {analyzed} files with {sum(counts)} resting poses")
    if broken:
        print_note(f"{broken} files could not be analyzed; see the column 'error'")
    return 0 if analyzed else 1


def drop(options: DropArguments) -> int:
    """Print the steps of a roll."""
    # Imported here, as `rest` does without.
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
    body, poses = read_poses(
        options.mesh, center_of_mass(options.com), options.coplanar_tolerance, options.part
    )
    equilibria = poses.morse.equilibria
    steps = roll_steps(equilibria, down, largest)
    if options.figure is not None:
        from dicedesign.report.figures import surface_to_draw
        from dicedesign.report.motion_pictures import drop_figure

        surface = surface_to_draw(body.points, body.triangles, poses.hull)
        atomic_write(options.figure, drop_figure(surface, poses, down).png())
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
