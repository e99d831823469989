"""Picture of a floor with bodies on it."""

from __future__ import annotations

import numpy as np

from dicedesign.palette import outcome_colors, rgb
from dicedesign.report.raster import UP, Camera, encode_png, frame_cameras, rasterize, trim
from dicedesign.report.renderer import RenderMesh, render, render_shadow
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.scenes.room import FLOOR_TRIANGLES, Room

PIXELS = 1600
"""Side of the picture before it is trimmed."""

MAX_TRIANGLES = 3_000_000
"""Limit for all bodies together; above it, meshes with many triangles are drawn as their hulls."""

RISE, TURN = np.radians([38.0, 20.0])
"""Camera angles: elevation above the floor, and rotation about the vertical from its front."""

MAX_FLAT_TRIANGLES = 400
"""Meshes of at most this many triangles are drawn with flat faces and sharp edges."""

FLOOR_BRIGHTNESS = 0.93


def room_picture(room: Room) -> bytes:
    """PNG of the room from one side and above, with one color per mesh, and shadows."""
    counts = np.bincount([body.model for body in room.bodies])
    points: list[Floats] = []
    triangles: list[Integers] = []
    sizes: list[int] = []
    for body in room.bodies:
        model = room.models[body.model]
        corners, faces = model.body.points, model.body.triangles
        assert faces is not None
        if counts[body.model] * len(faces) * len(room.models) > MAX_TRIANGLES:
            corners, faces = model.poses.hull.vertices, model.poses.hull.triangles
        # Edges stay sharp only where faces share no points.
        if len(faces) <= MAX_FLAT_TRIANGLES:
            corners = corners[faces].reshape(-1, 3)
            faces = np.arange(len(corners)).reshape(-1, 3)
        points.append(body.to_room(corners))
        triangles.append(faces + sum(sizes))
        sizes.append(len(corners))
    all_points, all_triangles = np.concatenate(points), np.concatenate(triangles)
    of_models = rgb(outcome_colors(len(room.models)))
    colors = of_models[[body.model for body in room.bodies]].repeat(sizes, axis=0)
    level = np.array([np.sin(TURN), -np.cos(TURN), 0.0])
    camera = Camera(np.cos(RISE) * level + np.sin(RISE) * UP, UP)
    (camera,) = frame_cameras([camera], [np.concatenate([all_points, room.floor_corners])])
    heights = all_points[:, 2].clip(0.0)
    highest = float(max(heights.max(), 1e-300))
    table = render_shadow(all_points, all_triangles, heights, UP, camera, PIXELS, highest)
    floor = camera.pixel_positions(room.floor_corners, PIXELS)
    on_floor, _ = rasterize(floor, FLOOR_TRIANGLES, PIXELS)
    table[on_floor >= 0] *= FLOOR_BRIGHTNESS
    surface = RenderMesh(all_points, all_triangles, colors)
    (picture,) = trim([render(surface, camera, PIXELS, backdrop=table)])
    return encode_png(picture)
