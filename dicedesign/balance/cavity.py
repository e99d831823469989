"""The least cavity of a solid that brings its center of mass to a wanted place.

Of all parts of a solid that lie deeper than a wall, the one of least volume whose removal has a
wanted moment is what a plane cuts off. The plane is found by maximizing a concave function of three
variables, the dual of that linear program.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from manifold3d import Manifold, OpType

from dicedesign.errors import DegenerateBodyError, InputError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.meshes.body import Body, shells_of
from dicedesign.geometry.meshes.manifold import mesh_of, solid
from dicedesign.geometry.sphere import even_directions, norms
from dicedesign.geometry.surfaces.grid_surface import (
    DepthGrid,
    depth_grid,
    surface_nets,
    without_double_cuts,
)
from dicedesign.geometry.triangles import Surface, join_surfaces, solid_properties, surface_of
from dicedesign.results.parts import Cavities
from dicedesign.runtime.arrays import Floats, Integers

STEPS: Final = 48
"""Of the grid along the longest extent."""

LEAST_PART: Final = 0.01
"""Volume of a part of the cavity, over that of the largest, below which it is left solid."""

DEEPER: Final = 1.05
"""Factor of what walls are too thin by, by which the cavity is made less wide the next time."""

LITTLE: Final = 2e-3
"""Part of the wall by which it is besides."""

TIMES: Final = 6
"""That walls are measured and the cavity is made less wide, at most."""

CENTERED: Final = 1e-14
"""Moment that may be left, in units of about the diagonal."""

STEPS_TO_PLANE: Final = 60
"""Most steps of Newton's method."""

HALVINGS: Final = 40
"""Times that one of them is halved at most."""

DECREASE: Final = 1e-4
"""Part of the decrease that the slope promises which a step must achieve."""

START: Final = 1.2
"""The first plane is nearer than the farthest corner by this factor."""

NEAREST: Final = 1e-4
"""Distance of the plane from the center of mass, over the diagonal, at which nothing is gained any
more by bringing it nearer."""

DIFFERENCE: Final = 1e-4
"""Relative, of the planes whose slopes give second derivatives."""

REGULAR: Final = 1e-9
"""Part of their trace that is added to them."""


@dataclass(frozen=True, eq=False)
class HalfSpacePart:
    """The part of a solid where `normal @ x >= offset`, with normal (3,) a unit vector."""

    part: Manifold
    normal: Floats
    offset: float


def balancing_cavity(surface: Surface, wall: float, center: Floats) -> Surface:
    """The least cavity deeper than a wall with which a uniform solid has its center of mass at a
    place, oriented outward as if it were a solid, of one part or several.

    surface: of the solid; wall: in its unit of length, above 0; center: (3,), another than that of
    the solid.

    Raises
    ------
    InputError: no cavity leads there, or there is none as deep; the surface bounds no solid.
    """
    room, _ = within_walls(surface, wall)
    cut = beyond_plane(room, center, surface.volume * (surface.centroid - center))
    if cut is None:
        far = float(norms(center - surface.centroid))
        raise InputError(
            f"hollow: expected a center of mass that cavities lead to, got one {far:.3g} from that "
            f"of the solid without, too far for walls of {wall:g}; reduce wall_mm"
        )
    return Surface(*mesh_of(cut.part))


def beyond_plane(room: Manifold, center: Floats, moment: Floats) -> HalfSpacePart | None:
    """The part of least volume of a solid that has a moment (3,), in the fourth power of its unit
    and not 0, about a place (3,): all that is beyond a plane. None where none has it.

    With lengths in units of about 1 and the place at the origin, the plane's normal over its
    distance is the minimizer x of the convex function

        integral over the room of max(x . y - 1, 0) dy  -  x . moment.
    """
    low, high = np.reshape(room.bounding_box(), (2, 3))
    unit = float(norms(high - low) + norms(0.5 * (low + high) - center))
    room, moment = room.translate(tuple(-center)).scale((1.0 / unit,) * 3), moment / unit**4
    toward = moment / norms(moment)
    farthest = float((mesh_of(room)[0] @ toward).max())
    if farthest <= 0.0:
        return None

    def beyond(plane: Floats) -> Manifold:
        return room.trim_by_plane(tuple(plane), 1.0 / float(norms(plane)))

    def at(plane: Floats) -> tuple[float, Floats]:
        """The function and its gradient."""
        points, triangles = mesh_of(beyond(plane))
        if len(triangles) == 0:
            return -float(plane @ moment), -moment
        volume, middle = solid_properties(points, triangles)
        slope = volume * middle - moment
        return float(plane @ slope) - volume, slope

    def curvature(plane: Floats) -> Floats:
        """(3, 3) second derivatives, from differences."""
        step = DIFFERENCE * float(norms(plane))
        rows = [(at(plane + h)[1] - at(plane - h)[1]) for h in step * np.eye(3)]
        matrix = np.array(rows) / (2.0 * step)
        matrix = 0.5 * (matrix + matrix.T)
        # There is none where the room is not cut.
        least = REGULAR * np.trace(matrix) + np.finfo(np.float64).tiny
        return np.asarray(matrix + least * np.eye(3))

    now = START * toward / farthest
    value, slope = at(now)
    for _ in range(STEPS_TO_PLANE):
        if norms(slope) <= CENTERED:
            size = float(norms(now))
            part = beyond(now).scale((unit,) * 3).translate(tuple(center))
            normal = now / size
            return HalfSpacePart(part, normal, float(normal @ center) + unit / size)
        step = -np.linalg.solve(curvature(now), slope)
        step *= min(1.0, float(norms(now) / norms(step)))
        for _ in range(HALVINGS):
            following, gradient = at(now + step)
            # Near the end the value is all rounding, and the slope is not.
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
    """All of a solid that is deeper than a wall, but for small parts, and its least distance from
    the surface, measured between triangles. Parameters, and what is raised, as `balancing_cavity`.
    """
    outside = _outside(surface, wall)
    grid, depth = depth_grid(surface, STEPS), wall
    for _ in range(TIMES):
        room = _deeper(grid, depth)
        if room is None:
            break
        least = float(outside.min_gap(room, 2.0 * wall))
        if least >= wall:
            return room, least
        depth += DEEPER * (wall - least) + LITTLE * wall
    raise InputError(
        f"hollow: expected room for a cavity in walls of {wall:g}, got none in a body with a "
        f"largest depth of {grid.depths.max():.3g}; reduce wall_mm, or leave hollow out"
    )


