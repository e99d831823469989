"""One body rolling from one orientation to rest (algorithm 1), as a sequence of rigid motions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from dicedesign.errors import InputError
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.sphere import angle_between, rotation_between
from dicedesign.geometry.triangles import Surface
from dicedesign.rest.equilibria import Equilibria
from dicedesign.rest.poses import rest_poses, standing_transforms
from dicedesign.rest.tracing import crossing, exit_half_edges, hinge_facets
from dicedesign.runtime.arrays import Floats
from dicedesign.tolerances import ROUNDING

SMALLEST_ANGLE = 1e-4
"""Least value of `max_angle`, in radians: about 30,000 steps for a half turn."""

Contact = Literal["vertex", "edge", "facet"]

CONTACTS: tuple[Contact, ...] = ("vertex", "edge", "facet")
"""What touches the table, by the number of its vertices; 3 or more are a facet."""


@dataclass(frozen=True)
class RollStep:
    """One moment of a roll.

    Attributes
    ----------
    down: (3,) unit direction that points down, in the body's frame.
    contact: what touches the table: "vertex", "edge" or "facet".
    vertices: hull vertices of the element in contact.
    height: height of the center of mass above the table, in the body's length unit.
    transform: (4, 4) rigid motion from the body's frame to the table's, z = 0 being the table. From
        step to step the body turns about its contact and does not slip.
    """

    down: Floats
    contact: Contact
    vertices: tuple[int, ...]
    height: float
    transform: Floats


@dataclass(frozen=True)
class _Moment:
    """A change of contact: the vertices touching the table, and those the body turns about next."""

    down: Floats
    touching: tuple[int, ...]
    turning: tuple[int, ...]


def roll(
    points_or_mesh: ArrayLike | Body | Surface,
    down: ArrayLike,
    max_angle: float | None = None,
    *,
    center_of_mass: ArrayLike | Literal["hull"] | None = None,
    coplanar_tolerance: float | None = None,
) -> tuple[RollStep, ...]:
    """Steps of a body that rolls from one orientation to rest.

    Parameters
    ----------
    points_or_mesh, center_of_mass, coplanar_tolerance: as for `dicedesign.rest_poses`.
    down, max_angle: as for `roll_steps`.

    Returns the steps, the first at the given orientation and the last on a stable facet. Vertex
    numbers refer to the hull of the points, `dicedesign.rest_poses(...).hull`.

    Raises
    ------
    DegenerateBodyError, OutsideHullError: as `dicedesign.rest_poses`.
    InputError: as `dicedesign.rest_poses` or `roll_steps`.

    Source: algorithm 1.
    """
    poses = rest_poses(points_or_mesh, center_of_mass, coplanar_tolerance=coplanar_tolerance)
    return roll_steps(poses.morse.equilibria, down, max_angle)


def roll_steps(
    equilibria: Equilibria, down: ArrayLike, max_angle: float | None = None
) -> tuple[RollStep, ...]:
    """Steps of `roll` for a classified hull.

    Parameters
    ----------
    equilibria: the classified hull.
    down: (3,) direction that points down at first, in the body's frame, not zero.
    max_angle: largest rotation in radians from one step to the next, at least `SMALLEST_ANGLE`;
        longer ones are split. Default: one step for each change of contact.

    Raises
    ------
    InputError: `down` is not three finite numbers or zero; `max_angle` is below `SMALLEST_ANGLE`.
    """
    start = np.asarray(down, dtype=np.float64)
    if start.shape != (3,) or not np.isfinite(start).all() or not start.any():
        raise InputError(
            f"down: expected three finite numbers, not all zero, got {down!r}; "
            "name the direction that points down"
        )
    if max_angle is not None and not max_angle >= SMALLEST_ANGLE:
        raise InputError(
            f"max angle: expected at least {SMALLEST_ANGLE:g} radians, got {max_angle:g}; take a "
            "larger one"
        )
    start = start / np.abs(start).max()
    # Between moments the body turns. Of several at one orientation the last counts, at which all
    # vertices in contact have touched down.
    moments: list[_Moment] = []
    for moment in _moments(equilibria, start / np.linalg.norm(start)):
        if moments and angle_between(moments[-1].down, moment.down) <= ROUNDING:
            moments.pop()
        moments.append(moment)
    first = moments[0]
    height = float(equilibria.radii[first.touching[0]] @ first.down)
    transform = standing_transforms(first.down, height, equilibria.center_of_mass)
    steps = [_step(equilibria, first.down, first.touching, transform)]
    for before, after in pairwise(moments):
        angle = float(angle_between(before.down, after.down))
        pieces = 1 if max_angle is None else max(1, int(np.ceil(angle / max_angle)))
        pivot = equilibria.hull.vertices[before.turning[0]]
        anchor = transform[:3, :3] @ pivot + transform[:3, 3]
        origin = transform[:3, :3]
        for piece in range(1, pieces + 1):
            arrived = piece == pieces
            direction = after.down
            if not arrived:
                left, gone = np.sin((1.0 - piece / pieces) * angle), np.sin(piece / pieces * angle)
                direction = (left * before.down + gone * after.down) / np.sin(angle)
            transform = np.eye(4)
            turn = rotation_between(origin @ direction, np.array([0.0, 0.0, -1.0]))
            transform[:3, :3] = turn @ origin
            transform[:3, 3] = anchor - transform[:3, :3] @ pivot
            touching = after.touching if arrived else before.turning
            steps.append(_step(equilibria, direction, touching, transform))
    return tuple(steps)


def _moments(equilibria: Equilibria, down: Floats) -> Iterator[_Moment]:
    hull = equilibria.hull
    vertex = int(np.argmax(equilibria.radii @ down))
    yield _Moment(down, (vertex,), (vertex,))
    while True:
        # In the cell of a vertex, until a hinge edge touches down.
        while True:
            at = np.array([vertex]), down[None], np.zeros(1)
            edge, _ = exit_half_edges(equilibria, *at, ascending=False)
            down = crossing(equilibria, edge, *at[1:], ascending=False)[0][0]
            ends = (vertex, int(hull.head[edge[0]]))
            if equilibria.hinge[edge[0]]:
                break
            vertex = ends[1]
            yield _Moment(down, ends, (vertex,))
        yield _Moment(down, ends, ends)
        facet = int(hinge_facets(equilibria, edge, down[None], np.zeros(1))[0][0])
        # From facet to facet over hinge edges, until one is stable or tips onto a vertex.
        while True:
            down = hull.normals[facet]
            corners = hull.tail[hull.facet_start[facet] : hull.facet_start[facet + 1]]
            touching = tuple(int(x) for x in corners)
            if equilibria.stable[facet]:
                yield _Moment(down, touching, ())
                return
            over = int(equilibria.roll_edge[facet])
            if over < 0:
                break
            yield _Moment(down, touching, (int(hull.tail[over]), int(hull.head[over])))
            facet = int(hull.facet[hull.twin[over]])
        vertex = int(equilibria.roll_vertex[facet])
        yield _Moment(down, touching, (vertex,))


def _step(
    equilibria: Equilibria, down: Floats, touching: tuple[int, ...], transform: Floats
) -> RollStep:
    contact: Contact = CONTACTS[min(len(touching), 3) - 1]
    height = float(equilibria.radii[touching[0]] @ down)
    return RollStep(down, contact, touching, height, transform)
