"""`dicedesign pose`: meshes stood in the poses in which they come to rest."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dicedesign.cli.bodies.body import add_rest_options, center_of_mass
from dicedesign.cli.options import (
    add_worker_options,
    check_worker_options,
    print_json,
    workers_of,
)
from dicedesign.errors import InputError
from dicedesign.runtime.checks import MOST_SEED, check_whole
from dicedesign.runtime.files import make_writable_folder
from dicedesign.runtime.text import printable, text_table

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dicedesign.scenes.standing import Job, Stood

__all__ = ["add_parser"]


def add_parser(commands: Any) -> None:
    """Add the subcommand to argparse's `commands`."""
    parser = commands.add_parser(
        "pose",
        help="stand meshes on a plane in the poses in which they come to rest",
        description="Write meshes in the pose in which they most probably come to rest, or in "
        "another, on the plane z = 0 with the center of mass on the z axis, in their own unit of "
        "length. GLB files keep their materials, PLY files their colours; other formats hold the "
        "shape alone.",
    )
    parser.add_argument(
        "meshes",
        type=Path,
        nargs="+",
        metavar="MESH",
        help="STL, OBJ, PLY, OFF, GLB, XYZ, ..., or a folder for all meshes in it",
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="PATH",
        help="of one mesh: the file to write, in the format of its ending (default: MESH_posed, "
        "here); of several or a folder: the folder for their files, which keep their names "
        "(default: posed)",
    )
    chosen = parser.add_mutually_exclusive_group()
    chosen.add_argument(
        "--pose", type=int, default=1, metavar="N", help="the N-th most probable (default: 1)"
    )
    chosen.add_argument(
        "--random",
        action="store_true",
        help="one drawn by the odds, turned about the vertical by any angle",
    )
    parser.add_argument(
        "--seed", type=int, default=0, metavar="S", help="of what --random draws (default: 0)"
    )
    parser.add_argument(
        "--format",
        metavar="NAME",
        help="of a folder's files: stl, obj, ply, off, glb, 3mf, xyz, ... (default: each mesh's)",
    )
    parser.add_argument(
        "--up",
        choices=("z", "y"),
        default="z",
        help="stand on z = 0, or on y = 0 as programs that show GLB files want (default: z)",
    )
    add_rest_options(parser)
    parser.add_argument("--json", action="store_true", help="print JSON with the transforms")
    add_worker_options(
        parser,
        "processes side by side (default: one for each core, or each thread of the cluster)",
        "of several meshes: ",
    )
    parser.set_defaults(command=_pose)


def _pose(options: argparse.Namespace) -> int:
    # Imported here, as other commands do without.
    from dicedesign.scenes.standing import PoseChoice, stand, stand_many

    check_whole("--pose", options.pose)
    check_whole("--seed", options.seed, least=0, most=MOST_SEED)
    check_worker_options(options)
    choice = PoseChoice(
        number=options.pose,
        seed=options.seed if options.random else None,
        center_of_mass=center_of_mass(options.com),
        coplanar_tolerance=options.coplanar_tolerance,
        y_up=options.up == "y",
    )
    into_folder = len(options.meshes) > 1 or os.path.isdir(options.meshes[0])
    if options.out is None:
        mesh = options.meshes[0]
        options.out = Path("posed" if into_folder else f"{mesh.stem}_posed{mesh.suffix}")
    elif os.path.isdir(options.out):
        into_folder = True
    jobs = list(_jobs(options, into_folder))
    _check_jobs(jobs)
    if len(jobs) == 1:
        if into_folder:
            make_writable_folder(jobs[0].target.parent)
        stood = [stand(jobs[0], choice)]
    else:
        for folder in sorted({job.target.parent for job in jobs}):
            make_writable_folder(folder)
        with workers_of(options, "files", len(jobs)) as workers:
            stood = stand_many(
                jobs,
                choice,
                workers.executor,
                workers.jobs,
                on_done=workers.advance,
                on_quiet=workers.on_quiet,
            )
    return _tell(stood, options)


def _jobs(options: argparse.Namespace, into_folder: bool) -> Iterator[Job]:
    """What is to be done, file by file."""
    from dicedesign.batch.folder import list_folder
    from dicedesign.scenes.posed_file import check_ending
    from dicedesign.scenes.standing import Job

    if options.format is not None:
        if not into_folder:
            raise InputError(
                f"--format: expected a folder for --out, got the file {options.out}, whose ending "
                "says its format; leave --format out"
            )
        check_ending(f".{options.format}", "--format")
    if not into_folder:
        (mesh,) = options.meshes
        check_ending(options.out.suffix, f"--out {options.out}")
        yield Job(mesh, mesh.name, options.out)
        return
    for mesh in options.meshes:
        names = list(list_folder(mesh).meshes) if os.path.isdir(mesh) else [mesh.name]
        for name in names:
            source = mesh / name if os.path.isdir(mesh) else mesh
            target = options.out / name
            if options.format is not None:
                target = target.with_suffix(f".{options.format}")
            yield Job(source, name, target)


def _check_jobs(jobs: list[Job]) -> None:
    """Raise InputError where two files would become one, or one would be written over itself."""
    sources: dict[Path, Path] = {}
    for job in jobs:
        other = sources.setdefault(job.target, job.source)
        if other != job.source:
            raise InputError(
                f"--out: expected meshes with different names, got {other} and {job.source}, which "
                f"would both be {job.target}; pose them one after the other"
            )
        both = os.path.exists(job.target) and os.path.exists(job.source)
        if both and os.path.samefile(job.target, job.source):
            raise InputError(
                f"--out: expected another path than the mesh's own, got {job.target}; take another"
            )


def _tell(stood: list[Stood], options: argparse.Namespace) -> int:
    """Print what was done; returns the exit code."""
    written = [one for one in stood if not one.error]
    for one in stood:
        for note in (one.error,) if one.error else one.notes if len(stood) == 1 else ():
            print(f"note: {printable(note)}", file=sys.stderr)
    if options.json:
        print_json({"files": [_plain(one) for one in stood]})
    else:
        columns = [("file", ""), ("pose", ">"), ("probability", ">"), ("written to", "")]
        rows = [
            [
                printable(one.job.name),
                f"{one.rest + 1} of {one.rests}",
                f"{100.0 * one.probability:.5f} %",
                printable(one.job.target),
            ]
            for one in written
        ]
        print("\n".join(text_table(columns, rows)))
    if len(written) < len(stood):
        print(f"note: {len(stood) - len(written)} files could not be posed", file=sys.stderr)
    return 0 if written else 1


def _plain(one: Stood) -> dict[str, Any]:
    if one.error:
        return {"file": str(one.job.source), "error": one.error}
    return {
        "file": str(one.job.source),
        "out": str(one.job.target),
        "pose": one.rest + 1,
        "poses": one.rests,
        "probability": one.probability,
        "transform": one.transform,
    }
