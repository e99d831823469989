"""Running a recipe from the command line: progress, notes, the table of odds and the exit code."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dicedesign.design.result import DesignStep
    from dicedesign.recipe import Recipe

__all__ = ["add_out_option", "run_and_print"]


def add_out_option(parser: Any) -> None:
    """Add `--out` to an argparse parser."""
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="folder for the results (default: outputs/NAME)"
    )


def run_and_print(recipe: Recipe, out: Path | None, *, enlarge: bool = False) -> int:
    """Run a recipe into a folder, None for outputs/NAME, and print what came of it.

    Progress and notes go to stderr. `enlarge` is that of `dicedesign.pipeline.run_recipe`, which
    also tells the errors. Returns the exit code: 0 converged, 1 not.
    """
    import torch
    from tqdm import tqdm

    from dicedesign.pipeline import run_recipe

    # Tensors here are far too small to share among threads.
    torch.set_num_threads(1)
    folder = out or Path("outputs") / recipe.name
    with tqdm(file=sys.stderr, disable=not sys.stderr.isatty(), unit=" steps") as bar:

        def on_step(step: DesignStep) -> None:
            bar.update()
            bar.set_postfix_str(f"max |p - q| {step.error:.2e}")

        result = run_recipe(
            recipe,
            folder,
            enlarge=enlarge,
            on_stage=bar.set_description_str,
            on_step=on_step,
        )
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
