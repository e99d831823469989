"""The solid of a die taken apart by the facets that it rests on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from dicedesign.fabricate.die import FinishedDie
from dicedesign.fabricate.file_formats import BODY_COLOR, Part
from dicedesign.geometry.triangles import doubled_area_vectors
from dicedesign.report.charts.palette import BASINS
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["NO_REST_COLOR", "facet_parts", "rest_colors", "rests_of_triangles"]

NO_REST_COLOR: Final = BODY_COLOR
"""Of what belongs to no outcome."""

_PAIRS_AT_ONCE: Final = 2_000_000
"""Pairs of a triangle and a facet that are compared at a time, to bound the memory."""

_TOUCHES: Final = 3e-3
"""Height above the table, over the largest extent, up to which a surface of any shape touches."""

_FACES_DOWN: Final = 0.9
"""Cosine of the angle to straight down up to which it may slope there."""


def rest_colors(die: FinishedDie) -> list[str]:
    """A colour for each rest, "#rrggbb": that of its basin on the Gauss map, and of its outcome
    where a die keeps the shape of a surface, as in the figures of either."""
    rests = range(len(die.plain.poses.facets))
    if die.reshaped is None:
        return [BASINS[rest % len(BASINS)] for rest in rests]
    outcomes = die.plain.outcomes.outcome_of_rest.tolist()
    return [NO_REST_COLOR if k < 0 else BASINS[k % len(BASINS)] for k in outcomes]


def facet_parts(parts: Sequence[Part], die: FinishedDie) -> list[Part]:
    """The same triangles in a part for each rest, "facet-0" for the most probable, and one for
    those of no rest, "body". Inlays are named "labels-0" and so on.

    parts: of the printed die; the first is its body, others are inlays.
    """
    colors = rest_colors(die)
    made = []
    for number, part in enumerate(parts):
        rests = rests_of_triangles(part.points, part.triangles, die)
        for rest in np.unique(rests).tolist():
            own = rests == rest
            kind = "facet" if number == 0 else "labels"
            name = ("body" if number == 0 else "labels") if rest < 0 else f"{kind}-{rest}"
            color = part.color
            if number == 0:
                color = NO_REST_COLOR if rest < 0 else colors[rest]
            labels = None if part.labels is None else part.labels[own]
            # The body of a facet that is all label would have no triangle.
            if labels is not None and labels.all():
                name, color, labels = name.replace("facet", "labels"), part.color, None
            made.append(replace(part, name=name, color=color, triangles=part.triangles[own]))
            made[-1] = replace(made[-1], labels=labels)
    return made


def rests_of_triangles(points: Floats, triangles: Integers, die: FinishedDie) -> Integers:
    """(t,) the rest whose facet each triangle of a printed die belongs to, or -1.

    Labels, and edges that were rounded, belong to the facet whose plane is nearest. A die that
    keeps the shape of a surface has no facets; there it is what touches the table.
    """
    poses, middles = die.plain.poses, points[triangles].mean(axis=1)
    of_facet = np.full(len(poses.hull.normals), -1, dtype=np.int64)
    of_facet[poses.facets] = np.arange(len(poses.facets))
    whole = die.plain.body.points if die.engraved is None else die.engraved.points
    normals = poses.hull.normals if die.reshaped is None else poses.normals
    support = np.array([(whole @ normal).max() for normal in normals])
    nearest = np.empty(len(middles), dtype=np.int64)
    rows = max(1, _PAIRS_AT_ONCE // len(normals))
    for first in range(0, len(middles), rows):
        some = slice(first, first + rows)
        nearest[some] = np.argmin(support - middles[some] @ normals.T, axis=1)
    if die.reshaped is None:
        return of_facet[nearest]
    down, areas = normals[nearest], doubled_area_vectors(points, triangles)
    heights = support[nearest] - (middles * down).sum(axis=1)
    flat = (areas * down).sum(axis=1) >= _FACES_DOWN * np.linalg.norm(areas, axis=1)
    touches = flat & (heights <= _TOUCHES * np.ptp(whole, axis=0).max())
    return np.where(touches, nearest, -1)
