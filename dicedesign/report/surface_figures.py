"""Figures of dice that keep the shape of a surface: before and after, in their hull, at rest; and
of bodies whose center of mass was moved."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Final

import numpy as np
from matplotlib.patches import Patch

from dicedesign.errors import InputError
from dicedesign.fabricate.die import FinishedDie
from dicedesign.geometry.sphere import norms, unit_vectors
from dicedesign.geometry.triangles import edge_keys
from dicedesign.report.bar_charts import Bars, outcome_chart
from dicedesign.report.palette import ACCENT, BASINS, FAINT, PALE, repeat, rgb
from dicedesign.report.raster import (
    UP,
    Camera,
    Picture,
    camera_on,
    frame_cameras,
    three_cameras,
    tilt_up,
)
from dicedesign.report.renderer import (
    MATERIAL,
    RenderMesh,
    Shell,
    color_triangles,
    render,
    render_on_table,
    with_shadow,
)
from dicedesign.report.sheet import TITLE, Sheet, picture_grid, with_style
from dicedesign.runtime.arrays import Floats, Integers

if TYPE_CHECKING:
    from dicedesign.balance.balanced import Balanced
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
"""From pale to dark in steps that look equal, also to color-blind people: nine of magma, by S. van
der Walt and N. Smith (2015), without its ends, on which shading could not be seen."""

REST_COLUMNS: Final = 4


@lru_cache(maxsize=1)
def surface_of(die: FinishedDie) -> RenderMesh:
    """The die as its file holds it."""
    body = die.plain.body
    assert body.triangles is not None
    return RenderMesh(body.points, body.triangles)


@lru_cache(maxsize=1)
def shell_of(die: FinishedDie) -> Shell:
    """Hull of a die, with its rests tinted."""
    hull = die.plain.poses.hull
    of_facet = np.full(len(hull.normals), -1, dtype=np.int64)
    of_facet[die.plain.poses.facets] = die.plain.outcomes.outcome_of_rest
    # A facet of n corners is a fan of n - 2 triangles.
    of_triangle = np.repeat(of_facet, np.diff(hull.facet_start) - 2)
    return Shell(hull.vertices, hull.triangles, outcome_tints(of_triangle))


def outcome_tints(outcomes: Integers) -> Floats:
    """Tints (h, 3) of a shell whose triangles belong to rests of outcomes (h,), or -1 of none."""
    tints = rgb(repeat(BASINS, int(outcomes.max(initial=0)) + 1))[outcomes]
    tints[outcomes < 0] = np.nan
    return tints


def rows_of_views(
    surfaces: Mapping[str, RenderMesh],
    cameras: Sequence[Camera],
    shell: Shell | None = None,
    above: float = 0.0,
    below: float = 0.0,
) -> Sheet:
    """A row of pictures for each surface, by what is written before the numbers of views.

    cameras: of each row, at least one; shell: around the surfaces, or None; above, below: pixels of
    room left free for more.
    """
    views = [(name, camera) for name in surfaces for camera in cameras]
    pictures = [render(surfaces[name], camera, PIXELS, shell) for name, camera in views]
    titles = [f"{name}view {cameras.index(camera) + 1}" for name, camera in views]
    return picture_grid(pictures, titles, len(cameras), above, below)


def before_after_figure(before: RenderMesh, after: RenderMesh, upward: Floats) -> Sheet:
    """A surface above what it was made into, from the same sides; upward: (3,) in the pictures."""
    cameras = three_cameras(np.concatenate([before.points, after.points]), upward)
    return rows_of_views({"before, ": before, "after, ": after}, cameras)


def before_after(die: FinishedDie) -> Sheet:
    """The surface before and after it was made into a die."""
    assert die.reshaped is not None
    before, after = die.reshaped.before, die.reshaped.after
    surface = RenderMesh(before.points, after.triangles)
    return before_after_figure(surface, replace(surface, points=after.points), die.upward)


def repair_figure(repaired: RepairedMesh, up: Floats) -> Sheet:
    """The triangles as they came above the surface made of them, from the same cameras; corners of
    edges that are not of two triangles are red.

    up: (3,) upward in the pictures.
    """
    triangles, surface = repaired.triangles, repaired.surface
    _, edge, uses = np.unique(edge_keys(triangles), return_inverse=True, return_counts=True)
    faulty = (uses != 2)[edge]
    colors = np.tile(MATERIAL, (len(repaired.points), 1))
    for corners in (triangles, np.roll(triangles, -1, axis=1)):
        colors[corners.ravel()[faulty]] = rgb([FAULT])
    plain = np.tile(MATERIAL, (len(surface.points), 1))
    before = RenderMesh(repaired.points, triangles, colors)
    return before_after_figure(before, RenderMesh(surface.points, surface.triangles, plain), up)


def repair(die: FinishedDie) -> Sheet:
    """The mesh of a die before and after it was repaired."""
    assert die.repaired is not None
    return repair_figure(die.repaired, die.upward)


def displacement_colors(shares: Floats) -> Floats:
    """(n, 3) red, green and blue from 0 to 1 of shares (n,) of the largest displacement."""
    places, colors = np.linspace(0.0, 1.0, len(MOVED)), rgb(MOVED)
    return np.stack([np.interp(shares, places, channel) for channel in colors.T], axis=1)


@with_style
def displacement_figure(
    before: Floats, after: Floats, triangles: Integers, cameras: Sequence[Camera]
) -> Sheet:
    """The surface after its deformation, colored by how far each point was moved.

    Distances are in percent of the diagonal of the box along the axes that holds the surface
    before; the mean in the title is that over the points.

    before, after: (n, 3) in one length unit; triangles: (t, 3) of both, consistently oriented;
        cameras: at
    least one.
    """
    diagonal = norms(np.ptp(before, axis=0))
    percent = 100.0 * norms(after - before) / diagonal
    top = max(float(percent.max()), 1e-9)
    surface = RenderMesh(after, triangles, displacement_colors(percent / top))
    sheet = rows_of_views({"after, ": surface}, cameras, above=42.0, below=105.0)
    middle = sheet.width / 2.0
    caption = (
        f"displacement: mean {percent.mean():.2g} %, largest {percent.max():.2g} % of the diagonal"
    )
    sheet.text(caption, (middle, 18.0), size=TITLE, va="top")
    upper = sheet.height - 110.0
    scale = sheet.axes(middle - 325.0, upper, middle + 325.0, upper + 24.0)
    colors = displacement_colors(np.linspace(0.0, 1.0, 650))[None]
    scale.imshow(colors, aspect="auto", extent=(0.0, top, 0.0, 1.0), interpolation="nearest")
    scale.set_yticks([])
    scale.set_xlabel("displacement (% of the diagonal)")
    return sheet


def displacement(die: FinishedDie) -> Sheet:
    """Displacement of each part of a die's surface, as colors."""
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
    return rows_of_views({"": RenderMesh(points, triangles, colors)}, cameras)


