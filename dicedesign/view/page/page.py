"""The page: its server, its tabs, one thread for changes, threads for work that takes longer."""

from __future__ import annotations

import html
import socket
import sys
from collections.abc import Callable, Hashable
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Final, Protocol

from dicedesign.errors import DiceError
from dicedesign.runtime.text import printable
from dicedesign.view.page.job import Job
from dicedesign.view.page.newest_first import Changes
from dicedesign.view.serving.gate import Gate
from dicedesign.view.serving.server import start_server, stop_server

if TYPE_CHECKING:
    import viser

__all__ = ["Page", "Panel"]

MOST_DIGITS: Final = 8
"""Of the number of what was clicked."""


class Panel(Protocol):
    """One tab of the page.

    Attributes
    ----------
    title: of the tab.
    """

    title: str

    def build(self, page: Page) -> None:
        """Add the GUI elements; called once, within the tab."""


class Page:
    """A page that is being served. All browsers that open it see the same.

    What the page knows is changed in one thread, by `soon`: callbacks of viser come from many
    threads, and in any order. `close` ends everything.

    Attributes
    ----------
    server: viser's; scene, gui: its parts.
    gate: who may open the page; `gate.address` is where.
    """

    def __init__(self, listening: socket.socket) -> None:
        self._actions: dict[str, Callable[[int], None]] = {}
        self._jobs: list[Job] = []
        self._notice: Any = None
        self._progress: Any = None
        self._changes = Changes(self.failed)
        self.gate = Gate.of(listening)
        self.server: viser.ViserServer = start_server(listening, self.gate, self._acted)
        self.scene = self.server.scene
        self.gui = self.server.gui

    def add_panels(self, panels: list[Panel]) -> None:
        """Add what the page says, and a tab for each panel."""
        self.gui.configure_theme(
            control_width="large",
            show_logo=False,
            show_share_button=False,
            brand_color=(79, 143, 192),
        )
        self.gui.set_panel_label("dicedesign")
        self._notice = self.gui.add_html("")
        self._progress = self.gui.add_html("")
        tabs = self.gui.add_tab_group()
        for panel in panels:
            with tabs.add_tab(panel.title):
                panel.build(self)

    def soon(self, change: Callable[[], None], kind: Hashable = None) -> None:
        """Make a change in the page's own thread; of each kind only the newest that waits."""
        self._changes.soon(change, kind)

    def on_action(self, name: str, act: Callable[[int], None]) -> None:
        """Call `act` in the page's thread when HTML with data-action="name:number" is clicked; it
        is given the number, from 0 on. Whatever else is asked for by hand is ignored."""
        self._actions[name] = act

    def start(
        self,
        work: Callable[[Job], Any],
        on_done: Callable[[Any], None],
        on_end: Callable[[], None] = lambda: None,
        on_error: Callable[[Exception], None] | None = None,
    ) -> Job:
        """Do work in the background. Its progress is shown at the top of the page.

        Parameters
        ----------
        work: is given its job, and calls `job.progress(words, part)` often: there it can be
            stopped.
        on_done: is given what the work returned; on_end: called after it, after an error and after
            a stop; on_error: is given what the work raised, by default said on the page. All in the
            page's thread.
        """
        failed = on_error or self.failed

        def ended(then: Callable[[], None]) -> None:
            def change() -> None:
                self._say_progress("", None)
                try:
                    then()
                finally:
                    on_end()

            self.soon(change)

        job = Job(
            work,
            lambda words, part: self.soon(lambda: self._say_progress(words, part), "progress"),
            lambda done: ended(lambda: on_done(done)),
            lambda error: ended(lambda: failed(error)),
            lambda: ended(lambda: None),
        )
        self._jobs = [*(known for known in self._jobs if known.running), job]
        return job

    def say(self, text: str, *, wrong: bool = False) -> None:
        """Show a sentence at the top of the page until the next; "" for none."""
        look = "wrong" if wrong else "note"
        self._notice.content = (
            f'<div class="dd"><p id="notice" class="{look}">{html.escape(text)}</p></div>'
            if text
            else ""
        )

    def download(self, client: viser.ClientHandle | None, name: str, content: bytes) -> None:
        """Have a browser save a file; None for all that are open."""
        (client or self.server).send_file_download(name, content, save_immediately=True)

    def close(self) -> None:
        """Stop what is under way, and the server."""
        for job in self._jobs:
            job.stop()
        for job in self._jobs:
            job.stop(wait=2.0)
        self._changes.close()
        stop_server(self.server)

    def failed(self, error: Exception) -> None:
        """Say what went wrong, in words where it is the user's, and go on."""
        if isinstance(error, DiceError):
            self.say(str(error), wrong=True)
            return
        text = f"an error that nobody foresaw, {type(error).__name__}: {error}"
        self.say(text, wrong=True)
        with suppress(OSError):
            print(f"dicedesign: {printable(text)}", file=sys.stderr, flush=True)

    def _acted(self, word: str) -> None:
        name, _, number = word.partition(":")
        act = self._actions.get(name)
        if act is not None and number.isdecimal() and len(number) <= MOST_DIGITS:
            self.soon(lambda: act(int(number)))

    def _say_progress(self, words: str, part: float | None) -> None:
        if not words:
            self._progress.content = ""
            return
        width = 100.0 if part is None else 100.0 * min(max(part, 0.0), 1.0)
        self._progress.content = (
            f'<div class="dd"><p id="progress">{html.escape(words)}</p><div class="track">'
            f'<div class="fill" style="width:{width:.1f}%;background:#4f8fc0"></div></div></div>'
        )
