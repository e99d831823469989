"""`dicedesign pose`, `scatter`, `repair`, `figure`: meshes posed, repaired and drawn."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dicedesign.cli.options import (
    add_rest_options,
    add_worker_options,
    center_of_mass,
    check_worker_options,
    numbers,
    print_json,
    vector,
    workers_of,
)
from dicedesign.errors import MOST_SEED, InputError, check_whole
from dicedesign.runtime.files import atomic_write, make_writable_folder
from dicedesign.runtime.text import printable, text_table
from dicedesign.runtime.workers import progress_bar
from dicedesign.tolerances import SMALLEST_EXTENT

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dicedesign.geometry.surfaces.repair import RepairedMesh
    from dicedesign.geometry.triangles import Surface
    from dicedesign.scenes.posing import Job, Stood
    from dicedesign.scenes.room import Room


def add_pose_parser(commands: Any) -> None:
    """Add `dicedesign pose` to argparse's `commands`."""
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
    parser.set_defaults(command=_run_pose)


def _run_pose(options: argparse.Namespace) -> int:
    # Imported here, as other commands do without.
    from dicedesign.scenes.posing import PoseChoice, stand, stand_many

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
    jobs = list(_list_jobs(options, into_folder))
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
    return _print_stood(stood, options)


def _list_jobs(options: argparse.Namespace, into_folder: bool) -> Iterator[Job]:
    """What is to be done, file by file."""
    from dicedesign.batch.folder import list_folder
    from dicedesign.scenes.posing import Job, check_ending

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


def _print_stood(stood: list[Stood], options: argparse.Namespace) -> int:
    """Print what was done; returns the exit code."""
    written = [one for one in stood if not one.error]
    for one in stood:
        for note in (one.error,) if one.error else one.notes if len(stood) == 1 else ():
            print(f"note: {printable(note)}", file=sys.stderr)
    if options.json:
        print_json({"files": [_plain_stood(one) for one in stood]})
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


def _plain_stood(one: Stood) -> dict[str, Any]:
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


MOST_BODIES: Final = 20_000


def add_scatter_parser(commands: Any) -> None:
    """Add `dicedesign scatter` to argparse's `commands`."""
    parser = commands.add_parser(
        "scatter",
        help="fill a floor with meshes of a folder in poses drawn by their odds",
        description="Fill a floor with meshes of a folder, each in a pose drawn by its odds and "
        "turned by any angle, such that what they cover on the floor, their convex hulls seen from "
        "above, does not overlap. The meshes take turns.",
    )
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="of the meshes")
    parser.add_argument(
        "--count", type=int, default=30, metavar="N", help="bodies on the floor (default: 30)"
    )
    parser.add_argument(
        "--seed", type=int, default=0, metavar="S", help="of all chance (default: 0)"
    )
    parser.add_argument(
        "--out",
        type=Path,
        required=True,
        metavar="FILE",
        help="the scene: .glb, with the meshes' materials and y upward as the format wants",
    )
    parser.add_argument(
        "--floor",
        metavar="W,D",
        help="sides of the floor in the meshes' unit of length (default: as large as they need)",
    )
    parser.add_argument(
        "--size",
        type=float,
        metavar="L",
        help="scale each mesh until the longest side of the box around it is L (default: as they "
        "are)",
    )
    parser.add_argument("--figure", type=Path, metavar="FILE.png", help="draw a picture of it")
    parser.add_argument(
        "--json", action="store_true", help="print every body's file, pose and transform as JSON"
    )
    parser.set_defaults(command=_run_scatter)


