"""Pages of `dicedesign view` in a headless Chromium."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Self
from urllib.parse import urlsplit

import numpy as np

from dicedesign.view.application import View

if TYPE_CHECKING:
    from playwright.sync_api import Page

PATIENCE = 60_000.0
"""Timeout in milliseconds, for a busy machine without a graphics card."""


@dataclass
class OpenedPage:
    """A page in the browser, and the view that serves it.

    Attributes
    ----------
    view: the server side, in this process.
    page: playwright's.
    foreign_urls: blocked requests of the page to other sites.
    errors: errors of its scripts.
    """

    ready: ClassVar[str] = "#probabilities"
    """Selector of an element of the loaded page."""

    view: View
    page: Page
    foreign_urls: list[str] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)

    @classmethod
    def open(cls, view: View, page: Page) -> Self:
        """Load the page and wait until it is ready."""
        opened = cls(view, page)
        page.set_default_timeout(PATIENCE)
        page.on("pageerror", lambda error: opened.errors.append(str(error)))
        page.on("websocket", lambda socket: opened._is_own(socket.url))
        page.route("**/*", opened._handle)
        page.goto(view.page.gate.address)
        page.wait_for_selector(cls.ready)
        return opened

    def _handle(self, route: Any) -> None:
        if self._is_own(route.request.url):
            route.continue_()
        else:
            route.abort()

    def _is_own(self, url: str) -> bool:
        """Whether a URL belongs to the page; all others are recorded."""
        parts = urlsplit(url)
        host = urlsplit(self.view.page.gate.address).netloc
        is_own = parts.scheme in ("data", "blob") or parts.netloc == host
        if not is_own:
            self.foreign_urls.append(url)
        return is_own

    def rows(self) -> list[list[str]]:
        """Texts of the table of probabilities: the label, nothing, and numbers in percent."""
        return self.table("probabilities")

    def table(self, name: str) -> list[list[str]]:
        """Texts of a table by its id."""
        rows = self.page.eval_on_selector_all(
            f"#{name} tbody tr", "rows => rows.map(r => [...r.cells].map(c => c.innerText.trim()))"
        )
        return [list(row) for row in rows]

    def probabilities(self, column: int = -1) -> np.ndarray:
        """Column of the table of probabilities, as parts of 1."""
        return np.array([float(row[column]) for row in self.rows()]) / 100.0

    def center(self) -> np.ndarray:
        """Center of mass on the page."""
        text = self.page.inner_text("#center")
        return np.array([float(part) for part in text.split(",")])

    def updates(self) -> int:
        """Number of changes of the body that the page has shown."""
        return int(self.page.get_attribute("#body", "data-update") or 0)

    def button(self, name: str) -> None:
        """Press a button by its text."""
        self.page.get_by_role("button", name=re.compile(rf"^\s*{re.escape(name)}\s*$")).click()

    def choose(self, label: str, option: str) -> None:
        """Choose an option of the list with a label."""
        self.page.get_by_label(label, exact=True).first.click()
        self.page.get_by_role("option", name=option, exact=True).click()

    def until(self, condition: Callable[[], bool]) -> None:
        """Wait until a condition holds."""
        for _ in range(int(PATIENCE / 100.0)):
            if condition():
                return
            self.page.wait_for_timeout(100.0)
        raise AssertionError("the condition did not hold in time")

    def on_screen(self, point: np.ndarray) -> tuple[float, float]:
        """Position of a point (3,) of the scene, in pixels from the upper left of the window."""
        size = self.page.viewport_size
        assert size is not None
        return screen_place(self.view, (size["width"], size["height"]), point)

    def drag(self, start: np.ndarray, end: np.ndarray, steps: int = 8) -> None:
        """Drag the mouse from a point (3,) of the scene to another."""
        mouse = self.page.mouse
        mouse.move(*self.on_screen(start))
        self.page.wait_for_timeout(300.0)
        mouse.down()
        for part in np.linspace(0.0, 1.0, steps + 1)[1:]:
            mouse.move(*self.on_screen(start + part * (end - start)))
            self.page.wait_for_timeout(60.0)
        mouse.up()


def gizmo_place(view: View) -> tuple[np.ndarray, np.ndarray]:
    """Position (3,) of the gizmo in the scene, and its axes (3, 3) as columns."""
    scene, rotation = view.page.scene, view.viewport.pose[:3, :3]
    node, frame = scene.get_handle_by_name("/body/gizmo"), scene.get_handle_by_name("/body")
    assert node is not None
    assert frame is not None
    return rotation @ node.position + frame.position, rotation


def screen_place(view: View, size: tuple[int, int], point: np.ndarray) -> tuple[float, float]:
    """Position of a point (3,) in a window of a size, in pixels from its upper left.

    Exactly one browser is open.
    """
    (client,) = view.page.server.get_clients().values()
    camera = client.camera
    forward = np.asarray(camera.look_at) - np.asarray(camera.position)
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, np.asarray(camera.up_direction))
    right /= np.linalg.norm(right)
    ray = point - np.asarray(camera.position)
    half = np.tan(camera.fov / 2.0) * float(ray @ forward)
    x = 0.5 + 0.5 * float(ray @ right) / (half * size[0] / size[1])
    y = 0.5 - 0.5 * float(ray @ np.cross(right, forward)) / half
    return float(x * size[0]), float(y * size[1])
