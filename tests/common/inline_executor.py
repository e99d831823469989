"""Executors without processes: one that runs everything at once, one that loses workers, and one
that waits to be told."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor, Future
from concurrent.futures.process import BrokenProcessPool
from typing import Any


class Inline(Executor):
    """Runs everything at once, in this process."""

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        try:
            future.set_result(function(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


class Lossy(Inline):
    """Fails submissions as a test says, by their number from 1 on and their arguments: as by the
    loss of the worker for True, or by an error. Remembers the arguments of all."""

    def __init__(self, fails: Callable[..., bool | Exception]) -> None:
        self.fails = fails
        self.submitted: list[tuple[Any, ...]] = []

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        self.submitted.append(args)
        error = self.fails(len(self.submitted), *args)
        if error is False:
            return super().submit(function, *args, **kwargs)
        future: Future[Any] = Future()
        future.set_exception(BrokenProcessPool() if error is True else error)
        return future


class Late(Executor):
    """Ends a task, the one that was submitted last, whenever it is told to."""

    def __init__(self) -> None:
        self.waiting: list[Callable[[], None]] = []

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        self.waiting.append(lambda: future.set_result(function(*args, **kwargs)))
        return future

    def end_one(self) -> None:
        """End it."""
        self.waiting.pop()()
