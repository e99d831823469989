"""`dicedesign run`: a recipe becomes an engraved die."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from dicedesign.cli.dice.run_recipe import add_result_options, run_and_print, with_result_options

__all__ = ["add_parser"]


def add_parser(commands: Any) -> None:
    """Add the subcommand to argparse's `commands`."""
    parser = commands.add_parser(
        "run",
        help="turn a recipe into a printable die",
        description="Turn a YAML recipe into an engraved, printable die with a report.",
    )
    parser.add_argument("recipe", type=Path, metavar="RECIPE", help="YAML file")
    add_result_options(parser)
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="key=value",
        dest="changes",
        help="change an entry of the recipe, such as size_mm=40 or method.exact.tolerance=1e-9",
    )
    parser.add_argument(
        "--resume",
        action="store_true",
        help="go on from the checkpoint of a concave die that an interrupted run left in the "
        "folder",
    )
    parser.set_defaults(command=_run)


def _run(options: argparse.Namespace) -> int:
    from dicedesign.recipe.reading import read_recipe

    recipe = with_result_options(read_recipe(options.recipe, options.changes), options)
    return run_and_print(recipe, options.out, resume=options.resume)
