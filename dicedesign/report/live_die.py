"""What a page needs to show a die that turns, linked with its facets and its Gauss map."""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Final

import numpy as np

from dicedesign.fabricate.die import FinishedDie
from dicedesign.fabricate.file_formats import BODY_COLOR, Contents, Part, glb
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.triangles import doubled_area_vectors
from dicedesign.report.discs import basin_outlines
from dicedesign.report.palette import BASINS
from dicedesign.runtime.arrays import Floats, Integers

MOST_TRIANGLES: Final = 60_000
"""A page of more would weigh megabytes more."""

PAIRS_AT_ONCE: Final = 2_000_000
"""Pairs of a triangle and a facet that are compared at a time, to bound the memory."""

TOUCHES: Final = 3e-3
"""Height above the table, over the largest extent, up to which a surface of any shape touches."""

FACES_DOWN: Final = 0.9
"""Cosine of the angle to straight down up to which it may slope there."""

ALONG: Final = 0.999
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
    outlines: of each disc of the Gauss map its middle in pixels, and the basin of each rest as a
        path of SVG, to a tenth of a pixel, see `basin_outlines`; none for a die without a map.
    """

    solid: bytes | None
    left_out: str
    colors: tuple[str, ...]
    heights: tuple[float, ...]
    upward: tuple[Floats | None, ...]
    center: Floats
    stands: bool
    outlines: tuple[tuple[Floats, list[str]], ...]


def live_die(die: FinishedDie, parts: Sequence[Part]) -> LiveDie:
    """A finished die for its page.

    parts: bodies of the printed die, the first being that of its STL.
    """
    solid, left_out = None, ""
    triangles = sum(len(part.triangles) for part in parts)
    if three_script() is None:
        left_out = "The die cannot be turned here: trimesh is installed without its viewer."
    elif triangles > MOST_TRIANGLES:
        left_out = f"The die cannot be turned here: it has {triangles:,} triangles."
    else:
        solid = glb(Contents(die.result.name, facet_parts(parts, die)))
    poses = die.plain.poses
    heights = poses.hull.heights(poses.center_of_mass)[poses.facets]
    upward: list[Floats | None] = [None for _ in heights]
    for label in () if die.engraved is None else die.engraved.placements[::-1]:
        for rest in np.flatnonzero(poses.normals @ label.frame[:3, 2] > ALONG):
            upward[rest] = label.frame[:3, 1]
    outlines = []
    for disc, basins in () if die.reshaped is not None else basin_outlines(poses):
        texts = [
            [" ".join(f"{x:.1f},{y:.1f}" for x, y in ring.tolist()) for ring in own]
            for own in basins
        ]
        outlines.append((disc.middle, ["".join(f"M{ring}Z" for ring in own) for own in texts]))
    return LiveDie(
        solid=solid,
        left_out=left_out,
        colors=tuple(rest_colors(die)),
        heights=tuple(heights.tolist()),
        upward=tuple(upward),
        center=poses.center_of_mass,
        stands=die.reshaped is not None,
        outlines=tuple(outlines),
    )


def rest_colors(die: FinishedDie) -> list[str]:
    """A colour for each rest, "#rrggbb": that of its basin on the Gauss map, and of its outcome
    where a die keeps the shape of a surface, as in the figures of either."""
    rests = range(len(die.plain.poses.facets))
    if die.reshaped is None:
        return [BASINS[rest % len(BASINS)] for rest in rests]
    outcomes = die.plain.outcomes.outcome_of_rest.tolist()
    return [BODY_COLOR if k < 0 else BASINS[k % len(BASINS)] for k in outcomes]


def facet_parts(parts: Sequence[Part], die: FinishedDie) -> list[Part]:
    """The same triangles in a part for each rest, "facet-0" for the most probable, and one for
    those of no rest, "body". Inlays are named "labels-0" and so on.

    parts: of the printed die; the first is its body, others are inlays.
    """
    colors, made = rest_colors(die), []
    for part in parts:
        is_body = part is parts[0]
        rests = rests_of_triangles(part.points, part.triangles, die)
        for rest in np.unique(rests).tolist():
            own = rests == rest
            color, labels = part.color, None if part.labels is None else part.labels[own]
            name = "body" if is_body else "labels"
            if rest >= 0:
                name = f"facet-{rest}" if is_body else f"labels-{rest}"
            if is_body:
                color = BODY_COLOR if rest < 0 else colors[rest]
            # The body of a facet that is all label would have no triangle.
            if labels is not None and labels.all():
                name, color, labels = name.replace("facet", "labels"), part.color, None
            triangles = part.triangles[own]
            made.append(replace(part, name=name, color=color, triangles=triangles, labels=labels))
    return made


def rests_of_triangles(points: Floats, triangles: Integers, die: FinishedDie) -> Integers:
    """(t,) the rest whose facet each triangle of a printed die belongs to, or -1.

    Labels, and edges that were rounded, belong to the facet whose plane is nearest. A die that
    keeps the shape of a surface has no facets; there it is what touches the table.
    """
    poses, middles = die.plain.poses, points[triangles].mean(axis=1)
    whole = die.plain.body.points if die.engraved is None else die.engraved.points
    normals = poses.hull.normals if die.reshaped is None else poses.normals
    support = np.array([(whole @ normal).max() for normal in normals])
    count = 1 + len(middles) * len(normals) // PAIRS_AT_ONCE
    parts = np.array_split(middles, count)
    nearest = np.concatenate([np.argmin(support - some @ normals.T, axis=1) for some in parts])
    if die.reshaped is None:
        of_facet = np.full(len(normals), -1, dtype=np.int64)
        of_facet[poses.facets] = np.arange(len(poses.facets))
        return of_facet[nearest]
    down, areas = normals[nearest], doubled_area_vectors(points, triangles)
    heights = support[nearest] - (middles * down).sum(axis=1)
    flat = (areas * down).sum(axis=1) >= FACES_DOWN * norms(areas)
    touches = flat & (heights <= TOUCHES * np.ptp(whole, axis=0).max())
    return np.where(touches, nearest, -1)


@lru_cache(maxsize=1)
def three_script() -> str | None:
    """The library that draws the 3D view of a page: three.js as trimesh brings it, without
    trimesh's own viewer; None where no trimesh with one is installed.

    It is under the MIT licence, whose notice is its first line.
    """
    found = find_spec("trimesh")
    if found is None or found.origin is None:
        return None
    viewer = Path(found.origin).parent / "resources/templates/viewer.zip"
    try:
        with zipfile.ZipFile(viewer) as archive:
            page = archive.read("viewer.html.template").decode("utf-8")
    except (OSError, KeyError, ValueError, zipfile.BadZipFile):
        return None
    # Where trimesh's own viewer follows.
    script, ends, _ = page.partition("var camera,controls,scene,renderer,tracklight;")
    _, begins, script = script.partition("<script>")
    needed = ("THREE.GLTFLoader", "WebGLRenderer", "Raycaster")
    return script if begins and ends and all(name in script for name in needed) else None
