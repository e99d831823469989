"""Figures of dice that keep the shape of a surface: before and after, in their hull, at rest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Final

import numpy as np
from matplotlib.patches import Patch

from dicedesign.errors import InputError
from dicedesign.fabricate.die import FinishedDie
from dicedesign.geometry.triangles import edge_keys
from dicedesign.report.palette import BASINS, repeated, rgb
from dicedesign.report.render.pictures import trim
from dicedesign.report.render.raster import Camera, framed, three_cameras
from dicedesign.report.render.renderer import Shell, Surface, render
from dicedesign.report.render.shading import MATERIAL
from dicedesign.report.render.tabletop import render_on_table, with_shadow
from dicedesign.report.sheet import TITLE, Sheet, picture_grid, styled
from dicedesign.runtime.arrays import Floats, Integers

if TYPE_CHECKING:
    from dicedesign.geometry.surfaces.repair import RepairedMesh

PIXELS: Final = 400

FAULT: Final = "#c0392b"
"""Of edges that are not of two triangles."""

CROSSING: Final = (0.80, 0.10, 0.10)

UNMARKED: Final = (0.82, 0.80, 0.76)

MOVED: Final = (
    "#fdebac",
    "#febf84",
    "#fd9266",
    "#f2645c",
    "#d6456c",
    "#b0357b",
    "#882781",
    "#621980",
    "#3b0f70",
)
"""From pale to dark in steps that look equal, also to colour-blind people: nine of magma, by S. van
der Walt and N. Smith (2015), without its ends, on which shading could not be seen."""

REST_COLUMNS: Final = 4


@lru_cache(maxsize=1)
def surface_of(die: FinishedDie) -> Surface:
    """The die as its file holds it."""
    body = die.plain.body
    assert body.triangles is not None
    return Surface(body.points, body.triangles)


@lru_cache(maxsize=1)
def shell_of(die: FinishedDie) -> Shell:
    """Its hull, with the facets tinted that it rests on."""
    hull = die.plain.poses.hull
    of_facet = np.full(len(hull.normals), -1, dtype=np.int64)
    of_facet[die.plain.poses.facets] = die.plain.outcomes.outcome_of_rest
    # A facet of n corners is a fan of n - 2 triangles.
    of_triangle = np.repeat(of_facet, np.diff(hull.facet_start) - 2)
    return Shell(hull.vertices, hull.triangles, outcome_tints(of_triangle))


def outcome_tints(outcomes: Integers) -> Floats:
    """Tints (h, 3) of a shell whose triangles belong to rests of outcomes (h,), or -1 of none."""
    tints = rgb(repeated(BASINS, int(outcomes.max(initial=0)) + 1))[outcomes]
    tints[outcomes < 0] = np.nan
    return tints


def rows_of_views(
    surfaces: Mapping[str, Surface],
    cameras: Sequence[Camera],
    shell: Shell | None = None,
    above: float = 0.0,
    below: float = 0.0,
) -> Sheet:
    """A row of pictures for each surface, by what is written before the numbers of views.

    cameras: of each row, at least one; shell: around the surfaces, or None; above, below: pixels of
    room left free for more.
    """
    pictures, titles = [], []
    for name, surface in surfaces.items():
        pictures += trim([render(surface, camera, PIXELS, shell) for camera in cameras])
        titles += [f"{name}view {k + 1}" for k in range(len(cameras))]
    return picture_grid(pictures, titles, len(cameras), above, below)


def before_after_figure(before: Surface, after: Surface, cameras: Sequence[Camera]) -> Sheet:
    """A surface above what it was made into, from the same cameras, of which there is at least
    one."""
    return rows_of_views({"before, ": before, "after, ": after}, cameras)


def before_after(die: FinishedDie) -> Sheet:
    """The surface before and after it was made into a die."""
    assert die.reshaped is not None
    before, after = die.reshaped.before, die.reshaped.after
    cameras = three_cameras(np.concatenate([before.points, after.points]), die.upward)
    return before_after_figure(
        Surface(before.points, after.triangles), Surface(after.points, after.triangles), cameras
    )


def repair_figure(repaired: RepairedMesh, up: Floats) -> Sheet:
    """The triangles as they came above the surface made of them, from the same cameras; corners of
    edges that are not of two triangles are red.

    up: (3,) upward in the pictures.
    """
    triangles, surface = repaired.triangles, repaired.surface
    _, edge, uses = np.unique(edge_keys(triangles), return_inverse=True, return_counts=True)
    faulty = (uses != 2)[edge]
    colors = np.tile(MATERIAL.astype(np.float64), (len(repaired.points), 1))
    for corners in (triangles, np.roll(triangles, -1, axis=1)):
        colors[corners.ravel()[faulty]] = rgb([FAULT])[0]
    plain = np.tile(MATERIAL.astype(np.float64), (len(surface.points), 1))
    before = Surface(repaired.points, triangles, colors)
    after = Surface(surface.points, surface.triangles, plain)
    cameras = three_cameras(np.concatenate([before.points, after.points]), up)
    return before_after_figure(before, after, cameras)


def repair(die: FinishedDie) -> Sheet:
    """The mesh of a die before and after it was repaired."""
    assert die.repaired is not None
    return repair_figure(die.repaired, die.upward)


def displacement_colors(shares: Floats) -> Floats:
    """(n, 3) red, green and blue from 0 to 1 of shares (n,) of the largest displacement."""
    places, colors = np.linspace(0.0, 1.0, len(MOVED)), rgb(MOVED)
    return np.stack([np.interp(shares, places, colors[:, k]) for k in range(3)], axis=1)


@styled
def displacement_figure(
    before: Floats, after: Floats, triangles: Integers, cameras: Sequence[Camera]
) -> Sheet:
    """The surface after its deformation, coloured by how far each point was moved.

    Distances are in percent of the diagonal of the box along the axes that holds the surface
    before; the mean in the title is that over the points.

    before, after: (n, 3) in one length unit; triangles: (t, 3) of both, oriented alike; cameras: at
    least one.
    """
    diagonal = float(np.linalg.norm(np.ptp(before, axis=0)))
    percent = 100.0 * np.linalg.norm(after - before, axis=1) / diagonal
    top = max(float(percent.max()), 1e-9)
    surface = Surface(after, triangles, displacement_colors(percent / top))
    sheet = rows_of_views({"after, ": surface}, cameras, above=42.0, below=105.0)
    middle = sheet.width / 2.0
    told = (
        f"displacement: mean {percent.mean():.2g} %, largest {percent.max():.2g} % of the diagonal"
    )
    sheet.text(told, (middle, 18.0), size=TITLE, anchor="ma")
    upper = sheet.height - 110.0
    scale = sheet.axes(middle - 325.0, upper, middle + 325.0, upper + 24.0)
    colors = displacement_colors(np.linspace(0.0, 1.0, 650))[None]
    scale.imshow(colors, aspect="auto", extent=(0.0, top, 0.0, 1.0), interpolation="nearest")
    scale.set_yticks([])
    scale.set_xlabel("displacement (% of the diagonal)")
    return sheet


def displacement(die: FinishedDie) -> Sheet:
    """How far each part of the surface of a die was moved."""
    assert die.reshaped is not None
    before, after = die.reshaped.before.points, die.reshaped.after.points
    cameras = three_cameras(np.concatenate([before, after]), die.upward)
    return displacement_figure(before, after, die.reshaped.after.triangles, cameras)


def crossings_figure(
    points: Floats, triangles: Integers, pairs: Integers, cameras: Sequence[Camera]
) -> Sheet:
    """A surface with the triangles that meet in red.

    points: (n, 3); triangles: (t, 3); pairs: (m, 2) numbers of triangles that meet and should not;
    cameras: at least one.
    """
    colors = np.full(points.shape, UNMARKED)
    colors[np.unique(triangles[np.unique(pairs)])] = CROSSING
    return rows_of_views({"": Surface(points, triangles, colors)}, cameras)


def crossings(die: FinishedDie) -> Sheet:
    """Where the surface of a die meets itself."""
    assert die.quality is not None
    assert die.reshaped is not None
    before, after = die.reshaped.before.points, die.reshaped.after
    cameras = three_cameras(np.concatenate([before, after.points]), die.upward)
    return crossings_figure(after.points, after.triangles, die.quality.intersections, cameras)


@styled
def hull_figure(
    surface: Surface, shell: Shell, labels: Sequence[str], cameras: Sequence[Camera]
) -> Sheet:
    """A surface within its convex hull, with the facets of the hull that it rests on coloured.

    surface: what to draw; shell: its hull, with the tints that `outcome_tints` gives; labels: k
    outcomes, at least one; cameras: at least one.
    """
    columns = 10
    below = 36.0 * -(-len(labels) // columns)
    sheet = rows_of_views({"": surface}, cameras, shell, below=below)
    keys = [
        Patch(color=color, label=label)
        for color, label in zip(repeated(BASINS, len(labels)), labels, strict=True)
    ]
    place = (0.5, (below + 10.0) / sheet.height)
    sheet.figure.legend(handles=keys, loc="upper center", bbox_to_anchor=place, ncols=columns)
    return sheet


def hull(die: FinishedDie) -> Sheet:
    """A die within its convex hull."""
    cameras = three_cameras(die.plain.body.points, die.upward)
    return hull_figure(surface_of(die), shell_of(die), die.result.labels, cameras)


def rests_figure(
    surface: Surface,
    shell: Shell,
    downs: Floats,
    labels: Sequence[str],
    probabilities: Floats,
    front: Floats,
) -> Sheet:
    """A die as it lies on a table after each outcome, and below that its underside.

    Parameters
    ----------
    surface: the die.
    shell: its convex hull, with its rests tinted; it is drawn over the undersides.
    downs: (k, 3) direction of the body that points down in each outcome, of any length above 0.
    labels: k outcomes, at least one.
    probabilities: (k,) in [0, 1], written beside the labels.
    front: (3,) direction of the body that is rather toward the viewer than away from him.

    Raises
    ------
    InputError: there is no outcome, or not one direction, label and probability for each.
    """
    if not 0 < len(downs) == len(labels) == len(probabilities):
        raise InputError(
            "outcomes: expected at least one, with one direction, one label and one probability "
            f"each, got {len(downs)} directions, {len(labels)} labels and {len(probabilities)} "
            "probabilities"
        )
    columns = min(REST_COLUMNS, len(downs))
    size = PIXELS if columns < REST_COLUMNS else 300
    rise = np.radians(18.0)
    ups = -downs / np.linalg.norm(downs, axis=1, keepdims=True)
    above, below = [], []
    for up in ups:
        level = _level_view(surface.points, up, front)
        above.append(Camera(np.cos(rise) * level + np.sin(rise) * up, up, np.zeros(3), 1.0))
        # As seen when the die is tipped backward, its front upward.
        below.append(Camera(-up, level, np.zeros(3), 1.0))
    seen = [with_shadow(surface.points, up) for up in ups]
    cameras = framed([*above, *below], [*seen, *seen])
    lying = [
        render_on_table(surface, up, camera, size) for up, camera in zip(ups, cameras, strict=False)
    ]
    undersides = [render(surface, camera, size, shell) for camera in cameras[len(downs) :]]
    written = [
        f"{label}: {100.0 * probability:.2f} %"
        for label, probability in zip(labels, probabilities.tolist(), strict=True)
    ]
    pictures, titles = [], []
    for first in range(0, len(downs), columns):
        row = slice(first, first + columns)
        blank = columns - len(labels[row])
        for views, texts in ((lying, written), (undersides, [f"{x}: underside" for x in labels])):
            pictures += trim(views[row] + blank * [np.full_like(views[0], 255)])
            titles += texts[row] + blank * [""]
    return picture_grid(pictures, titles, columns)


def _level_view(points: Floats, up: Floats, front: Floats) -> Floats:
    """The level unit direction (3,) to a viewer who sees points (n, 3) almost from their broad
    side, turned a little, and on the side of the front (3,) where there are two."""
    level = np.eye(3) - np.outer(up, up)
    spread = (points - points.mean(axis=0)) @ level
    # In rising order, and the first is that of `up`, along which there is none.
    _, narrow, long = np.linalg.eigh(spread.T @ spread)[1].T
    narrow, long = (axis if axis @ front >= 0.0 else -axis for axis in (narrow, long))
    turn = np.radians(25.0)
    return np.asarray(np.cos(turn) * narrow + np.sin(turn) * long)


def rests(die: FinishedDie) -> Sheet:
    """A die as it lies after each outcome."""
    assert die.reshaped is not None
    outcomes = die.plain.outcomes
    has_rest = (outcomes.rest_counts > 0)[:, None]
    # An outcome without a rest is shown where it was meant to be.
    downs = np.where(has_rest, die.plain.poses.normals[outcomes.main], die.reshaped.directions)
    front = three_cameras(die.plain.body.points, die.upward)[0].direction
    labels = die.result.labels
    return rests_figure(surface_of(die), shell_of(die), downs, labels, outcomes.odds, front)
