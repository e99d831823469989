"""Interrupts: Ctrl-C, and the signals by which a system ends a process."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

ENDING = [
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
]
"""Signals of Ctrl-C, of `kill` and schedulers, and of a terminal that closes."""


class Interrupt(KeyboardInterrupt):
    """Interrupt by a signal. Were it a plain KeyboardInterrupt, Python could end by SIGINT although
    it was caught, if it came while a library was running a text."""


_received: list[int] = []
"""Signals that have become interrupts, in order."""


def _interrupt(number: int, frame: FrameType | None) -> None:
    _received.append(number)
    raise Interrupt


@contextmanager
def signals_interrupt() -> Iterator[None]:
    """Raise KeyboardInterrupt for each of `ENDING` within the block, except those that the process
    was started to ignore. Does nothing in other threads than the main one."""
    replaced: dict[int, Any] = {}
    _received.clear()
    if threading.current_thread() is threading.main_thread():
        for number in ENDING:
            before = signal.getsignal(number)
            if before in (signal.SIG_DFL, signal.default_int_handler):
                replaced[number] = signal.signal(number, _interrupt)
    try:
        yield
    finally:
        for number, before in replaced.items():
            signal.signal(number, before)


def was_interrupted() -> bool:
    """Whether a signal has come within `signals_interrupt`."""
    return len(_received) > 0


def exit_code(code: int) -> int:
    """Exit code of a command that returned one: 128 plus the number of the signal, such as 143 for
    SIGTERM, if one but Ctrl-C ended the command before."""
    ended = [number for number in _received if number != signal.SIGINT]
    return 128 + ended[-1] if ended else code


@contextmanager
def hold_interrupts(message: str = "") -> Iterator[None]:
    """Delay interrupts until the end of a short block.

    message: message of the delayed interrupt. Does nothing in other threads, or for a
    signal with another handler.
    """
    held: dict[int, Any] = {}
    arrived: list[int] = []
    if threading.current_thread() is threading.main_thread():
        for number in ENDING:
            before = signal.getsignal(number)
            if before in (_interrupt, signal.default_int_handler):
                held[number] = before
                signal.signal(number, lambda each, _: arrived.append(each))
    try:
        yield
    finally:
        for number, before in held.items():
            signal.signal(number, before)
    if arrived:
        _received.extend(arrived)
        raise Interrupt(message)


@contextmanager
def block_signals() -> Iterator[None]:
    """Block `ENDING` within the block; processes that start there keep them blocked."""
    if not hasattr(signal, "pthread_sigmask"):
        # Windows.
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def obey_parent() -> None:
    """In a process started within `block_signals`: leave Ctrl-C and closed terminals to the parent,
    which ends its processes by SIGTERM."""
    for number in ENDING:
        signal.signal(number, signal.SIG_DFL if number == signal.SIGTERM else signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDING)
