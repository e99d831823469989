"""`dicedesign scatter`: a floor with bodies that lie about in poses drawn by their odds."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from dicedesign.cli.options import numbers, print_json
from dicedesign.errors import InputError
from dicedesign.runtime.checks import MOST_SEED, check_whole
from dicedesign.runtime.files import atomic_write
from dicedesign.runtime.text import printable, text_table
from dicedesign.runtime.workers import progress_bar
from dicedesign.tolerances import SMALLEST_EXTENT

if TYPE_CHECKING:
    from dicedesign.scenes.room import Room

__all__ = ["add_parser"]

MOST_BODIES: Final = 20_000

ENDINGS: Final = (".glb", ".usda")


def add_parser(commands: Any) -> None:
    """Add the subcommand to argparse's `commands`."""
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
        help="the scene: .glb, with the meshes' materials and y upward as the format wants, or "
        ".usda, the text form of USD, with a colour for each mesh and z upward",
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
    parser.set_defaults(command=_scatter)


def _scatter(options: argparse.Namespace) -> int:
    # Imported here, as other commands do without.
    from dicedesign.batch.folder import list_folder
    from dicedesign.geometry.meshes.formats import without_solids
    from dicedesign.scenes.room import scattered

    floor = _check(options)
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
        data = _scene(room, options.out)
    if options.figure is not None:
        from dicedesign.scenes.picture import room_picture

        atomic_write(options.figure, room_picture(room).png())
    atomic_write(options.out, data)
    if options.json:
        print_json(room.plain())
    else:
        print("\n".join(_table(options, room)))
    return 0


def _check(options: argparse.Namespace) -> tuple[float, float] | None:
    """The floor that is asked for. Raises InputError for options that cannot be meant."""
    check_whole("--count", options.count, most=MOST_BODIES)
    check_whole("--seed", options.seed, least=0, most=MOST_SEED)
    if options.out.suffix.lower() not in ENDINGS:
        raise InputError(
            f"--out: expected a path that ends in {' or '.join(ENDINGS)}, got {options.out}; "
            "rename it"
        )
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


def _scene(room: Room, path: Path) -> bytes:
    if path.suffix.lower() == ".glb":
        from dicedesign.scenes.glb import room_glb

        return room_glb(room)
    from dicedesign.scenes.usd import room_usda

    return room_usda(room)


def _table(options: argparse.Namespace, room: Room) -> list[str]:
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
