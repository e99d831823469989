"""Executors without processes: immediate, unreliable or delayed."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor, Future
from concurrent.futures.process import BrokenProcessPool
from typing import Any


class Inline(Executor):
    """Runs each task on submission."""

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        try:
            future.set_result(function(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


class Lossy(Inline):
    """Fails some submissions, and records the arguments of all.

    fails: called with the number of the submission, from 1, and its arguments. It returns False,
    True for a lost worker, or an error.
    """

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
    """Runs the latest task on request."""

    def __init__(self) -> None:
        self.waiting: list[Callable[[], None]] = []

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        self.waiting.append(lambda: future.set_result(function(*args, **kwargs)))
        return future

    def end_one(self) -> None:
        """Run the latest task."""
        self.waiting.pop()()
