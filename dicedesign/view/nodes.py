"""Nodes of the scene: the body, the gizmo that drags it, and the Gauss sphere."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import even_directions
from dicedesign.palette import BASINS, DARK, FAINT, PALE, rgb
from dicedesign.report.discs import basin_of_directions, great_arcs, lowest_corners
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.view.motion import SPHERE_POSITION, SPHERE_RADIUS, SceneFrame
from dicedesign.view.viewed_body import ViewedBody, facet_vertices

if TYPE_CHECKING:
    from viser import SceneApi


ARC_PIECES = 8
"""Straight pieces of the arc from one corner of a polyline to the next."""

MAX_DRAWN_EDGES = 400
"""Hulls with more edges are drawn without edges."""

Mesh = tuple[Floats, Integers]
"""Points (n, 3) and triangles (t, 3)."""

EMPTY_MESH: Mesh = (np.zeros((3, 3)), np.array([[0, 1, 2]]))
"""Invisible mesh; a browser needs at least one triangle."""


NO_LINES = np.zeros((1, 2, 3))
"""Invisible segment of a line; a browser needs at least one."""


def arc_segments(paths: Sequence[Floats]) -> Floats:
    """Split polylines of unit directions, each (m, 3), into straight pieces (k, 2, 3) of arcs."""
    starts, ends = (
        np.concatenate([NO_LINES[:, 0], *parts])
        for parts in ([path[:-1] for path in paths], [path[1:] for path in paths])
    )
    arcs = great_arcs(starts[1:], ends[1:], ARC_PIECES)
    pieces = np.stack([arcs[:, :-1], arcs[:, 1:]], axis=2).reshape(-1, 2, 3)
    return np.concatenate([NO_LINES, pieces])


DIRECTIONS = even_directions(6000)
"""Directions of the dots that color the sphere; arcs cover the rough borders of basins."""

DOT_SIZE = 0.036
"""Size of dots without gaps on a unit sphere."""

LINE_WIDTH = 0.01

MAX_LABELS = 60

COLORS = np.rint(255.0 * rgb(BASINS)).astype(np.uint8)
"""(20, 3) colors of rows, 0 to 255; they repeat after the last."""

_DARK, _GRAY, _PALE = (
    tuple(color) for color in np.rint(255.0 * rgb([DARK, FAINT, PALE])).astype(int).tolist()
)

_HULL_COLOR = (216, 222, 228)

OnRay = Callable[[Floats, Floats], None]
"""Called with the origin (3,) and the direction (3,) of a ray in the scene, in the thread of the
server; must not block."""

OnDrag = Callable[[str, Floats, Floats], None]
"""Called with "start", "update" or "end", the quaternion (4,), w first, and the position (3,).

