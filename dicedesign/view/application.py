"""The page from its start to its end."""

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
from dicedesign.view.exhibit import Exhibit
from dicedesign.view.new_die_panel import NewDiePanel
from dicedesign.view.page import Page, Panel
from dicedesign.view.serving import open_socket, require_viser
from dicedesign.view.sources import Source, Tell, source_of
from dicedesign.view.viewed_body import ViewedBody

__all__ = ["View", "serve_view"]

_BLOCK: Final = (1.0, 1.2, 0.8)
"""Sides of the body on a page that is opened with none."""


class View:
    """A page with its panels; `close` ends it.

    path: a mesh, a recipe, the folder of a finished die or of meshes; None for a block. host, port:
    where it is served; 0 for any port.

    Raises InputError: the path, the host or the port cannot be used, or viser is not installed.
    """

    def __init__(self, path: Path | None, host: str = "127.0.0.1", port: int = 0) -> None:
        require_viser()
        source = None if path is None else source_of(path)
        first = _first_body(source)
        self._over = threading.Event()
        self._fault: Exception | None = None
        self.page = Page(open_socket(host, port))
        self.exhibit = Exhibit(self.page)
        self._body = BodyPanel(self.exhibit, source)
        panels: list[Panel] = [self._body, NewDiePanel(self.exhibit)]
        if path is None:
            # Who brings nothing wants a die.
            panels.reverse()
        self.page.add_panels(panels)
        if first is not None:
            self.page.soon(lambda: self.exhibit.show(first))
        elif source is not None:
            name = source.names[0]
            self.page.soon(lambda: self._body.load(name, self._ends_with))

    def wait(self) -> None:
        """Serve. Raises what the first body raised, where it took too long to be waited for before
        there was a page; KeyboardInterrupt."""
        self._over.wait()
        if self._fault is not None:
            raise self._fault

    def close(self) -> None:
        """Stop everything."""
        self.page.close()

    def _ends_with(self, error: Exception) -> None:
        self._fault = error
        self._over.set()


def serve_view(
    path: Path | None, host: str, port: int, *, browser: bool, told: Callable[[str], None]
) -> None:
    """Serve a page until an interrupt. told: is given the address. Raises as `View`."""
    view = View(path, host, port)
    try:
        told(view.page.gate.address)
        if browser and _has_screen():
            webbrowser.open(view.page.gate.address_here)
        view.wait()
    except KeyboardInterrupt as interrupt:
        raise KeyboardInterrupt("the page is closed") from interrupt
    finally:
        view.close()


def _has_screen() -> bool:
    """Whether there is one for a browser; without, one of text would take the terminal."""
    screens = (os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))
    return sys.platform in ("darwin", "win32") or any(screens)


def _first_body(source: Source | None) -> ViewedBody | None:
    """What is on the page from its start; None for what takes longer."""
    if source is None:
        sides = np.array(np.meshgrid([-0.5, 0.5], [-0.5, 0.5], [-0.5, 0.5])).reshape(3, -1).T
        return ViewedBody.of(make_body(sides * _BLOCK, name="a block"))
    if not source.quick:
        return None
    viewed = source.load(source.names[0], Tell())
    for note in viewed.poses.notes:
        print(f"note: {printable(note)}", file=sys.stderr)
    return viewed
