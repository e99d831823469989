"""The page of `dicedesign view` in a headless Chromium, as a person uses and sees it."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self
from urllib.parse import urlsplit

import numpy as np
from common.looks import check_looks
from common.served import Served
from PIL import Image

if TYPE_CHECKING:
    from playwright.sync_api import BrowserContext, Page

PATIENCE = 90_000.0
"""Timeout in milliseconds, for a busy machine without a graphics card."""


@dataclass
class DiePage:
    """A page in the browser.

    Attributes
    ----------
    served: the server side, in this process.
    page: playwright's.
    foreign_urls: requests of the page to other sites.
    errors: errors of its scripts.
    posts: path and JSON value of each request.
    """

    served: Served
    page: Page
    foreign_urls: list[str] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)
    posts: list[tuple[str, Any]] = field(default_factory=list)

    @classmethod
    def open(cls, served: Served, context: BrowserContext) -> Self:
        """Load the page, and wait until a body is in view."""
        opened = cls(served, context.new_page())
        page = opened.page
        page.set_default_timeout(PATIENCE)
        page.on("pageerror", lambda error: opened.errors.append(str(error)))
        page.on("request", opened._note)
        page.goto(served.gate.address)
        page.wait_for_selector("#caption:not(:empty)")
        return opened

    def _note(self, request: Any) -> None:
        parts = urlsplit(request.url)
        own = urlsplit(self.served.gate.address).netloc
        if parts.scheme not in ("data", "blob") and parts.netloc != own:
            self.foreign_urls.append(request.url)
        if request.method == "POST" and parts.path != "/body/upload":
            self.posts.append((parts.path, request.post_data_json))

    def check(self) -> None:
        """No script failed, and nothing came from another site."""
        assert self.errors == []
        assert self.foreign_urls == []

    def text(self, selector: str) -> str:
        """Visible text of an element."""
        return self.page.inner_text(selector).strip()

    def choose(self, key: str, value: str) -> None:
        """Choose one of several."""
        self.page.check(f'[name="{key}"][value="{value}"]', force=True)

    def next(self) -> None:
        """Press the button at the foot, once it is ready."""
        self.page.click("#next:not([disabled])")

    def until(self, condition: Callable[[], bool]) -> None:
        """Wait until a condition holds."""
        for _ in range(int(PATIENCE / 100.0)):
            if condition():
                return
            self.page.wait_for_timeout(100.0)
        raise AssertionError("the condition did not hold in time")

    def tally(self, name: str = "tally") -> list[tuple[str, str]]:
        """Label and last cell of each row of a table."""
        rows = self.page.eval_on_selector_all(
            f"#{name} tr", "rows => rows.map(r => [r.cells[0].innerText, r.cells[2].innerText])"
        )
        return [(label.strip(), value.strip()) for label, value in rows]

    def download(self, kind: str, folder: Path) -> Path:
        """Save one of the files of the last step."""
        with self.page.expect_download() as waiting:
            self.page.click(f"#take-{kind}")
        path = folder / waiting.value.suggested_filename
        waiting.value.save_as(path)
        return path

    def check_looks(self) -> None:
        """What is on the screen is inside it, legible and not cut."""
        check_looks(self.page)

    def picture(self) -> np.ndarray:
        """(h, w, 3) picture of the page as floats from 0 to 255."""
        image = Image.open(io.BytesIO(self.page.screenshot(timeout=PATIENCE))).convert("RGB")
        return np.asarray(image).astype(np.float64)

    def die_box(self) -> tuple[float, float, float, float]:
        """Left, top, right and bottom of the colored die in the stage, in pixels."""
        picture = self.picture()
        panel = self.page.locator("#panel").bounding_box()
        assert panel is not None
        is_beside = panel["x"] > 0.0
        right = int(panel["x"]) if is_beside else picture.shape[1]
        bottom = picture.shape[0] if is_beside else int(panel["y"]) - 50
        stage = picture[60:bottom, :right]
        is_colored = np.ptp(stage, axis=2) > 60.0
        rows, columns = np.flatnonzero(is_colored.any(1)), np.flatnonzero(is_colored.any(0))
        assert len(rows), "no die in the picture"
        return (
            float(columns[0]) / right,
            float(rows[0]) / len(stage),
            float(columns[-1]) / right,
            float(rows[-1]) / len(stage),
        )
