"""`dicedesign bench`: measurements of the product itself, each on the frame of `bench.frame`."""

from __future__ import annotations

import argparse
from functools import partial
from typing import Any

from dicedesign.cli.options import add_engine_option, add_worker_options, check_worker_options

__all__ = ["add_parser"]


def add_parser(commands: Any) -> None:
    """Add the subcommand to argparse's `commands`; its benches are asked for when it runs."""
    parser = commands.add_parser("bench", help="measure the product itself", add_help=False)
    parser.add_argument("-h", "--help", action="store_true", dest="help")
    parser.add_argument("arguments", nargs=argparse.REMAINDER)
    parser.set_defaults(command=_run)


def _run(options: argparse.Namespace) -> int:
    from dicedesign.bench.frame import BENCHES, add_options, execute

    parser = argparse.ArgumentParser(
        prog="dicedesign bench", description="Measure the product itself."
    )
    benches = parser.add_subparsers(title="benches", required=True, metavar="BENCH")
    for bench in BENCHES:
        one = benches.add_parser(bench.name, help=bench.line, description=bench.description)
        add_options(one, bench)
        if bench.engine:
            add_engine_option(one)
        if bench.workers:
            add_worker_options(one, bench.workers)
        one.set_defaults(run=partial(execute, bench), has_workers=bool(bench.workers))
    given = parser.parse_args(["--help"] if options.help else options.arguments)
    if given.has_workers:
        check_worker_options(given)
    code: int = given.run(given)
    return code
