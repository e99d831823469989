"""The basins of a body as outlines over its Gauss map."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final

import numpy as np

from dicedesign.geometry.sphere import norms
from dicedesign.report.charts.disc_regions import region_on_disc
from dicedesign.report.charts.hemispheres import great_arcs
from dicedesign.report.figures.gauss_map import basin_of_directions, placed_discs
from dicedesign.rest.poses import RestPoses
from dicedesign.runtime.arrays import Floats

__all__ = ["basin_outlines"]

_STEP: Final = math.radians(5.0)
"""Longest piece of an arc: straight on paper it is beside the arc by less than half a pixel."""


def basin_outlines(poses: RestPoses) -> list[list[Floats]]:
    """For each rest the closed polygons (m, 2) of its basin, in pixels of the Gauss map.

    They are those of `gauss_map_figure`, on both discs; what winds around a point once is inside.
    """
    borders = _borders(poses)
    outlines: list[list[Floats]] = [[] for _ in poses.facets]
    for placed in placed_discs(poses):
        at_rim = int(basin_of_directions(poses, placed.disc.right[None])[0])
        for rest, outline in enumerate(outlines):
            regions = region_on_disc(placed.disc, borders.get(rest, ()), rest == at_rim)
            outline += [placed.on_paper(region) for region in regions]
    return outlines


def _borders(poses: RestPoses) -> dict[int, list[Floats]]:
    """The borders of basins by rest: loops (m, 3) of unit directions, the basin on their left."""
    maxima = poses.basins[0].paths.maxima.tolist()
    sides = poses.morse.saddle_basins.tolist()
    lines: dict[int, list[tuple[int, int, Floats]]] = {}
    for saddle, path in enumerate(_fine(poses.morse.polylines)):
        begin, end = maxima[2 * saddle + 1], maxima[2 * saddle]
        left, right = sides[saddle]
        lines.setdefault(left, []).append((begin, end, path))
        lines.setdefault(right, []).append((end, begin, path[::-1]))
    return {rest: _loops(own) for rest, own in lines.items()}


def _loops(lines: Iterable[tuple[int, int, Floats]]) -> list[Floats]:
    """Lines (m, 3) from one maximum to another, strung together until they close."""
    leaving: dict[int, list[tuple[int, Floats]]] = {}
    for begin, end, path in lines:
        leaving.setdefault(begin, []).append((end, path))
    loops = []
    for first in sorted(leaving):
        while leaving[first]:
            here, parts = first, []
            while leaving.get(here):
                here, path = leaving[here].pop()
                parts.append(path[:-1])
            loops.append(np.concatenate(parts))
    return loops


def _fine(paths: Iterable[Floats]) -> list[Floats]:
    """Great arcs (n, 3) with points between, so that none is longer than a step."""
    fine = []
    for path in paths:
        count = np.ceil(norms(path[1:] - path[:-1]) / _STEP).astype(np.int64).clip(1)
        arcs: list[Floats] = [path] * len(count)
        for pieces in np.unique(count).tolist():
            some = np.flatnonzero(count == pieces)
            made = great_arcs(path[some], path[some + 1], pieces)
            for place, arc in zip(some.tolist(), made, strict=True):
                arcs[place] = arc[:-1]
        fine.append(np.concatenate([*arcs, path[-1:]]))
    return fine
