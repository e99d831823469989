"""A die in the colors of its outcomes, as it is read: on top, or underneath."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from dicedesign.fabricate.file_formats import Part
from dicedesign.geometry.meshes.body import shells_of
from dicedesign.geometry.sphere import norms, unit_vectors
from dicedesign.geometry.triangles import Surface, doubled_area_vectors, join_surfaces
from dicedesign.palette import BLANK, INK, outcome_colors, rgb, text_color
from dicedesign.report.raster import Camera, encode_webp, frame_cameras, tilt_up
from dicedesign.report.renderer import RenderMesh, render_clear, render_shadow, with_shadow
from dicedesign.results.parts import READINGS
from dicedesign.results.result import Result
from dicedesign.runtime.arrays import Booleans, Floats, Integers, sums_by_index

PAIRS_AT_ONCE = 2_000_000
"""Number of pairs of a triangle and a facet that are compared at a time, to limit memory."""

FLUSH_DEPTH = 0.02
"""Largest depth of a flat triangle below the plane of its facet, over the size of the die: finished
facets were moved a little."""

FLUSH_COSINE = 0.999
"""Cosine of the largest angle between the normals of a triangle and of its facet."""

TOUCHING_HEIGHT = 3e-3
"""Height above the table up to which a concave die touches it, over its largest extent."""

TOUCHING_COSINE = 0.9
"""Cosine of the largest slope of the surface where it touches the table."""

SLIVER = 1e-9
"""Area of a piece of a triangle that is left out, over the squared size of the die."""

READ_ABOVE, STAND_ABOVE = 50.0, 20.0
"""Elevations of the camera in degrees, of a die with labels and of one without."""

READ_ASIDE = 28.0
"""Angle of the camera from the direction in which a label is upright, in degrees."""

LEVEL_LENGTH = 1e-3
"""Length of the level part of an upright unit direction below which it says nothing."""

MIN_PIXELS = 560
"""Smallest side of a rendered picture: outlines would be thick on smaller ones."""

SHADOW = 0.55
"""Opacity of the darkest shadow, relative to the one on white paper."""


def reading_way(result: Result) -> str:
    """Way to read a die, see `READINGS`; "down" without labels."""
    sentence = None if result.engraved is None else result.engraved.reading
    return next((way for way, text in READINGS.items() if text == sentence), "down")


def reading_sides(result: Result) -> Floats:
    """Unit normals (k, 3) of the sides that are read, for each rest: down or up."""
    normals = np.array([facet.normal for facet in result.facets])
    if result.concave is None and reading_way(result) == "down":
        return normals
    return -normals


def main_rest(result: Result) -> int:
    """Number of the rest in pictures: of the first of the most probable outcomes that have one."""
    outcomes = [facet.outcome for facet in result.facets]
    targets = dict(zip(result.labels, result.target, strict=True))
    known = [label for label in result.labels if label in outcomes]
    return outcomes.index(max(known, key=targets.__getitem__)) if known else 0


def color_parts(parts: Sequence[Part], result: Result) -> list[Part]:
    """Parts of a printed die, divided by the rest whose outcome they show.

    Names are "facet-0" for the most probable rest and so on, "labels-0" for its labels, and "body"
    and "labels" for triangles that show none. Facets with labels of several outcomes, around a
    corner or beside an edge, are cut between them.

    parts: of the file, the body first; others are inlays.
    """
    colored, whole = [], np.concatenate([part.points for part in parts])
    colors = dict(zip(result.labels, outcome_colors(len(result.labels)), strict=True))
    for part in parts:
        labels = part.labels
        if labels is None:
            labels = np.full(len(part.triangles), part is not parts[0])
        points, triangles, parents = _cut(part, labels, result, whole)
        labels = labels[parents]
        rests = shown_rests(Surface(points, triangles), labels, result, whole)
        for rest in np.unique(rests).tolist():
            outcome = None if rest < 0 else result.facets[rest].outcome
            color = BLANK if outcome is None else colors[outcome]
            label_color = INK if result.concave is not None else text_color(color)
            for is_label in (False, True):
                own = triangles[(rests == rest) & (labels == is_label)]
                if len(own) == 0:
                    continue
                name = "labels" if is_label else "facet" if rest >= 0 else "body"
                used, corners = np.unique(own, return_inverse=True)
                colored.append(
                    Part(
                        points[used],
                        corners.reshape(-1, 3),
                        name if rest < 0 else f"{name}-{rest}",
                        label_color if is_label else color,
                    )
                )
    return colored


def shown_rests(surface: Surface, labels: Booleans, result: Result, whole: Floats) -> Integers:
    """Rest (t,) whose outcome a triangle of a printed die shows, or -1 for rounded edges and sides
    that show none.

    On a convex die these are the facets that are read. Of a concave die they are the places that
    touch the table, and its labels.

    labels: (t,) whether a triangle belongs to a label. whole: (n, 3) points of the whole die.
    """
    normals, way = np.array([facet.normal for facet in result.facets]), reading_way(result)
    rests = np.arange(len(normals))
    sides, owners = {
        "up": (-normals, rests),
        "both": (np.concatenate([normals, -normals]), np.tile(rests, 2)),
    }.get(way, (normals, rests))
    middles = surface.points[surface.triangles].mean(axis=1)
    support = np.array([(whole @ side).max() for side in sides])
    count = 1 + len(middles) * len(sides) // PAIRS_AT_ONCE
    nearest = np.concatenate(
        [np.argmin(support - each @ sides.T, axis=1) for each in np.array_split(middles, count)]
    )
    down, areas = sides[nearest], doubled_area_vectors(surface.points, surface.triangles)
    depths = support[nearest] - (middles * down).sum(axis=1)
    is_flat = result.concave is None
    cosine = FLUSH_COSINE if is_flat else TOUCHING_COSINE
    deepest = (FLUSH_DEPTH if is_flat else TOUCHING_HEIGHT) * np.ptp(whole, axis=0).max()
    flush = ((areas * down).sum(axis=1) >= cosine * norms(areas)) & (depths <= deepest)
    shown = np.where(flush | (labels & is_flat), owners[nearest], -1)
    if way in ("corner", "edge"):
        on_top = np.argmax(_heights(middles, whole, normals), axis=1)
        shown = np.where(shown >= 0, on_top, shown)
    elif way == "marks":
        # The floors of a mark face upward.
        marks = shells_of(surface.triangles[labels])
        facing = sums_by_index(marks, areas[labels], int(marks.max(initial=-1)) + 1)
        shown[labels] = np.argmin(facing @ normals.T, axis=1)[marks]
    return shown


def _heights(places: Floats, whole: Floats, normals: Floats) -> Floats:
    """Heights (p, k) of places (p, 3) above the table in each rest, over the height of the die."""
    reach = whole @ normals.T
    high, low = reach.max(axis=0), reach.min(axis=0)
    return np.asarray((high - places @ normals.T) / (high - low))


def _cut(
    part: Part, labels: Booleans, result: Result, whole: Floats
) -> tuple[Floats, Integers, Integers]:
    """Points (n, 3) and triangles (t, 3) of a part, cut where one outcome's region of a facet ends
    and another's begins, and the triangle (t,) of the part that each comes from."""
    points, triangles = part.points, part.triangles
    parents = np.arange(len(triangles))
    if reading_way(result) not in ("corner", "edge"):
        return points, triangles, parents
    normals = np.array([facet.normal for facet in result.facets])
    flat = (shown_rests(part, labels, result, whole) >= 0) & ~labels
    for one, other in combinations(range(len(normals)), 2):
        heights = _heights(points, whole, normals)
        rise = heights[:, one] - heights[:, other]
        top = heights.argmax(axis=1)
        near = np.isin(top[triangles], (one, other)).any(axis=1) & flat[parents]
        extent = rise[triangles]
        crossed = near & (extent.min(axis=1) < -1e-6) & (extent.max(axis=1) > 1e-6)
        points, pieces, sources = _cut_triangles(points, triangles[crossed], rise)
        wide = norms(doubled_area_vectors(points, pieces)) > SLIVER * np.ptp(whole) ** 2
        pieces, sources = pieces[wide], sources[wide]
        triangles = np.concatenate([triangles[~crossed], pieces])
        parents = np.concatenate([parents[~crossed], parents[crossed][sources]])
    return points, triangles, parents


