"""Pictures of pages on a laptop and on a phone, for the gallery."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from PIL import Image

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

LAPTOP, PHONE = (1280, 800), (390, 844)
"""Sizes in pixels of the window."""

STEPS = ("roll", "pick", "dress", "try", "take", "experts")
"""Steps of the page of `dicedesign view`, and its part for experts."""

PATIENCE_MS = 600_000.0
"""Timeout in milliseconds: a busy machine designs six dice in minutes."""

SETTLE_MS = 1500.0
"""Milliseconds in which a page draws the die anew."""

SEEDED = "let seed = 5; Math.random = () => (seed = (seed * 16807) % 2147483647) / 2147483647;"
"""Random numbers of pages, which are seeds of throws: minimal standard generator by S. K. Park and
K. W. Miller (1988)."""


@contextmanager
def open_page(
    browser: Browser, address: str, size: tuple[int, int], errors: list[str]
) -> Iterator[Page]:
    """Open a page without motion. size: of the window, in pixels; errors: receives those of its
    scripts."""
    context = browser.new_context(
        viewport={"width": size[0], "height": size[1]},
        color_scheme="light",
        reduced_motion="reduce",
    )
    context.set_default_timeout(PATIENCE_MS)
    context.add_init_script(SEEDED)
    page = context.new_page()
    page.on("pageerror", lambda error: errors.append(f"{address}: {error}"))
    page.goto(address)
    yield page
    context.close()


def screenshot(page: Page) -> Image.Image:
    """What a window shows when nothing moves and nothing is under the pointer."""
    page.mouse.move(0.0, 0.0)
    page.wait_for_timeout(SETTLE_MS)
    return Image.open(io.BytesIO(page.screenshot(timeout=PATIENCE_MS)))


def take_steps(page: Page) -> Iterator[Image.Image]:
    """Go through `STEPS` as a person does, with a picture of each."""
    page.wait_for_selector("#caption:not(:empty)")
    yield screenshot(page)
    page.click("#next:not([disabled])")
    page.wait_for_selector(".candidate")
    page.wait_for_selector("#progress", state="hidden")
    yield screenshot(page)
    page.click("#next:not([disabled])")
    page.check('[name="labels"][value="icons"]', force=True)
    page.wait_for_selector("#print-verdict.ok")
    yield screenshot(page)
    page.click("#next:not([disabled])")
    page.click("#throw-many:not([disabled])")
    page.wait_for_selector("#tally-verdict.ok")
    yield screenshot(page)
    page.click("#next:not([disabled])")
    page.wait_for_selector("#take-verdict.ok")
    yield screenshot(page)
    page.click("#experts")
    page.wait_for_selector("#body-verdict.ok")
    page.click("#body-map")
    page.wait_for_selector("#map:not([hidden]) svg path")
    yield screenshot(page)
