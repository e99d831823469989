"""Command lines in processes of their own, which may get signals and have limits.

Most are forked from one process that has imported the package, so that thousands of them take
minutes; signals reach real processes all the same.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import runpy
import signal
import sys
import time
from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, Final, Literal, TypeAlias

from dicedesign.errors import InputError

Kind: TypeAlias = Literal["hang", "traceback", "wrong", "lost"]
"""Of a fault: no end within the limit; an error that nobody foresaw; a wrong answer; a result that
is missing, half-written or in the way."""

LIMIT: Final = 120.0
"""Seconds after which a command counts as one that hangs; what it does takes a few."""

PRELOADED: Final = "tests.soak.preloaded"
"""Imported by the process that others are forked from."""


@dataclass(frozen=True)
class Command:
    """A command line.

    Attributes
    ----------
    arguments: of the program. folder: where it runs.
    program: what is called with the arguments and returns the exit code, importable by name; None
        for `python -m dicedesign`.
    fresh: begin that with a new interpreter, instead of by a fork.
    memory: bytes of addresses that it may take beside what is there at its start; None for any
        number. Heeded on Linux.
    sent, after: a signal, if any, and the seconds from the begin until it is sent.
    """

    arguments: tuple[str, ...]
    folder: Path
    program: Callable[[list[str]], int] | None = None
    fresh: bool = False
    memory: int | None = None
    sent: signal.Signals | None = None
    after: float = 0.0


@dataclass(frozen=True)
class Ended:
    """How a command ended.

    Attributes
    ----------
    code: exit code, or the number of the signal that ended it, negative.
    out, err: what it printed. seconds: that it took. hung: whether it had to be killed.
    """

    code: int
    out: str
    err: str
    seconds: float
    hung: bool


@dataclass(frozen=True)
class Fault:
    """What went wrong, in a line."""

    kind: Kind
    what: str


@dataclass(frozen=True)
class Tried:
    """A case that has ended: its number, and what went wrong."""

    number: int
    faults: list[Fault]


Case: TypeAlias = Generator[Command, Ended, Tried]
"""Yields commands and is sent how each ended."""


def require_signals() -> None:
    """Raise InputError on a system that cannot fork."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        raise InputError(
            f"soak: expected a system with signals and forks, got {sys.platform}; run it on "
            "Linux or macOS"
        )


def faults_of(ended: Ended, *expected: int) -> list[Fault]:
    """Hangs and unforeseen errors. expected: exit codes that are right."""
    if ended.hung:
        return [Fault("hang", f"no end within {LIMIT:g} s")]
    last = " ".join(ended.err.split())[-300:]
    if "Traceback (most recent call last)" in ended.err:
        return [Fault("traceback", f"exit code {ended.code}: {last}")]
    if ended.code not in expected:
        wanted = " or ".join(map(str, expected))
        return [Fault("traceback", f"exit code {ended.code}, expected {wanted}: {last}")]
    return []


def before_main(said: str) -> bool:
    """Whether a program that said this was interrupted while the interpreter still began, which no
    program can word."""
    return said.rstrip().endswith("KeyboardInterrupt") and ", in main\n" not in said


def drive(cases: Iterable[Case], scratch: Path, jobs: int) -> Generator[Tried, None, None]:
    """Cases as they end; so many side by side.

    scratch: an existing folder for what commands print. Processes that run when the iterator is
    closed are killed.
    """
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([PRELOADED])
    waiting, running, count = iter(cases), list[_Running](), 0
    try:
        while True:
            while len(running) < jobs and (case := next(waiting, None)) is not None:
                count += 1
                one = _Running(case, scratch / str(count), context)
                one.begin(next(case))
                running.append(one)
            if not running:
                return
            wait([each for one in running for each in one.awaited()], _pause(running))
            for one in list(running):
                ended = one.tended()
                if ended is None:
                    continue
                try:
                    one.begin(one.case.send(ended))
                except StopIteration as end:
                    running.remove(one)
                    yield end.value
    finally:
        for one in running:
            one.stop()


