"""Places to which cavities, or another density inside, can bring a body's center of mass."""

from __future__ import annotations

from typing import Final

import numpy as np

from dicedesign.errors import DegenerateBodyError, InputError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.sphere import even_directions
from dicedesign.geometry.surfaces.distances import depth_grid
from dicedesign.geometry.surfaces.surface import Surface

__all__ = ["reach"]

STEPS: Final = 28
"""Of the grid along the longest extent."""

DIRECTIONS: Final = 60
"""In which the farthest shift is found."""


def reach(
    surface: Surface, wall: float, part: float = 1.0, densities: tuple[float, float] = (0.0, 1.0)
) -> ConvexHull:
    """Shifts of the center of mass from that of the uniform solid.

    Where cavities may be anywhere deeper than a wall, the centers of mass that they lead to are a
    convex set: the moments of their complements are a zonoid (Lyapunov), of which these are an
    image in perspective. It is farthest in a direction where all is hollow that lies behind the
    center of mass itself. The hull of such shifts is inside of it. So it is with two densities in
    place of none and that of the walls.

    surface: of the solid; wall: least thickness, in its unit; part: of the shifts, to be safe;
    densities: least and largest, deeper than the walls, over that of the walls. Depths are found on
    a coarse grid, and directions are few: some hundredths are uncertain.

    Raises InputError where there is no room, or only a thin one, that deep.
    """
    grid = depth_grid(surface, STEPS)
    near = np.isfinite(grid.depths)
    depths, nodes = grid.depths[near], grid.places(np.argwhere(near))
    # Parts of the cubes about the nodes that are in the solid, and deeper than the wall: none of
    # those whose middles are not, of which no part is where the solid is thin.
    filled, deep = (np.clip((depths - least) / grid.spacing + 0.5, 0.0, 1.0) for least in (0, wall))
    deep[depths <= wall] = 0.0
    away = nodes - filled @ nodes / filled.sum()
    # All that is deep is as dense as can be, but for what lies behind.
    dense = filled + (densities[1] - 1.0) * deep
    mass, moment = dense.sum(), dense @ away
    lost = (densities[1] - densities[0]) * deep
    moments = lost[:, None] * away
    shifts = []
    for direction in even_directions(DIRECTIONS):
        order = np.argsort(nodes @ direction, kind="stable")
        left = mass - np.concatenate([[0.0], np.cumsum(lost[order])])
        along = moment @ direction - np.cumsum(moments[order] @ direction)
        most = int(np.argmax(np.concatenate([[moment @ direction], along]) / left))
        shifts.append((moment - moments[order[:most]].sum(axis=0)) / left[most])
    try:
        return convex_hull(part * np.array(shifts))
    except DegenerateBodyError as error:
        raise InputError(
            f"hollow: expected walls that leave room for cavities, got walls of {wall:.3g} in a "
            f"body with a largest depth of {depths.max(initial=0.0):.3g}, over its circumscribed "
            "radius; reduce wall_mm, or leave hollow out"
        ) from error
