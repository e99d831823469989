"""Figures of the Gauss map of a body: basins and separatrices, heights, and paths of rolls."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import colormaps
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Circle
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from dicedesign.errors import InputError
from dicedesign.geometry.sphere import even_directions, norms
from dicedesign.palette import BASINS, DARK, FAINT, rgb
from dicedesign.report.discs import (
    DISC_PIXELS,
    LEAST_WRITTEN,
    MAP_SIZE,
    RADIUS,
    Disc,
    great_arcs,
    map_basins,
)
from dicedesign.report.sheet import NOTE, Sheet, with_style
from dicedesign.rest.poses import RestPoses
from dicedesign.rest.prior import DensityPrior
from dicedesign.rest.roll import RollStep, roll_steps
from dicedesign.runtime.arrays import Floats, Integers

if TYPE_CHECKING:
    from dicedesign.fabricate.die import FinishedDie

Painter = Callable[[Floats, Integers], Floats]
"""Function from directions (p, p, 3), and the rests (p, p) reached from them, to colors (p, p, 3)
from 0 to 1."""

ARC_PIECES = 24
"""Straight pieces of a great arc."""

MAX_HULL_EDGES = 3000
"""Most edges of a hull whose arcs are drawn."""

PALEST = 0.15
"""Strength of the color of directions of density 0 under a prior."""

PATH_STARTS = 80
"""Number of paths if no directions are given."""

LINES: dict[str, dict[str, Any]] = {
    "hull arcs": {"color": FAINT, "linewidth": 1.0},
    "separatrices": {"color": DARK, "linewidth": 3.3},
    "paths": {"color": "#d6006e", "linewidth": 2.2},
}
"""Styles of great arcs by their name in the legend."""

POINTS: dict[str, dict[str, Any]] = {
    "maxima": {"marker": "^", "ms": 12.0, "mfc": "white"},
    "saddles": {"marker": "D", "ms": 9.0, "mfc": "white"},
    "minima": {"marker": "o", "ms": 9.0, "mfc": DARK},
}
"""Styles of stationary points by their attribute of the Morse-Smale complex."""


def gauss_map(die: FinishedDie) -> Sheet:
    """Gauss map of a die with the labels of its rests."""
    labels = [facet.label or "" for facet in die.result.facets]
    return gauss_map_figure(die.plain.poses, labels)


def gauss_map_figure(poses: RestPoses, labels: Sequence[str] | None = None) -> Sheet:
    """Basins, separatrices and stationary points on two equal-area discs.

    Colors fade with the density of a prior. Hull arcs are left out for hulls of more than 3000
    edges. Probabilities of at most 1 % are not written.

    Parameters
    ----------
    poses: rests of a body.
    labels: k texts above the probabilities of the rests; empty ones are left out.

    Raises
    ------
    InputError: there is not one label for each rest.
    """
    if labels is not None and len(labels) != len(poses.normals):
        raise InputError(
            f"labels: expected one for each of the {len(poses.normals)} rests, got {len(labels)}; "
            "use an empty text for rests without one"
        )
    prior, note = poses.prior, "Equal-area projection: areas on paper are probabilities."
    if isinstance(prior, DensityPrior):
        note = "Equal-area projection: the stronger a color, the likelier at first."
        largest = float(prior.density(even_directions(40_000)).max())
    elif prior is not None:
        note = "Equal-area projection; the probabilities are those of the samples."

    def paint(directions: Floats, rests: Integers) -> Floats:
        full = rgb(BASINS)[rests % len(BASINS)]
        if not isinstance(prior, DensityPrior):
            return full
        density = prior.density(directions.reshape(-1, 3)).reshape(rests.shape)
        strength = PALEST + (1.0 - PALEST) * np.minimum(density / largest, 1.0)
        return np.asarray(1.0 - strength[..., None] * (1.0 - full))

    return complex_figure(poses, paint, note, labels)


@with_style
def heights_figure(poses: RestPoses) -> Sheet:
    """Support function by color, with separatrices and stationary points, on two equal-area discs.

    It is lowest at the rests, and has creases on the arcs of the hull's edges. Source: figure 4 of
    the paper.
    """
    hull, center = poses.hull, poses.center_of_mass
    lowest = float(hull.heights(center).min())
    highest = float(norms(hull.vertices - center).max())

    def paint(directions: Floats, rests: Integers) -> Floats:
        heights = np.stack([(row @ (hull.vertices - center).T).max(-1) for row in directions])
        parts = (heights - lowest) / max(highest - lowest, np.finfo(float).tiny)
        return colormaps["viridis"](parts)[..., :3]

    sheet = complex_figure(poses, paint, "Its color tells how high the center of mass then is.")
    middle, middle_row = sheet.width / 2.0, sheet.height - 69.0
    scale = sheet.axes(middle - 130.0, middle_row - 8.0, middle + 130.0, middle_row + 8.0)
    scale.imshow(np.linspace(0.0, 1.0, 260)[None], cmap="viridis", aspect="auto")
    scale.axis("off")
    for value, side, end in ((lowest, -1.0, "right"), (highest, 1.0, "left")):
        sheet.text(f"{value:.4g}", (middle + side * 140.0, middle_row), size=NOTE, ha=end)
    return sheet


def paths_figure(poses: RestPoses, downs: Floats | None = None) -> Sheet:
    """Paths of a rolling body over its Gauss map, on two equal-area discs.

    downs: (n, 3) directions that point down at first, of any length above 0; None for 80 all over
    the sphere. Source: figure 7 of the paper. Raises InputError: a direction is 0 or not finite.
    """
    equilibria = poses.morse.equilibria
    downs = even_directions(PATH_STARTS) if downs is None else downs
    paths = [path_of(roll_steps(equilibria, down)) for down in downs]
    colors = 0.55 + 0.45 * rgb(BASINS)
    note = "A path leads from the release of a body, the dot, to its rest."
    return complex_figure(
        poses, lambda directions, rests: colors[rests % len(colors)], note, paths=paths
    )


def path_of(steps: Sequence[RollStep]) -> Floats:
    """Directions (n, 3) that point down in the steps of a roll."""
    return np.array([step.down for step in steps])


@with_style
def complex_figure(
    poses: RestPoses,
    painter: Painter,
    note: str,
    labels: Sequence[str] | None = None,
    paths: Sequence[Floats] = (),
) -> Sheet:
    """Separatrices and stationary points over a picture of the sphere, on two equal-area discs.

    Parameters
    ----------
    poses, labels: as in `gauss_map_figure`.
    painter: makes the picture; note: sentence about it, written below.
    paths: paths of rolling bodies, each (n, 3) unit directions to join by great arcs; a dot marks
        each start.
    """
    sheet, hull = Sheet(*MAP_SIZE), poses.hull
    normals = hull.normals[hull.facet]
    edges = np.flatnonzero(np.arange(len(hull.tail)) < hull.twin)
    edges = edges[: len(edges) if len(edges) <= MAX_HULL_EDGES else 0]
    arcs = {
        "hull arcs": [great_arcs(normals[edges], normals[hull.twin[edges]], ARC_PIECES)],
        "separatrices": [great_arcs(p[:-1], p[1:], ARC_PIECES) for p in poses.morse.polylines],
        "paths": [great_arcs(path[:-1], path[1:], ARC_PIECES) for path in paths],
    }
    lines = {name: np.concatenate(own) for name, own in arcs.items() if sum(map(len, own))}
    for disc, directions, regions in map_basins(poses):
        ground = painter(directions, regions)
        _draw_disc(sheet, disc, poses, ground, regions, labels, lines)
        starts = np.array([path[0] for path in paths]).reshape(-1, 3)
        starts = disc.project(starts[disc.heights(starts) >= 0.0])
        sheet.drawing.plot(*disc.to_paper(starts).T, "o", ms=9.0, color=LINES["paths"]["color"])
        side = ", ".join(map(str, disc.short))
        place = (disc.middle[0], 46.0)
        sheet.text(f"seen from ({side}) of the body", place, va="bottom")
    keys = [Line2D([], [], label=name, **LINES[name]) for name in lines]
    for kind, style in POINTS.items():
        name = "minima (rests)" if kind == "minima" else kind
        keys.append(Line2D([], [], color=DARK, linestyle="", mew=2.0, label=name, **style))
    place = (0.5, 1.0 - (DISC_PIXELS + 86.0) / sheet.height)
    sheet.figure.legend(handles=keys, loc="upper center", bbox_to_anchor=place, ncols=len(keys))
    upward = "+y" if disc.short[:2] == (0, 0) else "+z"
    sheet.text(
        f"Each point is a direction that points down in the body's frame. {note} "
        f"The body's {upward} is upward on both discs.",
        (sheet.width / 2.0, DISC_PIXELS + 160.0),
        size=NOTE,
    )
    return sheet


def _draw_disc(
    sheet: Sheet,
    disc: Disc,
    poses: RestPoses,
    ground: Floats,
    regions: Integers,
    labels: Sequence[str] | None,
    lines: dict[str, Floats],
) -> None:
    """Draw a hemisphere.

    ground: (p, p, 3) colors of its pixels, lowest row first; regions: (p, p) their rests; lines:
    great arcs (k, n, 3) by the name of their style.
    """
    (x, y), axes, morse = disc.middle, sheet.drawing, poses.morse
    rim = Circle((x, y), RADIUS, fill=False, edgecolor=DARK, linewidth=2.0)
    axes.add_patch(rim)
    square = (x - RADIUS, x + RADIUS, y + RADIUS, y - RADIUS)
    pixels = np.rint(255.0 * ground[::-1]).astype(np.uint8)
    axes.imshow(pixels, extent=square, interpolation="nearest", aspect="auto", clip_path=rim)
    for name, arcs in lines.items():
        # Arcs beyond the rim are not drawn; the rest are clipped.
        near = arcs[(disc.heights(arcs) > 0.0).any(axis=1)]
        near = np.where(disc.heights(near)[..., None] > -0.5, near, np.nan)
        drawn = LineCollection(
            list(disc.to_paper(disc.project(near))), capstyle="round", **LINES[name]
        )
        axes.add_collection(drawn, autolim=False)
        drawn.set_clip_path(rim)
    stationary = []
    for name, style in POINTS.items():
        points = getattr(morse, name)
        stationary.append(disc.project(points[disc.heights(points) >= -1e-9]))
        on_paper = disc.to_paper(stationary[-1]).T
        axes.plot(*on_paper, linestyle="", mec=DARK, mew=2.0, zorder=3.0, **style)
    is_on_disc = disc.heights(morse.minima) >= 0.0
    written = np.flatnonzero(is_on_disc & (poses.probabilities > LEAST_WRITTEN)).tolist()
    texts = [f"{100.0 * poses.probabilities[rest]:.1f} %" for rest in written]
    if labels is not None:
        texts = [f"{labels[k]}\n{text}".strip() for k, text in zip(written, texts, strict=True)]
    places = place_texts(
        disc.project(morse.minima[written]),
        texts,
        [regions == rest for rest in written],
        np.concatenate(stationary),
        NOTE / RADIUS,
    )
    halo = [withStroke(linewidth=4.0, foreground="white")]
    for text, place in zip(texts, disc.to_paper(places), strict=True):
        sheet.text(text, place, size=NOTE, path_effects=halo)


def place_texts(
    anchors: Floats,
    texts: Sequence[str],
    regions: Sequence[NDArray[np.bool_]],
    obstacles: Floats,
    font_size: float,
) -> Floats:
    """Centers (k, 2) of texts beside their anchors.

    Each text in turn takes the place of least cost: near its anchor, off the obstacles and earlier
    texts, and preferably above the anchor, in its region, and on the unit disc.

    Parameters
    ----------
    anchors: (k, 2) points on paper.
    texts: k texts of one or more lines.
    regions: k masks (size, size) of the square [-1, 1]^2, lowest row first.
    obstacles: (m, 2) points to keep visible.
    font_size: font size in the unit of the points.
    """
    letter_width, line_height, gaps = 0.62, 1.25, (0.55, 1.0, 1.6, 2.3)
    inner = np.array([(x, y) for x in (-0.9, -0.3, 0.3, 0.9) for y in (-0.8, 0.0, 0.8)])
    turns = 2.0 * np.pi * np.arange(16) / 16
    around = np.stack([np.sin(turns), np.cos(turns)], axis=1)
    placed: list[tuple[Floats, Floats]] = []
    for anchor, text, region in zip(anchors, texts, regions, strict=True):
        lines = text.splitlines()
        letters = max(map(len, lines))
        half = 0.5 * font_size * np.array([letter_width * letters, line_height * len(lines)])
        reach = np.concatenate([around * (half + gap * font_size) for gap in gaps])
        centers = anchor + reach
        cost = np.linalg.norm(reach, axis=1) + 0.2 * font_size * np.tile(turns > 0, len(gaps))
        hidden = np.abs(centers[:, None] - obstacles) < half + 0.3 * font_size
        cost += font_size * 3.0 * hidden.all(-1).sum(1)
        samples = centers[:, None] + half * inner
        column, row = ((samples + 1.0) / 2.0 * len(region)).astype(int).clip(0, len(region) - 1).T
        cost += font_size * 2.5 * (~region[row, column]).mean(axis=0)
        for center, other in placed:
            overlap = (half + other - np.abs(centers - center)).clip(0.0)
            cost += 30.0 * overlap.prod(1) / font_size + font_size * (overlap > 0).all(1)
        cost += 10.0 * (np.linalg.norm(np.abs(centers) + half, axis=1) - 1.0).clip(0.0)
        placed.append((centers[int(np.argmin(cost))], half))
    return np.array([center for center, _ in placed]).reshape(-1, 2)
