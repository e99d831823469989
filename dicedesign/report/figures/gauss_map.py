"""The Morse-Smale complex of a body over its Gauss map.

Which rest a body reaches from given directions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from dicedesign.errors import InputError
from dicedesign.report.charts.hemispheres import Disc, choose_axis, great_arcs, opposite_discs
from dicedesign.report.charts.palette import BASINS, DARK, FAINT
from dicedesign.report.charts.png import agg_figure
from dicedesign.report.charts.text_places import place_texts
from dicedesign.rest.poses import RestPoses
from dicedesign.rest.tracing import slide

__all__ = ["basin_of_directions", "gauss_map_figure"]

_PIXELS: Final = 480

_ARC_PIECES: Final = 24

_MOST_HULL_EDGES: Final = 3000

_LEAST_WRITTEN: Final = 0.01

_FONT_SIZE: Final = 8.0

_DISC_INCHES: Final = 4.6

_RIM_TOLERANCE: Final = 1e-9


def gauss_map_figure(poses: RestPoses, labels: Sequence[str] | None = None) -> Figure:
    """Basins, separatrices and stationary points as two equal-area discs.

    Hull arcs are left out for hulls of more than 3000 edges. Rests of at most 1 % are not written
    at their minima.

    Parameters
    ----------
    poses: the rests of a body.
    labels: k texts written above the probabilities of the rests; empty ones are left out.

    Raises
    ------
    InputError: there is not one label for each rest.
    """
    if labels is not None and len(labels) != len(poses.normals):
        raise InputError(
            f"labels: expected one for each of the {len(poses.normals)} rests, got {len(labels)}; "
            "use an empty text for rests without one"
        )
    weighty = poses.probabilities >= min(_LEAST_WRITTEN, poses.probabilities[0])
    axis = choose_axis(poses.normals[weighty])
    figure = agg_figure(2 * _DISC_INCHES + 0.4, _DISC_INCHES + 1.3)
    height = figure.get_figheight()
    handles: dict[str, Any] = {}
    for column, disc in enumerate(opposite_discs(axis)):
        left = (0.1 + column * (_DISC_INCHES + 0.2)) / figure.get_figwidth()
        width = _DISC_INCHES / figure.get_figwidth()
        axes = figure.add_axes((left, 0.9 / height, width, _DISC_INCHES / height))
        handles |= _draw_disc(axes, disc, poses, labels)
        seen = ", ".join(f"{(1 - 2 * column) * n:d}" for n in axis)
        axes.set_title(f"seen from ({seen}) of the body", fontsize=10, color=DARK, pad=4)
    figure.legend(
        handles.values(),
        handles.keys(),
        loc="lower center",
        bbox_to_anchor=(0.5, 0.36 / height),
        ncols=len(handles),
        fontsize=9,
        frameon=False,
    )
    upward = "+y" if axis[:2] == (0, 0) else "+z"
    figure.text(
        0.5,
        0.16 / height,
        "Each point is a direction that points down in the body's frame. Equal-area projection: "
        f"areas on paper are probabilities. The body's {upward} is upward on both discs.",
        ha="center",
        fontsize=8,
        color=DARK,
    )
    return figure


def _draw_disc(
    axes: Axes, disc: Disc, poses: RestPoses, labels: Sequence[str] | None
) -> dict[str, Any]:
    """Draw one hemisphere; returns the entries of the legend."""
    axes.set(xlim=(-1.02, 1.02), ylim=(-1.02, 1.02), aspect="equal")
    axes.set_axis_off()
    rim = axes.add_patch(Circle((0, 0), 1, fill=False, edgecolor=DARK, linewidth=1.0, zorder=5))
    rests = basin_of_directions(poses, disc.pixels(_PIXELS).reshape(-1, 3))
    regions = rests.reshape(_PIXELS, _PIXELS)
    colors = np.array([to_rgb(color) for color in BASINS])[regions % len(BASINS)]
    image = axes.imshow(colors, extent=(-1, 1, -1, 1), origin="lower", zorder=0)
    image.set_clip_path(rim)
    handles: dict[str, Any] = {}
    hull = poses.hull
    if len(hull.tail) // 2 <= _MOST_HULL_EDGES:
        edges = np.flatnonzero(np.arange(len(hull.tail)) < hull.twin)
        normals = hull.normals[hull.facet]
        arcs = great_arcs(normals[edges], normals[hull.twin[edges]], _ARC_PIECES)
        grey = LineCollection(disc.lines(arcs), colors=FAINT, linewidths=0.5, zorder=2)
        handles["hull arcs"] = axes.add_collection(grey)
    segments = [great_arcs(a[:-1], a[1:], _ARC_PIECES) for a in poses.morse.polylines]
    paths = [part for arcs in segments for part in disc.lines(arcs)]
    bold = LineCollection(paths, colors=DARK, linewidths=1.6, capstyle="round", zorder=3)
    handles["separatrices"] = axes.add_collection(bold)
    for name, points, marker, size in (
        ("maxima", poses.morse.maxima, "^", 26),
        ("saddles", poses.morse.saddles, "D", 16),
        ("minima (rests)", poses.morse.minima, "o", 22),
    ):
        at = disc.project(points[points @ disc.axis >= -_RIM_TOLERANCE])
        handles[name] = axes.scatter(
            at[:, 0],
            at[:, 1],
            s=size,
            marker=marker,
            facecolors=DARK if marker == "o" else "white",
            edgecolors=DARK,
            linewidths=0.8,
            zorder=6,
            clip_on=False,
        )
    _write_rests(axes, disc, poses, labels, regions)
    return handles


def _write_rests(
    axes: Axes,
    disc: Disc,
    poses: RestPoses,
    labels: Sequence[str] | None,
    regions: NDArray[np.int64],
) -> None:
    """Write labels and probabilities at the minima of one hemisphere, whose pixels have the rests
    `regions`."""
    here = poses.morse.minima @ disc.axis >= 0.0
    rests = np.flatnonzero(here & (poses.probabilities > _LEAST_WRITTEN)).tolist()
    texts = [f"{100.0 * poses.probabilities[rest]:.1f} %" for rest in rests]
    if labels is not None:
        texts = [
            f"{labels[rest]}\n{text}" if labels[rest] else text
            for rest, text in zip(rests, texts, strict=True)
        ]
    markers = np.concatenate([poses.morse.minima, poses.morse.saddles, poses.morse.maxima])
    obstacles = disc.project(markers[markers @ disc.axis >= 0.0])
    anchors = disc.project(poses.morse.minima[rests])
    point = 2.04 / (72.0 * _DISC_INCHES)
    own = [regions == rest for rest in rests]
    places = place_texts(anchors, texts, own, obstacles, _FONT_SIZE * point)
    for text, (x, y) in zip(texts, places.tolist(), strict=True):
        axes.text(
            x,
            y,
            text,
            ha="center",
            va="center",
            fontsize=_FONT_SIZE,
            linespacing=1.1,
            color=DARK,
            parse_math=False,
            zorder=8,
            path_effects=[withStroke(linewidth=2.2, foreground="white")],
        )


_CHUNK = 20_000


def basin_of_directions(poses: RestPoses, directions: NDArray[np.float64]) -> NDArray[np.int64]:
    """Index into `poses` of the rest reached from each direction.

    directions: (k, 3) unit vectors that point down in the body's frame.
    Returns (k,).
    """
    equilibria = poses.morse.equilibria
    rests = np.empty(len(directions), dtype=np.int64)
    for start in range(0, len(directions), _CHUNK):
        part = directions[start : start + _CHUNK]
        lowest = np.argmax(part @ equilibria.radii.T, axis=1)
        facets, _ = slide(equilibria, lowest, part, np.zeros(len(part)))
        rests[start : start + _CHUNK] = poses.morse.basin_of_facet[facets]
    return rests
