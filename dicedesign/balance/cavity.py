"""Smallest cavity of a solid that moves its center of mass to a given point.

Of all parts of a solid that are deeper than a wall, the smallest one whose removal has a given
moment is cut off by a plane. The plane is the solution of the dual of that linear program, a convex
minimization in three variables.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from manifold3d import Manifold, OpType

from dicedesign.errors import DegenerateBodyError, InputError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.meshes.body import shells_of
from dicedesign.geometry.meshes.manifold import mesh_of, solid
from dicedesign.geometry.sphere import even_directions, norms
from dicedesign.geometry.surfaces.grid_surface import GridValues, depths_inside
from dicedesign.geometry.triangles import Surface, join_surfaces, surface_of
from dicedesign.results.parts import Cavities
from dicedesign.runtime.arrays import Floats

STEPS = 40
"""Grid steps along the longest extent."""

LEAST_PART = 0.01
"""Volume of a part of the cavity, relative to the largest part, below which it stays solid."""

DEEPER = 1.05
"""Increase of the depth of the cavity over the deficit of its walls."""

DEEPER_BY_WALL = 2e-3
"""Further increase, relative to the wall."""

MAX_TRIES = 6
"""Largest number of times that walls are measured and the cavity is made smaller."""

CENTERED = 1e-14
"""Largest remaining moment, in units of about the diagonal."""

MAX_STEPS = 60
"""Largest number of Newton steps."""

HALVINGS = 40
"""Largest number of halvings of a step."""

DECREASE = 1e-4
"""Share of the predicted decrease that a step must achieve (Armijo condition)."""

START = 1.2
"""Ratio of the distances of the farthest corner and of the first plane."""

NEAREST = 1e-4
"""Distance of the plane from the center of mass, relative to the diagonal, at which the search
fails."""

DIFFERENCE = 1e-4
"""Relative step of the finite differences for second derivatives."""

REGULAR = 1e-9
"""Regularization of the second derivatives, relative to their trace."""


Plane: TypeAlias = tuple[tuple[float, ...], float]
"""Unit normal and offset of a plane; beyond it `normal @ x >= offset`, as for `trim_by_plane`."""


def balancing_cavity(surface: Surface, wall: float, center: Floats) -> Surface:
    """Smallest cavity, of one or several parts, that moves the center of mass of a uniform solid;
    its surface is oriented outward.

    surface: of the solid; wall: least thickness in its unit of length, above 0; center: (3,) new
    center of mass, other than the solid's.

    Raises InputError if no cavity moves it there, the walls leave no room, or the surface bounds no
    solid.
    """
    room, _ = within_walls(surface, wall)
    cut = beyond_plane(room, center, surface.volume * (surface.centroid - center))
    if cut is None:
        far = float(norms(center - surface.centroid))
        raise InputError(
            f"hollow: expected a center of mass that cavities lead to, got one {far:.3g} from the "
            f"uniform solid's, too far for walls of {wall:g}; reduce wall_mm"
        )
    return mesh_of(cut[0])


def weigh_part(part: Manifold) -> tuple[float, Floats]:
    """Volume and centroid (3,) of a solid, both 0 for an empty one."""
    if part.is_empty():
        return 0.0, np.zeros(3)
    surface = mesh_of(part)
    return surface.volume, surface.centroid


def beyond_plane(room: Manifold, center: Floats, moment: Floats) -> tuple[Manifold, Plane] | None:
    """Smallest part of a solid with a moment (3,) about a center (3,): all that is beyond a plane;
    and the plane. None if no part has the moment.

    moment: not 0, in the fourth power of the unit of length. With lengths of about 1 and the center
    at the origin, the plane's normal over its distance is the minimizer x of the convex function

        integral over the room of max(x . y - 1, 0) dy  -  x . moment.
    """
    low, high = np.reshape(room.bounding_box(), (2, 3))
    unit = float(norms(high - low) + norms(0.5 * (low + high) - center))
    room, moment = room.translate(tuple(-center)).scale((1.0 / unit,) * 3), moment / unit**4
    toward = moment / norms(moment)
    farthest = float((mesh_of(room).points @ toward).max())
    if farthest <= 0.0:
        return None

    def beyond(plane: Floats) -> Manifold:
        return room.trim_by_plane(tuple(plane), 1.0 / float(norms(plane)))

    def at(plane: Floats) -> tuple[float, Floats]:
        """Value and gradient of the function."""
        volume, centroid = weigh_part(beyond(plane))
        slope = volume * centroid - moment
        return float(plane @ slope) - volume, slope

    def curvature(plane: Floats) -> Floats:
        """(3, 3) second derivatives by finite differences."""
        step = DIFFERENCE * float(norms(plane))
        rows = [(at(plane + h)[1] - at(plane - h)[1]) for h in step * np.eye(3)]
        matrix = np.array(rows) / (2.0 * step)
        matrix = 0.5 * (matrix + matrix.T)
        # They vanish where the plane does not cut the room.
        least = REGULAR * np.trace(matrix) + np.finfo(np.float64).tiny
        return np.asarray(matrix + least * np.eye(3))

    now = START * toward / farthest
    value, slope = at(now)
    for _ in range(MAX_STEPS):
        if norms(slope) <= CENTERED:
            size = float(norms(now))
            normal = now / size
            part = beyond(now).scale((unit,) * 3).translate(tuple(center))
            return part, (tuple(normal), float(normal @ center) + unit / size)
        step = -np.linalg.solve(curvature(now), slope)
        step *= min(1.0, float(norms(now) / norms(step)))
        for _ in range(HALVINGS):
            following, gradient = at(now + step)
            # Near the end only the slope is not dominated by rounding.
            less = following <= value + DECREASE * float(slope @ step)
            if less or norms(gradient) <= 0.5 * norms(slope):
                break
            step = 0.5 * step
        else:
            return None
        now, value, slope = now + step, following, gradient
        if norms(now) * NEAREST >= 1.0:
            return None
    return None


def within_walls(surface: Surface, wall: float) -> tuple[Manifold, float]:
    """Part of a solid deeper than a wall, without small parts, and its least distance from the
    surface, measured between triangles. Raises InputError if there is none.
    """
    outside = _outside(surface, wall)
    grid, depth = _sample_depths(surface, STEPS), wall
    for _ in range(MAX_TRIES):
        deeper = grid.above(depth)
        if len(deeper.triangles) == 0:
            break
        room = Manifold.batch_boolean(large_parts(solid(deeper), LEAST_PART), OpType.Add)
        least = float(outside.min_gap(room, 2.0 * wall))
        if least >= wall:
            return room, least
        depth += DEEPER * (wall - least) + DEEPER_BY_WALL * wall
    raise InputError(
        f"hollow: expected room for a cavity in walls of {wall:g}, got none in a body with a "
        f"largest depth of {grid.values.max():.3g}; reduce wall_mm, or leave hollow out"
    )


def large_parts(body: Manifold, share: float) -> list[Manifold]:
    """Separate parts of a solid that have at least a share of the volume of the largest."""
    parts = body.decompose()
    least = share * max(part.volume() for part in parts)
    return [part for part in parts if part.volume() >= least]


def least_wall(surface: Surface, cavity: Surface) -> float:
    """Least distance between the surfaces of a solid and of a cavity, both oriented outward."""
    most = surface.diagonal
    inner = solid(cavity)
    return float(_outside(surface, most).min_gap(inner, most))


def _outside(surface: Surface, margin: float) -> Manifold:
    """Complement of a solid in a box that is larger by a margin."""
    lower = surface.points.min(axis=0) - margin
    size = np.ptp(surface.points, axis=0) + 2.0 * margin
    body = solid(surface)
    return Manifold.cube(tuple(size)).translate(tuple(lower)) - body


def _sample_depths(surface: Surface, steps: int) -> GridValues:
    """Depths inside a solid on a grid with a number of steps along its longest extent."""
    low, high = surface.points.min(axis=0), surface.points.max(axis=0)
    spacing = float((high - low).max()) / steps
    return GridValues(
        lambda places: depths_inside(surface, places), low - spacing, high + spacing, spacing
    )


REACH_STEPS = 24
"""Grid steps along the longest extent."""

DIRECTIONS = 60
"""Number of directions in which the farthest shift is computed."""


def reach(
    surface: Surface, wall: float, part: float = 1.0, densities: tuple[float, float] = (0.0, 1.0)
) -> ConvexHull:
    """Convex hull of possible shifts of the center of mass from the uniform solid's.

    The centers of mass with cavities anywhere deeper than a wall are a convex set: the moments of
    their complements are a zonoid (Lyapunov), of which they are a perspective image. The farthest
    shift in a direction has a cavity of all that is behind the center of mass. The hull of such
    shifts is inside of the set. The same holds for two densities instead of cavities.

    surface: of the solid; wall: least thickness in its unit; part: factor of the shifts, for
    safety; densities: smallest and largest density deeper than the wall, relative to the wall's.
    The grid is coarse and directions are few, for an accuracy of some hundredths.

    Raises InputError if the walls leave no room, or only a thin one.
    """
    grid = _sample_depths(surface, REACH_STEPS)
    near = grid.values > -grid.cell
    depths, nodes = grid.values[near], grid.nodes[near]
    # Shares of the cells about the nodes that are in the solid, and deeper than the wall; 0 for
    # cells whose centers are not, so that thin solids have none.
    filled, deep = (np.clip((depths - least) / grid.cell + 0.5, 0.0, 1.0) for least in (0, wall))
    deep[depths <= wall] = 0.0
    away = nodes - filled @ nodes / filled.sum()
    # Deep parts have the largest density, except for those behind the center of mass.
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
            f"wall_mm: expected walls that leave room inside, got walls of {wall:.3g} in a body "
            f"with a largest depth of {depths.max(initial=0.0):.3g}; reduce wall_mm"
        ) from error


def with_cavity(surface: Surface, wall: float, center: Floats) -> Surface:
    """Surface of a solid with its `balancing_cavity`; parameters and errors are as there."""
    return join_surfaces(surface, balancing_cavity(surface, wall, center).reverse())


def measure_cavities(whole: Surface) -> Cavities:
    """Measure the cavities of a body in mm.

    whole: one surface oriented outward, with others inside of it, oriented inward. Raises
    InputError otherwise.
    """
    shell = shells_of(whole.triangles)
    shells = [
        surface_of(whole.points, whole.triangles[shell == k]) for k in range(int(shell.max()) + 1)
    ]
    outer = [each for each in shells if each.volume > 0.0]
    inner = [each.reverse() for each in shells if each.volume < 0.0]
    if len(outer) != 1 or not inner:
        raise InputError(
            f"cavities: expected one surface with others inside, got {len(outer)} oriented "
            f"outward and {len(inner)} inward; make the die again"
        )
    volume = sum(each.volume for each in inner)
    return Cavities(
        number=len(inner),
        wall_mm=min(least_wall(outer[0], each) for each in inner),
        volume_mm3=volume,
        part=volume / outer[0].volume,
        shift_mm=float(np.linalg.norm(whole.centroid - outer[0].centroid)),
    )
