"""`dicedesign design`: probabilities become an engraved die, without a recipe."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

from dicedesign.cli.dice.run_recipe import add_result_options, run_and_print, with_result_options
from dicedesign.errors import InputError, RecipeError

__all__ = ["add_parser"]

OPTION_OF_KEY: Final = (
    (r"target(: |\.)(probabilities|fair|binomial|sum_of_dice)(\.\d+)?", "--target"),
    (r"target(: |\.)labels(\.\d+)?", "--labels"),
    (r"target", "--target"),
    (r"name", "--name"),
    (r"seed", "--seed"),
    (r"size_mm", "--size-mm"),
    (r"start\.mesh(\.path)?", "--mesh"),
)
"""How an error about an entry of the recipe begins, as a regular expression, and the option that
the entry came from."""


def add_parser(commands: Any) -> None:
    """Add the subcommand to argparse's `commands`."""
    parser = commands.add_parser(
        "design",
        help="turn probabilities into a printable die",
        description="Turn probabilities into an engraved, printable die with a report. The shape "
        "is found alone, or is that of a mesh, bent a little (--mesh); the recipe is written "
        "beside the die.",
    )
    parser.add_argument(
        "--target",
        required=True,
        metavar="p,q,...",
        help="probabilities that sum to 1, fractions or decimals, such as 1/2,1/3,1/6; or what a "
        "recipe says, such as 'fair: 7' or 'sum_of_dice: [6, 6]'",
    )
    parser.add_argument(
        "--labels", metavar="a,b,...", help="a label for each of them (default: 1,2,...)"
    )
    parser.add_argument(
        "--mesh",
        metavar="FILE",
        help="bend this closed surface (OBJ, STL, ...) until it is a die, and keep its shape as "
        "far as can be",
    )
    parser.add_argument(
        "--repair",
        action="store_true",
        help="make the mesh the closed surface of one solid first, where it is none",
    )
    add_result_options(parser)
    parser.add_argument("--name", default="die", help="name of the die (default: die)")
    parser.add_argument(
        "--seed", type=int, default=0, metavar="N", help="another seed gives another shape"
    )
    parser.add_argument(
        "--size-mm",
        type=float,
        metavar="X",
        help="largest distance between two corners (default: 30, or as much as the labels need, "
        "and 30 with --mesh)",
    )
    parser.set_defaults(command=_design)


def _design(options: argparse.Namespace) -> int:
    from dicedesign.recipe.reading import checked_recipe, typed_target

    with _named_options():
        target = typed_target(options.target, options.labels)
    if options.repair and options.mesh is None:
        raise InputError("--repair: expected --mesh FILE with it, got none; add it")
    entries: dict[str, Any] = {
        "name": options.name,
        "seed": options.seed,
        "target": target,
        "start": {"search": {}},
        "method": {"exact": {}},
    }
    if options.mesh is not None:
        entries["start"] = {"mesh": {"path": options.mesh, "repair": options.repair}}
        entries["method"] = {"concave": {}}
    if options.size_mm is not None:
        entries["size_mm"] = options.size_mm
    with _named_options():
        recipe = checked_recipe(entries)
    recipe = with_result_options(recipe, options)
    return run_and_print(
        recipe, options.out, enlarge=options.size_mm is None and options.mesh is None
    )


@contextmanager
def _named_options() -> Iterator[None]:
    """Makes messages about entries of the recipe such about the options that they came from."""
    try:
        yield
    except RecipeError as error:
        message = str(error)
        for key, option in OPTION_OF_KEY:
            message = re.sub(rf"^{key}(?=: )", option, message)
        raise RecipeError(message) from error
