"""The body in the scene: its mesh, its hull, the facets that it rests on, its center of mass."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.report.charts.palette import DARK, FAINT, rgb
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.view.bodies.viewed_body import ViewedBody
from dicedesign.view.scenes.place import Place
from dicedesign.view.scenes.sphere import MOST_LABELS, OnRay, bytes_of, tell_rays

if TYPE_CHECKING:
    from viser import SceneApi

__all__ = ["BodyNodes"]

_GRAY: Final = tuple(np.rint(255.0 * rgb([FAINT])[0]).astype(int).tolist())

_EDGE: Final = tuple(np.rint(255.0 * rgb([DARK])[0]).astype(int).tolist())

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
        nothing = np.zeros((3, 3)), np.array([[0, 1, 2]])
        self._mesh = scene.add_mesh_simple(
            "/body/mesh", *nothing, color=_SURFACE, flat_shading=True, side="double"
        )
        self._hull = scene.add_mesh_simple(
            "/body/hull", *nothing, color=_SURFACE, flat_shading=True, side="front"
        )
        self._edges = scene.add_line_segments(
            "/body/edges", np.zeros((1, 2, 3)), _GRAY, thickness=1.5
        )
        self._rests = scene.add_line_segments(
            "/body/rests", np.zeros((1, 2, 3)), np.zeros((1, 2, 3), np.uint8), thickness=5.0
        )
        self._center = scene.add_icosphere("/body/center", 0.045, color=_EDGE)
        self._labels: list[Any] = []
        self._faces: Integers | None = None

    def show_mesh(self, points: Floats | None, triangles: Integers | None) -> None:
        """Show a mesh, points (n, 3) in the scene's unit, within a hull that lets it through; None
        for the hull alone."""
        inside = points is not None
        if points is not None and triangles is not None:
            _give(self._mesh, points, triangles)
        self._mesh.visible = inside
        self._hull.opacity = 0.25 if inside else None

    def on_click(self, clicked: OnRay) -> None:
        """Call a function with the ray of each click on the hull."""
        tell_rays(self._hull, clicked)

    def update(self, viewed: ViewedBody, place: Place) -> None:
        """Show a body's hull and what it rests on."""
        hull = viewed.hull
        points = place.into_scene(hull.vertices)
        if self._faces is None or not np.array_equal(hull.triangles, self._faces):
            self._faces = hull.triangles
        _give(self._hull, points, self._faces)
        half = np.flatnonzero(np.arange(len(hull.tail)) < hull.twin)
        self._edges.points = np.stack([points[hull.tail[half]], points[hull.head[half]]], axis=1)
        self._update_rests(viewed, points)
        self._center.position = place.into_scene(viewed.center)

    def _update_rests(self, viewed: ViewedBody, points: Floats) -> None:
        hull, rows = viewed.hull, viewed.rows
        outlines, colors = [], []
        color_of_row = np.array([row.color for row in rows])
        for facet, row in zip(viewed.poses.facets, viewed.row_of_rest, strict=True):
            outline = _outline(hull, points, int(facet))
            outlines.append(outline)
            colors.append(np.repeat(color_of_row[row], len(outline)))
        self._rests.colors = np.repeat(bytes_of(np.concatenate(colors))[:, None], 2, axis=1)
        self._rests.points = np.concatenate(outlines)
        shown = [row for row in rows[:MOST_LABELS] if row.rest >= 0]
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


def _outline(hull: ConvexHull, points: Floats, facet: int) -> Floats:
    """(k, 2, 3) edges of a facet, drawn in a little so that neighbours' lie beside them."""
    corners = points[hull.tail[hull.facet_start[facet] : hull.facet_start[facet + 1]]]
    middle = corners.mean(axis=0)
    drawn = middle + 0.93 * (corners - middle) + 0.004 * hull.normals[facet]
    return np.stack([drawn, np.roll(drawn, -1, axis=0)], axis=1)


def _give(mesh: Any, points: Floats, triangles: Integers) -> None:
    """Vertices and faces of a mesh; where they are the same nothing is sent."""
    mesh.vertices = points
    mesh.faces = triangles
