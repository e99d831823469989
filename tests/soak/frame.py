"""Run commands in separate processes, with signals and limits.

Most are forked from one process that has imported the package, so that thousands take minutes.
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
"""Timeout in seconds; commands normally take a few."""

JOBS = 2

PRELOADED = (
    "torch trimesh manifold3d dicedesign.cli.rest dicedesign.cli.rolls dicedesign.recipe.convex "
    "dicedesign.recipe.thrown dicedesign.fabricate.engraving"
)
"""Modules that the parent of the forked processes imports."""


@dataclass(frozen=True)
class CommandEnd:
    """End of a command.

    Attributes
    ----------
    code: exit code, or the negative number of the signal that ended it; None after a timeout.
    out, err: stdout and stderr.
    seconds: duration.
    """

    code: int | None
    out: str
    err: str
    seconds: float


def all_faults(case: Callable[..., list[str]], numbers: range, *arguments: Any) -> list[str]:
    """Run numbered cases in parallel, and list their faults. case: called with the arguments and a
    number."""
    # Each worker has its own process from which commands are forked.
    with ProcessPoolExecutor(JOBS, multiprocessing.get_context("spawn")) as workers:
        faults = workers.map(partial(case, *arguments), numbers)
        return [f"{number}: {fault}" for number in numbers for fault in next(faults)]


def faults_of(ended: CommandEnd, *expected: int) -> list[str]:
    """List timeouts and unexpected errors. expected: correct exit codes."""
    if ended.code is None:
        return [f"no end within {LIMIT:g} s"]
    if ended.code in expected and "Traceback (most recent call last)" not in ended.err:
        return []
    last = " ".join(ended.err.split())[-300:]
    return [f"exit code {ended.code}, expected {' or '.join(map(str, expected))}: {last}"]


def before_main(output: str) -> bool:
    """Whether an interrupt came while the interpreter started, before any program can handle it."""
    return output.rstrip().endswith("KeyboardInterrupt") and ", in main\n" not in output


def dicedesign(arguments: list[str]) -> int:
    """Run `python -m dicedesign` in this process, and return the exit code."""
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
) -> CommandEnd:
    """Run a command line in a folder.

    program: called with the arguments in a forked process, returns the exit code; None runs
    `python -m dicedesign` in a new interpreter. memory: limit on additional address space in bytes,
    on Linux. sent, after: signal, and the seconds from the start until it is sent.
    """
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(PRELOADED.split())
    ready, sender = context.Pipe(duplex=False)
    with TemporaryDirectory() as output, ready:
        process = context.Process(
            target=_become, args=(arguments, folder, program, memory, Path(output), sender)
        )
        process.start()
        sender.close()
        with suppress(EOFError):
            ready.recv_bytes()
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
        # A process that ends at once has no output files.
        out, err = (
            path.read_text("utf-8", "replace") if path.exists() else ""
            for path in (Path(output, "1"), Path(output, "2"))
        )
        return CommandEnd(code, out, err, seconds)


def _become(
    arguments: list[str],
    folder: Path,
    program: Callable[[list[str]], int] | None,
    memory: int | None,
    output: Path,
    ready: Connection,
) -> None:
    """Replace this process by the command."""
    # Interrupts from the terminal must reach only the test.
    os.setsid()
    # A shell may have started the test with interrupts ignored.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    # Locks must end with the process, as in a normal program.
    multiprocessing.set_start_method("fork", force=True)
    os.chdir(folder)
    for stream in (1, 2):
        os.dup2(os.open(output / str(stream), os.O_WRONLY | os.O_CREAT, 0o600), stream)
    size = Path("/proc/self/statm")
    if memory is not None and size.exists():
        import resource

        limit = int(size.read_text().split()[0]) * resource.getpagesize() + memory
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    ready.send_bytes(b"ready")
    ready.close()
    if program is None:
        os.execv(sys.executable, [sys.executable, "-m", "dicedesign", *arguments])
    code = program(arguments)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
