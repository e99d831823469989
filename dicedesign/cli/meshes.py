"""`dicedesign pose`, `scatter`, `repair`, `balance` and `figure`."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dicedesign.cli.commands import (
    BalanceArguments,
    FigureArguments,
    PoseArguments,
    RepairArguments,
    ScatterArguments,
)
from dicedesign.cli.options import (
    FIGURE_ENDINGS,
    center_of_mass,
    check_outputs,
    direction,
    numbers,
    percents,
    print_files,
    print_json,
    print_notes,
    require_ending,
    require_figure,
    text_table,
    workers_of,
)
from dicedesign.errors import MOST_SEED, InputError, check_whole, printable
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.geometry.sphere import angle_between
from dicedesign.runtime.files import (
    atomic_write,
    json_text,
    make_writable_folder,
    open_output_folder,
    write_files,
)
from dicedesign.runtime.workers import progress_bar, show_part
from dicedesign.tolerances import SAME_REST_ANGLE, SMALLEST_EXTENT

if TYPE_CHECKING:
    from dicedesign.balance.balanced import Balanced
    from dicedesign.balance.goals import Goal
    from dicedesign.scenes.posing import PoseJob, PoseResult


def pose_meshes(options: PoseArguments) -> int:
    """Write meshes in resting poses."""
    from dicedesign.scenes.posing import PoseChoice, write_pose, write_poses

    check_whole("--pose", options.pose)
    check_whole("--seed", options.seed, least=0, most=MOST_SEED)
    choice = PoseChoice(
        number=options.pose,
        facet=options.facet,
        seed=options.seed if options.random else None,
        center_of_mass=center_of_mass(options.com),
        coplanar_tolerance=options.coplanar_tolerance,
        item=options.item,
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
    check_outputs(options, *sources)
    if len(jobs) > 1 or jobs[0].target != options.out:
        for folder in sorted({job.target.parent for job in jobs}):
            make_writable_folder(folder)
    if len(jobs) == 1:
        poses = [write_pose(jobs[0], choice)]
    else:
        with workers_of(options, "files", len(jobs)) as workers:
            poses = write_poses(
                jobs,
                choice,
                workers.executor,
                workers.jobs,
                on_done=workers.bar.update,
            )
    posed = [pose for pose in poses if not pose.error]
    print_notes(*(pose.error for pose in poses if pose.error))
    if len(poses) == 1:
        print_notes(*poses[0].notes)
    if options.json:
        files = [
            {"file": str(pose.job.source), "error": pose.error}
            if pose.error
            else {
                "file": str(pose.job.source),
                "out": str(pose.job.target),
                "pose": None if pose.rest is None else pose.rest + 1,
                "facet": pose.facet,
                "poses": pose.rests,
                "probability": pose.probability,
                "transform": pose.transform,
            }
            for pose in poses
        ]
        print_json({"files": files})
    else:
        table = text_table(
            ("file", "", [printable(pose.job.name) for pose in posed]),
            ("pose", ">", [_pose_text(pose) for pose in posed]),
            ("probability", ">", percents([pose.probability for pose in posed], ".5f")),
            ("written to", "", [printable(pose.job.target) for pose in posed]),
        )
        print(table)
    if len(posed) < len(poses):
        print_notes(f"{len(poses) - len(posed)} files could not be posed")
    return 0 if posed else 1


def _pose_text(pose: PoseResult) -> str:
    if pose.rest is None:
        return f"facet {pose.facet}, unstable"
    return f"{pose.rest + 1} of {pose.rests}"


def _list_jobs(options: PoseArguments) -> Iterator[PoseJob]:
    """Source and target of each mesh."""
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


MAX_BODIES = 20_000
"""Limit of `--count`."""


def scatter(options: ScatterArguments) -> int:
    """Write a scene of meshes on a floor."""
    from dicedesign.batch.batch import list_folder
    from dicedesign.scenes.room import room_glb, scatter_bodies

    check_whole("--count", options.count, most=MAX_BODIES)
    check_whole("--seed", options.seed, least=0, most=MOST_SEED)
    require_ending("--out", options.out, ".glb")
    check_outputs(options, options.out)
    require_figure(options, options.figure)
    sides = None if options.floor is None else numbers("--floor", options.floor, "w,d")
    lengths = [("--floor", side) for side in sides or ()]
    if options.size is not None:
        lengths.append(("--size", options.size))
    for name, length in lengths:
        # Its square and the inverse of that must not overflow.
        if not SMALLEST_EXTENT <= length <= 1.0 / SMALLEST_EXTENT:
            raise InputError(
                f"{name}: expected a length from {SMALLEST_EXTENT:g} to {1.0 / SMALLEST_EXTENT:g}, "
                f"got {length:g}; change it, or the unit"
            )
    files = list_folder(options.folder)
    with progress_bar("meshes", min(options.count, len(files.meshes))) as bar:

        def on_mesh(error: str) -> None:
            if error:
                bar.write(f"note: skipped {printable(error)}", file=sys.stderr)
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
        show_part(bar, 0, None, "scene")
        contents = {options.out: room_glb(room)}
        if options.figure is not None:
            from dicedesign.report.raster import decode_png
            from dicedesign.report.sheet import figure_bytes, picture_sheet
            from dicedesign.scenes.picture import room_picture

            figure = picture_sheet(decode_png(room_picture(room)))
            contents[options.figure] = figure_bytes(figure, options.figure.suffix)
    write_files(contents)
    if options.json:
        print_json(room.plain())
        return 0
    rests = [
        [body.rest for body in room.bodies if body.model == number]
        for number in range(len(room.models))
    ]
    pose_counts = [
        f"{len(set(model_rests))} of {len(model.poses.probabilities)}"
        for model_rests, model in zip(rests, room.models, strict=True)
    ]
    table = text_table(
        ("file", "", [printable(model.name) for model in room.models]),
        ("bodies", "d", map(len, rests)),
        ("poses", ">", pose_counts),
        ("scale", ".4g", [model.scale for model in room.models]),
    )
    width, depth = room.floor
    print(
        f"{printable(options.out)}: {len(room.bodies)} bodies of {len(room.models)} meshes on a "
        f"floor of {width:g} by {depth:g}\n\n{table}"
    )
    return 0


def repair(options: RepairArguments) -> int:
    """Write the repaired surface of a mesh."""
    from dicedesign.fabricate.file_formats import format_of_ending, mesh_bytes
    from dicedesign.geometry.surfaces.repair import FINEST, input_surface
    from dicedesign.report.paper import PAGE_WIDTH
    from dicedesign.report.raster import upward_of
    from dicedesign.report.sheet import figure_bytes
    from dicedesign.report.surface_figures import repair as draw_repair

    mesh, out = options.mesh, _repaired_path(options)
    kind = format_of_ending(out.suffix, str(out))
    picture = out.with_name(f"{out.stem}_repair.png")
    check_outputs(options, out, picture)
    with open_output_folder(out.parent), progress_bar("repair"):
        surface, notes, repaired = input_surface(read_body(mesh, options.item), FINEST, repair=True)
        points = np.asarray(np.linalg.solve(kind.frame, surface.points.T).T, np.float64)
        contents = {out: mesh_bytes(points, surface.triangles, out.suffix, str(out))}
        if repaired is not None:
            figure = draw_repair(repaired, upward_of(mesh), width=PAGE_WIDTH)
            contents[picture] = figure_bytes(figure, ".png")
        write_files(contents)
    print_notes(*notes)
    if repaired is not None:
        numbers = repaired.numbers
        handles = "not closed" if numbers.handles_before is None else numbers.handles_before
        rows: list[tuple[Any, ...]] = [
            ("points", len(repaired.points), len(surface.points)),
            ("triangles", len(repaired.triangles), len(surface.triangles)),
            ("pieces", numbers.pieces, 1),
            ("cavities", numbers.cavities, 0),
            ("handles", handles, numbers.handles),
        ]
        for name, *parts in (
            ("mean distance to the other", numbers.missed_mean, numbers.off_mean),
            ("largest distance", numbers.missed_largest, numbers.off_largest),
        ):
            rows.append((name, *(f"{100.0 * part:.2g} % of the diagonal" for part in parts)))
        names, *columns = zip(*rows, strict=True)
        before, after = ([str(value) for value in column] for column in columns)
        print(text_table(("", "", names), ("before", ">", before), ("after", ">", after)))
    print_files(contents)
    return 0


def _repaired_path(options: RepairArguments) -> Path:
    """File of a repaired mesh."""
    if options.file is not None and options.out is not None:
        raise InputError(
            f"--out: expected one file to write, got {options.out} and {options.file}; leave one "
            "of them out"
        )
    from dicedesign.fabricate.file_formats import FILE_FORMATS

    mesh, out = options.mesh, options.file or options.out
    ending = mesh.suffix if mesh.suffix[1:].lower() in FILE_FORMATS else ".stl"
    name = f"{mesh.stem}_repaired{ending}"
    return Path(name) if out is None else out / name if os.path.isdir(out) else out


def balance(options: BalanceArguments) -> int:
    """Write a mesh with its center of mass moved toward a goal."""
    from dicedesign.balance.balanced import balance_body
    from dicedesign.balance.options import BalanceOptions
    from dicedesign.balance.ways import MODIFIER
    from dicedesign.report.paper import PAGE_WIDTH
    from dicedesign.report.sheet import figure_bytes
    from dicedesign.report.surface_figures import balance as draw_balance

    goal = _make_goal(options)
    infill = options.infill
    given: dict[str, Any] = {
        "infill": None if infill is None else _parse_numbers("--infill", infill),
    }
    for name in ("by", "size_mm", "wall_mm", "drain_mm", "tolerance"):
        given[name] = getattr(options, name)
    settings = BalanceOptions(**{name: value for name, value in given.items() if value is not None})
    file = options.out
    if file.suffix.lower() != ".stl":
        if file.suffix and not file.is_dir():
            raise InputError(
                f"--out: expected a folder or a file that ends in .stl, got {file}; rename it"
            )
        file /= "balanced.stl"
    ends = (MODIFIER, "_balance.png", "_balance.json")
    check_outputs(options, file, *(file.with_name(file.stem + end) for end in ends))
    with open_output_folder(file.parent), progress_bar("balance") as bar:
        body = read_body(options.mesh, options.item)
        result = balance_body(body, goal, settings, on_way=bar.set_description_str)
        contents = {
            file.with_name(file.stem + end) if end else file: data
            for end, data in result.made.files.items()
        }
        figure = draw_balance(result, width=PAGE_WIDTH)
        contents[file.with_name(f"{file.stem}_balance.png")] = figure_bytes(figure, ".png")
        contents[file.with_name(f"{file.stem}_balance.json")] = json_text(result.data()).encode()
        write_files(contents)
    print_notes(*result.notes)
    if options.json:
        print_json({**result.data(), "files": [str(path) for path in contents]})
    else:
        _print_balance(options.mesh, result)
        print_files(contents)
    return 0 if result.reached else 1


def _make_goal(options: BalanceArguments) -> Goal:
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
        return Standing(down=numbers("--stand-down", options.stand_down))
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
    return GivenProbabilities(_parse_numbers("--target", options.target), poses)


def _parse_numbers(option: str, text: str) -> tuple[float, ...]:
    """Parse fractions or decimals separated by commas."""
    try:
        return tuple(float(Fraction(part.strip())) for part in text.split(","))
    except (ValueError, ZeroDivisionError, OverflowError) as error:
        raise InputError(
            f"{option}: expected numbers such as 0.5,1/4, got {text!r}; separate them by commas"
        ) from error


def _print_balance(mesh: Path, result: Balanced) -> None:
    """Print the outcome, the centers of mass, and the probabilities of the files beside the
    goal."""
    goal = "goal reached" if result.reached else "goal not reached"
    is_least = result.rests == result.rests_at_least
    least = ", the fewest possible within reach" if is_least else ""
    print(
        f"{printable(mesh)}: {goal} by {result.by}; {result.rests_before} resting poses before, "
        f"{result.rests} now{least}"
    )
    if result.wanted is None and len(result.directions) == 1:
        others = angle_between(result.poses.normals, result.directions[0]) > SAME_REST_ANGLE
        ((now, before),) = zip(result.probabilities, result.before, strict=True)
        following = result.poses.probabilities[others].max(initial=0.0)
        pose = result.numbers[0]
        print(
            f"{'the pose' if pose is None else f'pose {pose}'} now comes up {100.0 * now:.1f} % of "
            f"the time (before: {100.0 * before:.1f} %), the next pose {100.0 * following:.1f} %"
        )
    for name, place in (
        ("before", result.center_before),
        ("wanted", result.center_wanted),
        ("now", result.center),
    ):
        print(f"center of mass {name:6}  {'  '.join(f'{x + 0.0:10.5f}' for x in place)} mm")
    if result.made.wall_mm is not None:
        print(f"walls of at least {result.made.wall_mm:.4g} mm")
    table = text_table(
        ("pose", ">", ["new" if number is None else str(number) for number in result.numbers]),
        ("facet normal (down)", "", map(direction, result.directions)),
        ("before", ">", percents(result.before, ".4f")),
        ("goal", ">", percents(result.wanted, ".4f")),
        ("now", ">", percents(result.probabilities, ".4f")),
    )
    print(f"\n{table}")


MIN_WIDTH, MAX_WIDTH = 2.5, 20.0
"""Limits of `--width`, in inches."""


def draw_figure(options: FigureArguments) -> int:
    """Draw a figure of a body."""
    from dicedesign.recipe.subjects import subject_of
    from dicedesign.report.body_figures import BODY_FIGURES
    from dicedesign.report.paper import COLUMN_WIDTH
    from dicedesign.report.sheet import figure_bytes

    kind = BODY_FIGURES[options.kind]
    for name, kinds in (
        ("down", ("paths", "drop")),
        ("before", ("before_after",)),
    ):
        if getattr(options, name) is not None and options.kind not in kinds:
            raise InputError(
                f"--{name}: expected with {' or '.join(kinds)}, got {options.kind}; leave it out"
            )
    out = options.out or Path(f"{options.subject.resolve().stem}_{options.kind}.png")
    require_ending("--out", out, *FIGURE_ENDINGS, *([] if kind.table is None else [".csv"]))
    check_outputs(options, out)
    width = COLUMN_WIDTH if options.width is None else options.width
    if not MIN_WIDTH <= width <= MAX_WIDTH:
        raise InputError(
            f"--width: expected {MIN_WIDTH:g} to {MAX_WIDTH:g} inches, got {width:g}; one "
            f"column of a paper is {COLUMN_WIDTH:g} wide"
        )
    down = None if options.down is None else numbers("--down", options.down)
    with progress_bar("figure"):
        subject = subject_of(
            options.subject,
            center_of_mass=center_of_mass(options.com),
            coplanar_tolerance=options.coplanar_tolerance,
            item=options.item,
            down=down,
            before=options.before,
            width=width,
        )
        if kind.table is not None and out.suffix.lower() == ".csv":
            data = kind.table(subject).encode()
        else:
            data = figure_bytes(kind.draw(subject), out.suffix)
    if subject.result is not None:
        print_notes(*subject.result.changes())
    atomic_write(out, data)
    print_files([out])
    return 0
