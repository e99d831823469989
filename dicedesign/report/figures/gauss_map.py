"""The Morse-Smale complex of a body over its Gauss map."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import even_directions
from dicedesign.report.charts.chart import draw_legend
from dicedesign.report.charts.hemispheres import Disc, choose_axis, great_arcs, opposite_discs
from dicedesign.report.charts.palette import BASINS, DARK, FAINT, rgb
from dicedesign.report.charts.paper import NOTE, Paper, Picture
from dicedesign.report.charts.series import Curve, Style
from dicedesign.report.charts.text_places import place_texts
from dicedesign.report.figures.figure import FIGURES, Figure
from dicedesign.rest.poses import RestPoses
from dicedesign.rest.prior import DensityPrior
from dicedesign.rest.tracing import slide
from dicedesign.runtime.arrays import Floats, Integers

if TYPE_CHECKING:
    from dicedesign.fabricate.die import FinishedDie

__all__ = [
    "MAP_SIZE",
    "PlacedDisc",
    "basin_of_directions",
    "complex_figure",
    "gauss_map_figure",
    "lowest_corners",
    "placed_discs",
]

Painter = Callable[[Floats, Integers], Picture]
"""From directions (p, p, 3) and the rests (p, p) they lead to, to a picture (p, p, 3) of them."""

_PIXELS: Final = 345

_ARC_PIECES: Final = 24

_MOST_HULL_EDGES: Final = 3000

_LEAST_WRITTEN: Final = 0.01

_DISC: Final = 690.0
"""Pixels of a disc's square, which is a little larger."""

MAP_SIZE: Final = (2.0 * _DISC + 60.0, _DISC + 195.0)
"""Pixels across and down of the figure."""

_MARGIN: Final = 1.02

_RIM_TOLERANCE: Final = 1e-9

_CHUNK: Final = 20_000

_ARCS: Final = Curve([], [], Style(FAINT, width=1.0), "hull arcs")

_SEPARATRICES: Final = Curve([], [], Style(DARK, width=3.3), "separatrices")

_PATHS: Final = Curve([], [], Style("#d6006e", width=2.2), "paths")

_START: Final = 4.5
"""Radius of the dot at a path's start."""

_POINTS: Final = {
    "maxima": Style("white", "", marker="^", size=6.0, edge=DARK),
    "saddles": Style("white", "", marker="D", size=4.5, edge=DARK),
    "minima": Style(DARK, "", marker="o", size=5.0),
}
"""By attributes of the complex."""

_AREAS_ARE_ODDS: Final = "Equal-area projection: areas on paper are probabilities."

_UNDER_A_PRIOR: Final = "Equal-area projection: the stronger a color, the likelier at first."

_SAMPLED: Final = "Equal-area projection; the odds are those of the samples."

_PALEST: Final = 0.15
"""Strength of the color of directions that a prior leaves out."""

_PRIOR_SAMPLES: Final = 40_000

_NAMES: Final = {"minima": "minima (rests)"}


@dataclass(frozen=True, eq=False)
class PlacedDisc:
    """A hemisphere on paper.

    Attributes
    ----------
    disc: the hemisphere; axis: (3,) short integer direction of its centre.
    middle: (2,) pixels of its centre; radius: in pixels.
    """

    disc: Disc
    axis: tuple[int, int, int]
    middle: Floats
    radius: float

    def on_paper(self, points: Floats) -> Floats:
        """Pixels (..., 2), the second downward, of points (..., 2) of the disc of radius 1."""
        return self.middle + self.radius * points * [1.0, -1.0]


