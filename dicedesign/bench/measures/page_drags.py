"""How fast a page follows the mouse: from drags in the browser to what it shows of them."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dicedesign.runtime.arrays import Floats
from dicedesign.view.application import View
from dicedesign.view.bodies.viewed_body import ViewedBody

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

__all__ = ["DragRates", "drag_rates", "gizmo_place", "screen_place"]

PATIENCE: Final = 120_000.0
"""Milliseconds that a page may take to show a body."""

WATCH: Final = """() => {
  const seen = window.seen = {updates: [], frames: 0, last: null};
  const look = () => {
    const body = document.getElementById('body');
    const update = body && body.getAttribute('data-update');
    if (update !== seen.last) { seen.last = update; seen.updates.push(performance.now()); }
  };
  new MutationObserver(look).observe(
    document.body, {childList: true, subtree: true, attributes: true});
  const count = () => { seen.frames += 1; requestAnimationFrame(count); };
  requestAnimationFrame(count);
}"""
"""Notes when the page shows another body, and counts the frames it draws."""

SIZE: Final = (640, 480)
"""Pixels of the window: who draws without a graphics card draws few."""

REACH: Final = 0.12
"""Of the drag to either side, in units of the scene, in which the body has the radius 1."""

LEAST_EVENT: Final = 1.0 / 120.0
"""Seconds between two moves of the mouse."""


@dataclass(frozen=True)
class DragRates:
    """What a drag of some seconds came to.

    Attributes
    ----------
    moves: of the mouse; updates: of the body that the browser showed; frames: that it drew.
    seconds: that it took. gaps: (n,) milliseconds between updates.
    """

    moves: int
    updates: int
    frames: int
    seconds: float
    gaps: Floats


def drag_rates(browser: Browser, viewed: ViewedBody, seconds: float) -> DragRates:
    """Drag the center of mass of a body to and fro by the arrow of its gizmo."""
    view = View(None)
    context = browser.new_context(viewport={"width": SIZE[0], "height": SIZE[1]})
    try:
        page = context.new_page()
        page.set_default_timeout(PATIENCE)
        view.page.soon(lambda: view.exhibit.show(viewed))
        page.goto(view.page.gate.address)
        page.wait_for_selector("#odds")
        # The panel hides half of so small a window.
        page.wait_for_timeout(3000.0)
        page.evaluate(WATCH)
        return _dragged(view, page, seconds)
    finally:
        context.close()
        view.close()


def _dragged(view: View, page: Page, seconds: float) -> DragRates:
    at, axes = gizmo_place(view)
    arrow = at + 0.5 * axes[:, 2]
    page.mouse.move(*screen_place(view, SIZE, arrow))
    page.wait_for_timeout(1000.0)
    page.mouse.down()
    page.mouse.move(*screen_place(view, SIZE, arrow + 0.02 * axes[:, 2]))
    before = page.evaluate("() => ({updates: window.seen.updates.length, frames: seen.frames})")
    started, moves = time.perf_counter(), 0
    while (now := time.perf_counter() - started) < seconds:
        way = REACH * np.sin(2.0 * np.pi * now)
        page.mouse.move(*screen_place(view, SIZE, arrow + way * axes[:, 2]))
        moves += 1
        time.sleep(max(0.0, started + moves * LEAST_EVENT - time.perf_counter()))
    took = time.perf_counter() - started
    after: dict[str, Any] = page.evaluate("() => window.seen")
    page.mouse.up()
    times = np.array(after["updates"][before["updates"] :], dtype=np.float64)
    return DragRates(moves, len(times), after["frames"] - before["frames"], took, np.diff(times))


def gizmo_place(view: View) -> tuple[Floats, Floats]:
    """Where the gizmo is in the scene (3,), and its axes (3, 3) as columns."""
    scene, turned = view.page.scene, view.exhibit.pose[:3, :3]
    node, frame = scene.get_handle_by_name("/body/gizmo"), scene.get_handle_by_name("/body")
    assert node is not None
    assert frame is not None
    return turned @ node.position + frame.position, turned


def screen_place(view: View, size: tuple[int, int], point: Floats) -> tuple[float, float]:
    """Where a point (3,) of the scene is in a window of a size in pixels, from its upper left; of
    the only browser that is open."""
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
