"""One thread in which all that a page knows is changed, the newest of each kind of change only."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable

__all__ = ["Changes"]


class Changes:
    """Changes wait in a line, in which a newer one takes the place of an older of its kind: who
    drags faster than can be followed sees where the mouse is, not where it was.

    on_error: is given what a change raises; the thread goes on.
    """

    def __init__(self, on_error: Callable[[Exception], None]) -> None:
        self._on_error = on_error
        self._waiting: OrderedDict[Hashable, Callable[[], None]] = OrderedDict()
        self._news = threading.Condition()
        self._open = True
        self._busy = False
        self._thread = threading.Thread(target=self._work, name="changes", daemon=True)
        self._thread.start()

    def soon(self, change: Callable[[], None], kind: Hashable = None) -> None:
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
