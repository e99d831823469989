"""A body whose center of mass was moved: how it rests, what is inside, and its probabilities."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from dicedesign.balance.balanced import Balanced
from dicedesign.geometry.meshes.manifold import solid
from dicedesign.report.bar_charts import Bars, outcome_chart
from dicedesign.report.palette import ACCENT, FAINT, PALE, rgb
from dicedesign.report.render.pictures import Picture, trim
from dicedesign.report.render.raster import camera_on
from dicedesign.report.render.renderer import Surface, render
from dicedesign.report.render.shading import MATERIAL
from dicedesign.report.sheet import Sheet, picture_grid
from dicedesign.rest.poses import RestPoses
from dicedesign.runtime.arrays import Floats

UP: Final = np.array([0.0, 0.0, 1.0])

PIXELS: Final = 420


def balance_figure(found: Balanced) -> Sheet:
    """The body in its most probable pose before and now, and cut open through its center of mass,
    below bars of the probabilities of the poses that the goal is about, of at most ten of them."""
    views = {
        "before": _standing(found, found.poses_before),
        "now": _standing(found, found.poses),
        "cut open, and the center of mass": _opened(found),
    }
    sheet = picture_grid(trim(list(views.values())), list(views), 3, above=650.0)
    return outcome_chart(
        ["new" if number is None else str(number) for number in found.numbers[:10]],
        [
            Bars.written("before", FAINT, found.before[:10]),
            Bars.written("now", ACCENT, found.odds[:10]),
        ],
        title="odds before and now",
        x_label="pose, numbered by its odds before",
        target=None if found.wanted is None else found.wanted[:10],
        sheet=sheet,
    )


def _standing(found: Balanced, poses: RestPoses) -> Picture:
    """The outside in its most probable pose."""
    body = found.made.body
    assert body.triangles is not None
    turn, move = poses.transforms[0][:3, :3], poses.transforms[0][:3, 3]
    points = body.points @ turn.T + move
    return render(Surface(points, body.triangles), camera_on(points, (1.0, -0.7, 0.5), UP), PIXELS)


def _opened(found: Balanced) -> Picture:
    """The body cut through its centers of mass, before and now, upright if it can be, with a dot at
    each."""
    shift = found.center - found.center_before
    across = np.linalg.cross(UP, shift)
    if np.linalg.norm(across) <= 1e-3 * np.linalg.norm(shift) or not shift.any():
        across = np.array([0.0, -1.0, 0.0])
    across /= np.linalg.norm(across)
    points, triangles, colors = [], [], []
    start = 0
    for part, color in _parts(found):
        half = part.trim_by_plane(tuple(-across), -float(across @ found.center))
        if half.is_empty():
            continue
        mesh = half.to_mesh64()
        corners = np.array(mesh.vert_properties[:, :3], dtype=np.float64)
        points.append(corners)
        triangles.append(np.array(mesh.tri_verts, dtype=np.int64) + start)
        colors.append(np.tile(color, (len(corners), 1)).astype(np.float64))
        start += len(corners)
    cut = Surface(
        np.concatenate(points), np.concatenate(triangles), np.concatenate(colors), smooth=False
    )
    camera = camera_on(found.made.body.points, across + 0.15 * UP, UP)
    picture = render(cut, camera, PIXELS)
    rows, columns = np.indices((420, PIXELS)) + 0.5
    for center, dot in ((found.center_before, FAINT), (found.center, ACCENT)):
        column, row = camera.pixel_positions(center[None], PIXELS)[0, :2]
        spot = np.hypot(rows - row, columns - column) <= 7.0
        picture[spot] = np.rint(255.0 * rgb([dot])[0]).astype(np.uint8)
    return picture


def _parts(found: Balanced) -> list[tuple[Any, Floats]]:
    """What the body is of, as solids of manifold3d, with the color of each."""
    made = found.made
    assert made.body.triangles is not None
    body = solid(made.body.points, made.body.triangles)
    plain = MATERIAL.astype(np.float64)
    parts = [(body, plain)]
    if made.sparse is not None:
        assert made.sparse.triangles is not None
        sparse = solid(made.sparse.points, made.sparse.triangles)
        parts = [(body - sparse, plain), (body ^ sparse, rgb([PALE])[0])]
    return parts
