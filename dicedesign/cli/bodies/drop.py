"""`dicedesign drop`: one body rolling from one orientation to rest."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dicedesign.cli.bodies.body import add_body_options, center_of_mass, read_poses
from dicedesign.cli.options import direction, print_json, vector
from dicedesign.errors import InputError
from dicedesign.runtime.files import atomic_write
from dicedesign.runtime.text import text_table

if TYPE_CHECKING:
    from dicedesign.rest.roll import RollStep
    from dicedesign.runtime.arrays import Integers

__all__ = ["add_parser"]


def add_parser(commands: Any) -> None:
    """Add the subcommand to argparse's `commands`."""
    parser = commands.add_parser(
        "drop",
        help="follow a body from one orientation to rest",
        description="Follow a body that is let go at one orientation until it rests.",
    )
    add_body_options(parser)
    parser.add_argument(
        "--down",
        required=True,
        metavar="x,y,z",
        help="direction in the body's frame that points down at first",
    )
    parser.add_argument(
        "--max-angle-deg", type=float, metavar="A", help="split rotations larger than this"
    )
    parser.add_argument(
        "--figure",
        type=Path,
        metavar="FILE.png",
        help="draw the moments in which the contact changes, and the path over the Gauss map",
    )
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.set_defaults(command=_drop)


def _drop(options: argparse.Namespace) -> int:
    # Imported here, as other commands do without.
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
    center = center_of_mass(options.com)
    body, poses = read_poses(options.mesh, center, options.coplanar_tolerance, options.part)
    equilibria = poses.morse.equilibria
    steps = roll_steps(equilibria, down, largest)
    if options.figure is not None:
        from dicedesign.report.body_figures.body_figure import drawn_surface
        from dicedesign.report.body_figures.drop import drop_figure

        surface = drawn_surface(body.points, body.triangles, poses.hull)
        changes = steps if largest is None else roll_steps(equilibria, down)
        atomic_write(options.figure, drop_figure(surface, poses, changes).png())
    if options.json:
        source = equilibria.hull.source
        print_json({"steps": [_plain(step, source) for step in steps]})
    else:
        columns = [("step", "d"), ("contact", ""), ("height of center", ".8g")]
        rows = [
            [i, step.contact, step.height, direction(step.down)] for i, step in enumerate(steps)
        ]
        print("\n".join(text_table([*columns, ("direction down", "")], rows)))
    return 0


def _plain(step: RollStep, source: Integers) -> dict[str, Any]:
    return {
        "down": step.down.tolist(),
        "contact": step.contact,
        "points": [int(source[v]) for v in step.vertices],
        "height": step.height,
        "transform": step.transform.tolist(),
    }
