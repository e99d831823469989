"""Pages for tests."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from common.die_page import DiePage
from common.served import served_page

if TYPE_CHECKING:
    from playwright.sync_api import Browser

Open = Callable[..., DiePage]


@pytest.fixture
def open_page(browser: Browser) -> Iterator[Open]:
    """Opens a path, or None, as `dicedesign view` does, in a window of a size."""
    with ExitStack() as ends:

        def open_path(
            path: Path | None = None, size: tuple[int, int] = (1280, 800), dark: bool = False
        ) -> DiePage:
            served = ends.enter_context(served_page(path))
            context = browser.new_context(
                viewport={"width": size[0], "height": size[1]},
                color_scheme="dark" if dark else "light",
                reduced_motion="reduce",
                accept_downloads=True,
            )
            ends.callback(context.close)
            return DiePage.open(served, context)

        yield open_path
