"""`dicedesign pose`, `scatter`, `repair`, `balance`, `figure`: meshes posed, changed and drawn."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dicedesign.cli.commands import Balance, Figure, Pose, Repair, Scatter
from dicedesign.cli.options import (
    center_of_mass,
    check_worker_options,
    direction,
    numbers,
    percents,
    print_json,
    print_note,
    text_table,
    vector,
    workers_of,
)
from dicedesign.errors import MOST_SEED, InputError, check_whole, printable
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.runtime.files import atomic_write, json_text, make_writable_folder
from dicedesign.tolerances import SMALLEST_EXTENT

if TYPE_CHECKING:
    from dicedesign.balance.balanced import Balanced
    from dicedesign.balance.goals import Goal
    from dicedesign.scenes.posing import PoseJob


def pose(options: Pose) -> int:
    """Write meshes in poses."""
    from dicedesign.scenes.posing import PoseChoice, write_pose, write_poses

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
    jobs = list(_list_jobs(options))
    sources: dict[Path, Path] = {}
    for job in jobs:
        other = sources.setdefault(job.target, job.source)
        if other != job.source:
            raise InputError(
                f"--out: expected meshes with different names, got {other} and {job.source}, which "
                f"would both be {job.target}; pose them one after the other"
            )
        _refuse_overwriting(job.source, job.target, "another path than the mesh's own")
    if len(jobs) > 1 or jobs[0].target != options.out:
        for folder in sorted({job.target.parent for job in jobs}):
            make_writable_folder(folder)
    if len(jobs) == 1:
        stood = [write_pose(jobs[0], choice)]
    else:
        with workers_of(options, "files", len(jobs)) as workers:
            stood = write_poses(
                jobs,
                choice,
                workers.executor,
                workers.jobs,
                on_done=workers.advance,
                on_quiet=workers.on_quiet,
            )
    written = [one for one in stood if not one.error]
    for one in stood:
        for note in (one.error,) if one.error else one.notes if len(stood) == 1 else ():
            print_note(printable(note))
    if options.json:
        plain: list[dict[str, Any]] = []
        for one in stood:
            plain.append({"file": str(one.job.source)})
            plain[-1] |= (
                {"error": one.error}
                if one.error
                else {
                    "out": str(one.job.target),
                    "pose": one.rest + 1,
                    "poses": one.rests,
                    "probability": one.probability,
                    "transform": one.transform,
                }
            )
        print_json({"files": plain})
    else:
        table = text_table(
            ("file", "", [printable(one.job.name) for one in written]),
            ("pose", ">", [f"{one.rest + 1} of {one.rests}" for one in written]),
            ("probability", ">", percents([one.probability for one in written], ".5f")),
            ("written to", "", [printable(one.job.target) for one in written]),
        )
        print(table)
    if len(written) < len(stood):
        print_note(f"{len(stood) - len(written)} files could not be posed")
    return 0 if written else 1


def _list_jobs(options: Pose) -> Iterator[PoseJob]:
    """What is to be done, file by file."""
    from dicedesign.batch.batch import list_folder
    from dicedesign.scenes.posing import PoseJob, check_ending

    first, out = options.meshes[0], options.out
    into_folder = len(options.meshes) > 1 or os.path.isdir(first)
    if out is None:
        out = Path("posed" if into_folder else f"{first.stem}_posed{first.suffix}")
    into_folder = into_folder or os.path.isdir(out)
    if options.format is not None:
        if not into_folder:
            raise InputError(
                f"--format: expected a folder for --out, got the file {out}, whose ending "
                "says its format; leave --format out"
            )
        check_ending(f".{options.format}", "--format")
    if not into_folder:
        check_ending(out.suffix, f"--out {out}")
        yield PoseJob(first, first.name, out)
        return
    for mesh in options.meshes:
        is_folder = os.path.isdir(mesh)
        for name in list(list_folder(mesh).meshes) if is_folder else [mesh.name]:
            target = out / name
            if options.format is not None:
                target = target.with_suffix(f".{options.format}")
            yield PoseJob(mesh / name if is_folder else mesh, name, target)


def _refuse_overwriting(source: Path, target: Path, expected: str) -> None:
    """Raise InputError where a file would be written over itself."""
    if os.path.exists(target) and os.path.exists(source) and os.path.samefile(target, source):
        raise InputError(f"--out: expected {expected}, got {target}; take another")


MOST_BODIES: Final = 20_000


def scatter(options: Scatter) -> int:
    """Write a floor with meshes of a folder."""
    from dicedesign.batch.batch import list_folder
    from dicedesign.geometry.meshes.reading import without_solids
    from dicedesign.runtime.workers import progress_bar
    from dicedesign.scenes.room import room_glb, scatter_bodies

    check_whole("--count", options.count, most=MOST_BODIES)
    check_whole("--seed", options.seed, least=0, most=MOST_SEED)
    if options.out.suffix.lower() != ".glb":
        raise InputError(f"--out: expected a path that ends in .glb, got {options.out}; rename it")
    sides = None if options.floor is None else numbers("--floor", options.floor, "w,d")
    lengths = [("--floor", side) for side in sides or ()]
    if options.size is not None:
        lengths.append(("--size", options.size))
    for name, length in lengths:
        # Its square, and the inverse of that, are numbers.
        if not SMALLEST_EXTENT <= length <= 1.0 / SMALLEST_EXTENT:
            raise InputError(
                f"{name}: expected a length from {SMALLEST_EXTENT:g} to {1.0 / SMALLEST_EXTENT:g}, "
                f"got {length:g}; change it, or the unit"
            )
    files = list_folder(options.folder)
    with without_solids(), progress_bar("meshes", min(options.count, len(files.meshes))) as bar:

        def on_mesh(error: str) -> None:
            if error:
                bar.write(f"note: left out {printable(error)}", file=sys.stderr)
            else:
                bar.update(1)

        room = scatter_bodies(
            options.folder,
            list(files.meshes),
            options.count,
            options.seed,
            floor=None if sides is None else (sides[0], sides[1]),
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
        return 0
    rests = [
        [body.rest for body in room.bodies if body.model == number]
        for number in range(len(room.models))
    ]
    seen = [
        f"{len(set(own))} of {len(model.poses.probabilities)}"
        for own, model in zip(rests, room.models, strict=True)
    ]
    table = text_table(
        ("file", "", [printable(model.name) for model in room.models]),
        ("bodies", "d", map(len, rests)),
        ("poses seen", ">", seen),
        ("scale", ".4g", [model.scale for model in room.models]),
    )
    width, depth = room.floor
    print(
        f"{printable(options.out)}: {len(room.bodies)} bodies of {len(room.models)} meshes on a "
        f"floor of {width:g} by {depth:g}\n\n{table}"
    )
    return 0


def repair(options: Repair) -> int:
    """Write a mesh as the surface of one solid."""
    from dicedesign.fabricate.file_formats import format_of_ending, mesh_bytes
    from dicedesign.geometry.surfaces.repair import FINEST, input_surface
    from dicedesign.report.raster import upward_of
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
        print_note(printable(note))
    if made is not None:
        found = made.numbers
        handles = "not closed" if found.handles_before is None else found.handles_before
        rows: list[tuple[Any, ...]] = [
            ("points", len(made.points), len(surface.points)),
            ("triangles", len(made.triangles), len(surface.triangles)),
            ("pieces", found.pieces, 1),
            ("cavities", found.cavities, 0),
            ("handles", handles, found.handles),
        ]
        for name, *parts in (
            ("mean distance to the other", found.missed_mean, found.off_mean),
            ("largest distance", found.missed_largest, found.off_largest),
        ):
            rows.append((name, *(f"{100.0 * part:.2g} % of the diagonal" for part in parts)))
        names, *columns = zip(*rows, strict=True)
        before, after = ([str(value) for value in column] for column in columns)
        print(text_table(("", "", names), ("before", ">", before), ("after", ">", after)))
    print(f"files: {', '.join(map(printable, files))}")
    return 0


def balance(options: Balance) -> int:
    """Write a mesh with its center of mass where it serves a goal best."""
    from dicedesign.balance.balanced import balanced
    from dicedesign.balance.options import BalanceOptions
    from dicedesign.report.surface_figures import balance_figure

    goal = _goal(options)
    region, infill = options.region, options.infill
    given: dict[str, Any] = {
        "region": _numbers("--region", region) if region and "," in region else region,
        "by": options.by,
        "size_mm": options.size_mm,
        "wall_mm": options.wall_mm,
        "drain_mm": options.drain_mm,
        "infill": None if infill is None else _numbers("--infill", infill),
        "tolerance": options.tolerance,
    }
    wanted = BalanceOptions(**{name: value for name, value in given.items() if value is not None})
    file = options.out
    if file.suffix.lower() != ".stl":
        if file.suffix and not file.is_dir():
            raise InputError(
                f"--out: expected a folder or a file that ends in .stl, got {file}; rename it"
            )
        make_writable_folder(file)
        file /= "balanced.stl"
    _refuse_overwriting(options.mesh, file, "another file than the mesh")
    body = read_body(options.mesh)
    found = balanced(body, goal, wanted, on_way=lambda way: print_note(f"by {way} ..."))
    contents = {
        file.with_name(file.stem + end) if end else file: data
        for end, data in found.made.files.items()
    }
    contents[file.with_name(f"{file.stem}_balance.png")] = balance_figure(found).png()
    contents[file.with_name(f"{file.stem}_balance.json")] = json_text(found.data()).encode()
    for path, data in contents.items():
        atomic_write(path, data)
    for note in found.notes:
        print_note(printable(note))
    if options.json:
        print_json({**found.data(), "files": [str(path) for path in contents]})
    else:
        _print_balanced(options.mesh, found)
        print(f"files: {', '.join(map(printable, contents))}")
    return 0 if found.reached else 1


def _goal(options: Balance) -> Goal:
    from dicedesign.balance.goals import (
        EqualProbabilities,
        FewestRests,
        GivenProbabilities,
        Standing,
    )

    if options.poses is not None and options.target is None:
        raise InputError("--poses: expected --target p,q,... with it, got none; add it")
    if options.equal is not None:
        return EqualProbabilities(options.equal)
    if options.stand is not None:
        return Standing(pose=options.stand)
    if options.stand_down is not None:
        return Standing(down=vector("--stand-down", options.stand_down))
    if options.target is None:
        return FewestRests()
    poses = None
    if options.poses is not None:
        try:
            poses = tuple(int(part) for part in options.poses.split(","))
        except ValueError as error:
            raise InputError(
                f"--poses: expected numbers of poses such as 1,2, got {options.poses!r}; "
                "dicedesign rest lists them"
            ) from error
    return GivenProbabilities(_numbers("--target", options.target), poses)


def _numbers(option: str, text: str) -> tuple[float, ...]:
    """The numbers of a text, fractions or decimals."""
    try:
        return tuple(float(Fraction(part.strip())) for part in text.split(","))
    except (ValueError, ZeroDivisionError, OverflowError) as error:
        raise InputError(
            f"{option}: expected numbers such as 0.5,1/4, got {text!r}; separate them by commas"
        ) from error


def _print_balanced(mesh: Path, found: Balanced) -> None:
    """Print what was wanted, and what the files do."""
    print(
        f"{printable(mesh)}: {'reached' if found.reached else 'not reached'}, by {found.by}; "
        f"{found.rests_before} resting poses before, {found.rests} now"
    )
    for name, place in (
        ("before", found.center_before),
        ("wanted", found.center_wanted),
        ("now", found.center),
    ):
        print(f"center of mass {name:6}  {'  '.join(f'{x + 0.0:10.5f}' for x in place)} mm")
    if found.made.wall_mm is not None:
        print(f"walls of at least {found.made.wall_mm:.4g} mm")
    table = text_table(
        ("pose", ">", ["new" if number is None else str(number) for number in found.numbers]),
        ("facet normal (down)", "", map(direction, found.directions)),
        ("before", ">", percents(found.before, ".4f")),
        ("goal", ">", percents(found.wanted, ".4f")),
        ("now", ">", percents(found.probabilities, ".4f")),
    )
    print(f"\n{table}")


def draw_figure(options: Figure) -> int:
    """Draw a kind of figure."""
    from dicedesign.recipe.subjects import subject_of
    from dicedesign.report.figures import BODY_FIGURES
    from dicedesign.runtime.workers import progress_bar

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
    out = options.out or Path(f"{options.subject.resolve().stem}_{options.kind}.png")
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