def _run_scatter(options: argparse.Namespace) -> int:
    # Imported here, as other commands do without.
    from dicedesign.batch.folder import list_folder
    from dicedesign.geometry.meshes.reading import without_solids
    from dicedesign.scenes.room import room_glb, scattered

    floor = _checked_floor(options)
    files = list_folder(options.folder)
    with (
        without_solids(),
        progress_bar("meshes", min(options.count, len(files.meshes))) as bar,
    ):

        def on_mesh(error: str) -> None:
            if error:
                bar.write(f"note: left out {printable(error)}", file=sys.stderr)
            else:
                bar.update(1)

        room = scattered(
            options.folder,
            list(files.meshes),
            options.count,
            options.seed,
            floor=floor,
            size=options.size,
            on_mesh=on_mesh,
        )
        data = room_glb(room)
    if options.figure is not None:
        from dicedesign.scenes.picture import room_picture

        atomic_write(options.figure, room_picture(room))
    atomic_write(options.out, data)
    if options.json:
        print_json(room.plain())
    else:
        print("\n".join(_room_table(options, room)))
    return 0


def _checked_floor(options: argparse.Namespace) -> tuple[float, float] | None:
    """The floor that is asked for. Raises InputError for options that cannot be meant."""
    check_whole("--count", options.count, most=MOST_BODIES)
    check_whole("--seed", options.seed, least=0, most=MOST_SEED)
    if options.out.suffix.lower() != ".glb":
        raise InputError(f"--out: expected a path that ends in .glb, got {options.out}; rename it")
    if options.size is not None:
        _check_length("--size", options.size)
    if options.floor is None:
        return None
    width, depth = numbers("--floor", options.floor, "w,d")
    for side in (width, depth):
        _check_length("--floor", side)
    return width, depth


def _check_length(name: str, length: float) -> None:
    """Raise InputError for a length whose square, or its inverse, would not be a number."""
    if not SMALLEST_EXTENT <= length <= 1.0 / SMALLEST_EXTENT:
        raise InputError(
            f"{name}: expected a length from {SMALLEST_EXTENT:g} to {1.0 / SMALLEST_EXTENT:g}, "
            f"got {length:g}; change it, or the unit"
        )


def _room_table(options: argparse.Namespace, room: Room) -> list[str]:
    rows = []
    for number, model in enumerate(room.models):
        rests = [body.rest for body in room.bodies if body.model == number]
        poses = f"{len(set(rests))} of {len(model.poses.probabilities)}"
        rows.append([printable(model.name), len(rests), poses, model.scale])
    columns = [("file", ""), ("bodies", "d"), ("poses seen", ">"), ("scale", ".4g")]
    width, depth = room.floor
    return [
        f"{printable(options.out)}: {len(room.bodies)} bodies of {len(room.models)} meshes on a "
        f"floor of {width:g} by {depth:g}",
        "",
        *text_table(columns, rows),
    ]


def add_repair_parser(commands: Any) -> None:
    """Add `dicedesign repair` to argparse's `commands`."""
    parser = commands.add_parser(
        "repair",
        help="make a mesh the closed surface of one solid",
        description="Make a mesh that is open, no manifold, of several bodies or meets itself the "
        "closed surface of the largest solid that it encloses, for a concave die. One that is "
        "such a surface already is written as it is. Needs the extra 'repair'.",
    )
    parser.add_argument("mesh", type=Path, metavar="IN", help="STL, OBJ, PLY, OFF, GLB, ...")
    parser.add_argument(
        "out",
        type=Path,
        metavar="OUT",
        help="the file to write, in the unit of IN, in the format of its ending; a picture of "
        "before and after is written beside it, ending in _repair.png",
    )
    parser.set_defaults(command=_run_repair)


def _run_repair(options: argparse.Namespace) -> int:
    # Imported here, as other commands do without.
    from dicedesign.fabricate.file_formats import format_of_ending, mesh_bytes
    from dicedesign.geometry.meshes.reading import read_body
    from dicedesign.geometry.surfaces.repair import FINEST, input_surface
    from dicedesign.report.render.raster import upward_of
    from dicedesign.report.surface_figures import repair_figure

    kind = format_of_ending(options.out.suffix, str(options.out))
    surface, notes, made = input_surface(read_body(options.mesh), FINEST, repair=True)
    points = np.asarray(np.linalg.solve(kind.frame, surface.points.T).T, np.float64)
    data = mesh_bytes(points, surface.triangles, options.out.suffix, str(options.out))
    files = [options.out]
    atomic_write(options.out, data)
    if made is not None:
        files.append(options.out.with_name(f"{options.out.stem}_repair.png"))
        atomic_write(files[1], repair_figure(made, upward_of(options.mesh)).png())
    for note in notes:
        print(f"note: {printable(note)}", file=sys.stderr)
    if made is not None:
        print("\n".join(_repair_table(made, surface)))
    print(f"files: {', '.join(printable(str(path)) for path in files)}")
    return 0


