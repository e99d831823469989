"""Headless Chromium for tests of pages."""

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
"""Prefix of the reasons for skipped tests."""

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
    """Name of a missing requirement, or None."""
    for package in ("viser", "playwright"):
        if find_spec(package) is None:
            return package
    return None if _program() else PROGRAMS[0]


def _program() -> str | None:
    return next(filter(None, map(shutil.which, PROGRAMS)), None)


@contextmanager
def headless_browser() -> Iterator[Browser]:
    """Start the browser in English."""
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
