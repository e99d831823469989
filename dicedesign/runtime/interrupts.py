"""Interrupts from the keyboard that wait for what must not stay half done."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["interrupts_held"]


@contextmanager
def interrupts_held(said: str) -> Iterator[None]:
    """An interrupt that comes in here is raised at the end of it, for something short.

    said: the message of that KeyboardInterrupt. Where somebody else handles interrupts, and in
    threads that get none, nothing is held.
    """
    before = signal.getsignal(signal.SIGINT)
    main_thread = threading.current_thread() is threading.main_thread()
    if before is not signal.default_int_handler or not main_thread:
        yield
        return
    arrived: list[int] = []
    signal.signal(signal.SIGINT, lambda number, _: arrived.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if arrived:
        raise KeyboardInterrupt(said)
