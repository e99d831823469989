"""What a piece of work costs: beside others in this process, or alone in a new one.

Seconds are those of the processor, so that other programs on the machine do not count.

Work in a process of its own, so that what hangs or dies there can be reported.
"""

from __future__ import annotations

import gc
import json
import multiprocessing
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection
from pathlib import Path
from statistics import median
from types import TracebackType
from typing import Any, Final

import numpy as np

__all__ = ["CrashError", "HangError", "Watchdog", "in_new_process", "in_turn"]

FEWEST_ROUNDS: Final = 5
"""A median is taken of at least so many rounds in this process, unless others are asked for."""

_FRAME: Final = """
import json, time
{setting}
started = time.process_time()
{work}
seconds = time.process_time() - started
from dicedesign.runtime.clock import peak_megabytes
print(json.dumps([seconds, peak_megabytes()]))
"""


def in_turn(
    actions: Sequence[Callable[[], Any]],
    seconds: float,
    *,
    rounds: int = FEWEST_ROUNDS,
    row: float = 0.0,
) -> list[float]:
    """Median seconds of each action. They are called in rounds for about the given seconds, so that
    what slows the machine falls on all of them alike; a first round is not counted.

    rounds: how many there are at least.
    row: seconds for which an action is called again and again when its turn comes; all its calls
        count but the first. At 0 it is called once, and pays for caches that the action before it
        filled: with works of some microseconds, most of their time.
    """
    taken: list[list[float]] = [[] for _ in actions]
    for action in actions:
        action()
    # An order that changes, and no garbage collector whose turn comes in a rhythm of its own.
    order = np.random.default_rng(0)
    collecting = gc.isenabled()
    gc.disable()
    ended = time.process_time() + seconds
    try:
        while rounds > 0 or time.process_time() < ended:
            rounds -= 1
            for index in order.permutation(len(actions)):
                taken[index] += _turn(actions[index], row)
    finally:
        if collecting:
            gc.enable()
    return [median(times) for times in taken]


def _turn(action: Callable[[], Any], row: float) -> list[float]:
    """Seconds of an action's calls in a row, see `in_turn`."""
    if row > 0.0:
        action()
    times, ended = [], time.process_time() + row
    while True:
        begun = time.process_time()
        action()
        now = time.process_time()
        times.append(now - begun)
        if now >= ended:
            return times


def in_new_process(
    works: Sequence[tuple[str, str]], folder: Path, rounds: int
) -> list[tuple[float, float | None]]:
    """Median seconds and peak memory in MB (see `dicedesign.runtime.clock`) of each work, each
    time in a new process that runs in a folder, in turn. A work is two pieces of Python code; the
    seconds of the first are not counted. Raises RuntimeError where a work fails."""
    seconds: list[list[float]] = [[] for _ in works]
    peaks: list[list[float]] = [[] for _ in works]
    for _ in range(rounds):
        for index, (setting, work) in enumerate(works):
            command = [sys.executable, "-c", _FRAME.format(setting=setting, work=work)]
            done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
            if done.returncode != 0:
                code = f"{setting}\n{work}"
                raise RuntimeError(f"what was to be measured failed:\n{code}\n{done.stderr}")
            taken, peak = json.loads(done.stdout.splitlines()[-1])
            seconds[index].append(taken)
            if peak is not None:
                peaks[index].append(peak)
    return [
        (median(times), median(most) if most else None)
        for times, most in zip(seconds, peaks, strict=True)
    ]


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
