"""`dicedesign bench`: where the benches went."""

from __future__ import annotations

import argparse
from typing import Any

from dicedesign.errors import InputError


def add_parser(commands: Any) -> None:
    """Add the subcommand to argparse's `commands`; it refuses whatever it is given."""
    parser = commands.add_parser("bench", add_help=False)
    parser.add_argument("arguments", nargs=argparse.REMAINDER)
    parser.set_defaults(command=_refuse)


def _refuse(options: argparse.Namespace) -> int:
    raise InputError(
        "bench: expected a command of the installed package, got one that is now a script of its "
        "source; run `python -m benchmarks NAME` in a checkout"
    )
