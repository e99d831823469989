"""The command line: parsing, exit codes and plain errors.

Data go to stdout, progress and notes to stderr. Exit codes: 0 done, 1 not converged, 2 bad input
or an output that cannot be written, 3 an error that nobody foresaw, 130 interrupted.
"""

from __future__ import annotations

import argparse
import contextlib
import errno
import gc
import io
import os
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Any, Final

from dicedesign.errors import DiceError
from dicedesign.runtime.text import printable

__all__ = ["main"]

COMMANDS: Final = {
    "run": "dice:add_run_parser",
    "design": "dice:add_design_parser",
    "search": "dice:add_search_parser",
    "rest": "rest:add_rest_parser",
    "drop": "rest:add_drop_parser",
    "pose": "meshes:add_pose_parser",
    "scatter": "meshes:add_scatter_parser",
    "figure": "meshes:add_figure_parser",
    "repair": "meshes:add_repair_parser",
    "balance": "balance:add_parser",
    "throw": "throw:add_parser",
    "rolls": "rolls:add_parser",
    "table": "table_fit:add_parser",
    "view": "dice:add_view_parser",
    "bench": "bench:add_parser",
}
"""Module in this folder and function that adds the parser of each subcommand."""

DEBUG: Final = "--debug"

UNFORESEEN: Final = 3
"""Exit code of an error that is none of the user's."""

_NOT_WRITTEN: Final = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EBADF)
"""What the system says where a stream is full or gone; files of this package have errors of their
own."""

ALLOCATIONS_PER_COLLECTION: Final = 50_000
"""Of containers, between collections of garbage in cycles: with Python's 700 a run with figures
spends a seventh of its time on them, as the libraries that it imports are millions of objects."""

LIST_OPTIONS: Final = (
    "--com",
    "--down",
    "--inertia",
    "--labels",
    "--region",
    "--stand-down",
    "--target",
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a subcommand and return its exit code."""
    gc.set_threshold(ALLOCATIONS_PER_COLLECTION, 50)
    _mend_streams()
    given = list(sys.argv[1:] if arguments is None else arguments)
    words = [word for word in given if word != DEBUG]
    try:
        options = _parser(words[0] if words else None).parse_args(_joined(words))
        code: int = options.command(options)
        sys.stdout.flush()
        return code
    except (KeyboardInterrupt, Exception) as error:
        code, said = _ending(error)
        if code == UNFORESEEN and len(words) < len(given):
            raise
        _say(said)
        return code


def _ending(error: BaseException) -> tuple[int, str]:
    """The exit code after an error, and what is said of it, if anything."""
    _drop_unwritten()
    interrupt = _interrupt_behind(error)
    if interrupt is not None:
        return 130, f"interrupted; {str(interrupt) or 'nothing half-written was left'}"
    if isinstance(error, DiceError):
        return 2, str(error)
    if isinstance(error, BrokenPipeError):
        # The reader of our output has gone, as in `dicedesign rest ... | head`.
        return 0, ""
    if isinstance(error, OSError) and error.filename is None and error.errno in _NOT_WRITTEN:
        return 2, (
            f"stdout: expected an output that takes what is printed, got {error.strerror!r}; make "
            "room or send it elsewhere"
        )
    if isinstance(error, MemoryError):
        return 2, "memory: expected enough for this input, got too little; take a smaller one"
    return UNFORESEEN, (
        f"an error that nobody foresaw, {type(error).__name__}: {error}; please report it to those "
        f"you have dicedesign from, with your command and what it says with {DEBUG}"
    )


def _say(text: str) -> None:
    """One line on stderr, whatever names it quotes; nothing for no text."""
    if text:
        with contextlib.suppress(OSError):
            print(f"dicedesign: {printable(text)}", file=sys.stderr, flush=True)


def _mend_streams() -> None:
    """Let streams that are closed lead nowhere, instead of into the next file that is opened, and
    write what the encoding of others has no letter for as an escape."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        stream = getattr(sys, name)
        if stream is None:
            nowhere = open(os.devnull, mode, encoding="utf-8")  # noqa: SIM115
            setattr(sys, name, nowhere)
        elif mode == "w" and isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _drop_unwritten() -> None:
    """Drop what stdout holds if it takes nothing more: Python itself would try again at its end."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _interrupt_behind(error: BaseException | None) -> KeyboardInterrupt | None:
    """The interrupt that a library has wrapped, as pydantic does where it calls this package."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__
    return error


def _parser(command: str | None) -> argparse.ArgumentParser:
    """The parser of a command, or of all where none is known: each loads only what it needs."""
    parser = argparse.ArgumentParser(
        prog="dicedesign",
        description="Design solid objects by the odds with which they come to rest.",
    )
    parser.add_argument(
        "--version",
        action=_Version,
        nargs=0,
        help="print the version, and whether there are compiled kernels, and exit",
    )
    parser.add_argument(DEBUG, action="store_true", help="show where an unforeseen error came from")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    for name in (command,) if command in COMMANDS else COMMANDS:
        # Imported here, so that an interrupt during the import ends as plainly as any other.
        module, _, add_parser = COMMANDS[name].partition(":")
        getattr(import_module(f"dicedesign.cli.{module}"), add_parser)(commands)
    return parser


class _Version(argparse.Action):
    """Finds the version out only where it is asked for."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from importlib.metadata import version

        from dicedesign.kernels import ops as kernels

        how = "with compiled kernels" if kernels.available() else "without compiled kernels, slower"
        print(f"dicedesign {version('dicedesign')}, {how}")
        parser.exit()


def _joined(arguments: list[str]) -> list[str]:
    """`--com -1,0,0` as `--com=-1,0,0`, which argparse would take for another option."""
    joined: list[str] = []
    for argument in arguments:
        if joined and joined[-1] in LIST_OPTIONS and argument[:1] == "-" and "," in argument:
            joined[-1] += f"={argument}"
        else:
            joined.append(argument)
    return joined
