"""Command line: parser, exit codes and error messages.

Data go to stdout, progress and notes to stderr. Exit codes: 0 done, 1 not converged, 2 bad input
or an output that cannot be written, 3 unexpected error, 130 interrupted, 143 ended by SIGTERM, 129
by a terminal that closed.
"""

from __future__ import annotations

import argparse
import contextlib
import difflib
import errno
import gc
import inspect
import io
import os
import re
import sys
from collections.abc import Sequence
from dataclasses import MISSING, fields
from pkgutil import resolve_name
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

from dicedesign.cli.commands import (
    BalanceArguments,
    DesignArguments,
    DropArguments,
    FigureArguments,
    PoseArguments,
    RepairArguments,
    RestArguments,
    RollsArguments,
    RunArguments,
    ScatterArguments,
    SetArguments,
    SweepArguments,
    ThrowArguments,
    ViewArguments,
)
from dicedesign.cli.shared_options import Command
from dicedesign.errors import DiceError, InputError, printable
from dicedesign.runtime.files import check_memory
from dicedesign.runtime.interrupts import exit_code, signals_interrupt, was_interrupted

__all__ = ["main"]

COMMANDS: dict[str, tuple[type[Command], str]] = {
    "run": (RunArguments, "dice:run_recipe"),
    "design": (DesignArguments, "dice:design"),
    "set": (SetArguments, "dice:make_dice_set"),
    "sweep": (SweepArguments, "dice:sweep"),
    "rest": (RestArguments, "rest:list_rests"),
    "drop": (DropArguments, "rest:drop"),
    "pose": (PoseArguments, "meshes:pose_meshes"),
    "scatter": (ScatterArguments, "meshes:scatter"),
    "figure": (FigureArguments, "meshes:draw_figure"),
    "repair": (RepairArguments, "meshes:repair"),
    "balance": (BalanceArguments, "meshes:balance"),
    "throw": (ThrowArguments, "throws:throw"),
    "rolls": (RollsArguments, "rolls:judge_rolls"),
    "view": (ViewArguments, "dice:view"),
}
"""Arguments of each subcommand, and the "module:function" of this folder that runs it."""

DEBUG = "--debug"

UNEXPECTED = 3
"""Exit code of a bug."""

STREAM_ERRORS = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EBADF)
"""System errors of a full or closed stream; files raise `OutputError` instead."""

LITTLE_MEMORY = (
    "bad_alloc",
    "allocate memory",
    "failed to map segment",
    "Cannot allocate",
    "start new thread",
)
"""Texts in errors of libraries, and of modules that cannot be loaded, for lack of memory."""

OPTION = r"^(\w+)(?: \((.*?)\))?: (.*(?:\n .*)*)"
"""Name, placeholder and description of an option in a `help_text`."""

ALLOCATIONS_PER_COLLECTION = 50_000
"""Container allocations between garbage collections. With Python's default of 700, a run with
figures spends a seventh of its time there, because its libraries are millions of objects."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a subcommand and return its exit code."""
    gc.set_threshold(ALLOCATIONS_PER_COLLECTION, 50)
    # A closed stream would otherwise take the descriptor of the next file. Characters that an
    # encoding lacks are escaped.
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115
        elif mode == "w" and isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    given = list(sys.argv[1:] if arguments is None else arguments)
    words = [word for word in given if word != DEBUG]
    with signals_interrupt():
        try:
            code = _run(words)
            sys.stdout.flush()
        except (KeyboardInterrupt, Exception) as error:
            code, message = _describe_error(error)
            if code == UNEXPECTED and len(words) < len(given):
                raise
            if message:
                with contextlib.suppress(OSError):
                    print(f"dicedesign: {printable(message)}", file=sys.stderr, flush=True)
    return exit_code(code)


def _run(words: list[str]) -> int:
    joined: list[str] = []
    for word in words:
        # `--com -1,0,0` as `--com=-1,0,0`, which argparse would take for another option.
        if joined and joined[-1].startswith("--") and re.match(r"-[^-].*,", word):
            joined[-1] += f"={word}"
        else:
            joined.append(word)
    if words and not words[0].startswith("-"):
        _check_names(joined)
    given = vars(make_parser(words[0] if words else "").parse_args(joined))
    options = {name: value for name, value in given.items() if value is not None}
    kind, address = COMMANDS[options.pop("command")]
    check_memory()
    code: int = resolve_name(f"dicedesign.cli.{address}")(kind(**options))
    return code


def _check_names(words: Sequence[str]) -> None:
    """Raise InputError for an unknown command, or one of its options, with the most similar one."""
    command = words[0]
    if command not in COMMANDS:
        close = difflib.get_close_matches(command, COMMANDS, n=1)
        hint = f"did you mean {close[0]}?" if close else "see dicedesign --help"
        raise InputError(f"expected a command such as design or rest, got {command!r}; {hint}")
    known = [f"--{each.name}".replace("_", "-") for each in fields(COMMANDS[command][0])]
    for word in words[1:]:
        name = word.partition("=")[0]
        if name == "--":
            return
        if re.match("--?[a-z]", name, re.IGNORECASE) and not any(
            option.startswith(name) for option in ("-h", "--help", *known)
        ):
            close = difflib.get_close_matches(name, known, n=1)
            hint = f"did you mean {close[0]}?" if close else f"see dicedesign {command} --help"
            raise InputError(f"{name}: expected an option of dicedesign {command}; {hint}")


