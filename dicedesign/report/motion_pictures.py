"""Motions as strips of pictures and as one that moves: throws onto a table, and rolls to rest."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from io import BytesIO
from typing import TYPE_CHECKING, Final

import numpy as np
from PIL import Image
from scipy.spatial.transform import Rotation

from dicedesign.geometry.sphere import angle_between, even_directions, norms, unit_vectors
from dicedesign.report.gauss_map import path_of, paths_figure
from dicedesign.report.raster import UP, Camera, Picture, frame_cameras, tilt_up, trim
from dicedesign.report.renderer import (
    RenderMesh,
    render,
    render_on_table,
    render_shadow,
    with_shadow,
)
from dicedesign.report.sheet import Sheet, picture_grid
from dicedesign.rest.poses import RestPoses
from dicedesign.rest.roll import roll_steps
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.simulation import FRAMES_PER_SECOND, Film, throw_film

if TYPE_CHECKING:
    from dicedesign.fabricate.die import FinishedDie

MARGIN: Final = 1.2
"""Room around the die in pictures, over its extent."""

MOMENTS: Final = 10

STRIP_PIXELS: Final = 1800
"""Width of all pictures in a row."""

TALL: Final = 3.0
"""Height of a film, over the extent of its die, beyond which all pictures are in one row."""

GIF_PIXELS: Final = 480

MOST_FRAMES: Final = 150

SLOWER: Final = 4

SLANT: Final = math.sin(math.radians(18.0))
"""Height on paper of what is flat on the table, over its depth."""


@dataclass(frozen=True, eq=False)
class FilmedDie:
    """A throw, and the solid to draw in it.

    Attributes
    ----------
    film: of the throw.
    points: (n, 3) of the solid, labels cut in or not, in the frame and unit of length of the body
        that was filmed; triangles: (t, 3).
    center_of_mass: (3,) that the body was thrown with, in the same.
    """

    film: Film
    points: Floats
    triangles: Integers
    center_of_mass: Floats

    @property
    def radius(self) -> float:
        """Radius of the die on its table, in m."""
        return self.film.table.size / 2.0

    def camera(self) -> Camera:
        """Camera at the origin; the throw runs to the right."""
        positions = self.film.positions
        right = _level_direction(positions[-1] - positions[0], self.radius)
        return Camera(tilt_up(np.cross(right, UP), UP), UP)

    def reach(self, middles: Floats, camera: Camera, depth: float) -> tuple[float, float]:
        """How far below and above the table's middle (3,), or (f, 3) in each frame, a picture of
        the film reaches; depth: of half the table, in m."""
        heights = (self.film.positions - middles) @ camera.frame()[1]
        margin = MARGIN * self.radius
        lowest = min(float(heights.min()) - margin, -SLANT * depth - 0.06 * self.radius)
        return lowest, float(heights.max()) + margin

    def picture(
        self, frame: int, middle: Floats, camera: Camera, size: int, depth: float
    ) -> Picture:
        """(size, size, 3) picture of a frame, above a table z = 0 that is as wide as the picture.

        middle: (3,) point of the table halfway between its front edge and its back edge; depth:
        from there to each, in m.
        """
        points = self.film.place_points(self.points, self.center_of_mass, frame)
        heights = points[:, 2].clip(0.0)
        shadow = render_shadow(points, self.triangles, heights, UP, camera, size, self.radius)
        rows = (size / 2.0 - np.arange(size) - 0.5) * 2.0 * camera.half_width / size
        # Upward from the table's middle: the table, and below that its edge.
        above = rows + (camera.center - middle) @ camera.frame()[1] + SLANT * depth
        bright = np.where((above >= 0.0) & (above <= 2.0 * SLANT * depth), 0.94, 1.0)
        bright[(above < 0.0) & (above >= -0.06 * self.radius)] = 0.72
        surface = RenderMesh(points, self.triangles, smooth=False)
        return render(surface, camera, size, backdrop=bright[:, None] * shadow)


def _level_direction(way: Floats, least: float) -> Floats:
    """The level unit direction (3,) of a way (3,); any where it is no longer than `least`."""
    level = way * [1.0, 1.0, 0.0]
    return unit_vectors(level) if norms(level) > least else np.array([1.0, 0.0, 0.0])


def _moments(ways: Floats) -> list[int]:
    """At most `MOMENTS` of the states before, between and after ways (n,), the first and the last
    among them, between which the way is about the same."""
    way = np.concatenate([[0.0], ways.cumsum()])
    nearest = np.abs(way[:, None] - np.linspace(0.0, way[-1], MOMENTS)).argmin(axis=0)
    return np.unique([*nearest[:-1], len(ways)]).tolist()


@lru_cache(maxsize=1)
def film_throw(die: FinishedDie) -> FilmedDie:
    """A typical throw of a die that is thrown as a mesh."""
    assert die.thrown is not None
    thrown = die.thrown.die
    assert thrown.solid.triangles is not None
    film = throw_film(thrown.body, thrown.table)
    center = thrown.poses.center_of_mass
    return FilmedDie(film, thrown.solid.points, thrown.solid.triangles, center)


def film(die: FinishedDie) -> Sheet:
    """A throw of a die at several moments."""
    return film_figure(film_throw(die))


def film_figure(filmed: FilmedDie) -> Sheet:
    """The die at up to 10 moments, with the time above each.

    Between any two of them it moves and turns about as much. The camera goes along with it, but not
    up and down.
    """
    film, radius, camera = filmed.film, filmed.radius, filmed.camera()
    turns = Rotation.from_matrix(film.rotations)
    turned = (turns[1:] * turns[:-1].inv()).magnitude() * radius
    moments = _moments(turned + norms(np.diff(film.positions, axis=0)))
    ground = film.positions * [1.0, 1.0, 0.0]
    lowest, highest = filmed.reach(ground, camera, 2.0 * radius)
    columns = MOMENTS if highest - lowest > TALL * 2.0 * radius else MOMENTS // 2
    width = STRIP_PIXELS // columns
    unit = MARGIN * 2.0 * radius / width
    size = max(math.ceil((highest - lowest) / unit), width)
    middle_height = (lowest + highest) / 2.0 * camera.frame()[1]
    first = (size - width) // 2
    pictures = []
    for frame in moments:
        center = ground[frame] + middle_height
        moved = replace(camera, center=center, half_width=size * unit / 2.0)
        picture = filmed.picture(frame, ground[frame], moved, size, 2.0 * radius)
        pictures.append(picture[:, first : first + width])
    titles = [f"{film.seconds[frame]:.2f} s" for frame in moments]
    return picture_grid(pictures, titles, columns)


def throw(die: FinishedDie) -> bytes:
    """A throw of a die as a GIF."""
    return moving_picture(film_throw(die))


def moving_picture(filmed: FilmedDie) -> bytes:
    """The throw as a looping GIF, four times slower than real; faster if it had more than 150
    frames. Deterministic."""
    film, radius, camera = filmed.film, filmed.radius, filmed.camera()
    right, upward, toward = camera.frame()
    level = unit_vectors(toward * [1.0, 1.0, 0.0])
    along, nearness = film.positions @ right, film.positions @ level
    depth = float(np.ptp(nearness)) / 2.0 + 2.0 * radius
    middle = (along.min() + along.max()) / 2.0 * right
    middle = middle + (nearness.min() + nearness.max()) / 2.0 * level
    lowest, highest = filmed.reach(middle, camera, depth)
    side = max(float(np.ptp(along)) + MARGIN * 2.0 * radius, highest - lowest)
    center = middle + (lowest + highest) / 2.0 * upward
    camera = replace(camera, center=center, half_width=side / 2.0)
    last = len(film.seconds) - 1
    frames = np.linspace(0, last, min(last + 1, MOST_FRAMES)).round().astype(int).tolist()
    pictures = trim([filmed.picture(k, middle, camera, GIF_PIXELS, depth) for k in frames])
    # In 64 colors that all of them share, and that eight pictures tell.
    samples = np.concatenate(pictures[:: math.ceil(len(pictures) / 8)])
    palette = Image.fromarray(samples).quantize(64)
    first, *others = (
        Image.fromarray(picture).quantize(palette=palette, dither=Image.Dither.NONE)
        for picture in pictures
    )
    buffer = BytesIO()
    # The last is shown for two seconds.
    shown = [*[1000 * SLOWER // FRAMES_PER_SECOND] * len(others), 2000]
    first.save(buffer, "GIF", save_all=True, append_images=others, duration=shown, loop=0)
    return buffer.getvalue()


def drop_figure(
    surface: RenderMesh, poses: RestPoses, down: Sequence[float] | Floats | None = None
) -> Sheet:
    """A body in the moments of a roll in which its contact with the table changes, all from one
    side, and the path of the direction that points down over the Gauss map.

    surface: the body; poses: its rests; down: (3,) direction of it that points down at first, or
    None for the one of 300 with the most changes of contact. Of more than ten moments those are
    shown that are most evenly spread over the way. Source: figure 6 of the paper.
    """
    starts = even_directions(300) if down is None else [np.asarray(down)]
    steps = max((roll_steps(poses.morse.equilibria, start) for start in starts), key=len)
    path = path_of(steps)
    shown = _moments(angle_between(path[:-1], path[1:]))
    moves = [(step.transform[:3, :3], step.transform[:3, 3]) for step in steps]
    placed = [surface.points @ moves[k][0].T + moves[k][1] for k in shown]
    begin, end = (moves[k][0] @ poses.center_of_mass + moves[k][1] for k in (0, -1))
    right, turn = _level_direction(end - begin, 0.0), np.radians(25.0)
    level = np.cos(turn) * np.cross(right, UP) + np.sin(turn) * right
    cameras = [Camera(tilt_up(level, UP), UP)] * len(placed)
    cameras = frame_cameras(cameras, [with_shadow(points, UP) for points in placed])
    pictures = [
        render_on_table(replace(surface, points=points), UP, own, 300)
        for points, own in zip(placed, cameras, strict=True)
    ]
    titles = [f"{k + 1}: {steps[k].contact}, {steps[k].height:.4g} high" for k in shown]
    titles[-1] = f"{shown[-1] + 1}: at rest, {steps[-1].height:.4g} high"
    grid = picture_grid(pictures, titles, min(5, len(pictures))).pixels()
    sphere = paths_figure(poses, path[:1]).pixels()
    sheet = Sheet(max(grid.shape[1], sphere.shape[1]), len(grid) + 10 + len(sphere))
    sheet.picture(grid, (sheet.width - grid.shape[1]) / 2.0, 0.0)
    sheet.picture(sphere, (sheet.width - sphere.shape[1]) / 2.0, len(grid) + 10.0)
    return sheet
