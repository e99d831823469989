"""Motions as pictures: a throw onto a table as a GIF, and a roll to rest moment by moment."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from dicedesign.geometry.sphere import angle_between, even_directions, norms, unit_vectors
from dicedesign.geometry.triangles import Surface
from dicedesign.report.gauss_map import path_of, paths_map
from dicedesign.report.paper import COLUMN_WIDTH
from dicedesign.report.raster import UP, Camera, frame_cameras, tilt_up, trim
from dicedesign.report.renderer import (
    RenderMesh,
    render,
    render_on_table,
    render_shadow,
    with_shadow,
)
from dicedesign.report.sheet import (
    Sheet,
    cell_pixels,
    grid_columns,
    picture_grid,
    with_style,
)
from dicedesign.rest.poses import RestPoses
from dicedesign.rest.roll import roll_steps
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.simulation import FRAMES_PER_SECOND, Film, throw_film

if TYPE_CHECKING:
    from dicedesign.fabricate.die import FinishedDie

MARGIN = 1.2
"""Room around the die in pictures, over its extent."""

MAX_MOMENTS = 10
"""Most moments of a roll that are drawn."""

MOMENT_COLUMNS = 5
"""Most moments in a row."""

GIF_PIXELS = 480
"""Width of the moving picture."""

MAX_FRAMES = 150
"""Most frames of the moving picture."""

LONGEST_WAY = 16.0
"""Largest distance from the rest at which the moving picture begins, over the radius of the die."""

SLOW_MOTION = 4
"""Duration of the moving picture over the duration of the throw."""

EDGE = 0.06
"""Thickness of the table on paper, over the radius of the die."""

SLANT = math.sin(math.radians(18.0))
"""Height on paper of flat things on the table, over their depth."""


def _level_direction(way: Floats, min_length: float) -> Floats:
    """Horizontal unit direction (3,) of a way (3,), or x if the way is not longer than
    `min_length`."""
    level = way * [1.0, 1.0, 0.0]
    return unit_vectors(level) if norms(level) > min_length else np.array([1.0, 0.0, 0.0])


def throw(die: FinishedDie) -> bytes:
    """Typical throw of a die, which is thrown as a mesh, as a GIF."""
    assert die.thrown is not None
    thrown = die.thrown.die
    film = throw_film(thrown.body, thrown.table)
    return moving_picture(film, thrown.solid.surface, thrown.poses.center_of_mass)


def moving_picture(film: Film, surface: Surface, center_of_mass: Floats) -> bytes:
    """Looping GIF of a throw, four times slower than real; faster if it had more than 150 frames.

    Deterministic. The throw runs to the right. It begins where the die is `LONGEST_WAY` radii from
    its rest, so that the die is not small.

    Parameters
    ----------
    film: the throw.
    surface: the solid to draw, in the frame and the unit of length of the body that was filmed.
    center_of_mass: (3,) center of mass of that body.
    """
    radius = film.table.size / 2.0
    far = np.flatnonzero(norms(film.positions - film.positions[-1]) > LONGEST_WAY * radius)
    begin = int(far[-1]) + 1 if len(far) > 0 else 0
    ways = film.positions[begin:]
    right = _level_direction(ways[-1] - ways[0], radius)
    level = np.cross(right, UP)
    camera = Camera(tilt_up(level, UP), UP)
    upward = camera.frame()[1]
    along, nearness = ways @ right, ways @ level
    # The table reaches two radii beyond the way of the die.
    depth = float(np.ptp(nearness)) / 2.0 + 2.0 * radius
    middle = (along.min() + along.max()) / 2.0 * right
    middle = middle + (nearness.min() + nearness.max()) / 2.0 * level
    heights, room = (ways - middle) @ upward, MARGIN * radius
    front = -SLANT * depth
    lowest = min(float(heights.min()) - room, front - EDGE * radius)
    highest = float(heights.max()) + room
    side = max(float(np.ptp(along)) + 2.0 * room, highest - lowest)
    shift = (lowest + highest) / 2.0
    camera = replace(camera, center=middle + shift * upward, half_width=side / 2.0)
    rows = shift + (0.5 - (np.arange(GIF_PIXELS) + 0.5) / GIF_PIXELS) * side
    paper = np.where(np.abs(rows) <= -front, 0.94, 1.0)
    paper[(rows < front) & (rows >= front - EDGE * radius)] = 0.72
    last = len(film.seconds) - 1
    frames = np.linspace(begin, last, min(len(ways), MAX_FRAMES)).round().astype(int)
    pictures = []
    for frame in frames.tolist():
        placed = film.place_points(surface.points, center_of_mass, frame)
        above = placed[:, 2].clip(0.0)
        shadow = render_shadow(placed, surface.triangles, above, UP, camera, GIF_PIXELS, radius)
        moved = RenderMesh(placed, surface.triangles, smooth=False)
        pictures.append(render(moved, camera, GIF_PIXELS, backdrop=paper[:, None] * shadow))
    pictures = trim(pictures)
    # All frames share 64 colors, which are taken from eight of them.
    samples = np.concatenate(pictures[:: math.ceil(len(pictures) / 8)])
    palette = Image.fromarray(samples).quantize(64)
    first, *others = (
        Image.fromarray(picture).quantize(palette=palette, dither=Image.Dither.NONE)
        for picture in pictures
    )
    buffer = BytesIO()
    # The last frame is shown for two seconds.
    durations = [*[1000 * SLOW_MOTION // FRAMES_PER_SECOND] * len(others), 2000]
    first.save(buffer, "GIF", save_all=True, append_images=others, duration=durations, loop=0)
    return buffer.getvalue()


@with_style
def drop(
    surface: RenderMesh,
    poses: RestPoses,
    down: Sequence[float] | Floats | None = None,
    *,
    width: float = COLUMN_WIDTH,
) -> Sheet:
    """Body at the moments of a roll at which its contact with the table changes, all from one side,
    and the path of the direction that points down over the Gauss map.

    Of more than ten moments, those are shown that are spread most evenly over the way. Source:
    figure 6 of the paper.

    Parameters
    ----------
    surface, poses: the body and its rests.
    down: (3,) direction of the body that points down at first, or None for the one of 300 with the
        most changes of contact.
    width: in inches.
    """
    starts = even_directions(300) if down is None else [np.asarray(down)]
    steps = max((roll_steps(poses.morse.equilibria, start) for start in starts), key=len)
    path = path_of(steps)
    way = np.concatenate([[0.0], angle_between(path[:-1], path[1:]).cumsum()])
    nearest = np.abs(way[:, None] - np.linspace(0.0, way[-1], MAX_MOMENTS)).argmin(axis=0)
    moments = np.unique([*nearest[:-1], len(steps) - 1]).tolist()
    moves = [(step.transform[:3, :3], step.transform[:3, 3]) for step in steps]
    placed = [surface.points @ moves[k][0].T + moves[k][1] for k in moments]
    begin, end = (moves[k][0] @ poses.center_of_mass + moves[k][1] for k in (0, -1))
    right, turn = _level_direction(end - begin, 0.0), np.radians(25.0)
    level = np.cos(turn) * np.cross(right, UP) + np.sin(turn) * right
    cameras = [Camera(tilt_up(level, UP), UP)] * len(placed)
    cameras = frame_cameras(cameras, [with_shadow(points, UP) for points in placed])
    columns = grid_columns(width, min(MOMENT_COLUMNS, max(len(placed), 2)))
    size = cell_pixels(width, columns)
    pictures = [
        render_on_table(replace(surface, points=points), UP, own, size)
        for points, own in zip(placed, cameras, strict=True)
    ]
    titles = [f"{k + 1}: {steps[k].contact}, {steps[k].height:.4g} high" for k in moments]
    titles[-1] = f"{moments[-1] + 1}: at rest, {steps[-1].height:.4g} high"
    sphere = paths_map(poses, path[:1], width)
    sheet = picture_grid(pictures, titles, columns, width, below=sphere.height)
    sphere.draw(sheet, sheet.height - sphere.height)
    return sheet
