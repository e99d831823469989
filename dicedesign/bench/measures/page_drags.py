"""How fast a page follows the mouse: from drags in the browser to what it shows of them."""

from __future__ import annotations

import queue
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

SHAKE: Final = """([start, end, seconds, wait]) => new Promise((done) => {
  const seen = {updates: [], frames: 0, moves: 0, seconds: 0}, began = performance.now();
  const under = document.elementFromPoint(...start);
  let last = null, drawing = true;
  const look = () => {
    const body = document.getElementById('body');
    const update = body && body.getAttribute('data-update');
    if (update !== last) { last = update; seen.updates.push(performance.now()); }
  };
  const watch = new MutationObserver(look);
  watch.observe(document.body, {childList: true, subtree: true, attributes: true});
  const draw = () => { seen.frames += 1; if (drawing) requestAnimationFrame(draw); };
  requestAnimationFrame(draw);
  const mouse = setInterval(() => {
    const passed = (performance.now() - began) / 1000;
    if (passed > seconds) {
      clearInterval(mouse);
      watch.disconnect();
      drawing = false;
      seen.seconds = passed;
      done(seen);
      return;
    }
    const part = 0.5 - 0.5 * Math.cos(2 * Math.PI * passed);
    const [x, y] = [0, 1].map((k) => start[k] + part * (end[k] - start[k]));
    under.dispatchEvent(new PointerEvent('pointermove', {
      clientX: x, clientY: y, pointerId: 1, pointerType: 'mouse', isPrimary: true,
      buttons: 1, bubbles: true}));
    seen.moves += 1;
  }, wait);
})"""
"""Moves a mouse that is down to and fro, notes when the page shows another body, and counts the
frames it draws."""

SIZE: Final = (640, 480)
"""Pixels of the window: who draws without a graphics card draws few."""

REACH: Final = 0.12
"""Of the drag to either side, in units of the scene, in which the body has the radius 1."""

SETTLING: Final = 6000.0
"""Milliseconds."""

UPDATES: Final = 20
"""That are timed."""

LEAST_EVENT: Final = 1.0 / 120.0
"""Seconds between two moves of the mouse."""


@dataclass(frozen=True)
class DragRates:
    """What a drag of some seconds came to.

    Attributes
    ----------
    moves: of the mouse; updates: of the body that the browser showed; frames: that it drew.
    seconds: that it took. gaps: (n,) milliseconds between updates.
    work: seconds of a processor that the server takes for an update, up to what it sends.
    """

    moves: int
    updates: int
    frames: int
    seconds: float
    gaps: Floats
    work: float


def drag_rates(browser: Browser, viewed: ViewedBody, seconds: float) -> DragRates:
    """Drag the center of mass of a body to and fro by the arrow of its gizmo."""
    view = View(None)
    context = browser.new_context(viewport={"width": SIZE[0], "height": SIZE[1]})
    try:
        page = context.new_page()
        page.set_default_timeout(PATIENCE)
        view.page.soon(lambda: view.exhibit.show(viewed))
        page.goto(view.page.gate.address)
        page.get_by_role("tab", name="Body").click()
        page.wait_for_selector("#odds")
        # Until all is compiled that draws.
        page.wait_for_timeout(SETTLING)
        return _dragged(view, page, seconds)
    finally:
        context.close()
        view.close()


def _dragged(view: View, page: Page, seconds: float) -> DragRates:
    at, axes = gizmo_place(view)
    ends = [screen_place(view, SIZE, at + (0.5 + way) * axes[:, 2]) for way in (-REACH, REACH)]
    middle = np.mean(ends, axis=0).tolist()
    page.mouse.move(*middle)
    page.wait_for_timeout(1000.0)
    page.mouse.down()
    page.mouse.move(*ends[0])
    page.wait_for_timeout(1000.0)
    seen: dict[str, Any] = page.evaluate(SHAKE, [*ends, seconds, 1e3 * LEAST_EVENT])
    page.mouse.up()
    work = _work(view)
    times = np.array(seen["updates"], dtype=np.float64)
    return DragRates(
        seen["moves"], len(times), seen["frames"], seen["seconds"], np.diff(times), work
    )


def _work(view: View) -> float:
    """Seconds of a processor for an update of the body on show."""
    told: queue.Queue[float] = queue.Queue()

    def update() -> None:
        exhibit = view.exhibit
        assert exhibit.viewed is not None
        aside = 1e-3 * np.ptp(exhibit.viewed.hull.vertices, axis=0)
        began = time.thread_time()
        for step in range(UPDATES):
            exhibit.update(exhibit.viewed.with_center(exhibit.viewed.center + step * aside)[0])
        told.put((time.thread_time() - began) / UPDATES)

    view.page.soon(update)
    return told.get(timeout=PATIENCE / 1e3)


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
