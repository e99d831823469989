"""`dicedesign rest`: all rests of a mesh with their probabilities."""

from __future__ import annotations

import argparse
import math
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dicedesign.cli.bodies.body import add_body_options, center_of_mass, read_poses
from dicedesign.cli.bodies.rest_folder import add_folder_options, refuse_folder_options, rest_folder
from dicedesign.cli.options import direction, print_json
from dicedesign.errors import InputError, named
from dicedesign.runtime.files import atomic_write
from dicedesign.runtime.text import printable, text_table

if TYPE_CHECKING:
    from dicedesign.rest.poses import RestPoses
    from dicedesign.runtime.arrays import Floats

__all__ = ["add_parser", "rest_summary"]


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
        "board-game, hard-wood, paper, carpet, or the file of a table; with "
        "another way to throw after a colon, as in board-game:cup",
    )
    parser.add_argument(
        "--prior",
        metavar="PRIOR",
        help="of a mesh: its odds where not all sides are equally likely to be down at first: "
        "vmf:x,y,z:CONCENTRATION, half:x,y,z, cap:x,y,z:ANGLE in degrees, or samples:FILE.csv; "
        "x,y,z point down, in the mesh's frame",
    )
    parser.add_argument(
        "--figure", type=Path, metavar="FILE.png", help="draw the Morse-Smale complex"
    )
    parser.add_argument(
        "--heights",
        type=Path,
        metavar="FILE.png",
        help="draw how high the center of mass is over the directions that may point down",
    )
    add_folder_options(parser)
    parser.set_defaults(command=_rest)


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
                **({} if poses.errors is None else {"error": float(poses.errors[i])}),
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
    if os.path.isdir(options.mesh):
        return rest_folder(options, center_of_mass(options.com))
    refuse_folder_options(options)
    center = center_of_mass(options.com)
    body, poses = read_poses(options.mesh, center, options.coplanar_tolerance, options.part)
    if options.prior is not None:
        poses = _under_prior(options, poses)
    thrown = None
    if options.table is not None:
        from dicedesign.throws.momentum.momentum_model import momentum_model
        from dicedesign.throws.momentum.momentum_odds import momentum_odds
        from dicedesign.throws.rigid_body import rigid_body

        with named("--table"):
            model = momentum_model(options.table)
        thrown = momentum_odds(poses, rigid_body(body, poses), model)
    for path, draw in ((options.figure, _complex), (options.heights, _heights)):
        if path is not None:
            atomic_write(path, draw(poses))
    if options.json:
        print_json(rest_summary(poses, thrown))
    else:
        print(_table(options, poses, thrown))
    return 0


def _under_prior(options: argparse.Namespace, poses: RestPoses) -> RestPoses:
    """The rests with the odds that `--prior` asks for."""
    from dicedesign.rest.axial_priors import VonMisesFisher
    from dicedesign.rest.prior import read_prior
    from dicedesign.rest.sampled_directions import SampledDirections

    if options.table is not None:
        raise InputError(
            "--prior: expected none with --table, onto which bodies are thrown with any side down "
            "alike, got both; leave one of them out"
        )
    prior = read_prior(options.prior)
    if isinstance(prior, SampledDirections):
        near = VonMisesFisher.fitted(prior.directions)
        axis = ",".join(f"{x:.6g}" for x in near.axis)
        print(
            f"note: the density of one axis nearest to the samples is vmf:{axis}:"
            f"{near.concentration:.6g}",
            file=sys.stderr,
        )
    return poses.under(prior)


def _complex(poses: RestPoses) -> bytes:
    from dicedesign.report.figures.gauss_map import gauss_map_figure

    return gauss_map_figure(poses).png()


def _heights(poses: RestPoses) -> bytes:
    from dicedesign.report.body_figures.heights import heights_figure

    return heights_figure(poses).png()


def _table(options: argparse.Namespace, poses: RestPoses, thrown: Floats | None) -> str:
    center = ", ".join(f"{x:.6g}" for x in poses.center_of_mass)
    milliseconds = 1e3 * sum(poses.seconds.values())
    columns = [("rest", "d"), ("probability", ">"), ("facet normal (down)", "")]
    columns += [("area", ".4g"), ("margin", ">")]
    rows = [
        [i + 1, f"{100 * p:.5f} %", direction(normal), area, f"{math.degrees(margin):.2f} deg"]
        for i, (p, normal, area, margin) in enumerate(
            zip(poses.probabilities, poses.normals, poses.areas, poses.margins, strict=True)
        )
    ]
    if poses.errors is not None:
        columns.insert(2, ("error", ">"))
        for row, error in zip(rows, poses.errors, strict=True):
            row.insert(2, f"{100 * error:.1e} %")
    if thrown is not None:
        columns.insert(2, ("thrown", ">"))
        for row, odds in zip(rows, thrown, strict=True):
            row.insert(2, f"{100 * odds:.5f} %")
    return "\n".join(
        [
            f"{printable(options.mesh)}: {len(poses.probabilities)} resting poses, hull of "
            f"{len(poses.hull.vertices)} vertices and {len(poses.hull.normals)} facets, "
            f"{milliseconds:.1f} ms",
            f"center of mass ({center}), {poses.center_of_mass_source}",
            *([] if options.prior is None else [f"under the prior {printable(options.prior)}"]),
            "",
            *text_table(columns, rows),
        ]
    )
