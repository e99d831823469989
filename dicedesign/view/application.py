"""The page from its start to its end."""

from __future__ import annotations

import threading
import webbrowser
from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np

from dicedesign.geometry.meshes.body import make_body
from dicedesign.view.bodies.viewed_body import ViewedBody
from dicedesign.view.page.page import Page
from dicedesign.view.panels.body import BodyPanel
from dicedesign.view.panels.new_die import NewDiePanel
from dicedesign.view.scenes.exhibit import Exhibit
from dicedesign.view.serving.gate import open_socket
from dicedesign.view.serving.server import require_viser

__all__ = ["View", "serve_view"]

PORT: Final = 8080


class View:
    """A page with its panels; `close` ends it."""

    def __init__(self, path: Path | None, host: str, port: int) -> None:
        require_viser()
        self.page = Page(open_socket(host, port))
        self.exhibit = Exhibit(self.page)
        self.page.add_panels([BodyPanel(self.exhibit), NewDiePanel(self.exhibit)])
        corners = np.array(np.meshgrid([0, 1], [0, 1.2], [0, 0.8])).reshape(3, -1).T
        self.page.soon(lambda: self.exhibit.show(ViewedBody.of(make_body(corners, name="block"))))

    def close(self) -> None:
        """Stop everything."""
        self.page.close()


def serve_view(
    path: Path | None, host: str, port: int, *, browser: bool, told: Callable[[str], None]
) -> None:
    """Serve a page until an interrupt. told: is given the address."""
    view = View(path, host, port)
    try:
        told(view.page.gate.address)
        if browser:
            webbrowser.open(view.page.gate.address)
        threading.Event().wait()
    except KeyboardInterrupt as interrupt:
        raise KeyboardInterrupt("the page is closed") from interrupt
    finally:
        view.close()
