"""Running a recipe from the command line: progress, notes, the table of odds and the exit code."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dicedesign.errors import InputError

if TYPE_CHECKING:
    from tqdm import tqdm

    from dicedesign.concave.result import ConcaveStep
    from dicedesign.design.refinement import Round
    from dicedesign.design.result import DesignStep
    from dicedesign.recipe.schema.recipe import Recipe
    from dicedesign.results.folder import RunResult

__all__ = ["add_out_option", "run_and_print"]


def add_out_option(parser: Any) -> None:
    """Add `--out` to an argparse parser."""
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="folder for the results (default: outputs/NAME)"
    )


def run_and_print(
    recipe: Recipe, out: Path | None, *, enlarge: bool = False, resume: bool = False
) -> int:
    """Run a recipe into a folder, None for outputs/NAME, and print what came of it.

    Progress and notes go to stderr. `enlarge` is that of `dicedesign.recipe.run.run_recipe`, for a
    convex die, and `resume` that of `dicedesign.recipe.concave_run.run_concave_recipe`, for a
    concave one; they also tell the errors. Returns the exit code: 0 converged, 1 not.
    """
    import torch
    from tqdm import tqdm

    if resume and recipe.method.concave is None:
        raise InputError(
            f"--resume: expected a recipe of method: {{concave: {{}}}}, got {recipe.method.name}, "
            "which keeps no checkpoint; leave it out"
        )
    # Tensors here are far too small to share among threads.
    torch.set_num_threads(1)
    folder = out or Path("outputs") / recipe.name
    with tqdm(file=sys.stderr, disable=not sys.stderr.isatty(), unit=" steps") as bar:
        if recipe.method.concave is None:
            result = _run_convex(recipe, folder, bar, enlarge)
        else:
            result = _run_concave(recipe, folder, bar, resume)
    for note in result.notes:
        print(f"note: {note}", file=sys.stderr)
    _print(recipe.name, result)
    return 0 if result.converged else 1


def _run_convex(recipe: Recipe, folder: Path, bar: tqdm[Any], enlarge: bool) -> RunResult:
    from dicedesign.recipe.run import run_recipe

    def on_step(step: DesignStep) -> None:
        bar.update()
        bar.set_postfix_str(f"max |p - q| {step.error:.2e}")

    def on_round(thrown: Round) -> None:
        told = f"{thrown.drops} throws, total variation {thrown.deviation:.3f}"
        bar.set_description_str(f"{told} (perfect {thrown.noise_floor:.3f})")

    return run_recipe(
        recipe,
        folder,
        enlarge=enlarge,
        on_stage=bar.set_description_str,
        on_step=on_step,
        on_round=on_round,
    )


def _run_concave(recipe: Recipe, folder: Path, bar: tqdm[Any], resume: bool) -> RunResult:
    from dicedesign.recipe.concave_run import run_concave_recipe

    assert recipe.method.concave is not None
    attempts = recipe.method.concave.attempts

    def on_step(step: ConcaveStep) -> None:
        bar.update()
        error = "" if step.error is None else f", max |p - q| {step.error:.2e}"
        bar.set_postfix_str(f"attempt {step.attempt} of {attempts}, {step.stage}{error}")

    return run_concave_recipe(
        recipe, folder, resume=resume, on_stage=bar.set_description_str, on_step=on_step
    )


def _print(name: str, result: RunResult) -> None:
    summary = result.summary
    print(f"{name}: {result.status} ({result.message})")
    _print_odds(summary)
    if "displacement" in summary:
        print(f"other  {0.0:<#10.5g}  {summary['elsewhere']:#.5g}")
        moved = summary["displacement"]
        print(
            f"displacement: mean {100.0 * moved['mean']:.3g} %, largest "
            f"{100.0 * moved['largest']:.3g} % of the diagonal"
        )
    if "engraved_max_abs_error" in summary and "thrown" not in summary:
        print(f"engraved: max |p - q| {summary['engraved_max_abs_error']:.2e}")
    print(f"files in {result.folder}: {', '.join(summary['files'].values())}")


def _print_odds(summary: dict[str, Any]) -> None:
    """Target and odds by label; of a thrown die those that it was designed for and seen with."""
    columns = {"achieved": summary["probabilities"]}
    if "thrown" in summary:
        thrown = summary["thrown"]
        columns = {"set down": summary["probabilities"], "model": thrown["momentum"]}
        if "simulated" in thrown:
            columns["thrown"] = thrown["simulated"]["frequencies"]
    print("label  target      " + "".join(f"{name:<12s}" for name in columns).rstrip())
    for label, wanted, *odds in zip(
        summary["labels"], summary["target"], *columns.values(), strict=True
    ):
        cells = "".join(f"{value:<#12.5g}" for value in odds).rstrip()
        print(f"{label:>5s}  {wanted:<#10.5g}  {cells}")
