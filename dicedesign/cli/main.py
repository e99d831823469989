"""The command line: parsing, exit codes and plain errors.

Data go to stdout, progress and notes to stderr. Exit codes: 0 done, 1 not converged, 2 bad input,
130 interrupted.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Any, Final

from dicedesign.errors import DiceError

__all__ = ["main"]

COMMANDS: Final = (
    "run",
    "design",
    "search",
    "rest",
    "drop",
    "throw",
    "rolls",
    "table",
    "bench",
)
"""Each is a module of this folder, with its parser and what it does."""

LIST_OPTIONS: Final = ("--com", "--down", "--inertia", "--target", "--labels")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a subcommand and return its exit code."""
    try:
        given = list(sys.argv[1:] if arguments is None else arguments)
        options = _parser(given[0] if given else None).parse_args(_joined(given))
        code: int = options.command(options)
        sys.stdout.flush()
        return code
    except DiceError as error:
        print(f"dicedesign: {error}", file=sys.stderr)
        return 2
    except BrokenPipeError:
        # The reader of our output has gone, as in `dicedesign rest ... | head`.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (KeyboardInterrupt, Exception) as error:
        interrupt = _interrupt_behind(error)
        if interrupt is None:
            raise
        kept = str(interrupt) or "nothing half-written was left"
        print(f"dicedesign: interrupted; {kept}", file=sys.stderr)
        return 130


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
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and exit")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    for name in (command,) if command in COMMANDS else COMMANDS:
        # Imported here, so that an interrupt during the import ends as plainly as any other.
        import_module(f"dicedesign.cli.{name}").add_parser(commands)
    return parser


class _Version(argparse.Action):
    """Finds the version out only where it is asked for."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from importlib.metadata import version

        print(f"dicedesign {version('dicedesign')}")
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
