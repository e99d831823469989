"""Bodies of the page for experts: rests, Gauss map, and what dragging does to them.

A state of a body never changes: each change makes a new one with a number of its own.
"""

from __future__ import annotations

import tempfile
import threading
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import count, islice
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import numpy as np

from dicedesign.errors import DiceError, InputError
from dicedesign.geometry.meshes.reading import read_body, stl_bytes
from dicedesign.palette import BLANK, INK, outcome_colors, text_color
from dicedesign.report.discs import RADIUS, basin_outlines, svg_path
from dicedesign.throws.momentum_model import momentum_model
from dicedesign.view.dice import Shop
from dicedesign.view.meshes import CodedMesh, body_mesh
from dicedesign.view.sources import Source
from dicedesign.view.throwing import throw_body
from dicedesign.view.viewed_body import ViewedBody, facet_vertices

__all__ = ["Bodies"]

MAX_ENDING = 16
"""Characters of a file's ending that are kept; known ones are shorter."""

KEPT_BODIES = 24
"""Opened bodies that are kept in memory, each as it was opened."""

KEPT_CHANGES = 16
"""Latest changes of each body that are kept in memory."""

MAX_ROWS = 24
"""Rows of a table of probabilities; the others are summed."""

MAX_DRAGGED_CORNERS = 2000
"""Corners of a hull up to which it can be dragged."""

MIN_LABEL_PROBABILITY = 0.008
"""Probability from which on a basin has its label in the map."""

MAP_LABEL_SIZE = 11.5
"""Font size of the labels in the map, in its points."""

MAP_EDGE = 1.4
"""Margin around a half of the map, in its points."""


@dataclass(frozen=True, eq=False)
class _State:
    """State of a body.

    Attributes
    ----------
    opened: number of the body as it was opened.
    mesh: of a die; None to color the resting facets.
    """

    opened: int
    viewed: ViewedBody
    mesh: CodedMesh | None


class Bodies:
    """Functions behind the page's tab for experts. All take and return JSON values, except `open`
    of bytes, and may run in any thread.

    shop: where dice come from. source: bodies of the command line, or None.
    """

    def __init__(self, shop: Shop, source: Source | None) -> None:
        self._shop, self._source = shop, source
        # By the number of the opened body, in the order of use; its own state is the first.
        self._bodies: OrderedDict[int, OrderedDict[int, _State]] = OrderedDict()
        self._numbers, self._lock = count(1), threading.Lock()
        self.names: tuple[str, ...] = () if source is None else source.names

    def open(self, query: Mapping[str, Any]) -> dict[str, Any]:
        """Open a body: "name" of the command line's, or "die" and "dress" of a die."""
        if "die" in query:
            return self._keep(*self._shop.viewed(query))
        if self._source is None or query["name"] not in self.names:
            raise InputError(f"name: expected one of the page's, got {query['name']!r}; reload it")
        return self._keep(self._source.load(query["name"], lambda _: None))

    def upload(self, query: Mapping[str, Any], content: bytes) -> dict[str, Any]:
        """Open a mesh of the user's own. query: "name" of the file; content: of the file."""
        name = Path(str(query["name"])).name or "mesh"
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, f"mesh{Path(name).suffix[:MAX_ENDING]}")
            path.write_bytes(content)
            try:
                body = read_body(path)
            except DiceError as error:
                raise InputError(str(error).replace(str(path), name)) from error
        return self._keep(ViewedBody.of(body, name=name))

    def change(self, query: Mapping[str, Any]) -> dict[str, Any]:
        """Change a state: "center" (3,), or "uniform", or "vertices" of the hull moved by "by"
        (3,)."""
        state, note = self._find(query), ""
        viewed = state.viewed
        if "center" in query:
            viewed, was_outside = viewed.with_center(np.array(query["center"], dtype=np.float64))
            if was_outside:
                note = "The center of mass of a body is always inside its hull."
        elif "uniform" in query:
            viewed = viewed.with_uniform_center()
        else:
            vertices = np.array(query["vertices"], dtype=np.int64)
            corners = viewed.hull.vertices
            if len(corners) > MAX_DRAGGED_CORNERS:
                raise InputError(
                    f"hull: expected at most {MAX_DRAGGED_CORNERS:,} corners to drag, got "
                    f"{len(corners):,}; take a simpler body"
                )
            if not ((vertices >= 0) & (vertices < len(corners))).all():
                raise InputError(
                    f"vertices: expected corners from 0 to {len(corners) - 1}, got "
                    f"{vertices.tolist()}; reload the page"
                )
            viewed = viewed.with_vertices(vertices, corners[vertices] + np.array(query["by"]))
        return self._keep(viewed, state.mesh, state.opened) | {"note": note}

    def probabilities(self, query: Mapping[str, Any]) -> dict[str, Any]:
        """(rows,) "thrown" probabilities of a state by the momentum model of a "table"."""
        thrown = self._find(query).viewed.throw_probabilities(momentum_model(query["table"]))
        return {"thrown": thrown.tolist()}

    def throw(self, query: Mapping[str, Any]) -> dict[str, Any]:
        """Throws of a state; see `throw_body`."""
        return throw_body(self._find(query).viewed, query)

    def gauss_map(self, query: Mapping[str, Any]) -> dict[str, Any]:
        """Gauss map of a state as an SVG figure."""
        return {"svg": _map_svg(self._find(query).viewed)}

    def hull_file(self, query: Mapping[str, Any]) -> bytes:
        """STL file of the hull of a state."""
        return stl_bytes(self._find(query).viewed.hull.surface)

    def _find(self, query: Mapping[str, Any]) -> _State:
        number = int(query["state"])
        with self._lock:
            for opened, states in self._bodies.items():
                if number in states:
                    states.move_to_end(number)
                    states.move_to_end(opened, last=False)
                    self._bodies.move_to_end(opened)
                    return states[number]
        raise InputError("body: expected one that is still open, got an old one; open it again")

    def _keep(
        self, viewed: ViewedBody, mesh: CodedMesh | None = None, opened: int | None = None
    ) -> dict[str, Any]:
        """Keep a state, of the body with the number `opened` or of a new one, and describe it."""
        number = next(self._numbers)
        with self._lock:
            if opened is None or opened not in self._bodies:
                opened = number
                self._bodies[opened] = OrderedDict()
            states = self._bodies[opened]
            states[number] = _State(opened, viewed, mesh)
            while len(states) > 1 + KEPT_CHANGES:
                del states[next(islice(states, 1, None))]
            while len(self._bodies) > KEPT_BODIES:
                self._bodies.popitem(last=False)
        return _describe(viewed, mesh) | {"state": number}


