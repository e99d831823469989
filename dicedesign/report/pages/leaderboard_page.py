"""The best dice of a search on one HTML page that needs nothing else."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping
from html import escape
from typing import Any, Final

import numpy as np

from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.report.charts.paper import Paper
from dicedesign.report.pages.html_parts import figure_section, number, page
from dicedesign.report.render.raster import Camera
from dicedesign.report.render.renderer import Surface, render
from dicedesign.runtime.arrays import Floats

__all__ = ["leaderboard_html", "lying_die_png"]

_PIXELS: Final = 220

_TILT: Final = np.radians(30.0)
"""How far the camera stands above the table."""

_TURN: Final = np.radians(25.0)
"""How far it stands aside of the broadest side."""

_HEADER: Final = (
    "",
    "rank",
    "trial",
    "radius (mm)",
    "margin (°)",
    "max |p − q|",
    "asymmetry ρ",
    "recipe",
)

_NOTE: Final = (
    "Ranked by radius times margin. The radius is that of the largest circle in the outcome's "
    "facet where it is smallest: room for a label. The margin is the least angle from the normal "
    "of an outcome's facet to the border of its basin: how much of a push the odds bear. The two "
    "numbers are bold where no other die is better in both. Asymmetry is small where throws with "
    "momentum should change the odds little. Each die is shown as it lies on its most probable "
    "facet, all at one scale. Make a die from its recipe with "
    "dicedesign run."
)


def leaderboard_html(
    table: Mapping[str, Any], shapes: Mapping[int, Mapping[str, Any]], picture: bytes
) -> str:
    """The page as HTML.

    Parameters
    ----------
    table: as in leaderboard.json: "name", "size_mm", "trials", "converged" and "leaderboard", each
        entry with "rank", "number", "inradius_mm", "margin_deg", "max_abs_error", "asymmetry",
        "on_front", "as_given", "varied" and "recipe_file".
    shapes: by the number of each trial in it, "vertices" (n, 3) of the die in mm and "down" (3,).
    picture: PNG of `dicedesign.report.charts.pareto.pareto_figure`.
    """
    board = table["leaderboard"]
    verdict = f"{table['converged']} of {table['trials']} trials converged"
    if not board:
        verdict += ": there is no die to show"
    parts = [
        f"<h1>{escape(table['name'])}: search</h1>",
        f'<p class="verdict">{escape(verdict)}</p>',
    ]
    if board:
        parts.append(_board(table, shapes))
    caption = (
        f"Every trial at a size of {table['size_mm']:g} mm; numbers are those of the trials on the "
        "leaderboard."
    )
    parts.append(figure_section("Size against margin", picture, caption))
    return page(f"{table['name']}: search", parts)


def _board(table: Mapping[str, Any], shapes: Mapping[int, Mapping[str, Any]]) -> str:
    *short, last = (escape(text) for text in _HEADER)
    head = "".join(f'<th style="white-space:nowrap">{text}</th>' for text in short)
    head += f'<th style="text-align:left">{last}</th>'
    rows = []
    for entry in table["leaderboard"]:
        shape = shapes[entry["number"]]
        image = lying_die_png(np.array(shape["vertices"]), np.array(shape["down"]))
        source = b64encode(image).decode("ascii")
        mark = "strong" if entry["on_front"] else "span"
        cells = [
            f'<img alt="trial {entry["number"]}" style="width:7rem;min-width:0" '
            f'src="data:image/png;base64,{source}">',
            str(entry["rank"]),
            str(entry["number"]),
            f"<{mark}>{entry['inradius_mm']:.2f}</{mark}>",
            f"<{mark}>{entry['margin_deg']:.2f}</{mark}>",
            f"{entry['max_abs_error']:.1e}",
            number(entry["asymmetry"], 3),
        ]
        recipe = "<br>".join(map(escape, _recipe_lines(entry)))
        rows.append(
            "<tr>"
            + "".join(f"<td>{cell}</td>" for cell in cells)
            + f'<td style="min-width:11rem;text-align:left">{recipe}</td></tr>'
        )
    return (
        '<section><h2>Best dice</h2><div class="scroll"><table>'
        f"<thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table></div>"
        f'<p class="note">{escape(_NOTE)}</p></section>'
    )


def _recipe_lines(entry: Mapping[str, Any]) -> list[str]:
    """Where the recipe of an entry is, and what the search varied, without the weights that are
    0."""
    lines = [entry["recipe_file"]]
    if entry["as_given"]:
        lines.append("as given")
    for key, value in entry["varied"].items():
        name = key.rpartition(".")[2]
        if isinstance(value, list):
            lines.append(f"{name} {', '.join(value)}")
        elif isinstance(value, float):
            lines += [f"{name} {value:.2g}"] if value > 0.0 else []
        else:
            lines.append(f"{name} {value}")
    return lines


def lying_die_png(vertices: Floats, down: Floats) -> bytes:
    """Picture of a die that lies on a table, somewhat from above.

    The frame is as wide as the largest distance between two vertices.

    vertices: (n, 3) in any length unit; down: (3,) the direction of gravity.
    """
    hull = convex_hull(vertices)
    center = (vertices.min(axis=0) + vertices.max(axis=0)) / 2.0
    flat = vertices - center - np.outer((vertices - center) @ down, down)
    along, across = np.linalg.svd(flat)[2][:2]
    side = np.cos(_TURN) * across + np.sin(_TURN) * along
    direction = np.cos(_TILT) * side - np.sin(_TILT) * down
    # In the middle of the picture, the die is nowhere wider than its frame.
    frame = Camera(direction, -down, center, 1.0).frame()
    seen = vertices @ frame.T
    middle = (seen.min(axis=0) + seen.max(axis=0)) / 2.0 @ frame
    camera = Camera(direction, -down, middle, 0.53 * hull.diameter)
    surface = Surface(hull.vertices, hull.triangles, smooth=False)
    paper = Paper(_PIXELS, _PIXELS)
    paper.picture(render(surface, camera, _PIXELS), 0, 0)
    return paper.png()