def least_wall(surface: Surface, cavity: Surface) -> float:
    """Least distance between the surface of a solid and that of a cavity, both oriented outward."""
    most = surface.diagonal
    inner = solid(cavity.points, cavity.triangles)
    return float(_outside(surface, most).min_gap(inner, most))


def _outside(surface: Surface, margin: float) -> Manifold:
    """A box about a solid, larger by a margin, without it."""
    lower = surface.points.min(axis=0) - margin
    size = np.ptp(surface.points, axis=0) + 2.0 * margin
    body = solid(surface.points, surface.triangles)
    return Manifold.cube(tuple(size)).translate(tuple(lower)) - body


def _deeper(grid: DepthGrid, depth: float) -> Manifold | None:
    """Part of a solid deeper than a distance; None if there is none."""
    values = grid.depths - depth
    # Where two sheets would meet in a cell the cavity gives way.
    inside = ~without_double_cuts(-values)
    if not inside.any():
        return None
    least = np.finfo(np.float64).eps * grid.spacing

    def crossing(nodes: Integers, ahead: Integers) -> Floats:
        one, other = values[tuple(nodes.T)], values[tuple(ahead.T)]
        leaves = inside[tuple(nodes.T)]
        inner = np.where(leaves, one, other).clip(least)
        outer = np.where(leaves, other, one).clip(max=0.0)
        part = np.where(leaves, inner, -outer) / (inner - outer)
        return grid.places(nodes + part[:, None] * (ahead - nodes))

    parts = solid(*surface_nets(inside, crossing)).decompose()
    most = max(part.volume() for part in parts)
    large_parts = [part for part in parts if part.volume() >= LEAST_PART * most]
    return Manifold.batch_boolean(large_parts, OpType.Add)


REACH_STEPS: Final = 28
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
    grid = depth_grid(surface, REACH_STEPS)
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


def with_cavity(surface: Surface, wall: float, center: Floats) -> Surface:
    """A solid with the least cavity that brings its center of mass to a place (3,), as the surfaces
    of both together. Parameters, and what is raised, as `balancing_cavity`."""
    return join_surfaces(surface, _reverse(balancing_cavity(surface, wall, center)))


def measure_cavities(body: Body) -> Cavities:
    """The cavities of a body in mm.

    body: of one surface oriented outward and others, oriented inward, inside of it. Raises
    InputError if it is none.
    """
    assert body.triangles is not None
    shell = shells_of(body.triangles)
    shells = [
        surface_of(body.points, body.triangles[shell == k]) for k in range(int(shell.max()) + 1)
    ]
    outer = [each for each in shells if each.volume > 0.0]
    inner = [_reverse(each) for each in shells if each.volume < 0.0]
    if len(outer) != 1 or not inner:
        raise InputError(
            f"{body.name}: expected one surface with cavities inside, got {len(outer)} oriented "
            f"outward and {len(inner)} inward; make the die again"
        )
    whole = Surface(body.points, body.triangles)
    volume = sum(each.volume for each in inner)
    return Cavities(
        number=len(inner),
        wall_mm=min(least_wall(outer[0], each) for each in inner),
        volume_mm3=volume,
        part=volume / outer[0].volume,
        shift_mm=float(np.linalg.norm(whole.centroid - outer[0].centroid)),
    )


def _reverse(surface: Surface) -> Surface:
    return Surface(surface.points, surface.triangles[:, ::-1])