It runs in the thread of the server and must not block.
"""


def _notify_rays(node: Any, on_ray: OnRay) -> None:
    """Call a function with the ray of each click on a node."""

    @node.on_click
    async def _(event: Any) -> None:
        on_ray(np.array(event.ray_origin), np.array(event.ray_direction))


def _set_mesh(mesh: Any, points: Floats, triangles: Integers) -> None:
    """Set vertices and faces; viser sends only changes."""
    mesh.vertices, mesh.faces = points, triangles


class _Labels:
    """Labels that are children of a node, updated in place."""

    def __init__(self, scene: SceneApi, parent: str, anchor: Any) -> None:
        self._scene, self._parent, self._anchor = scene, parent, anchor
        self._nodes: list[Any] = []

    def show(self, labels: Iterable[tuple[str, Floats]]) -> None:
        """Show only these texts, at positions (3,)."""
        labels = list(labels)
        while len(self._nodes) > len(labels):
            self._nodes.pop().remove()
        while len(self._nodes) < len(labels):
            name = f"{self._parent}/label{len(self._nodes)}"
            node = self._scene.add_label(name, "", depth_test=True, anchor=self._anchor)
            self._nodes.append(node)
        for node, (text, position) in zip(self._nodes, labels, strict=True):
            node.text, node.position = text, position


class Sphere:
    """Nodes of the Gauss sphere, updated in place."""

    def __init__(self, scene: SceneApi) -> None:
        self._scene = scene
        scene.add_frame("/sphere", show_axes=False, position=SPHERE_POSITION)
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
            point_size=DOT_SIZE * SPHERE_RADIUS,
            point_shape="circle",
            precision="float32",
        )
        # Viser recreates the material of the dots with new colors. A second cloud with that
        # material saves the browser from compiling it again.
        scene.add_point_cloud(
            "/sphere/invisible", np.zeros((2, 3)), np.zeros((2, 3), dtype=np.uint8), point_size=1e-3
        )
        self._arcs: Any = scene.add_line_segments(
            "/sphere/arcs", NO_LINES, _DARK, thickness=LINE_WIDTH
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

    def on_click(self, on_ray: OnRay) -> None:
        """Call a function with the ray of each click on the sphere."""
        _notify_rays(self._inside, on_ray)

    def update(self, viewed: ViewedBody) -> None:
        """Show the basins and the Morse-Smale complex of a body."""
        poses = viewed.poses
        colors = COLORS[_color_of_rest(viewed)]
        # Flow lines follow this hull, which may have other corners than `poses.hull`.
        hull = poses.morse.equilibria.hull
        if self._hull is not hull:
            self._hull, self._lowest = hull, lowest_corners(hull, DIRECTIONS)
        self._dots.colors = colors[basin_of_directions(poses, DIRECTIONS, self._lowest)]
        self._arcs.points = 1.02 * SPHERE_RADIUS * arc_segments(poses.morse.polylines)
        for kind, node in self._points.items():
            node.points = 1.025 * SPHERE_RADIUS * getattr(poses.morse, kind)
        self._labels.show(
            (label, 1.06 * SPHERE_RADIUS * poses.normals[rest])
            for label, rest in viewed.labeled_rests[:MAX_LABELS]
        )

    def point_down(self, down: Floats) -> None:
        """Mark the direction (3,) that points down."""
        self._down.position = 1.02 * SPHERE_RADIUS * down


class Gizmo:
    """Handle that drags a point of the body, in the frame of the body."""

    def __init__(self, scene: SceneApi, on_drag: OnDrag) -> None:
        self._node = scene.add_transform_controls(
            "/body/gizmo", scale=0.7, disable_rotations=True, depth_test=False, visible=False
        )

        # Viser keeps the order of events only for asynchronous callbacks.
        async def on_update(event: Any) -> None:
            on_drag(event.phase, np.array(self._node.wxyz), np.array(self._node.position))

        self._node.on_update(on_update)

    def put(self, position: Floats, *, can_turn: bool) -> None:
        """Show the handle at a position (3,), with or without arcs for rotation."""
        self._node.disable_rotations = not can_turn
        self._node.wxyz, self._node.position = (1.0, 0.0, 0.0, 0.0), position
        self._node.visible = True

    def hide(self) -> None:
        """Hide the handle."""
        self._node.visible = False


def facet_on_ray(hull: ConvexHull, origin: Floats, direction: Floats) -> tuple[int, Floats]:
    """Facet and point (3,) where a ray from outside enters a hull.

    origin, direction: (3,) of the ray, which hits the hull.
    """
    slopes = hull.normals @ direction
    with np.errstate(divide="ignore", invalid="ignore"):
        distances = np.where(slopes < 0.0, hull.heights(origin) / slopes, -np.inf)
    facet = int(distances.argmax())
    return facet, origin + distances[facet] * direction


def direction_on_ray(origin: Floats, direction: Floats) -> Floats:
    """Unit vector (3,) where a ray from outside enters the unit sphere, or passes nearest to it."""
    direction = direction / np.linalg.norm(direction)
    closest = origin - (origin @ direction) * direction
    depth = np.sqrt(max(0.0, 1.0 - float(closest @ closest)))
    hit: Floats = closest - depth * direction
    return hit / np.linalg.norm(hit)


class BodyNodes:
    """Nodes of a body, updated in place.

    Attributes
    ----------
    frame: node `/body`, the parent of all others.
    """

    def __init__(self, scene: SceneApi) -> None:
        self._scene = scene
        self.frame = scene.add_frame("/body", show_axes=False)
        self._mesh = scene.add_mesh_simple(
            "/body/mesh", *EMPTY_MESH, color=_PALE, flat_shading=True, side="double"
        )
        self._hull = scene.add_mesh_simple(
            "/body/hull", *EMPTY_MESH, color=_HULL_COLOR, flat_shading=True, side="front"
        )
        self._edges: Any = scene.add_line_segments(
            "/body/edges", NO_LINES, _GRAY, thickness=LINE_WIDTH
        )
        self._rests = [
            scene.add_mesh_simple(
                f"/body/rests{number}",
                *EMPTY_MESH,
                color=color,
                flat_shading=True,
                side="double",
                visible=False,
            )
            for number, color in enumerate(COLORS.tolist())
        ]
        self._center = scene.add_icosphere("/body/center", 0.045, color=_DARK)
        self._engraved: tuple[Floats, Integers, dict[int, Integers]] | None = None
        self._blank = scene.add_mesh_simple(
            "/body/blank", *EMPTY_MESH, color=_HULL_COLOR, flat_shading=True, visible=False
        )
        self._labels = _Labels(scene, "/body", "center-center")

    def show_mesh(self, mesh: Mesh | None, viewed: ViewedBody) -> None:
        """Show a mesh, points (n, 3) in the scene, in a transparent hull; None shows no mesh.

        An engraved die has its facets in color instead, and its labels in ink.
        """
        self._engraved = None
        if mesh is not None:
            points, triangles = mesh
            self._engraved = split_engraved(mesh, viewed)
            if self._engraved is not None:
                triangles = self._engraved[1]
            _set_mesh(self._mesh, points, triangles)
        is_inked = self._engraved is not None
        self._mesh.visible, self._mesh.color = mesh is not None, _DARK if is_inked else _PALE
        self._hull.opacity = None if mesh is None else 0.0 if is_inked else 0.25
        for node in self._rests:
            node.opacity = None if mesh is None or is_inked else 0.5

    def on_click(self, on_ray: OnRay | None) -> None:
        """Call a function with the ray of each click on the hull; None lets the mouse through."""
        self._hull.remove_click_callback()
        if on_ray is not None:
            _notify_rays(self._hull, on_ray)

    def update(self, viewed: ViewedBody, frame: SceneFrame) -> None:
        """Show the hull and the resting facets of a body."""
        hull = viewed.hull
        points = frame.to_scene(hull.vertices)
        _set_mesh(self._hull, points, hull.triangles)
        self._edges.visible = len(hull.tail) <= 2 * MAX_DRAWN_EDGES
        if self._edges.visible:
            self._edges.points = points[np.stack([hull.tail, hull.head], axis=1)]
        self._center.position = frame.to_scene(viewed.center)
        # Facets have the colors of the basins for which they are labeled.
        facets, colors = viewed.labeled_facets, _color_of_rest(viewed)
        for color, node in enumerate(self._rests):
            colored_facets = facets[colors == color].tolist()
            node.visible = len(colored_facets) > 0
            if colored_facets and self._engraved is not None:
                mesh, _, triangles_of = self._engraved
                parts = [triangles_of[facet] for facet in colored_facets if facet in triangles_of]
                node.visible = len(parts) > 0
                if parts:
                    _set_mesh(node, mesh, np.concatenate(parts))
            elif colored_facets:
                _set_mesh(node, *_raise_facets(hull, points, colored_facets))
        self._blank.visible = False
        if self._engraved is not None:
            mesh, _, triangles_of = self._engraved
            parts = [own for facet, own in triangles_of.items() if facet not in facets]
            self._blank.visible = len(parts) > 0
            if parts:
                _set_mesh(self._blank, mesh, np.concatenate(parts))
        # Engraved labels stay visible.
        has_engraving = viewed.outcomes is not None and self._mesh.visible
        self._labels.show(
            (label, points[facet_vertices(hull, facet)].mean(axis=0) + 0.03 * hull.normals[facet])
            for label, rest in viewed.labeled_rests[: 0 if has_engraving else MAX_LABELS]
            for facet in [facets[rest]]
        )


MOST_PAIRS = 20_000_000
"""Limit on triangles times facets of a die that is split into its colors."""

DEEPEST = 0.15
"""Largest depth of a label below its facet, over the radius of the die."""

LEAST_FILLED = 0.9
"""Part of its hull that an engraved convex die fills."""

FLUSH = 1e-4
"""Distance from a facet's plane over the radius of the die, up to which a triangle is on it."""


