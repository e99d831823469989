"""The handle that is dragged with the mouse, and what of the body a click meets."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.runtime.arrays import Floats

if TYPE_CHECKING:
    from viser import SceneApi

__all__ = ["Gizmo", "met_facet", "met_sphere"]

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
