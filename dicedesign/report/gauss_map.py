"""Figures of the Gauss map of a body: basins and separatrices, heights, and paths of rolls."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.artist import Artist
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, PathPatch
from matplotlib.path import Path
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import minimum_filter

from dicedesign.errors import InputError
from dicedesign.geometry.sphere import even_directions, norms
from dicedesign.palette import BLANK, DARK, FAINT, INK, outcome_colors, rgb, text_color
from dicedesign.report.discs import (
    LEAST_WRITTEN,
    MAP_TOP,
    Disc,
    basin_outlines,
    disc_radius,
    great_arcs,
    map_basins,
)
from dicedesign.report.paper import COLUMN_WIDTH, GAP, POINTS
from dicedesign.report.sheet import (
    BODY,
    LINE,
    NOTE,
    Sheet,
    fold,
    key_height,
    text_width,
    with_style,
)
from dicedesign.rest.poses import RestPoses
from dicedesign.rest.prior import DensityPrior
from dicedesign.rest.roll import RollStep, roll_steps
from dicedesign.runtime.arrays import Floats, Integers

Veil = Callable[[Floats], Floats]
"""Function from directions (p, p, 3) to red, green, blue and opacity (p, p, 4) from 0 to 1 of what
is drawn over the basins there."""

ARC_PIECES = 24
"""Straight pieces of a great arc."""

MAX_HULL_EDGES = 3000
"""Most edges of a hull whose arcs are drawn."""

PALEST = 0.15
"""Strength of the color of directions of density 0 under a prior."""

PATH_STARTS = 80
"""Number of paths if no directions are given."""

PATH_PALENESS = 0.55
"""Part of white in the colors of basins under paths."""

SCALE_ROOM = 16.0
"""Height of the scale of a color map, in points."""

LINES: dict[str, dict[str, Any]] = {
    "hull arcs": {"color": FAINT, "linewidth": 0.4},
    "separatrices": {"color": DARK, "linewidth": 1.1},
    "paths": {"color": "#d6006e", "linewidth": 0.8},
}
"""Styles of great arcs by their name in the legend."""

POINTS_ON_MAP: dict[str, dict[str, Any]] = {
    "maxima": {"marker": "^", "ms": 4.2, "mfc": "white"},
    "saddles": {"marker": "D", "ms": 3.2, "mfc": "white"},
    "minima": {"marker": "o", "ms": 3.2, "mfc": DARK},
}
"""Styles of stationary points by their attribute of the Morse-Smale complex."""

CLEARANCE = 3.8
"""Distance of a label from stationary points and from the border of its basin, in points."""


def gauss_map(
    poses: RestPoses,
    labels: Sequence[str] | None = None,
    outcome_of_rest: ArrayLike | None = None,
    *,
    width: float = COLUMN_WIDTH,
) -> Sheet:
    """Basins, separatrices and stationary points on two equal-area discs.

    Basins have the colors of their outcomes, which fade with the density of a prior. Labels and
    probabilities are written where they fit into a basin, others are in the legend; those of at
    most 1 % are left out. Hull arcs are left out for hulls of more than 3000 edges.

    Parameters
    ----------
    poses: k rests of a body.
    labels: texts of the outcomes, or None for the numbers of the rests, the most probable being 1.
    outcome_of_rest: (k,) number of the outcome of each rest, or -1 for none; None if each rest is
        an outcome.
    width: in inches.

    Raises
    ------
    InputError: there is no label for an outcome, or not one outcome for each rest.
    """
    count = len(poses.normals)
    outcomes = np.arange(count) if outcome_of_rest is None else np.asarray(outcome_of_rest)
    names = [str(k + 1) for k in range(count)] if labels is None else list(labels)
    if outcomes.shape != (count,) or not -1 <= outcomes.min() <= outcomes.max() < len(names):
        raise InputError(
            f"labels, outcome_of_rest: expected the outcome of each of the {count} rests, -1 or a "
            f"number below that of the labels, got {len(outcomes)} outcomes and {len(names)} "
            "labels; give each rest an outcome"
        )
    prior, veil = poses.prior, None
    note = "Equal-area projection: areas on paper are probabilities."
    if isinstance(prior, DensityPrior):
        note = "Equal-area projection: the stronger a color, the likelier at first."
        veil = _density_veil(prior)
    elif prior is not None:
        note = "Equal-area projection; the probabilities are those of the samples."
    colors = outcome_colors(len(names))
    return _map_sheet(MapFigure(poses, outcomes.tolist(), names, colors, note, width, veil))


def _density_veil(prior: DensityPrior) -> Veil:
    """White that is the thicker the smaller the density of a prior is."""
    largest = float(prior.density(even_directions(40_000)).max())

    def veil(directions: Floats) -> Floats:
        density = prior.density(directions.reshape(-1, 3)).reshape(directions.shape[:-1])
        white = np.ones((*density.shape, 4))
        white[..., 3] = (1.0 - PALEST) * (1.0 - np.minimum(density / largest, 1.0))
        return white

    return veil


@with_style
def heights(poses: RestPoses, *, width: float = COLUMN_WIDTH) -> Sheet:
    """Support function by color, with separatrices and stationary points, on two equal-area discs.

    It is lowest at the rests, and has creases on the arcs of the hull's edges. Source: figure 4 of
    the paper.

    width: in inches.
    """
    hull, center = poses.hull, poses.center_of_mass
    lowest = float(hull.heights(center).min())
    highest = float(norms(hull.vertices - center).max())

    def veil(directions: Floats) -> Floats:
        values = np.stack([(row @ (hull.vertices - center).T).max(-1) for row in directions])
        parts = (values - lowest) / max(highest - lowest, np.finfo(float).tiny)
        return np.asarray(colormaps["viridis"](parts))

    count = len(poses.normals)
    note = "Its color tells how high the center of mass then is."
    numbers = [str(k + 1) for k in range(count)]
    figure = MapFigure(
        poses, range(count), numbers, [BLANK] * count, note, width, veil, has_probabilities=False
    )
    sheet = Sheet(POINTS * width, figure.height + SCALE_ROOM)
    figure.draw(sheet)
    middle, row, half = sheet.width / 2.0, sheet.height - GAP - SCALE_ROOM / 2.0, sheet.width / 6.0
    scale = sheet.rectangle(middle - half, row - 3.0, middle + half, row + 3.0)
    scale.imshow(np.linspace(0.0, 1.0, 256)[None], cmap="viridis", aspect="auto")
    scale.axis("off")
    for value, side, end in ((lowest, -1.0, "right"), (highest, 1.0, "left")):
        sheet.write(f"{value:.4g}", (middle + side * (half + 4.0), row), size=NOTE, ha=end)
    return sheet


def paths(poses: RestPoses, downs: Floats | None = None, *, width: float = COLUMN_WIDTH) -> Sheet:
    """Paths of a rolling body over its Gauss map, on two equal-area discs.

    downs: (n, 3) directions that point down at first, of any length above 0; None for 80 all over
    the sphere; width: in inches. Source: figure 7 of the paper.

    Raises InputError: a direction is 0 or not finite.
    """
    return _map_sheet(paths_map(poses, downs, width))


def paths_map(poses: RestPoses, downs: Floats | None, width: float) -> MapFigure:
    """Figure of `paths`, to be drawn on a sheet."""
    downs = even_directions(PATH_STARTS) if downs is None else downs
    count = len(poses.normals)
    pale = 1.0 - (1.0 - PATH_PALENESS) * (1.0 - rgb(outcome_colors(count)))
    return MapFigure(
        poses,
        range(count),
        [str(k + 1) for k in range(count)],
        ["#" + bytes(color).hex() for color in np.rint(255.0 * pale).astype(np.uint8)],
        "A path leads from the release of a body, the dot, to its rest.",
        width,
        paths=[path_of(roll_steps(poses.morse.equilibria, down)) for down in downs],
        has_probabilities=False,
    )


def path_of(steps: Sequence[RollStep]) -> Floats:
    """Directions (n, 3) that point down in the steps of a roll."""
    return np.array([step.down for step in steps])


@with_style
def _map_sheet(figure: MapFigure) -> Sheet:
    """Sheet of a figure alone."""
    sheet = Sheet(POINTS * figure.width, figure.height)
    figure.draw(sheet)
    return sheet


@dataclass(frozen=True)
class Label:
    """Label of a rest.

    Attributes
    ----------
    rest: number of the rest.
    text: one or more lines.
    place: (2,) its middle on the disc of radius 1.
    """

    rest: int
    text: str
    place: Floats


class MapFigure:
    """Separatrices and stationary points over basins, on two equal-area discs, with a legend and a
    remark below.

    Parameters
    ----------
    poses: k rests of a body.
    outcomes: k numbers of the outcomes of the rests, or -1 for none.
    names, colors: of the outcomes.
    note: sentence about the colors.
    width: of the sheet, in inches.
    veil: what is drawn over the basins, or None.
    paths: paths of rolling bodies, each (n, 3) unit directions to join by great arcs; a dot marks
        each start.
    has_probabilities: whether probabilities are written too.
    """

    def __init__(
        self,
        poses: RestPoses,
        outcomes: Sequence[int],
        names: Sequence[str],
        colors: Sequence[str],
        note: str,
        width: float,
        veil: Veil | None = None,
        paths: Sequence[Floats] = (),
        *,
        has_probabilities: bool = True,
    ) -> None:
        self.poses, self.outcomes, self.width = poses, outcomes, width
        # Number -1 is the last one.
        self.names = [[*names, ""][k] for k in outcomes]
        self.colors = [[*colors, BLANK][k] for k in outcomes]
        self.veil, self.paths, self.has_probabilities = veil, paths, has_probabilities
        self.discs = basin_outlines(poses, width)
        self.lines = _great_arcs(poses, paths)
        upward = "+y" if self.discs[0][0].short[:2] == (0, 0) else "+z"
        self.note = fold(
            f"Each point is a direction that points down in the body's frame. {note} "
            f"The body's {upward} is upward on both discs.",
            POINTS * width - 2.0 * GAP,
            NOTE,
        )
        self.labels = [
            list(self._place_labels(disc, basins.rests))
            for (disc, _), basins in zip(self.discs, map_basins(poses), strict=True)
        ]
        self.keys = [*self._line_keys(), *self._rest_keys()]
        self.note_top = (
            MAP_TOP + 2.0 * disc_radius(width) + 2.0 * GAP + key_height(self.keys, POINTS * width)
        )
        self.height = self.note_top + LINE * NOTE * (self.note.count("\n") + 1) + GAP
        """Height of the figure, in points."""

    def draw(self, sheet: Sheet, top: float = 0.0) -> None:
        """Draw the figure below a height in points."""
        grids, shift = map_basins(self.poses), np.array([0.0, top])
        for (disc, outlines), grid, labels in zip(self.discs, grids, self.labels, strict=True):
            shifted = Disc(disc.short, disc.middle + shift, disc.radius)
            rings = [[ring + shift for ring in own] for own in outlines]
            self._draw_disc(sheet, shifted, rings, grid.directions, labels)
            side = ", ".join(map(str, disc.short))
            sheet.write(f"from ({side})", (disc.middle[0], top + MAP_TOP / 2.0), size=BODY)
        sheet.add_key(self.keys, top + MAP_TOP + 2.0 * disc_radius(self.width) + GAP)
        place = (sheet.width / 2.0, top + self.note_top)
        sheet.write(self.note, place, size=NOTE, va="top")

    def _line_keys(self) -> Iterator[Artist]:
        """Yield the entries of lines and points in the legend."""
        for name in self.lines:
            yield Line2D([], [], label=name, **LINES[name])
        for kind, style in POINTS_ON_MAP.items():
            name = "minima (rests)" if kind == "minima" else kind
            yield Line2D([], [], color=DARK, linestyle="", mew=0.7, label=name, **style)

    def _rest_keys(self) -> Iterator[Artist]:
        """Yield the entries of rests whose texts do not fit into their basins, by outcome."""
        written = {
            label.rest
            for disc_labels in self.labels
            for label in disc_labels
            if label.text == self._text(label.rest)
        }
        shown = np.flatnonzero(self.poses.probabilities > LEAST_WRITTEN).tolist()
        for rest in sorted(set(shown) - written, key=self._rank):
            text = self._text(rest).replace("\n", ": ")
            yield Patch(fc=self.colors[rest], ec=DARK, label=text)

    def _rank(self, rest: int) -> tuple[bool, int]:
        """Key that sorts rests by outcome, those of none last."""
        return self.outcomes[rest] < 0, self.outcomes[rest]

    def _text(self, rest: int) -> str:
        """Text of a rest, in one or two lines."""
        if not self.has_probabilities:
            return self.names[rest]
        return f"{self.names[rest]}\n{100.0 * self.poses.probabilities[rest]:.1f} %".strip()

    def _place_labels(self, disc: Disc, rests: Integers) -> Iterator[Label]:
        """Yield the labels that fit into their basins on a disc; without their probabilities where
        these do not. rests: (p, p) of its pixels."""
        morse, size = self.poses.morse, len(rests)
        centers = (2.0 * np.arange(size) + 1.0) / size - 1.0
        x, y = np.meshgrid(centers, centers)
        clearance = CLEARANCE / disc.radius
        is_free = np.hypot(x, y) < 1.0 - 0.5 * clearance
        for kind in POINTS_ON_MAP:
            for point in disc.project(_on_disc(disc, getattr(morse, kind))):
                is_free &= np.hypot(x - point[0], y - point[1]) > clearance
        shown = self.poses.probabilities > LEAST_WRITTEN
        for rest in np.flatnonzero(shown & (disc.heights(morse.minima) >= 0.0)).tolist():
            anchor, is_own = disc.project(morse.minima[rest]), is_free & (rests == rest)
            for text in dict.fromkeys((self._text(rest), self.names[rest])):
                place = place_text(text, anchor, is_own, disc.radius) if text else None
                if place is not None:
                    yield Label(rest, text, place)
                    break

    def _draw_disc(
        self,
        sheet: Sheet,
        disc: Disc,
        outlines: Sequence[Sequence[Floats]],
        directions: Floats,
        labels: Sequence[Label],
    ) -> None:
        """Draw a hemisphere. outlines: of the basins, on paper; directions: (p, p, 3) of pixels."""
        (x, y), axes = disc.middle, sheet.drawing
        rim = Circle((x, y), disc.radius, fill=False, edgecolor=DARK, linewidth=0.7, zorder=2.5)
        axes.add_patch(rim)
        for rings, color in zip(outlines, self.colors, strict=True):
            if rings:
                path = Path.make_compound_path(*(Path(ring, closed=True) for ring in rings))
                # An edge of its color leaves no gap between basins.
                basin = PathPatch(path, facecolor=color, edgecolor=color, linewidth=0.3)
                axes.add_patch(basin)
                basin.set_clip_path(rim)
        if self.veil is not None:
            reach = disc.radius
            axes.imshow(
                self.veil(directions)[::-1],
                extent=(x - reach, x + reach, y + reach, y - reach),
                interpolation="bilinear",
                aspect="auto",
                clip_path=rim,
                zorder=1.5,
            )
        for name, arcs in self.lines.items():
            # Arcs beyond the rim are not drawn; the rest are clipped.
            near = arcs[(disc.heights(arcs) > 0.0).any(axis=1)]
            near = np.where(disc.heights(near)[..., None] > -0.5, near, np.nan)
            drawn = LineCollection(
                list(disc.to_paper(disc.project(near))), capstyle="round", **LINES[name]
            )
            axes.add_collection(drawn, autolim=False)
            drawn.set_clip_path(rim)
        for kind, style in POINTS_ON_MAP.items():
            places = disc.to_paper(disc.project(_on_disc(disc, getattr(self.poses.morse, kind))))
            axes.plot(*places.T, linestyle="", mec=DARK, mew=0.7, zorder=3.0, **style)
        starts = _on_disc(disc, np.array([path[0] for path in self.paths]).reshape(-1, 3))
        color = LINES["paths"]["color"]
        axes.plot(*disc.to_paper(disc.project(starts)).T, "o", ms=3.0, color=color)
        for label in labels:
            # What is written over a veil or paths needs a ground of its own.
            is_plain = self.veil is None and not self.paths
            ground = {"boxstyle": "square,pad=0.1", "fc": "white", "ec": "none", "alpha": 0.85}
            sheet.write(
                label.text,
                disc.to_paper(label.place),
                size=NOTE,
                linespacing=1.1,
                color=text_color(self.colors[label.rest]) if is_plain else INK,
                bbox=None if is_plain else ground,
            )


def _great_arcs(poses: RestPoses, paths: Sequence[Floats]) -> dict[str, Floats]:
    """Great arcs (k, n, 3) of a map by the name of their style."""
    hull = poses.hull
    normals = hull.normals[hull.facet]
    edges = np.flatnonzero(np.arange(len(hull.tail)) < hull.twin)
    edges = edges[: len(edges) if len(edges) <= MAX_HULL_EDGES else 0]
    arcs = {
        "hull arcs": [great_arcs(normals[edges], normals[hull.twin[edges]], ARC_PIECES)],
        "separatrices": [great_arcs(p[:-1], p[1:], ARC_PIECES) for p in poses.morse.polylines],
        "paths": [great_arcs(path[:-1], path[1:], ARC_PIECES) for path in paths],
    }
    return {name: np.concatenate(own) for name, own in arcs.items() if sum(map(len, own))}


def _on_disc(disc: Disc, directions: Floats) -> Floats:
    """Those of directions (k, 3) that are on a disc."""
    return directions[disc.heights(directions) >= -1e-9]


def place_text(
    text: str, anchor: Floats, is_free: NDArray[np.bool_], radius: float
) -> Floats | None:
    """Middle (2,) of a text on the disc of radius 1, as near to its anchor as it fits; None if it
    does not.

    Parameters
    ----------
    text: one or more lines of size `NOTE`.
    anchor: (2,) point.
    is_free: (p, p) whether each pixel of the square [-1, 1]^2 may be covered, lowest row first.
    radius: of the disc, in points.
    """
    size = len(is_free)
    spans = (1.15 * NOTE * (text.count("\n") + 1), text_width(text, NOTE))
    # Odd numbers of pixels have a middle.
    rows, columns = (int(span / radius * size / 2.0) | 1 for span in spans)
    fits = minimum_filter(is_free.astype(np.uint8), (rows, columns), mode="constant")
    row, column = np.nonzero(fits)
    if len(row) == 0:
        return None
    places = (2.0 * np.stack([column, row], axis=1) + 1.0) / size - 1.0
    return np.asarray(places[norms(places - anchor).argmin()])
