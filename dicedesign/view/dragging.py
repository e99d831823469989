"""Dragging: the center of mass, a corner or a facet of the hull; undo, and back to the start."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from dicedesign.runtime.arrays import Floats
from dicedesign.view.exhibit import Exhibit
from dicedesign.view.motion import settled
from dicedesign.view.nodes import Gizmo
from dicedesign.view.page import Page
from dicedesign.view.viewed_body import ViewedBody

__all__ = ["Dragging"]

CENTER: Final = "Center of mass"
CORNER: Final = "Corner"
FACET: Final = "Facet"
NOTHING: Final = "Nothing"

UNDO: Final = "Undo"
RESTART: Final = "Start over"

OUTSIDE: Final = (
    "The center of mass stays inside the hull: every body has it there. Drag it back to go on."
)

MOST_STEPS: Final = 200
"""That can be undone."""


class Dragging:
    """The handle, what it drags, and the bodies before."""

    def __init__(self, exhibit: Exhibit) -> None:
        self._exhibit = exhibit
        self._what = CENTER
        self._facet = 0
        self._corner = 0
        self._base: ViewedBody | None = None
        self._first: ViewedBody | None = None
        self._before: list[ViewedBody] = []
        self._field: Any = None
        self._gizmo: Any = None
        self._page: Any = None

    def build(self, page: Page) -> None:
        """Add the GUI elements and the handle."""
        self._page, gui = page, page.gui
        what = gui.add_dropdown(
            "Drag",
            (CENTER, CORNER, FACET, NOTHING),
            hint="Pull the arrows in the picture. Click the body to choose a corner or a facet.",
        )
        self._field = gui.add_vector3(
            "Center",
            (0.0, 0.0, 0.0),
            step=1e-3,
            hint="Center of mass in the unit of the mesh; type numbers to move it",
        )
        back = gui.add_button_group("Go back", (UNDO, RESTART))
        even = gui.add_button(
            "Solid of one density", hint="Put the center of mass where that of the solid hull is"
        )
        self._gizmo = Gizmo(
            page.scene,
            lambda *moved: page.soon(
                lambda: self._dragged(*moved), "drag" if moved[0] == "update" else None
            ),
        )
        what.on_update(lambda _: page.soon(lambda: self._choose(what.value)))
        back.on_click(lambda _: page.soon(self._undo if back.value == UNDO else self._restart))
        even.on_click(lambda _: page.soon(self._even_out))

        @self._field.on_update
        def _(event: Any) -> None:
            # Of a person, not of this page.
            if event.client is not None:
                page.soon(lambda: self._typed(np.array(self._field.value)), "typed")

        self._exhibit.on_facet = self._clicked

    def begin(self, viewed: ViewedBody) -> None:
        """Another body is on show."""
        self._first, self._base, self._before = viewed, None, []
        extent = float(np.ptp(viewed.hull.vertices, axis=0).max())
        digits = max(0, 4 - int(np.floor(np.log10(extent))))
        self._field.precision, self._field.step = digits, 10.0**-digits
        self._facet = int(viewed.poses.facets[0])
        top = viewed.hull.vertices @ -viewed.poses.normals[0]
        self._corner = int(top.argmax())
        self._place_all()

    def _choose(self, what: str) -> None:
        self._what = what
        self._exhibit.listen(to_body=what in (CORNER, FACET))
        self._place_all()

    def _place_all(self) -> None:
        """Put the handle where the body is, and the numbers too."""
        viewed = self._exhibit.viewed
        if viewed is None:
            return
        # Adding zero takes the sign off a zero.
        tidy = np.where(np.abs(viewed.center) < 0.5 * self._field.step, 0.0, viewed.center) + 0.0
        self._field.value = tuple(float(x) for x in tidy)
        if self._what == NOTHING:
            self._gizmo.hide()
            return
        place = self._exhibit.place.into_scene(self._point(viewed))
        self._gizmo.put(place, turns=self._what == FACET)

    def _point(self, viewed: ViewedBody) -> Floats:
        """(3,) where the handle is on a body."""
        if self._what == CENTER:
            return viewed.center
        if self._what == CORNER:
            self._corner = min(self._corner, len(viewed.hull.vertices) - 1)
            return np.asarray(viewed.hull.vertices[self._corner])
        self._facet = min(self._facet, len(viewed.hull.normals) - 1)
        return np.asarray(viewed.hull.polygon(self._facet).mean(axis=0))

    def _clicked(self, facet: int, point: Floats) -> None:
        viewed = self._exhibit.viewed
        if viewed is None or self._what not in (CORNER, FACET):
            return
        corners = viewed.hull.tail[
            viewed.hull.facet_start[facet] : viewed.hull.facet_start[facet + 1]
        ]
        away = np.linalg.norm(viewed.hull.vertices[corners] - point, axis=1)
        self._facet, self._corner = facet, int(corners[away.argmin()])
        self._place_all()

    def _dragged(self, phase: str, wxyz: Floats, position: Floats) -> None:
        viewed = self._exhibit.viewed
        if viewed is None:
            return
        if phase == "start":
            self._exhibit.hold()
            self._base = viewed
        elif phase == "update":
            self._base = self._base or viewed
            self._follow(self._base, wxyz, position)
        elif self._base is not None:
            base, self._base = self._base, None
            self._keep(base)

    def _follow(self, base: ViewedBody, wxyz: Floats, position: Floats) -> None:
        """Show the body as it is with the handle at a position of the scene."""
        viewed = self._exhibit.viewed
        assert viewed is not None
        place = self._exhibit.place
        point = place.from_scene(position)
        if self._what == CENTER:
            moved, outside = viewed.with_center(point)
            self._page.say(OUTSIDE if outside else "", wrong=outside)
        elif self._what == CORNER:
            moved = base.with_vertex(self._corner, point).numbered_as(viewed)
        else:
            motion = place.motion(wxyz, position, self._point(base))
            moved = base.with_facet(self._facet, motion).numbered_as(viewed)
        self._exhibit.update(moved)

    def _keep(self, base: ViewedBody) -> None:
        """A change is done: it can be undone, and the body rolls where it now has to."""
        viewed = self._exhibit.viewed
        if viewed is None or viewed is base:
            return
        self._before = [*self._before[-MOST_STEPS:], base]
        self._page.say("")
        self._find_again(base, viewed)
        self._place_all()
        self._exhibit.move(settled(viewed, self._exhibit.pose))

    def _find_again(self, base: ViewedBody, viewed: ViewedBody) -> None:
        """The corner and the facet on the new hull that are nearest to those of the old."""
        if viewed.hull is base.hull:
            return
        sources = viewed.hull.source
        self._corner = int(np.abs(sources - self._corner).argmin())
        normal = base.hull.normals[min(self._facet, len(base.hull.normals) - 1)]
        self._facet = int((viewed.hull.normals @ normal).argmax())

    def _typed(self, center: Floats) -> None:
        viewed = self._exhibit.viewed
        if viewed is None:
            return
        moved, outside = viewed.with_center(center)
        self._exhibit.update(moved)
        self._keep(viewed)
        self._page.say(OUTSIDE if outside else "", wrong=outside)

    def _undo(self) -> None:
        if self._before:
            self._restore(self._before.pop())

    def _restart(self) -> None:
        viewed = self._exhibit.viewed
        if self._first is not None and viewed is not None and viewed is not self._first:
            self._before = [*self._before[-MOST_STEPS:], viewed]
            self._restore(self._first)

    def _restore(self, viewed: ViewedBody) -> None:
        self._page.say("")
        self._exhibit.update(viewed)
        self._place_all()
        self._exhibit.move(settled(viewed, self._exhibit.pose))

    def _even_out(self) -> None:
        viewed = self._exhibit.viewed
        if viewed is not None:
            self._exhibit.update(viewed.with_uniform_center())
            self._keep(viewed)
