"""HTML for notebooks: a solid to turn, beside a table whose rows have the colors of its facets."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path

import numpy as np

from dicedesign.palette import BLANK, outcome_colors, rgb
from dicedesign.runtime.arrays import Floats, Integers

HEIGHT_PX = 320
"""Height of the view, in pixels."""

LAMP = 1.5
"""Brightness of the lamp of the viewer on a facet at some angle to it."""

ON_FACET = 0.05
"""Largest distance of a colored triangle from the plane of its facet, over the size of the body."""

MAX_ROWS = 30
"""Most rows of a table; a last line counts the others."""

Solid = tuple[Floats, Integers] | Path
"""Points (n, 3) and triangles (m, 3), or a mesh file."""


def solid_and_table(
    solid: Solid | None,
    normals: Floats,
    row_of_facet: Sequence[int],
    title: str,
    heads: Sequence[str],
    rows: Sequence[Sequence[str]],
) -> str:
    """HTML of a solid beside a table.

    Parameters
    ----------
    solid: body to turn; None for the table alone.
    normals: (k, 3) outward normals of the facets to color.
    row_of_facet: k rows of the table; any other number for facets without one.
    title, heads, rows: texts of the table.
    """
    colors = outcome_colors(len(rows))
    view = (
        ""
        if solid is None
        else _view(solid, normals, [dict(enumerate(colors)).get(k, BLANK) for k in row_of_facet])
    )
    lines = [
        f'<tr><td style="border-left: 1em solid {color}">'
        + "</td><td>".join(map(escape, row))
        + "</td></tr>"
        for row, color in zip(rows, colors, strict=True)
    ]
    if len(lines) > MAX_ROWS:
        lines[MAX_ROWS:] = [f"<tr><td>and {len(lines) - MAX_ROWS} more</td></tr>"]
    table = "".join(f"<th>{head}</th>" for head in heads) + "".join(lines)
    return (
        f'<div style="display: flex; gap: 1em"><div style="flex: 2">{view}</div>'
        f'<div style="flex: 1"><p>{escape(title)}</p><table>{table}</table></div></div>'
    )


def _view(solid: Solid, normals: Floats, colors: Sequence[str]) -> str:
    """HTML of trimesh's viewer of a solid, whose facets with normals (k, 3) have k colors."""
    import trimesh
    from trimesh.viewer.notebook import scene_to_html
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    body = trimesh.load_mesh(solid) if isinstance(solid, Path) else trimesh.Trimesh(*solid)
    points, triangles = np.asarray(body.vertices), np.asarray(body.faces)
    depths = (points @ normals.T).max(axis=0) - points[triangles].mean(axis=1) @ normals.T
    far = depths.min(axis=1) > ON_FACET * np.ptp(points, axis=0).max()
    facets = np.where(far, len(normals), depths.argmin(axis=1))
    scene = trimesh.Scene()
    for facet in np.unique(facets):
        color = [*(rgb([[*colors, BLANK][facet]])[0] / LAMP), 1.0]
        material = PBRMaterial(baseColorFactor=color, metallicFactor=0.0, roughnessFactor=1.0)
        part = trimesh.Trimesh(points, triangles[facets == facet], process=False)
        part.visual = TextureVisuals(material=material)
        scene.add_geometry(part)
    document = scene_to_html(scene, escape_quotes=True)
    style = f"border: none; width: 100%; height: {HEIGHT_PX}px"
    return f'<iframe srcdoc="{document}" style="{style}"></iframe>'
