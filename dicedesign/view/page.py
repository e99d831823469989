"""The page: its server, its tabs, one thread for changes, threads for work that takes longer."""

from __future__ import annotations

import socket
import sys
import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from contextlib import suppress
from functools import cache
from typing import TYPE_CHECKING, Any, Final, Protocol

from jinja2 import Environment, PackageLoader, StrictUndefined

from dicedesign.errors import DiceError, printable
from dicedesign.view.serving import Gate, start_server, stop_server

if TYPE_CHECKING:
    import viser


@cache
def _macros() -> Any:
    environment = Environment(
        loader=PackageLoader("dicedesign.view"), autoescape=True, undefined=StrictUndefined
    )
    return environment.get_template("parts.html.j2").module


def html_part(name: str, *values: object) -> str:
    """The element that a macro of `templates/parts.html.j2` makes of its values; texts are
    escaped."""
    return str(getattr(_macros(), name)(*values))


class Changes:
    """Changes wait in a line, in which a newer one takes the place of an older of its kind: who
    drags faster than can be followed sees where the mouse is, not where it was.

    on_error: is given what a change raises; the thread goes on.
    """

    def __init__(self, on_error: Callable[[Exception], None]) -> None:
        self._on_error = on_error
        self._waiting: OrderedDict[Hashable, Callable[[], object]] = OrderedDict()
        self._news = threading.Condition()
        self._open = True
        self._thread = threading.Thread(target=self._work, name="changes", daemon=True)
        self._thread.start()

    def soon(self, change: Callable[[], object], kind: Hashable = None) -> None:
        """Make a change after those that wait. kind: of which only the newest is made; None for
        one that is always made. Nothing happens once this is closed."""
        with self._news:
            if self._open:
                self._waiting[object() if kind is None else kind] = change
                self._news.notify()

    def close(self) -> None:
        """Leave out what waits, and return when the change under way is made."""
        with self._news:
            self._open = False
            self._waiting.clear()
            self._news.notify()
        if threading.current_thread() is not self._thread:
            self._thread.join(timeout=5.0)

    def _work(self) -> None:
        while True:
            with self._news:
                self._news.wait_for(lambda: self._waiting or not self._open)
                if not self._open:
                    return
                _, change = self._waiting.popitem(last=False)
            try:
                change()
            except Exception as error:
                self._on_error(error)


class Stopped(BaseException):
    """Raised within work that was told to stop; no error, and caught by no handler of errors."""


class Job:
    """Work in a thread.

    Parameters
    ----------
    work: is given the job, and tells how far it is by `progress`.
    on_progress: is given the words and the part that is done, from 0 to 1, or None where nobody
        knows; called in the thread, as the others.
    on_done: is given what the work returned; on_error: what it raised; on_stopped: called where it
        was told to stop.
    """

    def __init__(
        self,
        work: Callable[[Job], Any],
        on_progress: Callable[[str, float | None], None],
        on_done: Callable[[Any], None],
        on_error: Callable[[Exception], None],
        on_stopped: Callable[[], None],
    ) -> None:
        self._work = work
        self._told = on_progress
        self._ends = on_done, on_error, on_stopped
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="job", daemon=True)
        self._thread.start()

    @property
    def running(self) -> bool:
        """Whether the work is not at its end."""
        return self._thread.is_alive()

    def progress(self, words: str, part: float | None = None) -> None:
        """Tell how far the work is. Raises Stopped where it was told to stop."""
        if self._stopping.is_set():
            raise Stopped
        self._told(words, part)

    def stop(self, wait: float = 0.0) -> None:
        """Have the work end at its next word of progress; wait up to so many seconds for it."""
        self._stopping.set()
        if threading.current_thread() is not self._thread:
            self._thread.join(timeout=wait)

    def _run(self) -> None:
        on_done, on_error, on_stopped = self._ends
        try:
            done = self._work(self)
        except Stopped:
            on_stopped()
        except Exception as error:
            on_error(error)
        else:
            on_done(done)


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

    def soon(self, change: Callable[[], object], kind: Hashable = None) -> None:
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
        self._notice.content = html_part("sentence", "notice", text, wrong)

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
        part = 1.0 if part is None else min(max(part, 0.0), 1.0)
        self._progress.content = html_part("progress", words, part) if words else ""