def crossings(die: FinishedDie) -> Sheet:
    """Self-intersections of a die's surface."""
    assert die.quality is not None
    assert die.reshaped is not None
    after = die.reshaped.after
    cameras = three_cameras(after.points, die.upward)
    return crossings_figure(after.points, after.triangles, die.quality.intersections, cameras)


@with_style
def hull_figure(
    surface: RenderMesh, shell: Shell, labels: Sequence[str], cameras: Sequence[Camera]
) -> Sheet:
    """A surface within its convex hull, with the facets of the hull that it rests on colored.

    surface: what to draw; shell: its hull, with the tints that `outcome_tints` gives; labels: k
    outcomes, at least one; cameras: at least one.
    """
    columns = 10
    below = 36.0 * -(-len(labels) // columns)
    sheet = rows_of_views({"": surface}, cameras, shell, below=below)
    colors = repeat(BASINS, len(labels))
    keys = [Patch(color=colors[k], label=label) for k, label in enumerate(labels)]
    place = (0.5, (below + 10.0) / sheet.height)
    sheet.figure.legend(handles=keys, loc="upper center", bbox_to_anchor=place, ncols=columns)
    return sheet


def hull(die: FinishedDie) -> Sheet:
    """A die within its convex hull."""
    cameras = three_cameras(die.plain.body.points, die.upward)
    return hull_figure(surface_of(die), shell_of(die), die.result.labels, cameras)


def rests_figure(
    surface: RenderMesh,
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
    ups = -unit_vectors(downs)
    levels = [_level_view(surface.points, up, front) for up in ups]
    cameras = [Camera(tilt_up(level, up), up) for level, up in zip(levels, ups, strict=True)]
    # The underside as it is seen when the die is tipped backward, its front upward.
    cameras += [Camera(-up, level) for level, up in zip(levels, ups, strict=True)]
    cameras = frame_cameras(cameras, 2 * [with_shadow(surface.points, up) for up in ups])
    count = len(downs)
    lying = [render_on_table(surface, ups[k], cameras[k], size) for k in range(count)]
    undersides = [render(surface, camera, size, shell) for camera in cameras[count:]]
    captions = [
        f"{label}: {100.0 * p:.2f} %" for label, p in zip(labels, probabilities, strict=True)
    ]
    below = [f"{label}: underside" for label in labels]
    pictures: list[Picture] = []
    titles: list[str] = []
    for first in range(0, count, columns):
        row = slice(first, first + columns)
        blank = columns - len(labels[row])
        for views, texts in ((lying, captions), (undersides, below)):
            pictures += views[row] + blank * [np.full_like(views[0], 255)]
            titles += texts[row] + blank * [""]
    return picture_grid(pictures, titles, columns)


def _level_view(points: Floats, up: Floats, front: Floats) -> Floats:
    """The level unit direction (3,) to a viewer who sees points (n, 3) almost from their broad
    side, turned a little, and on the side of the front (3,) where there are two."""
    level = np.eye(3) - np.outer(up, up)
    # In rising order of their spread, and the first is `up`, along which there is none.
    _, narrow, long = np.linalg.eigh(level @ np.cov(points.T) @ level)[1].T
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
    return rests_figure(
        surface_of(die), shell_of(die), downs, labels, outcomes.probabilities, front
    )


def balance_figure(result: Balanced) -> Sheet:
    """The body in its most probable pose before and now, and cut open through its center of mass,
    below bars of the probabilities of the poses that the goal is about, of at most ten of them."""
    body, views = result.made.body, []
    assert body.triangles is not None
    for poses in (result.poses_before, result.poses):
        turn, move = poses.transforms[0][:3, :3], poses.transforms[0][:3, 3]
        points = body.points @ turn.T + move
        camera = camera_on(points, (1.0, -0.7, 0.5), UP)
        views.append(render(RenderMesh(points, body.triangles), camera, PIXELS))
    titles = ["before", "now", "cut open, and the center of mass"]
    sheet = picture_grid([*views, _cut_open(result)], titles, 3, above=650.0)
    return outcome_chart(
        ["new" if number is None else str(number) for number in result.numbers[:10]],
        [Bars("before", FAINT, result.before[:10]), Bars("now", ACCENT, result.probabilities[:10])],
        title="probabilities before and now",
        x_label="pose, numbered by its probabilities before",
        target=None if result.wanted is None else result.wanted[:10],
        sheet=sheet,
    )


def _cut_open(result: Balanced) -> Picture:
    """The body cut through its centers of mass, before and now, upright if it can be, with a dot at
    each."""
    from dicedesign.geometry.meshes.manifold import solid

    balanced_solid, shift = result.made, result.center - result.center_before
    assert balanced_solid.body.triangles is not None
    across = np.cross(UP, shift)
    # A cut through both may run any way where they lie above each other.
    across = unit_vectors(across) if norms(across) > 1e-3 * norms(shift) else np.array([0, -1.0, 0])
    body = solid(balanced_solid.body.points, balanced_solid.body.triangles)
    parts = [(body, MATERIAL)]
    if balanced_solid.sparse is not None:
        assert balanced_solid.sparse.triangles is not None
        sparse = solid(balanced_solid.sparse.points, balanced_solid.sparse.triangles)
        parts = [(body - sparse, MATERIAL), (body ^ sparse, rgb([PALE])[0])]
    corners, colors = [], []
    for part, color in parts:
        half = part.trim_by_plane(tuple(-across), -float(across @ result.center)).to_mesh64()
        corners.append(np.asarray(half.vert_properties)[:, :3][np.asarray(half.tri_verts)])
        colors.append(np.tile(color, (len(corners[-1]), 1)))
    whole = np.concatenate(corners)
    triangles = np.arange(3 * len(whole)).reshape(-1, 3)
    cut = color_triangles(whole.reshape(-1, 3), triangles, np.concatenate(colors))
    camera = camera_on(balanced_solid.body.points, across + 0.15 * UP, UP)
    picture = render(cut, camera, PIXELS)
    rows, columns = np.indices(picture.shape[:2]) + 0.5
    for center, dot in ((result.center_before, FAINT), (result.center, ACCENT)):
        column, row, _ = camera.pixel_positions(center, PIXELS)
        spot = np.hypot(rows - row, columns - column) <= 7.0
        picture[spot] = np.rint(255.0 * rgb([dot])[0]).astype(np.uint8)
    return picture
