"""Meshes of the page: triangles with a code each, which says what a triangle shows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from dicedesign.geometry.sphere import norms, unit_vectors
from dicedesign.geometry.triangles import doubled_area_vectors
from dicedesign.recipe.output import die_contents
from dicedesign.recipe.pipeline import Work
from dicedesign.report.colored_die import color_parts
from dicedesign.rest.poses import RestPoses
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.view.throwing import pack_numbers
from dicedesign.view.viewed_body import ViewedBody, decimate

__all__ = ["CodedMesh", "body_mesh", "die_mesh"]

EDGE_CODE, BLANK_CODE, LABEL_CODE = 63, 62, 128
"""Codes of triangles: rounded edge, side without an outcome, and the bit of labels."""

MAX_OUTCOME_CODE = 61
"""Outcomes beyond share this code."""

FLAT_COSINE = 0.9999
"""Cosine of the largest angle between a facet and triangles that are part of it; others are on
rounded edges."""

FLAT_HEIGHT = 1e-3
"""Largest height of these triangles over the facet, relative to the size of the body."""


@dataclass(frozen=True, eq=False)
class CodedMesh:
    """Mesh with codes.

    Attributes
    ----------
    points: (n, 3) in the frame of the body; triangles: (t, 3).
    codes: (t,) outcome that the triangle shows, or row of the rest that it is part of; or
        `BLANK_CODE` or `EDGE_CODE`; plus `LABEL_CODE` on labels.
    """

    points: Floats
    triangles: Integers
    codes: Integers

    def data(self, poses: RestPoses, row_of_rest: Integers, show: int = 0) -> dict[str, Any]:
        """Data for the page: the mesh about the center of mass, and its rests with their rows.

        show: rest in which it is shown.
        """
        pairs = zip(poses.normals.tolist(), row_of_rest.tolist(), strict=True)
        return {
            "points": pack_numbers(self.points - poses.center_of_mass, "<f4"),
            "triangles": pack_numbers(self.triangles, "<u4"),
            "codes": pack_numbers(self.codes, "<u1"),
            "rests": [{"down": down, "outcome": row} for down, row in pairs],
            "show": show,
        }


def die_mesh(work: Work) -> CodedMesh:
    """Mesh of a finished die, with the outcomes that its sides show."""
    result, labels = work.result(), work.target.labels
    parts = color_parts(die_contents(work).parts, result)
    codes, flat = [], work.plain.poses.hull.normals
    for part in parts:
        name, _, rest = part.name.partition("-")
        outcome = result.facets[int(rest)].outcome if rest else None
        code = BLANK_CODE
        if outcome is not None:
            code = min(labels.index(outcome), MAX_OUTCOME_CODE)
        own = np.full(len(part.triangles), code + LABEL_CODE * (name == "labels"))
        if name == "body" and work.recipe.edges is not None:
            normals = unit_vectors(doubled_area_vectors(part.points, part.triangles))
            own[(normals @ flat.T).max(axis=1) < FLAT_COSINE] = EDGE_CODE
        codes.append(own)
    starts = np.cumsum([0, *(len(part.points) for part in parts)]).tolist()
    triangles = [part.triangles + start for part, start in zip(parts, starts, strict=False)]
    # Parts that meet share their corners, so that rounded edges can be smooth.
    points, index = np.unique(
        np.concatenate([part.points for part in parts]), axis=0, return_inverse=True
    )
    return CodedMesh(points, index.reshape(-1)[np.concatenate(triangles)], np.concatenate(codes))


def body_mesh(viewed: ViewedBody, most_rows: int) -> CodedMesh:
    """Mesh of a body, small enough to be drawn, with the rows of its resting facets.

    most_rows: rows beyond have no code.
    """
    body, hull, poses = viewed.shape.body, viewed.hull, viewed.poses
    points, triangles = hull.vertices, hull.triangles
    if body.triangles is not None and not viewed.is_dragged:
        points, triangles = decimate(body.points, body.triangles)
    codes = np.full(len(triangles), BLANK_CODE, dtype=np.int64)
    middles, normals = points[triangles].mean(axis=1), doubled_area_vectors(points, triangles)
    normals /= np.maximum(norms(normals), np.finfo(np.float64).tiny)[:, None]
    for rest, row in enumerate(viewed.row_of_rest.tolist()):
        if row < min(most_rows, len(viewed.rows)):
            normal = poses.normals[rest]
            height = (hull.vertices @ normal).max() - middles @ normal
            is_part = (normals @ normal > FLAT_COSINE) & (height < FLAT_HEIGHT * hull.diameter)
            codes[is_part] = row
    return CodedMesh(points, triangles, codes)