def _describe_error(error: BaseException) -> tuple[int, str]:
    """Exit code and message of an error."""
    try:
        sys.stdout.flush()
    except OSError:
        # Discard unflushed output, which Python would try to write again at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    cause: BaseException | None = error
    while cause is not None:
        # Libraries such as pydantic wrap interrupts.
        if isinstance(cause, KeyboardInterrupt):
            return 130, f"interrupted; {str(cause) or 'nothing half-written was left'}"
        cause = cause.__cause__
    if isinstance(error, DiceError):
        return 2, str(error)
    if isinstance(error, BrokenPipeError):
        # The reader closed the pipe, as in `dicedesign rest ... | head`.
        return 0, ""
    if isinstance(error, OSError) and error.filename is None and error.errno in STREAM_ERRORS:
        return 2, (
            f"stdout: expected an output that takes what is printed, got {error.strerror!r}; make "
            "room or send it elsewhere"
        )
    if isinstance(error, MemoryError) or any(text in str(error) for text in LITTLE_MEMORY):
        return 2, (
            "memory: expected enough for this input, got too little; take a smaller one, close "
            "other programs, or raise the limit (ulimit -v)"
        )
    if isinstance(error, OSError) and "temporary" in str(error):
        return 2, (
            "temporary folder: expected one that can be written, got none; make room, or name one "
            "by the environment variable TMPDIR"
        )
    if was_interrupted():
        # NumPy makes another error of an interrupt in some places.
        return 130, "interrupted; nothing half-written was left"
    return UNEXPECTED, (
        f"unexpected error, {type(error).__name__}: {error}; please report it with your command "
        f"and its output with {DEBUG}"
    )


def make_parser(word: str) -> argparse.ArgumentParser:
    """Parser of a command line that starts with `word`; only that command has its options."""
    parser = argparse.ArgumentParser(
        prog="dicedesign",
        description="Design solid objects by the probabilities with which they come to rest.",
        epilog="Example: dicedesign design 1/2,1/3,1/6. "
        "`dicedesign COMMAND --help` lists the options of a command.",
    )
    version = ""
    if word == "--version":
        from importlib.metadata import version as package_version

        from dicedesign.kernels import ops as kernels

        how = "with compiled kernels" if kernels.available() else "without compiled kernels, slower"
        version = f"dicedesign {package_version('dicedesign')}, {how}"
    parser.add_argument(
        "--version",
        action="version",
        version=version,
        help="print the version, and whether the kernels are compiled, and exit",
    )
    parser.add_argument(
        DEBUG,
        action="store_true",
        default=argparse.SUPPRESS,
        help="print the traceback of an unexpected error",
    )
    commands = parser.add_subparsers(
        title="commands", required=True, metavar="COMMAND", dest="command"
    )
    for name, (kind, _) in COMMANDS.items():
        description, _, rest = inspect.cleandoc(kind.help_text).partition("Options:\n")
        summary = description.partition("\n")[0].rstrip(".")
        if kind.extensions and name == word:
            extensions = resolve_name(kind.extensions)
            lines = "; ".join(f"{each.name}: {each.line}" for each in extensions)
            description += f"\n{extensions.kind.capitalize()}: {lines}."
        command = commands.add_parser(
            name,
            help=summary[:1].lower() + summary[1:],
            description=description,
            epilog=rest[rest.rindex("Example:") :],
        )
        if name == word:
            _add_options(command, kind)
    return parser


def _add_options(parser: argparse.ArgumentParser, kind: type[Command]) -> None:
    """Add an argument or an option for each field; the parser omits those that are not given."""
    texts: dict[str, tuple[str | None, str]] = {}
    for base in reversed(kind.__mro__):
        _, _, options = inspect.cleandoc(vars(base).get("help_text", "")).partition("Options:\n")
        for name, metavar, text in re.findall(OPTION, options, re.MULTILINE):
            texts[name] = metavar or None, " ".join(text.split()).replace("%", "%%")
    hints, fields_by_name = get_type_hints(kind), {field.name: field for field in fields(kind)}
    group: argparse._ActionsContainer = parser
    if kind.one_of:
        is_required = not any(fields_by_name[name].default for name in kind.one_of)
        group = parser.add_mutually_exclusive_group(required=is_required)
    usage = ["%(prog)s [options]"]
    for name, field in fields_by_name.items():
        value = hints[name]
        if isinstance(value, UnionType):
            value, _ = get_args(value)
        metavar, text = texts.get(name, (None, ""))
        settings: dict[str, Any] = {"help": text, "default": argparse.SUPPRESS}
        if value is bool:
            settings["action"] = "store_true"
        elif get_origin(value) is tuple:
            value = get_args(value)[0]
            settings |= {"action": "append"} if field.kw_only else {"nargs": "+"}
            settings = {"type": value, "metavar": metavar} | settings
        elif get_args(value):
            settings["choices"] = get_args(value)
        else:
            settings |= {"type": value, "metavar": metavar}
            if not field.kw_only and field.default is not MISSING:
                settings |= {"nargs": "?", "default": None}
        if field.kw_only:
            settings["required"] = field.default is MISSING
            settings["dest"] = name
            # `for` is a word of Python, so its field is `for_`.
            name = "--" + name.rstrip("_").replace("_", "-")
        if field.default is MISSING:
            usage.append(f"{name} {metavar}" if field.kw_only else metavar or "")
        elif not field.kw_only and field.name in kind.one_of:
            usage.append(metavar or "")
        (group if field.name in kind.one_of else parser).add_argument(name, **settings)
    parser.usage = " ".join(usage)
