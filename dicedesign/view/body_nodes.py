"""The body in the scene: mesh, hull, resting facets, center of mass, and the handle to drag."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.report.palette import DARK, FAINT, PALE, rgb
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.view.motion import Place
from dicedesign.view.sphere import (
    COLORS,
    MOST_LABELS,
    NOTHING,
    OnRay,
    edge_ribbons,
    give,
    tell_rays,
)
from dicedesign.view.viewed_body import ViewedBody

if TYPE_CHECKING:
    from viser import SceneApi


OnDrag = Callable[[str, Floats, Floats], None]
"""Is told "start", "update" or "end" of a drag, the quaternion (4,) and the position (3,)."""


class Gizmo:
    """Arrows, squares and arcs around a point of the body, in the body's frame of the scene.

    on_drag: called in the thread that serves; it may not wait.
    """

    def __init__(self, scene: SceneApi, on_drag: OnDrag) -> None:
        self._node = scene.add_transform_controls(
            "/body/gizmo", scale=0.7, disable_rotations=True, depth_test=False, visible=False
        )

        # Of viser's two kinds of callbacks only these keep their order.
        async def moved(event: Any) -> None:
            on_drag(event.phase, np.array(self._node.wxyz), np.array(self._node.position))

        self._node.on_update(moved)

    def put(self, position: Floats, *, turns: bool) -> None:
        """Show it at a position (3,), with arcs to turn something by or without."""
        self._node.disable_rotations = not turns
        self._node.wxyz, self._node.position = (1.0, 0.0, 0.0, 0.0), position
        self._node.visible = True

    def hide(self) -> None:
        """Show nothing to drag."""
        self._node.visible = False


def met_facet(hull: ConvexHull, origin: Floats, direction: Floats) -> tuple[int, Floats] | None:
    """The facet through which a ray from outside, origin (3,) and direction (3,), enters a hull,
    and where (3,); None where it passes by."""
    heights, slopes = hull.heights(origin), hull.normals @ direction
    with np.errstate(divide="ignore", invalid="ignore"):
        ways = heights / slopes
    enters = slopes < 0.0
    if not enters.any() or (heights[slopes == 0.0] < 0.0).any():
        return None
    facet = int(np.where(enters, ways, -np.inf).argmax())
    way = float(ways[facet])
    leaves = ways[slopes > 0.0]
    if way < 0.0 or (len(leaves) and way > leaves.min()):
        return None
    return facet, origin + way * direction


def met_sphere(origin: Floats, direction: Floats) -> Floats | None:
    """The unit direction (3,) at which a ray meets the unit sphere from outside, or None."""
    direction = direction / np.linalg.norm(direction)
    middle = -float(origin @ direction)
    under = middle * middle - float(origin @ origin) + 1.0
    if under < 0.0 or middle < 0.0:
        return None
    met: Floats = origin + (middle - np.sqrt(under)) * direction
    return met / np.linalg.norm(met)


_GRAY: Final = tuple(np.rint(255.0 * rgb([FAINT])[0]).astype(int).tolist())

_EDGE: Final = tuple(np.rint(255.0 * rgb([DARK])[0]).astype(int).tolist())

EDGE_WIDTH: Final = 0.012

_INSIDE: Final = tuple(np.rint(255.0 * rgb([PALE])[0]).astype(int).tolist())

_SURFACE: Final = (216, 222, 228)


class BodyNodes:
    """The nodes of a body, which are updated in place; all are below `/body`, whose frame stands
    on the floor.

    Attributes
    ----------
    frame: the node of the body's frame.
    """

    def __init__(self, scene: SceneApi) -> None:
        self._scene = scene
        self.frame = scene.add_frame("/body", show_axes=False)
        self._mesh = scene.add_mesh_simple(
            "/body/mesh", *NOTHING, color=_INSIDE, flat_shading=True, side="double"
        )
        self._hull = scene.add_mesh_simple(
            "/body/hull", *NOTHING, color=_SURFACE, flat_shading=True, side="front"
        )
        self._edges = scene.add_mesh_simple(
            "/body/edges", *NOTHING, color=_GRAY, side="double", cast_shadow=False
        )
        self._rests = [
            scene.add_mesh_simple(
                f"/body/rests{number}",
                *NOTHING,
                color=color,
                flat_shading=True,
                side="double",
                visible=False,
            )
            for number, color in enumerate(COLORS.tolist())
        ]
        self._center = scene.add_icosphere("/body/center", 0.045, color=_EDGE)
        self._labels: list[Any] = []

    def show_mesh(self, points: Floats | None, triangles: Integers | None) -> None:
        """Show a mesh, points (n, 3) in the scene's unit, within a hull that lets it through; None
        for the hull alone."""
        inside = points is not None
        if points is not None and triangles is not None:
            give(self._mesh, points, triangles)
        self._mesh.visible = inside
        self._hull.opacity = 0.25 if inside else None
        for node in self._rests:
            node.opacity = 0.5 if inside else None

    def show_hull(self, points: Floats, triangles: Integers) -> None:
        """Show a hull, points (n, 3) in the scene's unit, of which no more is known."""
        self.show_mesh(None, None)
        for node in (self._edges, *self._rests):
            node.visible = False
        while self._labels:
            self._labels.pop().remove()
        give(self._hull, points, triangles)

    def on_click(self, clicked: OnRay | None) -> None:
        """Call a function with the ray of each click on the hull; None for a hull that lets the
        mouse through to what is inside."""
        self._hull.remove_click_callback()
        if clicked is not None:
            tell_rays(self._hull, clicked)

    def update(self, viewed: ViewedBody, place: Place) -> None:
        """Show a body's hull and what it rests on."""
        hull = viewed.hull
        points = place.into_scene(hull.vertices)
        give(self._hull, points, hull.triangles)
        self._edges.visible = True
        give(self._edges, *edge_ribbons(hull, points, EDGE_WIDTH))
        self._update_rests(viewed, points)
        self._center.position = place.into_scene(viewed.center)

    def _update_rests(self, viewed: ViewedBody, points: Floats) -> None:
        """Color the facets that the body rests on like their basins."""
        hull, rows = viewed.hull, viewed.rows
        of_rest = np.array([row.color for row in rows])[viewed.row_of_rest] % len(self._rests)
        for number, node in enumerate(self._rests):
            facets = viewed.poses.facets[of_rest == number].tolist()
            node.visible = len(facets) > 0
            if facets:
                give(node, *_drawn(hull, points, facets))
        self._update_labels(viewed, points)

    def _update_labels(self, viewed: ViewedBody, points: Floats) -> None:
        hull, rows = viewed.hull, viewed.rows
        shown = [row for row in rows[:MOST_LABELS] if row.rest >= 0]
        if viewed.outcomes is not None and self._mesh.visible:
            # They would hide those that are cut in.
            shown = []
        while len(self._labels) > len(shown):
            self._labels.pop().remove()
        for number, row in enumerate(shown):
            if number == len(self._labels):
                name = f"/body/label{number}"
                self._labels.append(
                    self._scene.add_label(name, "", depth_test=True, anchor="center-center")
                )
            facet = int(viewed.poses.facets[row.rest])
            corners = points[hull.tail[hull.facet_start[facet] : hull.facet_start[facet + 1]]]
            self._labels[number].text = row.label
            self._labels[number].position = corners.mean(axis=0) + 0.03 * hull.normals[facet]


def _drawn(hull: ConvexHull, points: Floats, facets: list[int]) -> tuple[Floats, Integers]:
    """Corners (n, 3) and triangles of facets, a little above the hull and a little smaller."""
    corners, triangles, count = [], [], 0
    for facet in facets:
        own = points[hull.tail[hull.facet_start[facet] : hull.facet_start[facet + 1]]]
        middle = own.mean(axis=0)
        corners.append(middle + 0.94 * (own - middle) + 0.003 * hull.normals[facet])
        inner = np.arange(1, len(own) - 1)
        fan = np.stack([np.zeros_like(inner), inner, inner + 1], axis=1)
        triangles.append(count + fan)
        count += len(own)
    return np.concatenate(corners), np.concatenate(triangles)