def split_engraved(
    mesh: Mesh, viewed: ViewedBody
) -> tuple[Floats, Integers, dict[int, Integers]] | None:
    """Mesh of an engraved convex die: its points (n, 3), the triangles (t, 3) of its labels, and
    those on each facet; None for other bodies."""
    points, triangles = mesh
    hull, surface = viewed.hull, viewed.shape.body.surface
    source = viewed.shape.body.points
    is_decimated = len(points) != len(source)
    if viewed.outcomes is None or is_decimated or len(triangles) * len(hull.normals) > MOST_PAIRS:
        return None
    if surface.volume < LEAST_FILLED * hull.surface.volume:
        return None
    middles = source[triangles].mean(axis=1)
    depths = hull.heights(np.zeros(3)) - middles @ hull.normals.T
    facet, radius = depths.argmin(axis=1), float(np.ptp(source, axis=0).max()) / 2.0
    is_flush = depths.min(axis=1) <= FLUSH * radius
    if depths.min(axis=1).max() > DEEPEST * radius or not is_flush.any():
        return None
    triangles_of = {
        int(each): triangles[is_flush & (facet == each)] for each in np.unique(facet[is_flush])
    }
    return points, triangles[~is_flush], triangles_of


def _color_of_rest(viewed: ViewedBody) -> Integers:
    """(r,) index in `COLORS` of each rest."""
    return np.array([row.color for row in viewed.rows])[viewed.row_of_rest] % len(COLORS)


def _raise_facets(hull: ConvexHull, points: Floats, facets: list[int]) -> Mesh:
    """Shrink facets of a hull and raise them above it.

    points: (n, 3) vertices of the hull in the scene.
    """
    corners, triangles, count = [], [], 0
    for facet in facets:
        polygon = points[facet_vertices(hull, facet)]
        middle = polygon.mean(axis=0)
        corners.append(middle + 0.94 * (polygon - middle) + 0.003 * hull.normals[facet])
        inner = np.arange(1, len(polygon) - 1)
        triangles.append(count + np.stack([np.zeros_like(inner), inner, inner + 1], axis=1))
        count += len(polygon)
    return np.concatenate(corners), np.concatenate(triangles)
