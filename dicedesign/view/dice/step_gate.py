"""A gate through which a thread goes step by step, as others allow."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

__all__ = ["Abandoned", "Outdated", "StepGate"]


class Outdated(BaseException):
    """What a thread works on has changed: it begins again."""


class Abandoned(BaseException):
    """Nobody waits for what a thread works on: it ends."""


class StepGate:
    """How many steps a thread may make, and whether what it works on is still wanted.

    Attributes
    ----------
    turn: the lock of all that the thread and others share; who waits for a change waits on it.
    steps_left: None for any number.
    is_held: whether the thread waits for more.
    has_changed: whether something has, since the thread began.
    is_closed: whether nobody waits for anything.
    least_seconds: that a step takes at least, where any number may be made.
    """

    def __init__(self, on_held: Callable[[], None], least_seconds: float = 0.0) -> None:
        """A gate that lets no step through yet.

        on_held: called when the thread begins to wait.
        """
        self.turn = threading.Condition()
        self.steps_left: int | None = 0
        self.is_held, self.has_changed, self.is_closed = False, False, False
        self._on_held, self.least_seconds = on_held, least_seconds

    def allow(self, steps: int | None) -> None:
        """Let so many steps through from now on, None for any number."""
        with self.turn:
            self.steps_left = steps
            self.is_held = self.is_held and steps == 0
            self.turn.notify_all()

    def outdate(self) -> None:
        """Have the thread begin again at its next step."""
        with self.turn:
            self.has_changed = True
            self.turn.notify_all()

    def close(self) -> None:
        """Have the thread end at its next step."""
        with self.turn:
            self.is_closed = True
            self.turn.notify_all()

    def begin(self) -> None:
        """In the thread: wait until a step is allowed, and take note of all changes. Raises
        Abandoned."""
        self._hold()
        with self.turn:
            if self.is_closed:
                raise Abandoned
            self.has_changed = False

    def require_current(self) -> None:
        """In the thread: raise Outdated or Abandoned where that is so."""
        with self.turn:
            if self.is_closed:
                raise Abandoned
            if self.has_changed:
                raise Outdated

    def count(self) -> None:
        """In the thread: a step has been made."""
        with self.turn:
            if self.steps_left is not None:
                self.steps_left = max(self.steps_left - 1, 0)

    def wait(self, began: float) -> None:
        """In the thread: wait until the next step is allowed, after one that began at a time of
        `time.monotonic`. Raises as `require_current`."""
        with self.turn:
            rest = began + self.least_seconds - time.monotonic()
            if self.steps_left is None and rest > 0.0:
                self.turn.wait_for(lambda: self.is_closed or self.has_changed, rest)
        self.hold()

    def hold(self) -> None:
        """In the thread: wait until there is a step to be made. Raises as `require_current`."""
        self._hold()
        self.require_current()

    def _hold(self) -> None:
        with self.turn:
            if self.steps_left == 0:
                self.is_held = True
                self.turn.notify_all()
        if self.is_held:
            self._on_held()
        with self.turn:
            self.turn.wait_for(lambda: self.steps_left != 0 or self.is_closed)
            self.is_held = False
