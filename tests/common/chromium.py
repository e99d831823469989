"""Chromium without a window, which tests of pages drive."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

import pytest

__all__ = ["MISSING_BROWSER", "chromium"]

MISSING_BROWSER: Final = "no chromium that playwright can drive"

_OPTIONS: Final = (
    "--no-sandbox",
    "--lang=en-US",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
)
"""Draws 3D views without a graphics card."""


@contextmanager
def chromium() -> Iterator[object]:
    """The browser; the test is skipped where there is none."""
    program = shutil.which("chromium") or shutil.which("chromium-browser")
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        program = None
    if program is None:
        pytest.skip(MISSING_BROWSER)
    speech = {**os.environ, "LANG": "en_US.UTF-8", "LC_ALL": "en_US.UTF-8"}
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=program, args=_OPTIONS, env=speech)
        yield browser
        browser.close()