def _describe(viewed: ViewedBody, mesh: CodedMesh | None) -> dict[str, Any]:
    """Data of a body for the page: mesh about the center of mass, rows and facts.

    mesh: of a die, or None to color the resting facets.
    """
    body, hull, poses = viewed.shape.body, viewed.hull, viewed.poses
    rows = viewed.rows[:MAX_ROWS]
    if mesh is None or viewed.is_dragged:
        mesh = body_mesh(viewed, MAX_ROWS)
    others = float(sum(row.probability for row in viewed.rows[MAX_ROWS:]))
    errors = [abs(row.probability - row.target) for row in viewed.rows if row.target is not None]
    kind = f"{len(body.points):,} points"
    if body.triangles is not None:
        kind = "the dragged hull" if viewed.is_dragged else f"{len(body.triangles):,} triangles"
    margins, colors = np.degrees(poses.margins), _row_colors(viewed)
    return {
        "name": viewed.name,
        "kind": kind,
        "corners": len(hull.vertices),
        "facets": len(hull.normals),
        "rests": len(poses.facets),
        "margin_deg": float(margins.min()) if len(margins) > 1 else None,
        "notes": poses.notes,
        "error": max(errors, default=None),
        "center": viewed.center.tolist(),
        "size": hull.diameter,
        "rows": [
            {"label": row.label, "probability": row.probability, "target": row.target}
            for row in rows
        ],
        "others": [len(viewed.rows) - len(rows), others],
        "colors": colors[: len(rows)],
        "texts": [text_color(color) for color in colors[: len(rows)]],
        "mesh": mesh.data(poses, viewed.row_of_rest),
        "hull": {
            "vertices": hull.vertices.tolist(),
            "facets": [facet_vertices(hull, facet).tolist() for facet in range(len(hull.normals))],
            "normals": hull.normals.tolist(),
        }
        if len(hull.vertices) <= MAX_DRAGGED_CORNERS
        else None,
    }


def _row_colors(viewed: ViewedBody) -> list[str]:
    """Colors of the rows; rests without an outcome are blank."""
    count = len(viewed.rows)
    if viewed.outcomes is None:
        return outcome_colors(count)
    colors = outcome_colors(len(viewed.outcomes.labels))
    return [*colors, BLANK][:count]


def _map_svg(viewed: ViewedBody) -> str:
    """Two hemispheres of the Gauss map, one figure each, with basins in the colors of the rows, and
    their labels."""
    poses, colors, figures = viewed.poses, _row_colors(viewed), []
    rows = np.minimum(viewed.row_of_rest, len(colors) - 1).tolist()
    for number, (disc, outlines) in enumerate(basin_outlines(poses)):
        x, y = disc.middle
        circle = f'cx="{x:g}" cy="{y:g}" r="{RADIUS:g}"'
        corner, side = disc.middle - RADIUS - MAP_EDGE, 2.0 * (RADIUS + MAP_EDGE)
        parts = [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{corner[0]:g} {corner[1]:g} '
            f'{side:g} {side:g}" role="img" aria-label="Half {number + 1} of the Gauss map">',
            f'<clipPath id="disc{number}"><circle {circle}/></clipPath>',
            f'<g clip-path="url(#disc{number})" stroke="{INK}" stroke-width="0.7">',
        ]
        for row, rings in zip(rows, outlines, strict=True):
            if rings:
                parts.append(
                    f'<path fill="{colors[row]}" fill-rule="evenodd" d="{svg_path(rings)}"/>'
                )
        parts.append(f'</g><circle {circle} fill="none" stroke="{INK}" stroke-width="1.1"/>')
        for row, normal, probability in zip(rows, poses.normals, poses.probabilities, strict=True):
            if probability < MIN_LABEL_PROBABILITY or disc.heights(normal) <= 0.0:
                continue
            px, py = disc.to_paper(disc.project(normal))
            py += 0.36 * MAP_LABEL_SIZE
            parts.append(
                f'<text x="{px:.1f}" y="{py:.1f}" font-size="{MAP_LABEL_SIZE}" '
                f'font-weight="700" text-anchor="middle" fill="{text_color(colors[row])}">'
                f"{escape(viewed.rows[row].label)}</text>"
            )
        figures.append("".join([*parts, "</svg>"]))
    return "".join(figures)
