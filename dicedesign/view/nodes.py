"""What is in the scene: the body with its hull, resting facets, center of mass and the handle to
drag, and the Gauss sphere with its basins, arcs and points."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import angle_between, even_directions, norms, unit_vectors
from dicedesign.report.discs import basin_of_directions, great_arcs, lowest_corners
from dicedesign.report.palette import BASINS, DARK, FAINT, PALE, rgb
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.view.motion import SPHERE_AT, SPHERE_RADIUS, Place
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
"""At which the sphere is colored; the arcs hide that borders between dots are not sharp."""

DOT: Final = 0.036
"""Size of a dot that leaves no gaps, on a sphere of radius 1."""

ARC_WIDTH: Final = 0.012

EDGE_WIDTH: Final = 0.012

MOST_LABELS: Final = 24

COLORS: Final = np.rint(255.0 * rgb(BASINS)).astype(np.uint8)
"""(20, 3) of rows of bars, 0 to 255; they repeat after the last."""

_DARK, _GRAY, _INSIDE = (
    tuple(color) for color in np.rint(255.0 * rgb([DARK, FAINT, PALE])).astype(int).tolist()
)

_SURFACE: Final = (216, 222, 228)

OnRay = Callable[[Floats, Floats], None]
"""Is given the origin (3,) and the direction (3,) of a ray in the scene, in the thread that serves;
it may not wait."""

OnDrag = Callable[[str, Floats, Floats], None]
"""Is told "start", "update" or "end" of a drag, the quaternion (4,) and the position (3,)."""


def _notify_rays(node: Any, clicked: OnRay) -> None:
    """Call a function with the ray of each click on a node of the scene."""

    @node.on_click
    async def _(event: Any) -> None:
        clicked(np.array(event.ray_origin), np.array(event.ray_direction))


def _give(mesh: Any, points: Floats, triangles: Integers) -> None:
    """Give a mesh vertices and faces; where they are the same nothing is sent."""
    mesh.vertices, mesh.faces = points, triangles


class _Labels:
    """Labels below a node of the scene, which are updated in place."""

    def __init__(self, scene: SceneApi, below: str, anchor: Any) -> None:
        self._scene, self._below, self._anchor = scene, below, anchor
        self._nodes: list[Any] = []

    def show(self, labels: Iterable[tuple[str, Floats]]) -> None:
        """Show texts at positions (3,), and no others."""
        shown = list(labels)
        while len(self._nodes) > len(shown):
            self._nodes.pop().remove()
        for number in range(len(self._nodes), len(shown)):
            name = f"{self._below}/label{number}"
            node = self._scene.add_label(name, "", depth_test=True, anchor=self._anchor)
            self._nodes.append(node)
        for node, (text, position) in zip(self._nodes, shown, strict=True):
            node.text, node.position = text, position


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
        # Viser makes the material of dots anew with their colors, and the browser would compile it
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
        self._labels = _Labels(scene, "/sphere", "bottom-center")
        self._hull: ConvexHull | None = None
        self._lowest: Integers | None = None

    def on_click(self, clicked: OnRay) -> None:
        """Call a function with the ray of each click on the sphere."""
        _notify_rays(self._inside, clicked)

    def update(self, viewed: ViewedBody) -> None:
        """Show a body's basins and complex."""
        poses, rows = viewed.poses, viewed.rows
        color_of_row = np.array([row.color for row in rows])
        of_rest = COLORS[color_of_row[viewed.row_of_rest] % len(COLORS)]
        if self._hull is not poses.hull:
            self._hull, self._lowest = poses.hull, lowest_corners(poses.hull, DIRECTIONS)
        self._dots.colors = of_rest[basin_of_directions(poses, DIRECTIONS, self._lowest)]
        _give(self._arcs, *arc_ribbons(poses.morse.polylines, 1.02 * SPHERE_RADIUS, ARC_WIDTH))
        for kind, node in self._points.items():
            node.points = 1.025 * SPHERE_RADIUS * getattr(poses.morse, kind)
        self._labels.show(
            (row.label, 1.06 * SPHERE_RADIUS * poses.normals[row.rest])
            for row in rows[:MOST_LABELS]
            if row.rest >= 0
        )

    def point_down(self, down: Floats) -> None:
        """Mark the direction (3,) of the body that points down."""
        self._down.position = 1.02 * SPHERE_RADIUS * down


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
        self._center = scene.add_icosphere("/body/center", 0.045, color=_DARK)
        self._labels = _Labels(scene, "/body", "center-center")

    def show_mesh(self, points: Floats | None, triangles: Integers | None) -> None:
        """Show a mesh, points (n, 3) in the scene's unit, within a hull that lets it through; None
        for the hull alone."""
        inside = points is not None
        if points is not None and triangles is not None:
            _give(self._mesh, points, triangles)
        self._mesh.visible = inside
        self._hull.opacity = 0.25 if inside else None
        for node in self._rests:
            node.opacity = 0.5 if inside else None

    def show_hull(self, points: Floats, triangles: Integers) -> None:
        """Show a hull, points (n, 3) in the scene's unit, of which no more is known."""
        self.show_mesh(None, None)
        for node in (self._edges, *self._rests):
            node.visible = False
        self._labels.show(())
        _give(self._hull, points, triangles)

    def on_click(self, clicked: OnRay | None) -> None:
        """Call a function with the ray of each click on the hull; None for a hull that lets the
        mouse through to what is inside."""
        self._hull.remove_click_callback()
        if clicked is not None:
            _notify_rays(self._hull, clicked)

    def update(self, viewed: ViewedBody, place: Place) -> None:
        """Show a body's hull and what it rests on."""
        hull = viewed.hull
        points = place.into_scene(hull.vertices)
        _give(self._hull, points, hull.triangles)
        self._edges.visible = True
        _give(self._edges, *edge_ribbons(hull, points, EDGE_WIDTH))
        self._center.position = place.into_scene(viewed.center)
        # The facets that the body rests on have the colors of their basins.
        facets, rows = viewed.poses.facets, viewed.rows
        of_rest = np.array([row.color for row in rows])[viewed.row_of_rest] % len(self._rests)
        for number, node in enumerate(self._rests):
            own = facets[of_rest == number].tolist()
            node.visible = len(own) > 0
            if own:
                _give(node, *_raised_facets(hull, points, own))
        # Labels would hide those that are cut in.
        are_cut = viewed.outcomes is not None and self._mesh.visible
        self._labels.show(
            (row.label, points[_corners(hull, facet)].mean(axis=0) + 0.03 * hull.normals[facet])
            for row in rows[: 0 if are_cut else MOST_LABELS]
            if row.rest >= 0
            for facet in (int(facets[row.rest]),)
        )


def _corners(hull: ConvexHull, facet: int) -> Integers:
    """(c,) vertices of a facet, in order."""
    return hull.tail[hull.facet_start[facet] : hull.facet_start[facet + 1]]


def _raised_facets(hull: ConvexHull, points: Floats, facets: list[int]) -> Mesh:
    """Facets of a hull whose corners are at points (n, 3), a little above it and a little
    smaller."""
    corners, triangles, count = [], [], 0
    for facet in facets:
        own = points[_corners(hull, facet)]
        middle = own.mean(axis=0)
        corners.append(middle + 0.94 * (own - middle) + 0.003 * hull.normals[facet])
        inner = np.arange(1, len(own) - 1)
        triangles.append(count + np.stack([np.zeros_like(inner), inner, inner + 1], axis=1))
        count += len(own)
    return np.concatenate(corners), np.concatenate(triangles)
