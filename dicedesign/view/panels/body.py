"""The tab "Body": what a body does, live, and what can be done with it."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any, Final

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.meshes.formats import stl_bytes
from dicedesign.view.bodies.opened import Source, Tell
from dicedesign.view.bodies.viewed_body import ViewedBody
from dicedesign.view.page.job import Job
from dicedesign.view.page.page import Page
from dicedesign.view.panels.dragging import Dragging
from dicedesign.view.panels.odds import Odds
from dicedesign.view.panels.watching import Watching
from dicedesign.view.scenes.exhibit import Exhibit

__all__ = ["BodyPanel"]


SILENCE: Final = 1.0
"""Seconds between two lines about progress on a terminal."""


class BodyPanel:
    """Bars, handles and throws of the body on show.

    source: of bodies to choose from, or None.
    """

    title = "Body"

    def __init__(self, exhibit: Exhibit, source: Source | None) -> None:
        self._exhibit = exhibit
        self._source = source
        self._odds = Odds(exhibit)
        self._dragging = Dragging(exhibit)
        self._watching = Watching(exhibit, self._odds)
        self._page: Any = None
        self._loading: Job | None = None

    def build(self, page: Page) -> None:
        """Add the GUI elements; called once, within the tab."""
        self._page, gui = page, page.gui
        if self._source is not None and len(self._source.names) > 1:
            chosen = gui.add_dropdown("File", self._source.names)
            chosen.on_update(lambda _: page.soon(lambda: self.load(chosen.value), "file"))
        self._odds.build(page)
        with gui.add_folder("Change it"):
            self._dragging.build(page)
            save = gui.add_button("Download STL", hint="The hull as it is now")
        with gui.add_folder("Watch it"):
            self._watching.build(page)

        @save.on_click
        def _(event: Any) -> None:
            page.soon(lambda: self._save(event.client))

        self._exhibit.on_show(self._dragging.begin)

    def load(self, name: str, on_error: Callable[[Exception], None] | None = None) -> None:
        """Show another body of the source, when it is read or designed; on_error: as of
        `Page.start`."""
        source, page = self._source, self._page
        if source is None:
            return
        if self._loading is not None:
            self._loading.stop()
        self._loading = page.start(
            lambda job: source.load(name, Tell(_told_twice(job), self._preview)),
            self._exhibit.show,
            on_error=on_error,
        )

    def _preview(self, hull: ConvexHull) -> None:
        self._page.soon(lambda: self._exhibit.preview(hull))

    def _save(self, client: Any) -> None:
        viewed: ViewedBody | None = self._exhibit.viewed
        if viewed is None:
            return
        if not viewed.follows:
            self._page.say(
                "A file of one density has its center of mass where that of its solid is, not "
                "where it was dragged to; a cavity or weights can put it there."
            )
        hull = viewed.hull
        name = "".join(c if c.isalnum() or c in "-_" else "_" for c in viewed.name)
        self._page.download(client, f"{name}_hull.stl", stl_bytes(hull.vertices, hull.triangles))


def _told_twice(job: Job) -> Callable[[str], None]:
    """Tells of progress on the page, and on a terminal where there is one."""
    last = -SILENCE

    def told(words: str) -> None:
        nonlocal last
        job.progress(words)
        now = time.monotonic()
        if now - last >= SILENCE and sys.stderr.isatty():
            last = now
            print(f"note: {words}", file=sys.stderr, flush=True)

    return told
