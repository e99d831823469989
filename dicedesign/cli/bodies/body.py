"""The body of a command: options that name it, and its rests."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from dicedesign.cli.options import vector
from dicedesign.errors import InputError

if TYPE_CHECKING:
    from dicedesign.batch.analyse import Center
    from dicedesign.geometry.meshes.body import Body
    from dicedesign.rest.poses import RestPoses
    from dicedesign.runtime.arrays import Floats

__all__ = ["add_body_options", "add_rest_options", "center_of_mass", "read_poses"]


def add_body_options(parser: argparse.ArgumentParser) -> None:
    """Add MESH, `--part` and `add_rest_options`."""
    parser.add_argument(
        "mesh",
        type=Path,
        metavar="MESH",
        help="STL, OBJ, PLY, OFF, GLB, XYZ, ..., or densities of cells, NPY or NPZ",
    )
    parser.add_argument(
        "--part",
        action="append",
        default=[],
        metavar="FILE:DENSITY",
        help="a closed mesh in the same frame, of another density in units of MESH's own; it takes "
        "the place of what it overlaps, and 0 is a cavity; more than one may be given, the last "
        "one counts where they overlap",
    )
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
    path: Path,
    center: Center | Floats = None,
    coplanar_tolerance: float | None = None,
    parts: Sequence[str] = (),
) -> tuple[Body, RestPoses]:
    """The body of a file and its rests; notes about them go to stderr.

    center, coplanar_tolerance: as in `rest_poses`; parts: what `--part` gives.
    """
    # Imported here, as other commands do without.
    from dicedesign.geometry.meshes.formats import without_solids
    from dicedesign.geometry.meshes.reading import read_body
    from dicedesign.rest.poses import rest_poses

    with without_solids():
        body = read_body(path)
        others = [_part(text) for text in parts]
    if others:
        from dicedesign.geometry.meshes.weighted_body import weighted_body

        body = weighted_body([(body, 1.0), *others])
    poses = rest_poses(body, center, coplanar_tolerance=coplanar_tolerance)
    for note in poses.notes:
        print(f"note: {note}", file=sys.stderr)
    return body, poses


def _part(text: str) -> tuple[Body, float]:
    """The body and the density that a `--part` gives."""
    from dicedesign.geometry.meshes.reading import read_body

    path, _, density = text.rpartition(":")
    try:
        number = float(density)
    except ValueError:
        number = math.nan
    if not path or not 0.0 <= number < math.inf:
        raise InputError(
            f"--part: expected FILE:DENSITY with a density from 0 on, got {text!r}; write it such "
            "as ball.stl:7.8"
        )
    return read_body(Path(path)), number
