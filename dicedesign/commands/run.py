"""`dicedesign run`: a recipe becomes an engraved die."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dicedesign.design.result import DesignStep

__all__ = ["add_parser"]


def add_parser(commands: Any) -> None:
    """Add the subcommand to argparse's `commands`."""
    parser = commands.add_parser(
        "run",
        help="turn a recipe into a printable die",
        description="Turn a YAML recipe into an engraved, printable die with a report.",
    )
    parser.add_argument("recipe", type=Path, metavar="RECIPE", help="YAML file")
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="folder for the results (default: outputs/NAME)"
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="key=value",
        dest="changes",
        help="change an entry of the recipe, such as size_mm=40 or "
        "method.descent.stopping.tolerance=1e-4",
    )
    parser.set_defaults(command=_run)


def _run(options: argparse.Namespace) -> int:
    import torch
    from tqdm import tqdm

    from dicedesign.pipeline import run_recipe
    from dicedesign.recipe_file import read_recipe

    # Tensors here are far too small to share among threads.
    torch.set_num_threads(1)
    recipe = read_recipe(options.recipe, options.changes)
    folder = options.out or Path("outputs") / recipe.name
    with tqdm(file=sys.stderr, disable=not sys.stderr.isatty(), unit=" steps") as bar:

        def on_step(step: DesignStep) -> None:
            bar.update()
            bar.set_postfix_str(f"max |p - q| {step.error:.2e}")

        result = run_recipe(recipe, folder, on_stage=bar.set_description_str, on_step=on_step)
    for note in result.notes:
        print(f"note: {note}", file=sys.stderr)
    summary = result.summary
    print(f"{recipe.name}: {result.status} ({result.message})")
    print("label  target      achieved")
    rows = zip(summary["labels"], summary["target"], summary["probabilities"], strict=True)
    for label, wanted, got in rows:
        print(f"{label:>5s}  {wanted:<#10.5g}  {got:#.5g}")
    if "engraved_max_abs_error" in summary:
        print(f"engraved: max |p - q| {summary['engraved_max_abs_error']:.2e}")
    print(f"files in {folder}: {', '.join(summary['files'].values())}")
    return 0 if result.converged else 1
