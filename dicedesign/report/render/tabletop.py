"""A solid above a table, and its shadow there."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from dicedesign.report.render.pictures import Picture
from dicedesign.report.render.raster import Camera, rasterize
from dicedesign.report.render.renderer import Surface, render
from dicedesign.report.render.shading import blurred
from dicedesign.runtime.arrays import Floats, Integers

_UP: Final = np.array([0.0, 0.0, 1.0])

_RISE: Final = math.radians(18.0)

_TOP: Final = 0.94

_EDGE: Final = 0.72

_EDGE_HEIGHT: Final = 0.06

_BLUR: Final = 0.024

_SHADOW: Final = 0.18

_CONTACT: Final = 0.45

_FADING: Final = 6.0


def shadowed_table(
    points: Floats,
    triangles: Integers,
    heights: Floats,
    up: Floats,
    camera: Camera,
    size: int,
    reach: float,
) -> Floats:
    """Brightness (size, size) from 0 to 1 of a white table under a body, lit from above: the lower
    the body is above a place, the darker.

    Parameters
    ----------
    points: (n, 3) of the body, in any length unit; triangles: (t, 3).
    heights: (n,) of the points above the table, at least 0.
    up: (3,) unit vector.
    camera: where to look from, from above the table; size: pixels a side.
    reach: length over which shadows fade.
    """
    positions = camera.pixel_positions(points - heights[:, None] * up, size)
    positions[:, 2] = -heights / reach
    seen, depth = rasterize(positions, triangles, size)
    dark = np.where(seen >= 0, _SHADOW + _CONTACT * np.exp(_FADING * depth), 0.0)
    blur = _BLUR * reach * size / (2.0 * camera.half_width)
    return np.asarray(1.0 - blurred(dark, blur))


def with_shadow(points: Floats, up: Floats) -> Floats:
    """Points (2 n, 3) of a body that stands on a table, and of its shadow; up: (3,) unit vector."""
    heights = points @ up
    return np.concatenate([points, points - (heights - heights.min())[:, None] * up])


def render_on_table(
    surface: Surface, up: Floats, camera: Camera, size: int, reach: float | None = None
) -> Picture:
    """Picture of a body that stands on a table; up: (3,) unit vector; reach: length over which
    shadows fade, by default half the width of the picture."""
    heights = surface.points @ up
    heights -= heights.min()
    reach = camera.half_width if reach is None else reach
    table = shadowed_table(surface.points, surface.triangles, heights, up, camera, size, reach)
    return render(surface, camera, size, backdrop=table)


def side_camera(right: Floats) -> Camera:
    """A camera at the origin that sees the level direction (3,) run to the right."""
    direction = math.cos(_RISE) * np.cross(right, _UP) + math.sin(_RISE) * _UP
    return Camera(direction, _UP, np.zeros(3), 1.0)


@dataclass(frozen=True, eq=False)
class Tabletop:
    """Pictures of a solid above a table that is z = 0.

    The table is as wide as the picture, and as deep as two of the solid around its middle.

    Attributes
    ----------
    triangles: (t, 3) of the solid.
    radius: largest distance of its points from its center of mass, in any length unit.
    depth: distance in the same unit that the solid may move toward the camera and away from it.
    """

    triangles: Integers
    radius: float
    depth: float

    @property
    def drop(self) -> float:
        """How far below the table's middle its front edge ends in a picture."""
        return math.sin(_RISE) * self._half_depth + _EDGE_HEIGHT * self.radius

    @property
    def _half_depth(self) -> float:
        return self.depth + 2.0 * self.radius

    def picture(self, points: Floats, middle: Floats, camera: Camera, size: int) -> Picture:
        """(size, size, 3) picture of the solid.

        points: (n, 3) of the solid.
        middle: (3,) point of the table halfway between its front edge and its back edge.
        camera: one of `side_camera`, moved.
        """
        heights = points[:, 2].clip(0.0)
        shadow = shadowed_table(points, self.triangles, heights, _UP, camera, size, self.radius)
        backdrop = self._rows(middle, camera, size)[:, None] * shadow
        surface = Surface(points, self.triangles, smooth=False)
        return render(surface, camera, size, backdrop=backdrop)

    def _rows(self, middle: Floats, camera: Camera, size: int) -> Floats:
        """Brightness (size,) of the table in each row of pixels."""
        rows = (size / 2.0 - np.arange(size) - 0.5) * 2.0 * camera.half_width / size
        # Upward from the table's middle.
        above = rows + (camera.center - middle) @ camera.frame()[1]
        half = math.sin(_RISE) * self._half_depth
        bright = np.where(np.abs(above) <= half, _TOP, 1.0)
        bright[(-self.drop <= above) & (above < -half)] = _EDGE
        return bright
