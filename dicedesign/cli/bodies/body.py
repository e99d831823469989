"""The body of a command: options that name it, and its rests."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from dicedesign.cli.options import vector

if TYPE_CHECKING:
    from dicedesign.batch.analyse import Center
    from dicedesign.geometry.meshes.body import Body
    from dicedesign.rest.poses import RestPoses
    from dicedesign.runtime.arrays import Floats

__all__ = ["add_body_options", "add_rest_options", "center_of_mass", "read_poses"]


def add_body_options(parser: argparse.ArgumentParser) -> None:
    """Add MESH and `add_rest_options`."""
    parser.add_argument("mesh", type=Path, metavar="MESH", help="STL, OBJ, PLY, OFF, GLB, XYZ, ...")
    add_rest_options(parser)


def add_rest_options(parser: argparse.ArgumentParser) -> None:
    """Add `--com` and `--coplanar-tolerance`."""
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


def center_of_mass(text: str | None) -> Center:
    """The center of mass that `--com` asks for."""
    if text is None:
        return None
    return "hull" if text == "hull" else vector("--com", text)


def read_poses(
    path: Path, center: Center | Floats = None, coplanar_tolerance: float | None = None
) -> tuple[Body, RestPoses]:
    """The body of a file and its rests; notes about them go to stderr.

    center, coplanar_tolerance: as in `rest_poses`.
    """
    # Imported here, as other commands do without.
    from dicedesign.geometry.meshes.formats import without_solids
    from dicedesign.geometry.meshes.reading import read_body
    from dicedesign.rest.poses import rest_poses

    with without_solids():
        body = read_body(path)
    poses = rest_poses(body, center, coplanar_tolerance=coplanar_tolerance)
    for note in poses.notes:
        print(f"note: {note}", file=sys.stderr)
    return body, poses
