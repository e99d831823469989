"""What a page needs to show a die that turns, linked with its facets and its Gauss map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import Final

import numpy as np

from dicedesign.fabricate.die import FinishedDie
from dicedesign.fabricate.file_formats import Contents, Part
from dicedesign.fabricate.mesh_writers import glb
from dicedesign.report.live.basin_outlines import basin_outlines
from dicedesign.report.live.facet_parts import facet_parts, rest_colors
from dicedesign.report.live.three import three_script
from dicedesign.runtime.arrays import Floats

__all__ = ["LiveDie", "live_die", "viewer_file"]

_MOST_TRIANGLES: Final = 60_000
"""A page of more would weigh megabytes more."""

_ALONG: Final = 0.999
"""Cosine of the angle to a facet's normal up to which a label lies on the facet."""


@dataclass(frozen=True, eq=False)
class LiveDie:
    """A die for a page.

    Attributes
    ----------
    solid: GLB of the printed die, a node "facet-0" and so on for each rest, in the order of
        `Result.facets`; None where the page has no 3D view.
    left_out: why it has none, in a sentence; else empty.
    colors: "#rrggbb" of each rest.
    heights: (k,) of the center of mass over each rest, in mm.
    upward: for each rest the direction (3,) that is upward on its label, or None.
    center: (3,) center of mass, in mm.
    stands: whether a rest is shown by the die standing on it, as one is that keeps the shape of a
        surface; else its facet is turned to the viewer.
    outlines: of the basins on the Gauss map, as paths of SVG; none for a die that has no such map.
    """

    solid: bytes | None
    left_out: str
    colors: tuple[str, ...]
    heights: tuple[float, ...]
    upward: tuple[Floats | None, ...]
    center: Floats
    stands: bool
    outlines: tuple[str, ...]


def live_die(die: FinishedDie, parts: Sequence[Part]) -> LiveDie:
    """A finished die for its page.

    parts: bodies of the printed die, the first being that of its STL.
    """
    solid, left_out = None, ""
    triangles = sum(len(part.triangles) for part in parts)
    if three_script() is None:
        left_out = "The die cannot be turned here: trimesh is installed without its viewer."
    elif triangles > _MOST_TRIANGLES:
        left_out = f"The die cannot be turned here: it has {triangles:,} triangles."
    else:
        solid = glb(Contents(die.result.name, facet_parts(parts, die)))
    poses = die.plain.poses
    heights = poses.hull.heights(poses.center_of_mass)[poses.facets]
    return LiveDie(
        solid=solid,
        left_out=left_out,
        colors=tuple(rest_colors(die)),
        heights=tuple(heights.tolist()),
        upward=tuple(_upward(die, normal) for normal in poses.normals),
        center=poses.center_of_mass,
        stands=die.reshaped is not None,
        outlines=() if die.reshaped is not None else tuple(_paths(die)),
    )


def viewer_file(name: str) -> str:
    """What links view, table and map on a page, viewer.js, or how they look, viewer.css."""
    return files("dicedesign.report.live").joinpath(name).read_text("utf-8")


def _upward(die: FinishedDie, normal: Floats) -> Floats | None:
    """What is upward on the first label of a facet with a normal (3,)."""
    frames = [] if die.engraved is None else [label.frame for label in die.engraved.placements]
    upward: list[Floats] = [frame[:3, 1] for frame in frames if frame[:3, 2] @ normal > _ALONG]
    return upward[0] if upward else None


def _paths(die: FinishedDie) -> list[str]:
    """The basins as paths in pixels of the Gauss map, to a tenth."""
    paths = []
    for outline in basin_outlines(die.plain.poses):
        whole = [" ".join(f"{x:.1f},{y:.1f}" for x, y in np.asarray(ring)) for ring in outline]
        paths.append("".join(f"M{ring}Z" for ring in whole))
    return paths
