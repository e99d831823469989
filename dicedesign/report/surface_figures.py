"""Figures of concave dice, of repaired meshes, and of bodies whose center of mass was moved."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from matplotlib import colormaps
from matplotlib.patches import Patch

from dicedesign.fabricate.die import Assessment, FinishedDie
from dicedesign.geometry.sphere import angle_between, norms, unit_vectors
from dicedesign.geometry.triangles import edge_keys
from dicedesign.palette import ACCENT, DARK, FAINT, PALE, outcome_colors, rgb
from dicedesign.report.bar_charts import Bars, chart_height, outcome_chart
from dicedesign.report.paper import COLUMN_WIDTH, GAP, POINTS
from dicedesign.report.raster import (
    UP,
    Camera,
    Picture,
    frame_cameras,
    three_cameras,
    tilt_up,
)
from dicedesign.report.renderer import (
    MATERIAL,
    RenderMesh,
    color_facets,
    color_triangles,
    render,
    render_on_table,
    with_shadow,
)
from dicedesign.report.sheet import (
    BODY,
    LINE,
    Sheet,
    cell_pixels,
    fold,
    grid_columns,
    key_height,
    picture_grid,
    with_style,
)
from dicedesign.rest.outcomes import RARE_REST
from dicedesign.runtime.arrays import Floats, Integers

if TYPE_CHECKING:
    from dicedesign.balance.balanced import Balanced
    from dicedesign.geometry.surfaces.repair import RepairedMesh

VIEWS = 3
"""Number of viewpoints, side by side."""

SCALE_ROOM = 30.0
"""Height of the scale of a color map with its numbers and its name, in points."""

FAULT = "#c0392b"
"""Color of edges that do not have two triangles."""

CROSSING = (0.80, 0.10, 0.10)
"""Color of triangles that intersect others."""

UNMARKED = (0.82, 0.80, 0.76)
"""Color of other triangles there."""

REST_COLUMNS = 4
"""Most outcomes in a row."""

DOT = 0.018
"""Radius of the dot at a center of mass, over the side of the picture."""


@lru_cache(maxsize=1)
def surface_of(die: FinishedDie) -> RenderMesh:
    """Surface of a die as read back from its file."""
    surface = die.plain.body.surface
    return RenderMesh(surface.points, surface.triangles)


@lru_cache(maxsize=1)
def shell_of(die: FinishedDie) -> RenderMesh:
    """Convex hull of a die as glass, with tinted rests."""
    poses, outcomes = die.plain.poses, die.plain.outcomes.outcome_of_rest
    tints = np.full((len(poses.hull.normals), 3), np.nan)
    counted = outcomes >= 0
    colors = rgb(outcome_colors(len(die.plain.target.labels)))
    tints[poses.facets[counted]] = colors[outcomes[counted]]
    return color_facets(poses.hull, tints)


def rows_of_views(
    surfaces: Mapping[str, RenderMesh],
    cameras: Sequence[Camera],
    width: float,
    shell: RenderMesh | None = None,
    above: float = 0.0,
    below: float = 0.0,
) -> Sheet:
    """Sheet with a row of pictures for each surface.

    surfaces: by the text before the numbers of the views; cameras: at least one; width: in inches;
    shell: glass around the surfaces, or None; above, below: points left free for more.
    """
    views = [(name, camera) for name in surfaces for camera in cameras]
    size = cell_pixels(width, len(cameras))
    pictures = [render(surfaces[name], camera, size, shell) for name, camera in views]
    titles = [f"{name}view {cameras.index(camera) + 1}" for name, camera in views]
    return picture_grid(pictures, titles, len(cameras), width, above, below)


def before_after(
    before: RenderMesh, after: RenderMesh, upward: Floats, *, width: float = COLUMN_WIDTH
) -> Sheet:
    """Surface before and after a change, from equal viewpoints.

    upward: (3,) in the pictures; width: in inches.
    """
    cameras = three_cameras(np.concatenate([before.points, after.points]), upward)
    return rows_of_views({"before, ": before, "after, ": after}, cameras, width)


def reshaped(die: FinishedDie, *, width: float = COLUMN_WIDTH) -> Sheet:
    """Surface before and after it was made into a concave die. width: in inches."""
    assert die.reshaped is not None
    start, end = die.reshaped.before, die.reshaped.after
    surface = RenderMesh(start.points, end.triangles)
    return before_after(surface, replace(surface, points=end.points), die.upward, width=width)


def repair(repaired: RepairedMesh, upward: Floats, *, width: float = COLUMN_WIDTH) -> Sheet:
    """Mesh before and after its repair; edges that do not have two triangles have red corners.

    upward: (3,) in the pictures; width: in inches.
    """
    triangles, surface = repaired.triangles, repaired.surface
    _, edge, uses = np.unique(edge_keys(triangles), return_inverse=True, return_counts=True)
    faulty = (uses != 2)[edge]
    colors = np.tile(MATERIAL, (len(repaired.points), 1))
    for corners in (triangles, np.roll(triangles, -1, axis=1)):
        colors[corners.ravel()[faulty]] = rgb([FAULT])
    plain = np.tile(MATERIAL, (len(surface.points), 1))
    before = RenderMesh(repaired.points, triangles, colors)
    after = RenderMesh(surface.points, surface.triangles, plain)
    return before_after(before, after, upward, width=width)


@with_style
def displacement(die: FinishedDie, *, width: float = COLUMN_WIDTH) -> Sheet:
    """Surface of a concave die, colored by the displacement of its points.

    Displacements are in percent of the diagonal of the bounding box of the surface before; the mean
    in the title is over the points. width: in inches.
    """
    assert die.reshaped is not None
    before, after = die.reshaped.before.points, die.reshaped.after.points
    percent = 100.0 * norms(after - before) / norms(np.ptp(before, axis=0))
    top = max(float(percent.max()), 1e-9)

    def to_colors(parts: Floats) -> Floats:
        # Without the ends of the color map, on which shading could not be seen.
        return colormaps["magma_r"](0.05 + 0.75 * parts)[..., :3]

    surface = RenderMesh(after, die.reshaped.after.triangles, to_colors(percent / top))
    cameras = three_cameras(np.concatenate([before, after]), die.upward)
    caption = fold(
        f"displacement: mean {percent.mean():.2g} %, largest {percent.max():.2g} % of the diagonal",
        POINTS * width - 2.0 * GAP,
        BODY,
    )
    above = LINE * BODY * (caption.count("\n") + 1) + GAP
    sheet = rows_of_views({"after, ": surface}, cameras, width, above=above, below=SCALE_ROOM)
    middle, upper, half = sheet.width / 2.0, sheet.height - SCALE_ROOM, sheet.width / 4.0
    sheet.write(caption, (middle, GAP), va="top")
    scale = sheet.rectangle(middle - half, upper, middle + half, upper + 6.0)
    colors = to_colors(np.linspace(0.0, 1.0, 256))[None]
    scale.imshow(colors, aspect="auto", extent=(0.0, top, 0.0, 1.0), interpolation="nearest")
    scale.set_yticks([])
    scale.set_xlabel("displacement (% of the diagonal)", labelpad=1.0)
    return sheet


def crossings(die: FinishedDie, *, width: float = COLUMN_WIDTH) -> Sheet:
    """Surface of a concave die with the triangles that intersect others in red.

    width: in inches.
    """
    assert die.quality is not None
    assert die.reshaped is not None
    after, pairs = die.reshaped.after, die.quality.intersections
    colors = np.full(after.points.shape, UNMARKED)
    colors[np.unique(after.triangles[np.unique(pairs)])] = CROSSING
    surface = RenderMesh(after.points, after.triangles, colors)
    return rows_of_views({"": surface}, three_cameras(after.points, die.upward), width)


@with_style
def hull(die: FinishedDie, *, width: float = COLUMN_WIDTH) -> Sheet:
    """Die within its convex hull, on which the facets that it rests on are colored by outcome.

    width: in inches.
    """
    labels = die.result.labels
    colors = outcome_colors(len(labels))
    keys = [
        Patch(fc=color, ec=DARK, label=label) for color, label in zip(colors, labels, strict=True)
    ]
    below = key_height(keys, POINTS * width) + GAP
    cameras = three_cameras(die.plain.body.points, die.upward)
    sheet = rows_of_views({"": surface_of(die)}, cameras, width, shell_of(die), below=below)
    sheet.add_key(keys, sheet.height - below)
    return sheet


def rests(die: FinishedDie, *, width: float = COLUMN_WIDTH) -> Sheet:
    """Die at rest on a table on each face, with its outcome's probability, above its underside.

    Where outcomes have several rests, those that are not rare are shown, each with its own
    probability, without poses that look like a more probable one. The convex hull, with tinted
    rests, is drawn over the undersides. width: in inches.
    """
    assert die.reshaped is not None
    surface, outcomes, target = surface_of(die), die.plain.outcomes, die.plain.target
    shown = die.plain.shown_faces(RARE_REST)
    probabilities = outcomes.probabilities[target.outcome_of_face][shown]
    if target.has_repeated_labels:
        shown, probabilities = _distinct_poses(die.plain, shown)
    labels = [target.face_labels[face] for face in shown]
    # One or two pictures need not be as wide as the sheet.
    count, columns = len(labels), grid_columns(width, max(VIEWS, min(REST_COLUMNS, len(labels))))
    size = cell_pixels(width, columns)
    # A face without a rest is drawn in the pose that was meant for it.
    main = outcomes.main[shown]
    rest_normals = die.plain.poses.normals[main]
    meant = die.reshaped.directions[shown]
    ups = -unit_vectors(np.where((main >= 0)[:, None], rest_normals, meant))
    front = three_cameras(surface.points, die.upward)[0].direction
    levels = [_level_view(surface.points, up, front) for up in ups]
    cameras = [Camera(tilt_up(level, up), up) for level, up in zip(levels, ups, strict=True)]
    # The underside is seen as if the die were tipped backward, so that its front is upward.
    cameras += [Camera(-up, level) for level, up in zip(levels, ups, strict=True)]
    cameras = frame_cameras(cameras, 2 * [with_shadow(surface.points, up) for up in ups])
    lying = [render_on_table(surface, ups[k], cameras[k], size) for k in range(count)]
    undersides = [render(surface, camera, size, shell_of(die)) for camera in cameras[count:]]
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
    return picture_grid(pictures, titles, columns, width)


ALIKE = np.radians(20.0)
"""Angle between two poses of an outcome up to which one picture shows both."""


def _distinct_poses(plain: Assessment, faces: Integers) -> tuple[Integers, Floats]:
    """Faces whose poses look different, outcome by outcome, the most probable first, and the
    probabilities of all poses of the outcome that look like each."""
    rests = plain.outcomes.main[faces]
    faces, rests = faces[rests >= 0], rests[rests >= 0]
    normals, probabilities = plain.poses.normals[rests], plain.poses.probabilities[rests]
    outcome_of = plain.target.outcome_of_face[faces]
    shown, sums = list[int](), list[float]()
    for place in np.lexsort((-probabilities, outcome_of)).tolist():
        alike = [
            number
            for number, other in enumerate(shown)
            if outcome_of[other] == outcome_of[place]
            and angle_between(normals[other], normals[place]) <= ALIKE
        ]
        if alike:
            sums[alike[0]] += probabilities[place]
        else:
            shown.append(place)
            sums.append(probabilities[place])
    return faces[shown], np.array(sums)


def _level_view(points: Floats, up: Floats, front: Floats) -> Floats:
    """Horizontal unit direction (3,) to a viewer who sees points (n, 3) almost from their broad
    side, from the side of `front` (3,)."""
    level = np.eye(3) - np.outer(up, up)
    # The axes are in rising order of spread; the first is `up`, along which there is none.
    _, narrow, long = np.linalg.eigh(level @ np.cov(points.T) @ level)[1].T
    narrow, long = (axis if axis @ front >= 0.0 else -axis for axis in (narrow, long))
    turn = np.radians(25.0)
    return np.asarray(np.cos(turn) * narrow + np.sin(turn) * long)


def balance(result: Balanced, *, width: float = COLUMN_WIDTH) -> Sheet:
    """Balanced body in its most probable poses before and now, and cut open through its center of
    mass, below bars of the probabilities of the poses of the goal, at most ten.

    width: in inches.
    """
    body, size = result.made.body.surface, cell_pixels(width, VIEWS)
    moves = [poses.transforms[0] for poses in (result.poses_before, result.poses)]
    placed = [body.points @ move[:3, :3].T + move[:3, 3] for move in moves]
    cameras = frame_cameras([Camera(np.array([1.0, -0.7, 0.5]), UP)] * 2, placed)
    views = [
        render(RenderMesh(points, body.triangles), camera, size)
        for points, camera in zip(placed, cameras, strict=True)
    ]
    titles = ["before", "now", "cut open, and the center of mass"]
    above = chart_height(width) + GAP
    sheet = picture_grid([*views, _cut_open(result, size)], titles, VIEWS, width, above=above)
    return outcome_chart(
        ["new" if number is None else str(number) for number in result.numbers[:10]],
        [Bars("before", result.before[:10]), Bars("now", result.probabilities[:10])],
        title="probabilities before and now",
        x_label="pose, numbered by its probabilities before",
        target=None if result.wanted is None else result.wanted[:10],
        width=width,
        sheet=sheet,
    )


def _cut_open(result: Balanced, size: int) -> Picture:
    """Picture of the body, cut through its centers of mass before and now, with a dot at each.

    size: side in pixels.
    """
    from dicedesign.geometry.meshes.manifold import solid

    balanced_solid, shift = result.made, result.center - result.center_before
    across = np.cross(UP, shift)
    # Any vertical cut is through both if one is above the other.
    across = unit_vectors(across) if norms(across) > 1e-3 * norms(shift) else np.array([0, -1.0, 0])
    body = solid(balanced_solid.body.surface)
    parts = [(body, MATERIAL)]
    if balanced_solid.sparse is not None:
        sparse = solid(balanced_solid.sparse.surface)
        parts = [(body - sparse, MATERIAL), (body ^ sparse, rgb([PALE])[0])]
    corners, colors = [], []
    for part, color in parts:
        half = part.trim_by_plane(tuple(-across), -float(across @ result.center)).to_mesh64()
        corners.append(np.asarray(half.vert_properties)[:, :3][np.asarray(half.tri_verts)])
        colors.append(np.tile(color, (len(corners[-1]), 1)))
    whole = np.concatenate(corners)
    triangles = np.arange(3 * len(whole)).reshape(-1, 3)
    cut = color_triangles(whole.reshape(-1, 3), triangles, np.concatenate(colors))
    camera = Camera(across + 0.15 * UP, UP)
    (camera,) = frame_cameras([camera], [balanced_solid.body.points])
    picture = render(cut, camera, size)
    rows, columns = np.indices(picture.shape[:2]) + 0.5
    for center, dot in ((result.center_before, FAINT), (result.center, ACCENT)):
        column, row, _ = camera.pixel_positions(center, size)
        spot = np.hypot(rows - row, columns - column) <= DOT * size
        picture[spot] = np.rint(255.0 * rgb([dot])[0]).astype(np.uint8)
    return picture
