"""HTML of rests, dice and results in notebooks: a solid to turn, beside a table."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np
import trimesh
from trimesh.viewer.notebook import scene_to_html
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

from dicedesign.geometry.meshes.reading import read_body
from dicedesign.report.palette import BASINS, PALE, repeat, rgb
from dicedesign.rest.poses import RestPoses
from dicedesign.results.result import Result
from dicedesign.runtime.arrays import Floats, Integers

HEIGHT_PX = 320
"""Height of the view, in pixels."""

LAMP = 1.5
"""Brightness of the lamp of the viewer on a facet at some angle to it."""

ON_FACET = 0.05
"""Largest distance of a colored triangle from the plane of its rest, over the size of the body."""

MAX_ROWS = 30
"""Most rows of a table; a last line counts the others."""


def poses_html(poses: RestPoses) -> str:
    """HTML of the hull of a body and a table of its rests."""
    colors = repeat(BASINS, len(poses.normals))
    rows = [
        (f"{k}", f"{p:.4%}", f"{margin:.1f}°")
        for k, (p, margin) in enumerate(
            zip(poses.probabilities, np.degrees(poses.margins), strict=True)
        )
    ]
    view = _view(poses.hull.vertices, poses.hull.triangles, poses.normals, colors)
    title = f"{len(rows)} resting poses"
    return _page(view, title, ("rest", "probability", "margin"), rows, colors)


def result_html(result: Result, solid: tuple[Floats, Integers] | None = None) -> str:
    """HTML of a die and a table of its outcomes.

    solid: points (n, 3) and triangles (m, 3); None to read them from the folder of the result. The
        solid is left out if there is no folder.
    """
    colors = dict(zip(result.labels, repeat(BASINS, len(result.labels)), strict=True))
    normals = np.array([facet.normal for facet in result.facets])
    of_facets = [colors.get(facet.outcome or "", PALE) for facet in result.facets]
    name = result.files.get("die", result.files.get("plain"))
    if solid is None and result.folder is not None and name and (result.folder / name).is_file():
        surface = read_body(result.folder / name).surface
        solid = (surface.points, surface.triangles)
    rows = [
        (label, f"{p:.4%}", f"{q:.4%}")
        for label, p, q in zip(result.labels, result.probabilities, result.target, strict=True)
    ]
    view = "" if solid is None else _view(*solid, normals, of_facets)
    heads = ("outcome", "probability", "target")
    return _page(view, result.message, heads, rows, list(colors.values()))


def _view(points: Floats, triangles: Integers, normals: Floats, colors: Sequence[str]) -> str:
    """HTML of trimesh's viewer of a solid, colored by rest.

    normals: (k, 3) of the resting facets; colors: k colors of their triangles.
    """
    supports, middles = (points @ normals.T).max(axis=0), points[triangles].mean(axis=1)
    depths = supports - middles @ normals.T
    far = depths.min(axis=1) > ON_FACET * np.ptp(points, axis=0).max()
    facets = np.where(far, len(normals), depths.argmin(axis=1))
    scene = trimesh.Scene()
    for facet in np.unique(facets):
        color = [*(rgb([[*colors, PALE][facet]])[0] / LAMP), 1.0]
        material = PBRMaterial(baseColorFactor=color, metallicFactor=0.0, roughnessFactor=1.0)
        part = trimesh.Trimesh(points, triangles[facets == facet], process=False)
        part.visual = TextureVisuals(material=material)
        scene.add_geometry(part)
    document = scene_to_html(scene, escape_quotes=True)
    style = f"border: none; width: 100%; height: {HEIGHT_PX}px"
    return f'<iframe srcdoc="{document}" style="{style}"></iframe>'


def _page(
    view: str,
    title: str,
    heads: Sequence[str],
    rows: Sequence[Sequence[str]],
    colors: Sequence[str],
) -> str:
    """HTML of a view beside a table whose rows have colors."""
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
