"""`dicedesign rest FOLDER`: the rests of all meshes of a folder, as a table."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from dicedesign.cli.options import add_worker_options, check_worker_options, workers_of
from dicedesign.errors import InputError
from dicedesign.runtime.text import printable

if TYPE_CHECKING:
    from dicedesign.batch.analyse import Center
    from dicedesign.batch.rest_table import RestTable
    from dicedesign.batch.rows import Entry, Stamp

__all__ = ["add_folder_options", "refuse_folder_options", "rest_folder"]


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
    from dicedesign.batch.formats import table_format
    from dicedesign.batch.rest_table import RestTable
    from dicedesign.batch.rows import Stamp

    if options.table is not None:
        raise InputError(
            f"--table: expected one mesh, got the folder {options.mesh}; leave --table out, or "
            "name a mesh"
        )
    _check(options)
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
            _run(table, pending, options, center_of_mass)
    return _summary(table)


def _check(options: argparse.Namespace) -> None:
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


def _run(
    table: RestTable, pending: dict[str, Stamp], options: argparse.Namespace, center_of_mass: Center
) -> None:
    # Imported only where a file is left to analyse.
    from dicedesign.batch.file_batches import run_batch

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


def _summary(table: RestTable) -> int:
    counts = [entry.rests for entry in table.entries.values()]
    analysed, broken = sum(count > 0 for count in counts), counts.count(0)
    print(f"{printable(table.path)}: {analysed} files with {sum(counts)} resting poses")
    if broken:
        print(
            f"note: {broken} files could not be analysed; see the column 'error'", file=sys.stderr
        )
    return 0 if analysed else 1
