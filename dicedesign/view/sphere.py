"""The Gauss sphere in the scene: coloured basins, arcs of the complex, its points and labels."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import angle_between, even_directions, norms, unit_vectors
from dicedesign.report.discs import basin_of_directions, great_arcs, lowest_corners
from dicedesign.report.palette import BASINS, DARK, rgb
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.view.motion import SPHERE_AT, SPHERE_RADIUS
from dicedesign.view.viewed_body import ViewedBody

if TYPE_CHECKING:
    from viser import SceneApi


LONGEST_PIECE: Final = 0.12
"""Radians of a straight piece of an arc."""

MOST_EDGES: Final = 400
"""Of a hull whose edges are drawn; those of others lie too close."""

Mesh = tuple[Floats, Integers]
"""Points (n, 3) and triangles (t, 3)."""

NOTHING: Final[Mesh] = (np.zeros((3, 3)), np.array([[0, 1, 2]]))
"""A mesh that is not seen: a browser wants one triangle."""


def arc_ribbons(paths: tuple[Floats, ...], radius: float, width: float) -> Mesh:
    """Polylines of unit directions, each (m, 3), as strips along a sphere of a radius."""
    if not paths:
        return NOTHING
    starts = np.concatenate([path[:-1] for path in paths])
    ends = np.concatenate([path[1:] for path in paths])
    pieces = np.ceil(angle_between(starts, ends) / LONGEST_PIECE).astype(np.int64)
    corners = []
    for count in np.unique(pieces[pieces > 0]).tolist():
        arcs = great_arcs(starts[pieces == count], ends[pieces == count], count)
        aside = 0.5 * width * unit_vectors(np.linalg.cross(arcs[:, 0], arcs[:, -1]))[:, None]
        left, right = radius * arcs + aside, radius * arcs - aside
        quads = [left[:, :-1], right[:, :-1], right[:, 1:], left[:, 1:]]
        corners.append(np.stack(quads, axis=2).reshape(-1, 4, 3))
    return _quads(np.concatenate(corners)) if corners else NOTHING


def edge_ribbons(hull: ConvexHull, points: Floats, width: float) -> Mesh:
    """The edges of a hull whose corners are at points (n, 3), as strips along each of its facets, a
    little above them; nothing where there are too many."""
    if len(hull.tail) > 2 * MOST_EDGES:
        return NOTHING
    up = hull.normals[hull.facet]
    start, end = points[hull.tail], points[hull.head]
    inward = unit_vectors(np.linalg.cross(up, end - start))
    # The border of a small facet is narrower.
    shortest = np.minimum.reduceat(norms(end - start), hull.facet_start[:-1])
    wide = np.minimum(width, 0.1 * shortest[hull.facet])[:, None]
    lift = 0.002 * up
    quads = [start + lift, end + lift, end + lift + wide * inward, start + lift + wide * inward]
    return _quads(np.stack(quads, axis=1))


def _quads(corners: Floats) -> Mesh:
    """Quadrilaterals (q, 4, 3) as two triangles each."""
    halves = np.array([[0, 1, 2], [0, 2, 3]])
    triangles = (4 * np.arange(len(corners))[:, None, None] + halves).reshape(-1, 3)
    return corners.reshape(-1, 3), triangles


DIRECTIONS: Final = even_directions(6000)
"""At which the sphere is coloured; the arcs hide that borders between dots are not sharp."""

DOT: Final = 0.036
"""Size of a dot that leaves no gaps, on a sphere of radius 1."""

ARC_WIDTH: Final = 0.012

MOST_LABELS: Final = 24

COLORS: Final = np.rint(255.0 * rgb(BASINS)).astype(np.uint8)
"""(20, 3) of rows of bars, 0 to 255; they repeat after the last."""

_DARK: Final = tuple(np.rint(255.0 * rgb([DARK])[0]).astype(int).tolist())


OnRay = Callable[[Floats, Floats], None]
"""Is given the origin (3,) and the direction (3,) of a ray in the scene, in the thread that serves;
it may not wait."""


class Sphere:
    """The nodes of the Gauss sphere, which are updated in place."""

    def __init__(self, scene: SceneApi) -> None:
        self._scene = scene
        scene.add_frame("/sphere", show_axes=False, position=SPHERE_AT)
        self._inside = scene.add_icosphere(
            "/sphere/inside",
            0.985 * SPHERE_RADIUS,
            color=(250, 250, 250),
            cast_shadow=False,
            receive_shadow=False,
        )
        empty = np.zeros((1, 3))
        self._dots = scene.add_point_cloud(
            "/sphere/dots",
            SPHERE_RADIUS * DIRECTIONS,
            np.full((len(DIRECTIONS), 3), 200, dtype=np.uint8),
            point_size=DOT * SPHERE_RADIUS,
            point_shape="circle",
            precision="float32",
        )
        # Viser makes the material of dots anew with their colours, and the browser would compile it
        # each time if no others had it.
        scene.add_point_cloud(
            "/sphere/unseen", np.zeros((2, 3)), np.zeros((2, 3), dtype=np.uint8), point_size=1e-3
        )
        self._arcs = scene.add_mesh_simple(
            "/sphere/arcs", *NOTHING, color=_DARK, side="double", cast_shadow=False
        )
        self._points = {
            kind: scene.add_point_cloud(
                f"/sphere/{kind}",
                empty,
                color,
                point_size=size,
                point_shape=shape,  # type: ignore[arg-type]
                precision="float32",
            )
            for kind, color, size, shape in (
                ("minima", _DARK, 0.05, "circle"),
                ("saddles", (255, 255, 255), 0.035, "diamond"),
                ("maxima", (255, 255, 255), 0.04, "square"),
            )
        }
        self._down = scene.add_icosphere("/sphere/down", 0.04, color=(194, 87, 26))
        self._labels: list[Any] = []
        self._hull: ConvexHull | None = None
        self._lowest: Integers | None = None

    def on_click(self, clicked: OnRay) -> None:
        """Call a function with the ray of each click on the sphere."""
        tell_rays(self._inside, clicked)

    def update(self, viewed: ViewedBody) -> None:
        """Show a body's basins and complex."""
        poses, rows = viewed.poses, viewed.rows
        color_of_row = np.array([row.color for row in rows])
        of_rest = COLORS[color_of_row[viewed.row_of_rest] % len(COLORS)]
        if self._hull is not poses.hull:
            self._hull, self._lowest = poses.hull, lowest_corners(poses.hull, DIRECTIONS)
        self._dots.colors = of_rest[basin_of_directions(poses, DIRECTIONS, self._lowest)]
        give(self._arcs, *arc_ribbons(poses.morse.polylines, 1.02 * SPHERE_RADIUS, ARC_WIDTH))
        for kind, node in self._points.items():
            node.points = 1.025 * SPHERE_RADIUS * getattr(poses.morse, kind)
        self._update_labels(viewed)

    def point_down(self, down: Floats) -> None:
        """Mark the direction (3,) of the body that points down."""
        self._down.position = 1.02 * SPHERE_RADIUS * down

    def _update_labels(self, viewed: ViewedBody) -> None:
        shown = [row for row in viewed.rows[:MOST_LABELS] if row.rest >= 0]
        while len(self._labels) > len(shown):
            self._labels.pop().remove()
        for place, row in enumerate(shown):
            if place == len(self._labels):
                name = f"/sphere/label{place}"
                self._labels.append(
                    self._scene.add_label(name, "", depth_test=True, anchor="bottom-center")
                )
            label = self._labels[place]
            label.text = row.label
            label.position = 1.06 * SPHERE_RADIUS * viewed.poses.normals[row.rest]


def tell_rays(node: Any, clicked: OnRay) -> None:
    """Call a function with the ray of each click on a node of the scene."""

    @node.on_click
    async def _(event: Any) -> None:
        clicked(np.array(event.ray_origin), np.array(event.ray_direction))


def give(mesh: Any, points: Floats, triangles: Integers) -> None:
    """Vertices and faces of a mesh; where they are the same nothing is sent."""
    mesh.vertices = points
    mesh.faces = triangles