def _pause(running: list[_Running]) -> float:
    return max(0.0, min(one.due for one in running) - time.monotonic())


@dataclass(eq=False)
class _Running:
    """A case, and the process of its present command. printed: path of what that prints, without
    its ending."""

    case: Case
    printed: Path
    context: Any
    command: Command | None = None
    process: BaseProcess | None = None
    begun: Connection | None = None
    started: float = 0.0
    limit: float = 0.0
    signal_at: float = float("inf")
    hung: bool = False

    @property
    def due(self) -> float:
        """When something is to be done."""
        return min(self.limit, self.signal_at)

    def awaited(self) -> list[Any]:
        assert self.process is not None
        return [self.process.sentinel, *([] if self.begun is None else [self.begun])]

    def begin(self, command: Command) -> None:
        """Start the case's next command."""
        self.command = command
        self.begun, other = self.context.Pipe(duplex=False)
        self.process = self.context.Process(
            target=_run, args=(self.command, str(self.printed), other), daemon=True
        )
        self.process.start()
        other.close()
        self.started = time.monotonic()
        self.limit, self.signal_at, self.hung = self.started + LIMIT, float("inf"), False

    def tended(self) -> Ended | None:
        """Send the signal that is due, end what hangs; how the command ended, if it has."""
        assert self.process is not None
        assert self.command is not None
        now = time.monotonic()
        if self.begun is not None and self.begun.poll():
            with contextlib.suppress(EOFError):
                self.begun.recv_bytes()
            self.begun.close()
            self.begun, self.started = None, now
            if self.command.sent is not None:
                self.signal_at = now + self.command.after
        if self.process.exitcode is None and now >= self.due:
            self.hung = self.hung or now >= self.limit
            sent = signal.SIGKILL if self.hung else self.command.sent
            assert sent is not None
            self.signal_at = float("inf")
            self.limit = now + LIMIT
            with contextlib.suppress(ProcessLookupError):
                assert self.process.pid is not None
                os.kill(self.process.pid, sent)
        if self.process.exitcode is None:
            return None
        code = self.process.exitcode
        self.stop()
        out, err = (self._taken(ending) for ending in (".out", ".err"))
        return Ended(code, out, err, time.monotonic() - self.started, self.hung)

    def _taken(self, ending: str) -> str:
        path = self.printed.with_suffix(ending)
        try:
            text = path.read_text("utf-8", "replace")
            path.unlink()
        except FileNotFoundError:
            # The process was ended before it could print.
            return ""
        return text

    def stop(self) -> None:
        """End the process, if any runs."""
        if self.process is not None:
            self.process.kill()
            self.process.join()
            self.process.close()
            self.process = None
        if self.begun is not None:
            self.begun.close()
            self.begun = None


def _run(command: Command, printed: str, begun: Connection) -> None:
    """Become the command; to be called in a process of its own."""
    # Interrupts from the terminal are for the test.
    os.setsid()
    # A shell may have begun the test with interrupts ignored.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    # Locks go with the process, as those of a program that was not begun like this.
    multiprocessing.set_start_method("fork", force=True)
    os.chdir(command.folder)
    for stream, ending in ((1, ".out"), (2, ".err")):
        os.dup2(os.open(printed + ending, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), stream)
    if command.memory is not None:
        _limit_memory(command.memory)
    begun.send_bytes(b"begun")
    begun.close()
    if command.fresh:
        os.execv(sys.executable, [sys.executable, "-m", "dicedesign", *command.arguments])
    code = (command.program or _package)(list(command.arguments))
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def _package(arguments: list[str]) -> int:
    """What `python -m dicedesign` does."""
    sys.argv[1:] = arguments
    try:
        runpy.run_module("dicedesign", run_name="__main__")
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else 1
    return 0


def _limit_memory(more: int) -> None:
    import resource

    try:
        pages = int(Path("/proc/self/statm").read_text().split()[0])
    except FileNotFoundError:
        return
    limit = pages * resource.getpagesize() + more
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
