"""A die from several sides, and each of its labels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.figure import Figure

from dicedesign.errors import InputError
from dicedesign.report.charts.picture_grid import picture_grid
from dicedesign.report.render.flat_renderer import render_view
from dicedesign.report.render.raster import Camera
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["die_views_figure", "facet_views_figure"]

_SIDES: Final[tuple[tuple[str, tuple[int, int, int]], ...]] = (
    ("from +x", (1, 0, 0)),
    ("from +y", (0, 1, 0)),
    ("from +z", (0, 0, 1)),
    ("from (1, 1, 1)", (1, 1, 1)),
    ("from -x", (-1, 0, 0)),
    ("from -y", (0, -1, 0)),
    ("from -z", (0, 0, -1)),
    ("from (-1, -1, -1)", (-1, -1, -1)),
)

_BODY_PIXELS: Final = 400

_FACET_PIXELS: Final = 240

_FACET_COLUMNS: Final = 6

_FACET_FRAME: Final = 1.15

_PLANE_TOLERANCE: Final = 1e-4


def die_views_figure(vertices: Floats, triangles: Integers) -> Figure:
    """A solid from six sides and two corners, all at one scale.

    The body's z is upward; seen from +z and -z it is y.

    vertices: (n, 3) in any length unit; triangles: (t, 3).
    """
    center = (vertices.min(axis=0) + vertices.max(axis=0)) / 2.0
    radius = 1.03 * float(np.linalg.norm(vertices - center, axis=1).max())
    pictures = []
    for _, side in _SIDES:
        direction = np.array(side, dtype=np.float64)
        up = np.array([0.0, 1.0, 0.0] if side[:2] == (0, 0) else [0.0, 0.0, 1.0])
        camera = Camera(direction, up, center, radius)
        pictures.append(render_view(vertices, triangles, camera, _BODY_PIXELS))
    return picture_grid(pictures, [title for title, _ in _SIDES], 4)


def facet_views_figure(
    vertices: Floats,
    triangles: Integers,
    normals: Floats,
    ups: Floats,
    titles: Sequence[str],
) -> Figure:
    """Each facet of a solid seen straight from outside, filling its picture.

    Parameters
    ----------
    vertices: (n, 3) in any length unit, corners of the facets among them.
    triangles: (t, 3).
    normals: (k, 3) outward normals of the facets to show; k at least 1.
    ups: (k, 3) directions upward on the pictures; not parallel to the normals.
    titles: k texts.

    Raises
    ------
    InputError: there is no facet, or not one normal, up and title for each.
    """
    if not 0 < len(normals) == len(ups) == len(titles):
        raise InputError(
            "facets: expected at least one, with one normal, one up direction and one title each, "
            f"got {len(normals)} normals, {len(ups)} up directions and {len(titles)} titles"
        )
    extent = float(np.ptp(vertices, axis=0).max())
    pictures = []
    for normal, up in zip(normals, ups, strict=True):
        heights = vertices @ (normal / np.linalg.norm(normal))
        facet = vertices[heights >= heights.max() - _PLANE_TOLERANCE * extent]
        frame = Camera(normal, up, facet[0], 1.0).frame()
        low, high = (facet @ frame.T).min(axis=0), (facet @ frame.T).max(axis=0)
        half_width = _FACET_FRAME * float((high - low).max()) / 2.0
        camera = Camera(normal, up, (low + high) / 2.0 @ frame, half_width)
        pictures.append(render_view(vertices, triangles, camera, _FACET_PIXELS))
    return picture_grid(pictures, titles, min(_FACET_COLUMNS, len(pictures)))
