"""The page: its server, its tabs, a thread for changes, and threads for long jobs."""

from __future__ import annotations

import socket
import sys
import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from contextlib import suppress
from functools import cache, partial
from typing import TYPE_CHECKING, Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from dicedesign.errors import DiceError, printable
from dicedesign.view.serving import Gate, start_server

if TYPE_CHECKING:
    import viser


@cache
def _macros() -> Any:
    environment = Environment(
        loader=PackageLoader("dicedesign.view"), autoescape=True, undefined=StrictUndefined
    )
    return environment.get_template("parts.html.j2").module


def html_part(name: str, *values: object) -> str:
    """Render a macro of `templates/parts.html.j2`; texts are escaped."""
    return str(getattr(_macros(), name)(*values))


class ChangeQueue:
    """Queue of changes, run in one thread.

    A newer change replaces a waiting one of its kind, so that dragging shows the latest position
    of the mouse.

    on_error: called with the error of a change; the thread continues.
    """

    def __init__(self, on_error: Callable[[Exception], None]) -> None:
        self._on_error = on_error
        self._waiting: OrderedDict[Hashable, Callable[[], object]] = OrderedDict()
        self._news = threading.Condition()
        self._is_open = True
        self._thread = threading.Thread(target=self._run, name="changes", daemon=True)
        self._thread.start()

    def enqueue(self, change: Callable[[], object], kind: Hashable = None) -> None:
        """Run a change after those that wait; a closed queue ignores it.

        kind: replaces the waiting change of this kind; None replaces nothing.
        """
        with self._news:
            if self._is_open:
                self._waiting[object() if kind is None else kind] = change
                self._news.notify()

    def close(self) -> None:
        """Discard waiting changes, and wait for the current one."""
        with self._news:
            self._is_open = False
            self._news.notify()
        if threading.current_thread() is not self._thread:
            self._thread.join(timeout=5.0)

    def _run(self) -> None:
        while True:
            with self._news:
                self._news.wait_for(lambda: self._waiting or not self._is_open)
                if not self._is_open:
                    return
                _, change = self._waiting.popitem(last=False)
            try:
                change()
            except Exception as error:
                self._on_error(error)


class Stopped(BaseException):
    """A job was stopped. It is no `Exception`, so that error handlers do not catch it."""


class Job:
    """Work in a thread; see `Page.start`."""

    def __init__(
        self,
        page: Page,
        work: Callable[[Job], Any],
        on_done: Callable[[Any], object],
        on_error: Callable[[Exception], object],
    ) -> None:
        self._page, self._has_text = page, False
        self._is_stopped = threading.Event()
        self._thread = threading.Thread(
            target=self._run, args=(work, on_done, on_error), name="job", daemon=True
        )
        self._thread.start()

    def _run(
        self,
        work: Callable[[Job], Any],
        on_done: Callable[[Any], object],
        on_error: Callable[[Exception], object],
    ) -> None:
        try:
            end = partial(on_done, work(self))
        except Stopped:
            return
        except Exception as error:
            end = partial(on_error, error)
        finally:
            if self._has_text:
                self._page.show_progress("")
        self._page.enqueue(end)

    @property
    def is_running(self) -> bool:
        """Whether the thread runs."""
        return self._thread.is_alive()

    def check(self) -> None:
        """Raise Stopped after `stop`."""
        if self._is_stopped.is_set():
            raise Stopped

    def progress(self, text: str) -> None:
        """Show a text on the page until the job ends. Raises Stopped after `stop`."""
        self.check()
        self._has_text = True
        self._page.show_progress(text)

    def stop(self, wait: float = 0.0) -> None:
        """End the work at its next `check` or `progress`; wait for at most `wait` seconds."""
        self._is_stopped.set()
        if threading.current_thread() is not self._thread:
            self._thread.join(timeout=wait)


MAX_DIGITS = 8
"""Limit on the number in an action."""


class Page:
    """Served page, shared by all browsers that open it.

    Viser calls callbacks from several threads in any order, so `enqueue` makes all changes in one
    thread. `close` ends everything.

    Attributes
    ----------
    server: viser's server; scene, gui: its parts.
    gate: access to the page, and its address.
    tabs: viser's group of tabs, below the notice and the progress.
    on_close: functions that `close` calls first.
    """

    def __init__(self, listening: socket.socket) -> None:
        self._actions: dict[str, Callable[[int], None]] = {}
        self._jobs: list[Job] = []
        self.on_close: list[Callable[[], None]] = []
        self._changes = ChangeQueue(self.report_error)
        self.enqueue = self._changes.enqueue
        self.gate = Gate(listening.getsockname()[1])
        self.server: viser.ViserServer = start_server(listening, self.gate, self._run_action)
        self.scene, self.gui = self.server.scene, self.server.gui
        self.gui.configure_theme(
            control_width="large",
            show_logo=False,
            show_share_button=False,
            brand_color=(79, 143, 192),
        )
        self.gui.set_panel_label("dicedesign")
        self._notice, self._progress = self.gui.add_html(""), self.gui.add_html("")
        self.tabs = self.gui.add_tab_group()

    def on_action(self, name: str, act: Callable[[int], None]) -> None:
        """Register a callback for clicks on HTML with data-action="name:number".

        act: called in the thread of changes with the number, from 0. Other requests are ignored.
        """
        self._actions[name] = act

    def start(
        self,
        work: Callable[[Job], Any],
        on_done: Callable[[Any], object],
        on_error: Callable[[Exception], object] | None = None,
    ) -> Job:
        """Start a job in a thread.

        Parameters
        ----------
        work: called with the job; calls `job.check` or `job.progress` often, where it can be
            stopped.
        on_done: called with the result; on_error: called with an error, shown on the page by
            default. Both are called in the thread of changes, and neither after a stop.
        """
        job = Job(self, work, on_done, on_error or self.report_error)
        self._jobs = [*(running for running in self._jobs if running.is_running), job]
        return job

    def show_progress(self, text: str) -> None:
        """Show the progress of a job; "" shows none."""
        content = html_part("progress", text) if text else ""
        self.enqueue(lambda: setattr(self._progress, "content", content), "progress")

    def notify(self, text: str, *, is_error: bool = False) -> None:
        """Show a sentence at the top of the page until the next; "" shows none."""
        self._notice.content = html_part("sentence", "notice", text, is_error)

    def download(self, client: viser.ClientHandle | None, name: str, content: bytes) -> None:
        """Save a file in a browser; None means every open one."""
        (client or self.server).send_file_download(name, content, save_immediately=True)

    def close(self) -> None:
        """Stop all jobs and the server."""
        for act in self.on_close:
            act()
        for job in self._jobs:
            job.stop()
        for job in self._jobs:
            job.stop(wait=10.0)
        self._changes.close()
        self.server.stop()

    def report_error(self, error: Exception) -> None:
        """Show an error on the page; print an unexpected one on stderr too."""
        if isinstance(error, DiceError):
            self.notify(str(error), is_error=True)
            return
        text = f"unexpected error, {type(error).__name__}: {error}"
        self.notify(text, is_error=True)
        with suppress(OSError):
            print(f"dicedesign: {printable(text)}", file=sys.stderr, flush=True)

    def _run_action(self, action: str) -> None:
        name, _, number = action.partition(":")
        act = self._actions.get(name)
        if act is not None and number.isdecimal() and len(number) <= MAX_DIGITS:
            self.enqueue(lambda: act(int(number)))