def _repair_table(made: RepairedMesh, surface: Surface) -> list[str]:
    numbers = made.numbers
    missed, off = (
        [f"{100.0 * part:.2g} % of the diagonal" for part in parts]
        for parts in (
            (numbers.missed_mean, numbers.missed_largest),
            (numbers.off_mean, numbers.off_largest),
        )
    )
    closed = numbers.handles_before is not None
    rows = [
        ("points", len(made.points), len(surface.points)),
        ("triangles", len(made.triangles), len(surface.triangles)),
        ("pieces", numbers.pieces, 1),
        ("cavities", numbers.cavities, 0),
        ("handles", numbers.handles_before if closed else "not closed", numbers.handles),
        ("mean distance to the other", missed[0], off[0]),
        ("largest distance", missed[1], off[1]),
    ]
    texts = [(name, str(before), str(after)) for name, before, after in rows]
    return text_table([("", ""), ("before", ">"), ("after", ">")], texts)


def add_figure_parser(commands: Any) -> None:
    """Add `dicedesign figure` to argparse's `commands`."""
    # Only where the help is made: a command that is run does not need it.
    from dicedesign.report.body_figures import BODY_FIGURES

    kinds = "; ".join(f"{figure.name}: {figure.line}" for figure in BODY_FIGURES)
    parser = commands.add_parser(
        "figure",
        help="draw one of the paper's kinds of figures of a mesh, a finished die or a recipe",
        description="Draw one of the paper's kinds of figures of any body. Kinds: " + kinds + ".",
    )
    parser.add_argument("kind", metavar="KIND", help="one of these")
    parser.add_argument(
        "subject",
        type=Path,
        metavar="INPUT",
        help="a mesh file, a folder that `dicedesign run` left, or a recipe, whose die is designed",
    )
    parser.add_argument(
        "--out", type=Path, metavar="FILE.png", help="the picture (default: INPUT_KIND.png, here)"
    )
    parser.add_argument(
        "--down",
        metavar="x,y,z",
        help="of paths and drop: direction in the body's frame that points down at first",
    )
    parser.add_argument(
        "--before", type=Path, metavar="MESH", help="of before_after: what the body was made from"
    )
    parser.add_argument("--steps", type=int, metavar="N", help="of ablation: most of each descent")
    add_rest_options(parser)
    parser.set_defaults(command=_run_figure)


def _run_figure(options: argparse.Namespace) -> int:
    from dicedesign.recipe.subjects import subject_of
    from dicedesign.report.body_figures import BODY_FIGURES

    figure = BODY_FIGURES[options.kind]
    for name, kinds in (
        ("down", ("paths", "drop")),
        ("before", ("before_after",)),
        ("steps", ("ablation",)),
    ):
        if getattr(options, name) is not None and options.kind not in kinds:
            raise InputError(
                f"--{name}: expected with {' or '.join(kinds)}, got {options.kind}; leave it out"
            )
    if options.steps is not None:
        check_whole("--steps", options.steps)
    out = options.out
    if out is None:
        out = Path(f"{options.subject.resolve().stem}_{options.kind}.png")
    if out.suffix.lower() != ".png":
        raise InputError(f"--out: expected a path that ends in .png, got {out}; rename it")
    down = None if options.down is None else vector("--down", options.down)
    with progress_bar("steps") as bar:
        subject = subject_of(
            options.subject,
            center_of_mass=center_of_mass(options.com),
            coplanar_tolerance=options.coplanar_tolerance,
            down=down,
            before=options.before,
            steps=options.steps,
            on_step=lambda: bar.update(1),
        )
        data = figure.draw(subject).png()
    atomic_write(out, data)
    print(f"files: {printable(out)}")
    return 0
