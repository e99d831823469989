"""Work that takes seconds or minutes, in a thread of its own, with a way to stop it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

__all__ = ["Job", "Stopped"]


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
