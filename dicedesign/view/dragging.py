"""Drag the center of mass, a corner or a facet of the hull."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from dicedesign.runtime.arrays import Floats
from dicedesign.view.motion import release_motion
from dicedesign.view.nodes import Gizmo
from dicedesign.view.viewed_body import ViewedBody, facet_vertices
from dicedesign.view.viewport import Viewport

__all__ = ["DragControls"]

CENTER = "Center of mass"
CORNER = "Corner"
FACET = "Facet"
NOTHING = "Nothing"

OUTSIDE = "The center of mass of a body is always inside its hull. Drag it back."


class DragControls:
    """Fields, buttons and gizmo for dragging."""

    def __init__(self, viewport: Viewport) -> None:
        self._viewport, page = viewport, viewport.page
        self._target = NOTHING
        self._facet, self._corner = 0, 0
        self._base: ViewedBody | None = None
        self._first = viewport.viewed
        target = page.gui.add_dropdown(
            "Drag",
            (NOTHING, CENTER, CORNER, FACET),
            hint="Pull the arrows in the picture. Click the body to choose a corner or a facet.",
        )
        field: Any = page.gui.add_vector3(
            "Center",
            (0.0, 0.0, 0.0),
            step=1e-3,
            hint="Center of mass in the unit of the mesh; type numbers to move it",
        )
        self._center_field = field
        restart = page.gui.add_button("Start over", hint="The body as it was loaded")
        uniform = page.gui.add_button(
            "Solid of one density", hint="Move the center of mass to the centroid of the hull"
        )
        self._gizmo = Gizmo(
            page.scene,
            lambda *event: page.enqueue(
                lambda: self._drag(*event), "drag" if event[0] == "update" else None
            ),
        )
        target.on_update(lambda _: page.enqueue(lambda: self._choose(target.value)))
        restart.on_click(lambda _: page.enqueue(self._restart))
        uniform.on_click(lambda _: page.enqueue(self._make_uniform))

        @field.on_update
        def _(event: Any) -> None:
            # Updates by this page have no client.
            if event.client is not None:
                center = np.array(field.value)
                page.enqueue(lambda: self._set_center(center), "typed")

        viewport.on_facet = self._click
        viewport.on_show.append(self._begin)

    def _begin(self, viewed: ViewedBody) -> None:
        """Start with another body."""
        self._first, self._base = viewed, None
        extent = float(np.ptp(viewed.hull.vertices, axis=0).max())
        digits = max(0, 4 - int(np.floor(np.log10(extent))))
        self._center_field.precision, self._center_field.step = digits, 10.0**-digits
        self._facet = int(viewed.poses.facets[0])
        self._corner = int((viewed.hull.vertices @ -viewed.poses.normals[0]).argmax())
        self._place_controls()

    def _choose(self, target: str) -> None:
        self._target = target
        self._viewport.enable_clicks(target in (CORNER, FACET))
        self._place_controls()

    def _place_controls(self) -> None:
        """Show the center of mass in its field, and put the gizmo on its target."""
        viewed = self._viewport.viewed
        self._corner = min(self._corner, len(viewed.hull.vertices) - 1)
        self._facet = min(self._facet, len(viewed.hull.normals) - 1)
        # Adding zero removes the sign of a zero.
        is_zero = np.abs(viewed.center) < 0.5 * self._center_field.step
        self._center_field.value = tuple((np.where(is_zero, 0.0, viewed.center) + 0.0).tolist())
        if self._target == NOTHING:
            self._gizmo.hide()
            return
        position = self._viewport.frame.to_scene(self._target_point(viewed))
        self._gizmo.put(position, can_turn=self._target == FACET)

    def _target_point(self, viewed: ViewedBody) -> Floats:
        """(3,) point of a body that the gizmo drags."""
        if self._target == CENTER:
            return viewed.center
        if self._target == CORNER:
            return np.asarray(viewed.hull.vertices[self._corner])
        return np.asarray(viewed.hull.polygon(self._facet).mean(axis=0))

    def _click(self, facet: int, point: Floats) -> None:
        viewed = self._viewport.viewed
        corners = facet_vertices(viewed.hull, facet)
        distances = np.linalg.norm(viewed.hull.vertices[corners] - point, axis=1)
        self._facet, self._corner = facet, int(corners[distances.argmin()])
        self._place_controls()

    def _drag(self, phase: str, wxyz: Floats, position: Floats) -> None:
        viewed = self._viewport.viewed
        if phase == "start":
            self._viewport.hold()
            self._base = viewed
        elif phase == "update":
            self._base = self._base or viewed
            self._follow(self._base, viewed, wxyz, position)
        elif self._base is not None:
            base, self._base = self._base, None
            self._commit(base)

    def _follow(self, base: ViewedBody, viewed: ViewedBody, wxyz: Floats, position: Floats) -> None:
        """Show the base body with its target at a position of the scene."""
        point = self._viewport.frame.from_scene(position)
        if self._target == CENTER:
            moved, is_outside = viewed.with_center(point)
            self._viewport.page.notify(OUTSIDE if is_outside else "", is_error=is_outside)
        else:
            vertices = np.array([self._corner])
            if self._target == FACET:
                vertices = facet_vertices(base.hull, self._facet)
            arms = base.hull.vertices[vertices] - self._target_point(base)
            points = point + Rotation.from_quat(wxyz, scalar_first=True).apply(arms)
            moved = base.with_vertices(vertices, points).with_numbers_of(viewed)
        self._viewport.update(moved)

    def _commit(self, base: ViewedBody) -> None:
        """End a change of `base`: the body rolls to rest."""
        viewed = self._viewport.viewed
        if viewed is base:
            return
        if viewed.hull is not base.hull:
            # The nearest corner and facet of the new hull.
            self._corner = int(np.abs(viewed.hull.source - self._corner).argmin())
            self._facet = int((viewed.hull.normals @ base.hull.normals[self._facet]).argmax())
        self._settle(viewed)

    def _settle(self, viewed: ViewedBody) -> None:
        self._viewport.page.notify("")
        self._place_controls()
        self._viewport.move(release_motion(viewed, self._viewport.pose))

    def _set_center(self, center: Floats) -> None:
        viewed = self._viewport.viewed
        moved, is_outside = viewed.with_center(center)
        self._viewport.update(moved)
        self._commit(viewed)
        self._viewport.page.notify(OUTSIDE if is_outside else "", is_error=is_outside)

    def _make_uniform(self) -> None:
        viewed = self._viewport.viewed
        self._viewport.update(viewed.with_uniform_center())
        self._commit(viewed)

    def _restart(self) -> None:
        self._viewport.update(self._first)
        self._settle(self._first)
