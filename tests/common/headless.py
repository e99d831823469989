"""A Chromium without windows, to press the buttons of a page and to see what comes of it."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from playwright.sync_api import Browser

MISSING_BROWSER = "no browser: "
"""Reasons for skipping tests that need one begin so."""

PROGRAMS = ("chromium", "chromium-browser", "google-chrome")

ARGUMENTS = (
    "--no-sandbox",
    "--lang=en-US",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
)
"""English, and WebGL without a graphics card."""


def missing_browser() -> str | None:
    """What is missing for pages in a browser; None where nothing is."""
    for package in ("viser", "playwright"):
        if find_spec(package) is None:
            return package
    return None if _program() else PROGRAMS[0]


def _program() -> str | None:
    found = (shutil.which(name) for name in PROGRAMS)
    return next((path for path in found if path), None)


@contextmanager
def headless_browser() -> Iterator[Browser]:
    """The browser. It sees English whatever the system speaks."""
    from playwright.sync_api import sync_playwright

    english = {**os.environ, "LANG": "en_US.UTF-8", "LC_ALL": "en_US.UTF-8"}
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=_program(), args=list(ARGUMENTS), env=dict(english)
        )
        try:
            yield browser
        finally:
            browser.close()