def placed_discs(poses: RestPoses) -> tuple[PlacedDisc, PlacedDisc]:
    """The two hemispheres of the figure of a body, where the figure has them."""
    weighty = poses.probabilities >= min(_LEAST_WRITTEN, poses.probabilities[0])
    x, y, z = choose_axis(poses.normals[weighty])
    one, other = opposite_discs((x, y, z))
    height, radius = 60.0 + _DISC / 2.0, _DISC / (2.0 * _MARGIN)
    left, right = 15.0 + _DISC / 2.0, 45.0 + 1.5 * _DISC
    return (
        PlacedDisc(one, (x, y, z), np.array([left, height]), radius),
        PlacedDisc(other, (-x, -y, -z), np.array([right, height]), radius),
    )


def gauss_map_figure(poses: RestPoses, labels: Sequence[str] | None = None) -> Paper:
    """Basins, separatrices and stationary points as two equal-area discs; under a prior with a
    density the colors are as strong as it is.

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
    colors, prior = rgb(BASINS), poses.prior
    largest, note = 1.0, _AREAS_ARE_ODDS
    if prior is not None:
        note = _UNDER_A_PRIOR if isinstance(prior, DensityPrior) else _SAMPLED
    if isinstance(prior, DensityPrior):
        largest = float(prior.density(even_directions(_PRIOR_SAMPLES)).max())

    def painted(directions: Floats, rests: Integers) -> Picture:
        full = colors[rests % len(colors)]
        if isinstance(prior, DensityPrior):
            density = prior.density(directions.reshape(-1, 3)).reshape(rests.shape)
            strength = _PALEST + (1.0 - _PALEST) * np.minimum(density / largest, 1.0)
            full = 1.0 - strength[..., None] * (1.0 - full)
        return np.rint(255.0 * full).astype(np.uint8)

    return complex_figure(poses, painted, note, labels)


def complex_figure(
    poses: RestPoses,
    painter: Painter,
    note: str,
    labels: Sequence[str] | None = None,
    paths: Sequence[Floats] = (),
) -> Paper:
    """Separatrices and stationary points over a picture of the sphere, as two equal-area discs.

    Parameters
    ----------
    painter: makes the picture; note: what is written below about it.
    paths: of bodies that roll, each (n, 3) unit directions that great arcs join, with a dot at its
        start.
    poses, labels: as of `gauss_map_figure`.
    """
    paper = Paper(*MAP_SIZE)
    for placed in placed_discs(poses):
        _draw_disc(paper, placed, poses, painter, labels, paths)
        side = ", ".join(f"{n:d}" for n in placed.axis)
        paper.text(f"seen from ({side}) of the body", (placed.middle[0], 46.0), anchor="md")
    shown = [] if len(poses.hull.tail) // 2 > _MOST_HULL_EDGES else [_ARCS]
    shown += [_SEPARATRICES, _PATHS] if paths else [_SEPARATRICES]
    shown += [Curve([], [], style, _NAMES.get(kind, kind)) for kind, style in _POINTS.items()]
    draw_legend(paper, shown, (paper.width / 2.0, _DISC + 80.0))
    upward = "+y" if placed.axis[:2] == (0, 0) else "+z"
    paper.text(
        f"Each point is a direction that points down in the body's frame. {note} "
        f"The body's {upward} is upward on both discs.",
        (paper.width / 2.0, _DISC + 160.0),
        size=NOTE,
    )
    return paper


def _draw_disc(
    paper: Paper,
    placed: PlacedDisc,
    poses: RestPoses,
    painter: Painter,
    labels: Sequence[str] | None,
    paths: Sequence[Floats],
) -> None:
    """Draw one hemisphere."""
    disc, middle, radius, on_paper = placed.disc, placed.middle, placed.radius, placed.on_paper
    pixels = disc.pixels(_PIXELS)
    regions = basin_of_directions(poses, pixels.reshape(-1, 3)).reshape(_PIXELS, _PIXELS)
    paper.backdrop(painter(pixels, regions)[::-1], middle - radius, 2.0 * radius)
    hull = poses.hull
    if len(hull.tail) // 2 <= _MOST_HULL_EDGES:
        edges = np.flatnonzero(np.arange(len(hull.tail)) < hull.twin)
        normals = hull.normals[hull.facet]
        arcs = great_arcs(normals[edges], normals[hull.twin[edges]], _ARC_PIECES)
        for line in disc.lines(arcs):
            _ARCS.style.trace(paper, on_paper(line))
    for path in poses.morse.polylines:
        for line in disc.lines(great_arcs(path[:-1], path[1:], _ARC_PIECES)):
            _SEPARATRICES.style.trace(paper, on_paper(line))
    for path in paths:
        for line in disc.lines(great_arcs(path[:-1], path[1:], _ARC_PIECES)):
            _PATHS.style.trace(paper, on_paper(line))
        if path[0] @ disc.axis >= 0.0:
            paper.disc(on_paper(disc.project(path[:1]))[0], _START, _PATHS.style.color)
    paper.ring(middle, radius, DARK, 2.0)
    for name, style in _POINTS.items():
        points = getattr(poses.morse, name)
        near = points[points @ disc.axis >= -_RIM_TOLERANCE]
        style.mark(paper, on_paper(disc.project(near)))
    here = poses.morse.minima @ disc.axis >= 0.0
    written = np.flatnonzero(here & (poses.probabilities > _LEAST_WRITTEN)).tolist()
    texts = [f"{100.0 * poses.probabilities[rest]:.1f} %" for rest in written]
    if labels is not None:
        texts = [
            f"{labels[rest]}\n{text}" if labels[rest] else text
            for rest, text in zip(written, texts, strict=True)
        ]
    stationary = np.concatenate([getattr(poses.morse, name) for name in _POINTS])
    places = place_texts(
        disc.project(poses.morse.minima[written]),
        texts,
        [regions == rest for rest in written],
        disc.project(stationary[stationary @ disc.axis >= 0.0]),
        NOTE / radius,
    )
    for text, place in zip(texts, on_paper(places), strict=True):
        paper.text(text, place, size=NOTE, halo=True)


def lowest_corners(hull: ConvexHull, directions: Floats) -> Integers:
    """(k,) corner of a hull that is lowest where directions (k, 3) point down."""
    lowest = np.empty(len(directions), dtype=np.int64)
    arms = hull.vertices - hull.centroid
    for start in range(0, len(directions), _CHUNK):
        part = directions[start : start + _CHUNK]
        lowest[start : start + _CHUNK] = np.argmax(part @ arms.T, axis=1)
    return lowest


def basin_of_directions(
    poses: RestPoses, directions: Floats, lowest: Integers | None = None
) -> Integers:
    """Index into `poses` of the rest reached from each direction.

    directions: (k, 3) unit vectors that point down in the body's frame; lowest: (k,) their
    `lowest_corners`, which do not depend on the center of mass, where they are known.
    Returns (k,).
    """
    equilibria = poses.morse.equilibria
    if lowest is None:
        lowest = lowest_corners(equilibria.hull, directions)
    rests = np.empty(len(directions), dtype=np.int64)
    for start in range(0, len(directions), _CHUNK):
        part = slice(start, start + _CHUNK)
        begun = lowest[part], directions[part], np.zeros(len(directions[part]))
        facets, _ = slide(equilibria, *begun)
        rests[part] = poses.morse.basin_of_facet[facets]
    return rests


def _draw(die: FinishedDie) -> bytes:
    labels = [facet.label or "" for facet in die.result.facets]
    return gauss_map_figure(die.plain.poses, labels).png()


FIGURES.register(
    Figure(
        name="gauss_map",
        line="directions of the die by the facet that it comes to rest on",
        rank=40,
        title="Where the die ends up",
        caption=(
            "Every point is a direction of the die that points down when it is let go; its colour "
            "tells on which facet the die comes to rest if it rolls there without momentum."
        ),
        wanted=lambda die: die.reshaped is None,
        draw=_draw,
    )
)
