"""Command lines in processes of their own, which may get signals and have limits.

Most are forked from one process that has imported the package, so that thousands of them take
minutes; signals reach real processes all the same.
"""

from __future__ import annotations

import multiprocessing
import os
import runpy
import signal
import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

LIMIT = 120.0
"""Seconds after which a command counts as one that hangs; what it does takes a few."""

JOBS = 2

PRELOADED = (
    "torch trimesh manifold3d dicedesign.cli.rest dicedesign.cli.rolls dicedesign.recipe.convex "
    "dicedesign.recipe.thrown dicedesign.fabricate.engraving"
)
"""Imported, where it is there, by the process that others are forked from."""


@dataclass(frozen=True)
class Ended:
    """How a command ended.

    Attributes
    ----------
    code: exit code, or the number of the signal that ended it, negative; None if it hung.
    out, err: what it printed. seconds: that it took.
    """

    code: int | None
    out: str
    err: str
    seconds: float


def all_faults(case: Callable[..., list[str]], numbers: range, *given: Any) -> list[str]:
    """What went wrong in cases by their numbers, several side by side. case: called with what is
    given and a number."""
    # Each has a process of its own that others are forked from.
    with ProcessPoolExecutor(JOBS, multiprocessing.get_context("spawn")) as workers:
        found = workers.map(partial(case, *given), numbers)
        return [f"{number}: {one}" for number in numbers for one in next(found)]


def faults_of(ended: Ended, *expected: int) -> list[str]:
    """Hangs and unforeseen errors. expected: exit codes that are right."""
    if ended.code is None:
        return [f"no end within {LIMIT:g} s"]
    if ended.code in expected and "Traceback (most recent call last)" not in ended.err:
        return []
    last = " ".join(ended.err.split())[-300:]
    return [f"exit code {ended.code}, expected {' or '.join(map(str, expected))}: {last}"]


def before_main(said: str) -> bool:
    """Whether a program that said this was interrupted while the interpreter still began, which no
    program can word."""
    return said.rstrip().endswith("KeyboardInterrupt") and ", in main\n" not in said


def dicedesign(arguments: list[str]) -> int:
    """What `python -m dicedesign` does; its exit code."""
    sys.argv[1:] = arguments
    try:
        runpy.run_module("dicedesign", run_name="__main__")
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else 1
    return 0


def run_command(
    arguments: list[str],
    folder: Path,
    *,
    program: Callable[[list[str]], int] | None = dicedesign,
    memory: int | None = None,
    sent: signal.Signals | None = None,
    after: float = 0.0,
) -> Ended:
    """Run a command line in a folder.

    program: what is called with the arguments and returns the exit code; None for
    `python -m dicedesign` in a new interpreter, instead of by a fork. memory: bytes of addresses
    that it may take beside what is there at its start, on Linux. sent, after: a signal, if any, and
    the seconds from the begin until it is sent.
    """
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(PRELOADED.split())
    begun, other = context.Pipe(duplex=False)
    with TemporaryDirectory() as printed, begun:
        process = context.Process(
            target=_become, args=(arguments, folder, program, memory, Path(printed), other)
        )
        process.start()
        other.close()
        with suppress(EOFError):
            begun.recv_bytes()
        start = time.monotonic()
        if sent is not None:
            process.join(after)
            if process.exitcode is None:
                os.kill(process.pid, sent)
        process.join(LIMIT)
        code, seconds = process.exitcode, time.monotonic() - start
        if code is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.join()
        # A process that is ended at once has printed nothing.
        out, err = (
            path.read_text("utf-8", "replace") if path.exists() else ""
            for path in (Path(printed, "1"), Path(printed, "2"))
        )
        return Ended(code, out, err, seconds)


def _become(
    arguments: list[str],
    folder: Path,
    program: Callable[[list[str]], int] | None,
    memory: int | None,
    printed: Path,
    begun: Connection,
) -> None:
    """Become the command; to be called in a process of its own."""
    # Interrupts from the terminal are for the test.
    os.setsid()
    # A shell may have begun the test with interrupts ignored.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    # Locks go with the process, as those of a program that was not begun like this.
    multiprocessing.set_start_method("fork", force=True)
    os.chdir(folder)
    for stream in (1, 2):
        os.dup2(os.open(printed / str(stream), os.O_WRONLY | os.O_CREAT, 0o600), stream)
    size = Path("/proc/self/statm")
    if memory is not None and size.exists():
        import resource

        limit = int(size.read_text().split()[0]) * resource.getpagesize() + memory
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    begun.send_bytes(b"begun")
    begun.close()
    if program is None:
        os.execv(sys.executable, [sys.executable, "-m", "dicedesign", *arguments])
    code = program(arguments)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
