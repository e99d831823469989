"""Meshes of the page: triangles with a code each, which says what a triangle shows."""

from __future__ import annotations

from typing import Any

import numpy as np

from dicedesign.geometry.sphere import norms
from dicedesign.geometry.triangles import doubled_area_vectors
from dicedesign.recipe.output import die_contents, make_finished_die
from dicedesign.recipe.pipeline import Work
from dicedesign.report.pages import rests_of_triangles
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.view.throwing import pack_numbers
from dicedesign.view.viewed_body import ViewedBody

__all__ = ["mesh_data", "rest_codes", "triangle_codes"]

EDGE_CODE, BLANK_CODE, LABEL_CODE = 63, 62, 128
"""Codes of triangles: rounded edge, facet without an outcome, and the bit of labels."""

MAX_OUTCOME_CODE = 61
"""Outcome codes are at most this; outcomes beyond share it."""

FLAT_COSINE = 0.9999
"""Cosine of the largest angle between a facet and triangles that are part of it; others are on
rounded edges."""

FLAT_HEIGHT = 1e-3
"""Largest height of these triangles over the facet, relative to the size of the body."""


def mesh_data(work: Work) -> dict[str, Any]:
    """Mesh of the finished die about its center of mass, with a code for each triangle, and its
    rests."""
    parts = die_contents(work).parts
    first = np.cumsum([0, *(len(part.points) for part in parts)]).tolist()
    poses, outcome_of_rest = work.final.poses, work.final.outcomes.outcome_of_rest
    outcome = int(work.target.probabilities.argmax())
    pairs = zip(poses.normals.tolist(), outcome_of_rest.tolist(), strict=True)
    triangles = [part.triangles + start for part, start in zip(parts, first, strict=False)]
    points = np.concatenate([part.points for part in parts])
    return {
        "points": pack_numbers(points - poses.center_of_mass, "<f4"),
        "triangles": pack_numbers(np.concatenate(triangles), "<u4"),
        "codes": pack_numbers(np.concatenate(triangle_codes(work)), "<u1"),
        "rests": [{"down": down, "outcome": row} for down, row in pairs],
        # In pictures the most probable outcome has come up.
        "show": int(np.argmax(outcome_of_rest == outcome)),
    }


def triangle_codes(work: Work) -> list[Integers]:
    """(t,) codes of the triangles of each part of a finished die. A facet has that of the outcome
    whose label is on it."""
    finished, shown, codes = make_finished_die(work), np.append(_shown_outcomes(work), -1), []
    normals = np.append(work.plain.poses.normals, np.zeros((1, 3)), axis=0)
    for part in die_contents(work).parts:
        rests = rests_of_triangles(part, finished)
        code = np.where(shown[rests] < 0, BLANK_CODE, np.minimum(shown[rests], MAX_OUTCOME_CODE))
        labels = np.zeros(len(rests), dtype=bool) if part.labels is None else part.labels
        if part.name == "labels":
            labels = ~labels
        own = doubled_area_vectors(part.points, part.triangles)
        lengths = np.maximum(norms(own), np.finfo(np.float64).tiny)
        is_edge = ~labels & ((own * normals[rests]).sum(axis=1) < FLAT_COSINE * lengths)
        if work.die.reshaped is None:
            code = np.where(is_edge, EDGE_CODE, code)
        codes.append(code + np.where(labels, LABEL_CODE, 0))
    return codes


def _shown_outcomes(work: Work) -> Integers:
    """(r,) outcome whose label is on the facet of each rest of the plain die; -1 for none, or for
    labels of several."""
    normals, labels = work.plain.poses.normals, work.target.labels
    on_facet = [set[int]() for _ in normals]
    for placement in work.finished.placements:
        cosines = normals @ placement.frame[:3, 2]
        if cosines.max() > FLAT_COSINE:
            on_facet[int(cosines.argmax())].add(labels.index(placement.text))
    return np.array([min(own) if len(own) == 1 else -1 for own in on_facet])


def rest_codes(viewed: ViewedBody, points: Floats, triangles: Integers, most_rows: int) -> Integers:
    """(t,) row of the resting facet that each triangle of a body is part of, or `BLANK_CODE`.

    points: (n, 3), triangles: (t, 3) of its mesh; most_rows: rows beyond have no code.
    """
    codes = np.full(len(triangles), BLANK_CODE, dtype=np.int64)
    middles, normals = points[triangles].mean(axis=1), doubled_area_vectors(points, triangles)
    normals /= np.maximum(norms(normals), np.finfo(np.float64).tiny)[:, None]
    poses, within = viewed.poses, FLAT_HEIGHT * viewed.hull.diameter
    for rest, row in enumerate(viewed.row_of_rest.tolist()):
        if row >= min(most_rows, len(viewed.rows)):
            continue
        normal = poses.normals[rest]
        height = (viewed.hull.vertices @ normal).max() - middles @ normal
        codes[(normals @ normal > FLAT_COSINE) & (height < within)] = row
    return codes
