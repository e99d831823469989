"""A picture of a room."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.report.charts.palette import BASINS, rgb
from dicedesign.report.charts.paper import Paper
from dicedesign.report.charts.picture_grid import trimmed
from dicedesign.report.render.cameras import framed
from dicedesign.report.render.raster import Camera, rasterize
from dicedesign.report.render.renderer import Surface, render
from dicedesign.report.render.shadow import shadowed_table
from dicedesign.runtime.arrays import Floats, Integers

if TYPE_CHECKING:
    from dicedesign.scenes.room import Room

__all__ = ["room_picture"]

PIXELS: Final = 1600

MOST_TRIANGLES: Final = 3_000_000
"""Of all bodies together; of more, those with the most triangles are drawn as their hulls."""

RISE: Final = np.radians(38.0)

TURN: Final = np.radians(20.0)
"""From the floor's front edge."""

CREASE: Final = 400
"""Triangles of a mesh up to which it is drawn with flat faces and edges."""

SQUARE: Final = np.array([[0, 1, 2], [0, 2, 3]])

FLOOR: Final = 0.93
"""Brightness of the floor."""


def room_picture(room: Room) -> Paper:
    """The room from one side and above, each mesh in a colour of its own, with shadows."""
    meshes = [_drawn(room, number) for number in range(len(room.models))]
    sizes = np.array([len(meshes[body.model][1]) for body in room.bodies])
    colors = rgb(BASINS)
    points: list[Floats] = []
    triangles: list[Integers] = []
    tints, start = [], 0
    for body, size in zip(room.bodies, sizes.tolist(), strict=True):
        own_points, own_triangles = meshes[body.model]
        # Faces meet in edges only where they share no points.
        if size <= CREASE:
            own_points = own_points[own_triangles].reshape(-1, 3)
            own_triangles = np.arange(len(own_points)).reshape(-1, 3)
        points.append(body.placed(own_points))
        triangles.append(own_triangles + start)
        tints.append(np.tile(colors[body.model % len(colors)], (len(own_points), 1)))
        start += len(own_points)
    all_points, all_triangles = np.concatenate(points), np.concatenate(triangles)
    wide, deep = (side / 2.0 for side in room.floor)
    corners = np.array([[-wide, -deep, 0], [wide, -deep, 0], [wide, deep, 0], [-wide, deep, 0]])
    camera = _camera(np.concatenate([all_points, corners]))
    heights = all_points[:, 2].clip(0.0)
    reach = float(max(heights.max(), 1e-300))
    up = np.array([0.0, 0.0, 1.0])
    table = shadowed_table(all_points, all_triangles, heights, up, camera, PIXELS, reach)
    on_floor, _ = rasterize(camera.pixel_positions(corners, PIXELS), SQUARE, PIXELS)
    table[on_floor >= 0] *= FLOOR
    surface = Surface(all_points, all_triangles, np.concatenate(tints))
    (picture,) = trimmed([render(surface, camera, PIXELS, backdrop=table)])
    paper = Paper(picture.shape[1], picture.shape[0])
    paper.picture(picture, 0.0, 0.0)
    return paper


def _camera(points: Floats) -> Camera:
    up = np.array([0.0, 0.0, 1.0])
    level = np.array([np.sin(TURN), -np.cos(TURN), 0.0])
    camera = Camera(np.cos(RISE) * level + np.sin(RISE) * up, up, np.zeros(3), 1.0)
    return framed([camera], [points])[0]


def _drawn(room: Room, number: int) -> tuple[Floats, Integers]:
    """Points and triangles of a model for the picture."""
    model = room.models[number]
    assert model.body.triangles is not None
    count = sum(body.model == number for body in room.bodies)
    if count * len(model.body.triangles) * len(room.models) > MOST_TRIANGLES:
        return model.poses.hull.vertices, model.poses.hull.triangles
    return model.body.points, model.body.triangles
