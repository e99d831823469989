"""A picture of a room."""

from __future__ import annotations

import numpy as np

from dicedesign.report.palette import BASINS, rgb
from dicedesign.report.raster import Camera, encoded, framed, rasterize, trim
from dicedesign.report.renderer import Surface, render, shadowed_table
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.scenes.room import Room

PIXELS = 1600

MOST_TRIANGLES = 3_000_000
"""Of all bodies together; of more, those with the most triangles are drawn as their hulls."""

RISE, TURN = np.radians([38.0, 20.0])
"""From where it is seen: above the floor, and from its front edge."""

CREASE = 400
"""Triangles of a mesh up to which it is drawn with flat faces and edges."""

FLOOR = 0.93
"""Brightness of the floor."""


def room_picture(room: Room) -> bytes:
    """PNG of the room from one side and above, each mesh in a color of its own, with shadows."""
    colors = rgb(BASINS)
    counts = np.bincount([body.model for body in room.bodies])
    points: list[Floats] = []
    triangles: list[Integers] = []
    tints, start = [], 0
    for body in room.bodies:
        model = room.models[body.model]
        own_points, own_triangles = model.body.points, model.body.triangles
        assert own_triangles is not None
        if counts[body.model] * len(own_triangles) * len(room.models) > MOST_TRIANGLES:
            own_points, own_triangles = model.poses.hull.vertices, model.poses.hull.triangles
        # Faces meet in edges only where they share no points.
        if len(own_triangles) <= CREASE:
            own_points = own_points[own_triangles].reshape(-1, 3)
            own_triangles = np.arange(len(own_points)).reshape(-1, 3)
        points.append(body.placed(own_points))
        triangles.append(own_triangles + start)
        tints.append(np.tile(colors[body.model % len(colors)], (len(own_points), 1)))
        start += len(own_points)
    all_points, all_triangles = np.concatenate(points), np.concatenate(triangles)
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * [*room.floor, 0.0] / 2.0
    up = np.array([0.0, 0.0, 1.0])
    level = np.array([np.sin(TURN), -np.cos(TURN), 0.0])
    camera = Camera(np.cos(RISE) * level + np.sin(RISE) * up, up, np.zeros(3), 1.0)
    (camera,) = framed([camera], [np.concatenate([all_points, corners])])
    heights = all_points[:, 2].clip(0.0)
    reach = float(max(heights.max(), 1e-300))
    table = shadowed_table(all_points, all_triangles, heights, up, camera, PIXELS, reach)
    square = np.array([[0, 1, 2], [0, 2, 3]])
    on_floor, _ = rasterize(camera.pixel_positions(corners, PIXELS), square, PIXELS)
    table[on_floor >= 0] *= FLOOR
    surface = Surface(all_points, all_triangles, np.concatenate(tints))
    (picture,) = trim([render(surface, camera, PIXELS, backdrop=table)])
    return encoded(picture)
