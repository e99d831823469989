"""`dicedesign repair`: a mesh of any kind as the closed surface of one solid."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dicedesign.runtime.files import atomic_write
from dicedesign.runtime.text import printable, text_table

if TYPE_CHECKING:
    from dicedesign.geometry.repair.repair import RepairedMesh
    from dicedesign.geometry.surfaces.surface import Surface

__all__ = ["add_parser"]


def add_parser(commands: Any) -> None:
    """Add the subcommand to argparse's `commands`."""
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
    parser.set_defaults(command=_repair)


def _repair(options: argparse.Namespace) -> int:
    # Imported here, as other commands do without.
    from dicedesign.fabricate.file_formats import format_of_ending, mesh_bytes
    from dicedesign.geometry.meshes.reading import read_body
    from dicedesign.geometry.repair.repair import FINEST, input_surface
    from dicedesign.report.figures.repair import repair_figure
    from dicedesign.report.render.cameras import upward_of

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
        print("\n".join(_table(made, surface)))
    print(f"files: {', '.join(printable(str(path)) for path in files)}")
    return 0


def _table(made: RepairedMesh, surface: Surface) -> list[str]:
    numbers = made.numbers
    closed = numbers.handles_before is not None
    rows = [
        ("points", len(made.points), len(surface.points)),
        ("triangles", len(made.triangles), len(surface.triangles)),
        ("pieces", numbers.pieces, 1),
        ("cavities", numbers.cavities, 0),
        ("handles", numbers.handles_before if closed else "not closed", numbers.handles),
        ("mean distance to the other", *map(_percent, (numbers.missed_mean, numbers.off_mean))),
        ("largest distance", *map(_percent, (numbers.missed_largest, numbers.off_largest))),
    ]
    texts = [(name, str(before), str(after)) for name, before, after in rows]
    return text_table([("", ""), ("before", ">"), ("after", ">")], texts)


def _percent(part: float) -> str:
    return f"{100.0 * part:.2g} % of the diagonal"
