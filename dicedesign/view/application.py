"""Start, serve and end the page."""

from __future__ import annotations

import os
import sys
import threading
import webbrowser
from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np

from dicedesign.errors import printable
from dicedesign.geometry.meshes.body import make_body
from dicedesign.view.body_panel import BodyPanel
from dicedesign.view.new_die_panel import NewDiePanel
from dicedesign.view.page import Page, Panel
from dicedesign.view.serving import open_socket, require_viser
from dicedesign.view.sources import LoadCallbacks, open_source
from dicedesign.view.viewed_body import ViewedBody
from dicedesign.view.viewport import Viewport

__all__ = ["View", "serve_view"]

_BLOCK_SIDES: Final = (1.0, 1.2, 0.8)
"""Sides of the body on a page without a path."""


class View:
    """Page with its panels; `close` ends it.

    path: mesh, recipe, folder of a finished die, or folder of meshes; None shows a block. host,
    port: address of the page; port 0 is any free port.

    Raises InputError: the path, the host or the port cannot be used, or viser is not installed.
    """

    def __init__(self, path: Path | None, host: str = "127.0.0.1", port: int = 0) -> None:
        require_viser()
        source = None if path is None else open_source(path)
        first_body = None
        if source is None:
            corners = np.array(np.meshgrid(*[[-0.5, 0.5]] * 3)).reshape(3, -1).T
            first_body = ViewedBody.of(make_body(corners * _BLOCK_SIDES, name="a block"))
        elif source.is_quick:
            first_body = source.load(source.names[0], LoadCallbacks())
            for note in first_body.poses.notes:
                print(f"note: {printable(note)}", file=sys.stderr)
        self._end = threading.Event()
        self._error: Exception | None = None
        self.page = Page(open_socket(host, port))
        self.viewport = Viewport(self.page)
        body_panel = BodyPanel(self.viewport, source)
        panels: list[Panel] = [body_panel, NewDiePanel(self.viewport)]
        if source is None:
            panels.reverse()
        self.page.add_panels(panels)
        if first_body is not None:
            self.page.enqueue(lambda: self.viewport.show(first_body))
        elif source is not None:
            name = source.names[0]
            self.page.enqueue(lambda: body_panel.load(name, self._fail))

    def wait(self) -> None:
        """Serve the page until the first body fails to load, and raise its error.

        A body that loads quickly fails in the constructor. Raises KeyboardInterrupt.
        """
        self._end.wait()
        if self._error is not None:
            raise self._error

    def close(self) -> None:
        """Stop everything."""
        self.page.close()

    def _fail(self, error: Exception) -> None:
        self._error = error
        self._end.set()


def serve_view(
    path: Path | None, host: str, port: int, *, browser: bool, on_address: Callable[[str], None]
) -> None:
    """Serve a page until an interrupt. Raises as `View`.

    browser: opens a browser on this machine, if it has a screen. on_address: called with the URL.
    """
    view = View(path, host, port)
    # Without a screen, a text browser would take over the terminal.
    has_screen = sys.platform in ("darwin", "win32") or any(
        os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")
    )
    try:
        on_address(view.page.gate.address)
        if browser and has_screen:
            webbrowser.open(view.page.gate.local_address)
        view.wait()
    except KeyboardInterrupt as interrupt:
        raise KeyboardInterrupt("the page is closed") from interrupt
    finally:
        view.close()
