"""The command line: parsing, exit codes and plain errors.

Data go to stdout, progress and notes to stderr. Exit codes: 0 done, 1 not converged, 2 bad input,
130 interrupted.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from importlib.metadata import version

from dicedesign.errors import DiceError

__all__ = ["main"]

LIST_OPTIONS = ("--com", "--down", "--inertia", "--target", "--labels")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a subcommand and return its exit code."""
    try:
        given = list(sys.argv[1:] if arguments is None else arguments)
        options = _parser().parse_args(_joined(given))
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
    except KeyboardInterrupt as interrupt:
        kept = str(interrupt) or "nothing half-written was left"
        print(f"dicedesign: interrupted; {kept}", file=sys.stderr)
        return 130


def _parser() -> argparse.ArgumentParser:
    # Imported here, so that an interrupt during the import ends as plainly as any other.
    from dicedesign.cli import bench, design, drop, rest, rolls, run, search, table, throw

    parser = argparse.ArgumentParser(
        prog="dicedesign",
        description="Design solid objects by the odds with which they come to rest.",
    )
    parser.add_argument(
        "--version", action="version", version=f"dicedesign {version('dicedesign')}"
    )
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    for module in (run, design, search, rest, drop, throw, rolls, table, bench):
        module.add_parser(commands)
    return parser


def _joined(arguments: list[str]) -> list[str]:
    """`--com -1,0,0` as `--com=-1,0,0`, which argparse would take for another option."""
    joined: list[str] = []
    for argument in arguments:
        if joined and joined[-1] in LIST_OPTIONS and argument[:1] == "-" and "," in argument:
            joined[-1] += f"={argument}"
        else:
            joined.append(argument)
    return joined
