"""Pages for tests."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from common.browser import OpenedPage

from dicedesign.view.application import View

if TYPE_CHECKING:
    from playwright.sync_api import Browser

Open = Callable[..., OpenedPage]


@pytest.fixture
def open_page(browser: Browser) -> Iterator[Open]:
    """Opens a path, or None, as `dicedesign view` does, in a new window."""
    with ExitStack() as ends:

        def open_path(path: Path | None = None, kind: type[OpenedPage] = OpenedPage) -> OpenedPage:
            view = View(path)
            ends.callback(view.close)
            context = browser.new_context(
                viewport={"width": 960, "height": 640}, accept_downloads=True
            )
            ends.callback(context.close)
            return kind.open(view, context.new_page())

        yield open_path