def _cut_triangles(
    points: Floats, triangles: Integers, values: Floats
) -> tuple[Floats, Integers, Integers]:
    """Cut triangles (t, 3) along the line where values (n,) of their corners change sign.

    Returns all points, the new triangles (3 t, 3), and the triangle (3 t,) that each comes from.
    """
    above = values[triangles] > 0.0
    # The corner that is alone on its side comes first.
    alone = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), above.argmin(axis=1))
    places = (alone[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(triangles, places, axis=1).T
    cuts = []
    for end in (b, c):
        share = values[a] / (values[a] - values[end])
        cuts.append(points[a] + share[:, None] * (points[end] - points[a]))
    d = len(points) + np.arange(len(a))
    e = d + len(a)
    pieces = np.concatenate([np.stack(three, 1) for three in ((a, d, e), (d, b, c), (d, c, e))])
    return np.concatenate([points, *cuts]), pieces, np.tile(np.arange(len(a)), 3)


def colored_mesh(parts: Sequence[Part], *, is_smooth: bool) -> RenderMesh:
    """Mesh to draw of parts by `color_parts`."""
    whole = join_surfaces(*parts)
    colors = rgb([part.color for part in parts]).repeat(
        [len(part.points) for part in parts], axis=0
    )
    return RenderMesh(whole.points, whole.triangles, colors, smooth=is_smooth)


@dataclass(frozen=True, eq=False)
class ReadingView:
    """Viewpoint from which the outcome of a rest is read.

    Attributes
    ----------
    side: (3,) unit direction that is upward in the picture: the side that is read.
    level: (3,) unit direction from the die to the viewer, across `side`.
    above_deg: elevation of the viewer above `level`.
    """

    side: Floats
    level: Floats
    above_deg: float

    @property
    def camera(self) -> Camera:
        """Camera toward the origin, at scale 1."""
        return Camera(tilt_up(self.level, self.side, self.above_deg), self.side)


def reading_views(result: Result) -> list[ReadingView]:
    """Viewpoints for each rest. Labels are upright, a little aside; where there are none, the die's
    y is away from the viewer."""
    above = READ_ABOVE
    if result.concave is not None and reading_way(result) == "down":
        above = STAND_ABOVE
    views, turn = [], np.radians(READ_ASIDE)
    for side, facet in zip(reading_sides(result), result.facets, strict=True):
        away = np.array(facet.upright or (0.0, 1.0, 0.0))
        away = away - (away @ side) * side
        if norms(away) < LEVEL_LENGTH:
            away = np.eye(3)[0] - side[0] * side
        away = unit_vectors(away)
        level = np.sin(turn) * np.cross(away, side) - np.cos(turn) * away
        views.append(ReadingView(side, level, above))
    return views


def die_picture(parts: Sequence[Part], result: Result, width: int) -> bytes:
    """WebP picture of a die in color with a clear background, from its reading side; on a table if
    it is read on top.

    Parameters
    ----------
    parts: by `color_parts`.
    width: largest width of the picture, in pixels.
    """
    pixels = max(width, MIN_PIXELS)
    mesh = colored_mesh(parts, is_smooth=result.concave is not None)
    view = reading_views(result)[main_rest(result)]
    is_lifted = result.concave is None and reading_way(result) == "down"
    seen = mesh.points if is_lifted else with_shadow(mesh.points, view.side)
    (camera,) = frame_cameras([view.camera], [seen])
    shadow = np.zeros((pixels, pixels))
    if not is_lifted:
        heights = mesh.points @ view.side
        heights -= heights.min()
        reach = camera.half_width
        table = render_shadow(
            mesh.points, mesh.triangles, heights, view.side, camera, pixels, reach
        )
        shadow = SHADOW * (1.0 - table)
    picture = render_clear(mesh, camera, pixels, shadow)
    rows, columns = (np.flatnonzero(picture[..., 3].any(axis=axis)) for axis in (1, 0))
    return encode_webp(picture[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1], width)
