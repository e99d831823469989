"""Work in a process of its own, so that what hangs or dies there can be reported."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable
from multiprocessing.connection import Connection
from types import TracebackType
from typing import Any

__all__ = ["CrashError", "HangError", "Watchdog"]


class HangError(Exception):
    """The work was not done in time."""


class CrashError(Exception):
    """The work raised an error, or its process died."""


class Watchdog:
    """Calls one function many times in a worker process, which is replaced after a hang or death.

    function: importable by name, as its argument and result travel between processes.
    """

    def __init__(self, function: Callable[[Any], Any]) -> None:
        self._function = function
        self._start()

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._connection, other = context.Pipe()
        self._process = context.Process(target=_serve, args=(self._function, other), daemon=True)
        self._process.start()
        other.close()

    def call(self, argument: Any, seconds: float) -> Any:
        """`function(argument)`.

        Raises
        ------
        HangError: it took longer than the given seconds.
        CrashError: it raised an error or ended the process.
        """
        self._connection.send(argument)
        try:
            if not self._connection.poll(seconds):
                self._restart()
                raise HangError(f"no answer in {seconds:g} s")
            failed, answer = self._connection.recv()
        except EOFError as error:
            self._process.join()
            code = self._process.exitcode
            self._restart()
            raise CrashError(f"the process ended with code {code}") from error
        if failed:
            raise CrashError(answer)
        return answer

    def _restart(self) -> None:
        self._stop()
        self._start()

    def _stop(self) -> None:
        self._process.kill()
        self._process.join()
        self._process.close()
        self._connection.close()

    def __enter__(self) -> Watchdog:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._stop()


def _serve(function: Callable[[Any], Any], connection: Connection) -> None:
    while True:
        try:
            argument = connection.recv()
        except EOFError:
            return
        try:
            answer = False, function(argument)
        except Exception as error:
            answer = True, f"{type(error).__name__}: {error}"
        connection.send(answer)
