"""Pages in Debian's Chromium without windows, for pictures and tests."""

from __future__ import annotations

import os
import shutil
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from playwright.sync_api import Browser
    from starlette.applications import Starlette

    from dicedesign.view.server import Gate

PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
"""Names of the browser, the first of which is Debian's."""

ARGUMENTS = (
    "--no-sandbox",
    "--lang=en-US",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
)
"""English, and WebGL without a graphics card."""


def missing_browser() -> str | None:
    """Name of a missing requirement, or None."""
    for package in ("uvicorn", "playwright"):
        if find_spec(package) is None:
            return package
    return None if _browser_program() else PROGRAMS[0]


def _browser_program() -> str | None:
    return next(filter(None, map(shutil.which, PROGRAMS)), None)


@contextmanager
def headless_browser() -> Iterator[Browser]:
    """Start the browser in English."""
    from playwright.sync_api import sync_playwright

    english = {**os.environ, "LANG": "en_US.UTF-8", "LC_ALL": "en_US.UTF-8"}
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=_browser_program(), args=list(ARGUMENTS), env=dict(english)
        )
        try:
            yield browser
        finally:
            browser.close()


@contextmanager
def served_app(
    make: Callable[[Gate], Starlette], host: str | None = None, key: str = ""
) -> Iterator[Gate]:
    """Serve an application from a thread of this process.

    make: makes it for a gate, which is for a host (None: this machine) and with a key.
    """
    import uvicorn

    from dicedesign.view.server import LOOPBACK, Gate, open_socket

    listening = open_socket(0)
    gate = Gate(listening.getsockname()[1], host or LOOPBACK, key)
    server = uvicorn.Server(uvicorn.Config(make(gate), log_level="critical", ws="none"))
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]}, daemon=True)
    thread.start()
    try:
        while not server.started:
            time.sleep(0.01)
        yield gate
    finally:
        server.should_exit = server.force_exit = True
        thread.join()
        listening.close()
