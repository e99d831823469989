"""`dicedesign rest`: all rests of a mesh with their probabilities."""

from __future__ import annotations

import argparse
import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dicedesign.cli.options import vector
from dicedesign.cli.rest_folder import add_folder_options, refuse_folder_options, rest_folder

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from dicedesign.batch.analyse import Center
    from dicedesign.geometry.meshes.body import Body
    from dicedesign.rest.poses import RestPoses

    Floats = NDArray[np.float64]

__all__ = ["add_body_options", "add_parser", "center_of_mass", "poses_of", "rest_summary"]


def add_parser(commands: Any) -> None:
    """Add the subcommand to argparse's `commands`."""
    parser = commands.add_parser(
        "rest",
        help="list the resting poses of a mesh with their probabilities",
        description="List the resting poses of a mesh or point cloud with their probabilities. A "
        "folder in place of MESH stands for all meshes in it; their rests go to the table --out, "
        "and the same command goes on where an earlier one ended.",
    )
    add_body_options(parser)
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument(
        "--table",
        metavar="NAME|FILE.json",
        help="of a mesh: also the odds when it is thrown onto a table, by the momentum model: "
        "board-game, or a file made by `dicedesign table learn`",
    )
    parser.add_argument(
        "--figure", type=Path, metavar="FILE.png", help="draw the Morse-Smale complex"
    )
    add_folder_options(parser)
    parser.set_defaults(command=_rest)


def add_body_options(parser: argparse.ArgumentParser) -> None:
    """Options that say which body is meant."""
    parser.add_argument("mesh", type=Path, metavar="MESH", help="STL, OBJ, PLY, OFF, GLB, XYZ, ...")
    parser.add_argument(
        "--com",
        metavar="x,y,z|hull",
        help="center of mass in the mesh's unit, or that of the uniform solid hull (default: of "
        "the uniform solid; of its hull for point clouds and open meshes)",
    )
    parser.add_argument(
        "--coplanar-tolerance",
        type=float,
        metavar="T",
        help="merge hull triangles within this distance of one plane, relative to the body's half "
        "extent (default: 1e-11, for rounded coordinates such as STL 2e-6)",
    )


def poses_of(options: argparse.Namespace) -> RestPoses:
    """The rests of the body that the options name; notes go to stderr."""
    return _body_and_poses(options)[1]


def _body_and_poses(options: argparse.Namespace) -> tuple[Body, RestPoses]:
    # Imported here, as a folder is for workers and other commands do without.
    from dicedesign.geometry.meshes.formats import without_solids
    from dicedesign.geometry.meshes.reading import read_body
    from dicedesign.rest.poses import rest_poses

    center = center_of_mass(options.com)
    with without_solids():
        body = read_body(options.mesh)
    poses = rest_poses(body, center, coplanar_tolerance=options.coplanar_tolerance)
    for note in poses.notes:
        print(f"note: {note}", file=sys.stderr)
    return body, poses


def center_of_mass(text: str | None) -> Center:
    """The center of mass that `--com` asks for."""
    if text is None or text == "hull":
        return None if text is None else "hull"
    return vector("--com", text)


def rest_summary(poses: RestPoses, thrown: Floats | None = None) -> dict[str, Any]:
    """The answer as plain data. thrown: (k,) odds of a thrown body, where they were asked for."""
    return {
        "center_of_mass": poses.center_of_mass.tolist(),
        "center_of_mass_source": poses.center_of_mass_source,
        "hull": {"vertices": len(poses.hull.vertices), "facets": len(poses.hull.normals)},
        "rests": [
            {
                "normal": poses.normals[i].tolist(),
                "probability": float(poses.probabilities[i]),
                **({} if thrown is None else {"thrown": float(thrown[i])}),
                "transform": poses.transforms[i].tolist(),
                "area": float(poses.areas[i]),
                "margin_deg": math.degrees(poses.margins[i]),
            }
            for i in range(len(poses.probabilities))
        ],
        "seconds": poses.seconds,
    }


def _rest(options: argparse.Namespace) -> int:
    if options.mesh.is_dir():
        return rest_folder(options, center_of_mass(options.com))
    refuse_folder_options(options)
    body, poses = _body_and_poses(options)
    thrown = None
    if options.table is not None:
        from dicedesign.throws.momentum.momentum_odds import thrown_odds

        thrown = thrown_odds(body, poses, options.table)
    if options.figure is not None:
        _draw(poses, options.figure)
    if options.json:
        print(json.dumps(rest_summary(poses, thrown), indent=1, allow_nan=False))
    else:
        print(_table(options, poses, thrown))
    return 0


def _draw(poses: RestPoses, path: Path) -> None:
    from dicedesign.report.figures.gauss_map import gauss_map_figure
    from dicedesign.runtime.files import atomic_write

    atomic_write(path, gauss_map_figure(poses).png())


def _table(options: argparse.Namespace, poses: RestPoses, thrown: Floats | None) -> str:
    center = ", ".join(f"{x:.6g}" for x in poses.center_of_mass)
    milliseconds = 1e3 * sum(poses.seconds.values())
    lines = [
        f"{options.mesh}: {len(poses.probabilities)} resting poses, hull of "
        f"{len(poses.hull.vertices)} vertices and {len(poses.hull.normals)} facets, "
        f"{milliseconds:.1f} ms",
        f"center of mass ({center}), {poses.center_of_mass_source}",
        "",
        "rest  probability   "
        + ("" if thrown is None else "thrown        ")
        + "facet normal (down)            area       margin",
    ]
    for i, (p, n) in enumerate(zip(poses.probabilities, poses.normals, strict=True)):
        normal = "  ".join(f"{x + 0.0:8.5f}" for x in n)
        lines.append(
            f"{i + 1:4d}  {100 * p:9.5f} %   {_percent(thrown, i)}{normal}   "
            f"{poses.areas[i]:9.4g}  {math.degrees(poses.margins[i]):7.2f} deg"
        )
    return "\n".join(lines)


def _percent(thrown: Floats | None, rest: int) -> str:
    return "" if thrown is None else f"{100 * thrown[rest]:9.5f} %   "
