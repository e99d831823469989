"""Start, serve and end the page."""

from __future__ import annotations

import os
import sys
import threading
import webbrowser
from collections.abc import Callable
from pathlib import Path

import numpy as np

from dicedesign.errors import printable
from dicedesign.geometry.meshes.body import make_body
from dicedesign.runtime.workers import progress_bar
from dicedesign.view.body_panel import BodyPanel
from dicedesign.view.new_die_panel import NewDiePanel
from dicedesign.view.page import Page
from dicedesign.view.serving import open_socket, require_viser
from dicedesign.view.sources import Source, open_source
from dicedesign.view.viewed_body import ViewedBody
from dicedesign.view.viewport import Viewport

__all__ = ["View", "serve_view"]

_BLOCK_SIDES = (1.0, 1.2, 0.8)
"""Sides of the body on a page without a path, before the first die."""


class View:
    """Page with its panels; `close` ends it. The first body is loaded before the page opens.

    path: mesh, recipe, folder of a finished die, or folder of meshes; None designs a first die.
    port: of the page, for this machine alone; 0 is any free port.

    Raises InputError: the path or the port cannot be used, or viser is not installed.
    """

    def __init__(self, path: Path | None, port: int = 0) -> None:
        require_viser()
        source = None if path is None else open_source(path)
        listening = open_socket(port)
        try:
            body = _first_body(source)
        except BaseException:
            listening.close()
            raise
        self.page = Page(listening)
        self.viewport = Viewport(self.page, body)
        panels: dict[str, Callable[[], object]] = {
            "Body": lambda: BodyPanel(self.viewport, source),
            "New die": lambda: NewDiePanel(self.viewport, begins=source is None),
        }
        for title in panels if source is not None else reversed(panels):
            with self.page.tabs.add_tab(title):
                panels[title]()
        self.page.enqueue(lambda: self.viewport.show(body))

    def close(self) -> None:
        """Stop everything."""
        self.page.close()


def _first_body(source: Source | None) -> ViewedBody:
    """Load the first body of a source, with progress and notes on stderr; None makes a block."""
    if source is None:
        corners = np.array(np.meshgrid(*[[-0.5, 0.5]] * 3)).reshape(3, -1).T
        return ViewedBody.of(make_body(corners * _BLOCK_SIDES, name="a block"))
    with progress_bar("body") as bar:
        body = source.load(source.names[0], bar.set_description_str)
    for note in body.poses.notes:
        print(f"note: {printable(note)}", file=sys.stderr)
    return body


def serve_view(path: Path | None, port: int, *, browser: bool) -> None:
    """Serve a page, and print its address, until an interrupt. Raises as `View`.

    browser: opens a browser on this machine, if it has a screen.
    """
    view = View(path, port)
    # Without a screen, a text browser would take over the terminal.
    has_screen = sys.platform in ("darwin", "win32") or any(
        os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")
    )
    try:
        print(view.page.gate.address, flush=True)
        if browser and has_screen:
            webbrowser.open(view.page.gate.address)
        threading.Event().wait()
    except KeyboardInterrupt as interrupt:
        raise KeyboardInterrupt("the page is closed") from interrupt
    finally:
        view.close()
